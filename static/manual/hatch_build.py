"""Builds the manual while the project is installed or packed: into the wheel, or the checkout."""

from __future__ import annotations

import hashlib
import logging
import os
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

MANUAL = Path("static", "manual")
SITE = Path("build", "manual")
MADE_FROM = "made-from"
"""Beside the pages: the digest of what they were made from; pip asks for a build twice."""


def sources(root: Path) -> str:
    """Digest of everything that the pages are made from: texts, settings and docstrings."""
    digest = hashlib.sha256()
    texts = [path for path in (root / MANUAL).rglob("*") if path.is_file()]
    for path in sorted([*texts, *(root / "tracker").rglob("*.py")]):
        if "__pycache__" not in path.parts:
            digest.update(str(path.relative_to(root)).encode() + path.read_bytes())
    return digest.hexdigest()


def build(root: Path) -> Path:
    """Build the manual's pages, every warning an error, unless they are of these very sources.

    Args:
        root: The checkout.

    Returns:
        The folder of the built pages, ``build/manual``.

    Raises:
        mkdocs.exceptions.Abort: If a page has a mistake; the log says which.
    """
    stamp, wanted = root / SITE / MADE_FROM, sources(root)
    if stamp.is_file() and stamp.read_text(encoding="utf-8") == wanted:
        return root / SITE
    os.environ.setdefault("NO_MKDOCS_2_WARNING", "1")  # says nothing of our pages
    from mkdocs.commands.build import build as build_site
    from mkdocs.config import load_config

    logging.getLogger("mkdocs").addHandler(logging.StreamHandler())
    config = load_config(str(root / MANUAL / "mkdocs.yml"), strict=True)
    config.plugins.on_startup(command="build", dirty=False)
    try:
        build_site(config)
    finally:
        config.plugins.on_shutdown()
    stamp.write_text(wanted, encoding="utf-8")
    return root / SITE


class ManualHook(BuildHookInterface[Any]):
    """Asked by hatchling for a wheel and for an editable installation."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Build, and give the wheel the page's files and the built manual, not its sources."""
        root = Path(self.root)
        if version == "editable":  # a checkout's workbench serves build/manual
            try:
                build(root)
            # a page with a mistake, or tools that are not there, must keep nobody from working
            except (Exception, SystemExit) as error:
                self.app.display_warning(f"the manual was not built: {error}")
            return
        given = build_data["force_include"]
        given[str(build(root))] = "app/manual"
        for part in sorted((root / "static").iterdir()):
            if part.name != MANUAL.name:
                given[str(part)] = f"app/static/{part.name}"
