"""Builds the manual while the project is built: into the wheel, or beside the checkout."""

from __future__ import annotations

import logging
import os
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

MANUAL = Path("static", "manual")
SITE = Path("build", "manual")


def build(root: Path) -> Path:
    """Build the manual's pages, every warning an error.

    Args:
        root: The checkout.

    Returns:
        The folder of the built pages, ``build/manual``.

    Raises:
        mkdocs.exceptions.Abort: If a page has a mistake; the log says which.
    """
    os.environ.setdefault("NO_MKDOCS_2_WARNING", "1")  # an advertisement, not a warning
    from mkdocs.commands.build import build as build_site
    from mkdocs.config import load_config

    logging.getLogger("mkdocs").addHandler(logging.StreamHandler())
    config = load_config(str(root / MANUAL / "mkdocs.yml"), strict=True)
    config.plugins.on_startup(command="build", dirty=False)
    try:
        build_site(config)
    finally:
        config.plugins.on_shutdown()
    return root / SITE


class ManualHook(BuildHookInterface[Any]):
    """Asked by hatchling for a wheel and for an editable installation."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Build, and give the wheel the page's files and the built manual, not its sources."""
        root = Path(self.root)
        site = build(root)
        if version == "editable":  # a checkout's workbench serves build/manual
            return
        given = build_data["force_include"]
        given[str(site)] = "app/manual"
        for part in sorted((root / "static").iterdir()):
            if part.name != MANUAL.name:
                given[str(part)] = f"app/static/{part.name}"
