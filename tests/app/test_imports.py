"""Starting takes what the main job needs, and leaves the rest to the moment of use."""

from __future__ import annotations

import subprocess
import sys

import pytest

LATER = {
    "plotly": "the report",
    "scipy.stats": "half a second for one quantile",
    "scipy.special": "a tenth of a second for a gate and a normal quantile",
    "tracker.io.read.registry": "the readers of all formats: an import's",
    "viser": "the 3D view, which starts beside the page",
    "PIL": "viser's",
    "trimesh": "viser's",
    "tqdm": "the bars of a terminal",
    "mkdocs": "the manual is built before",
    "optuna": "studies",
    "distributed": "studies, in a process of their own",
    "sklearn": "studies: what matters",
    "tomlkit": "what is saved",
    "websockets.asyncio.client": "the way to viser",
    "concurrent.futures.process": "the check of identities",
}
"""What neither the web nor the engine imports before it is used, and what it is for."""


@pytest.mark.full
def test_the_web_imports_what_the_first_page_needs() -> None:
    told = subprocess.run(
        [sys.executable, "-c", "import app.web.server, sys; print(*sys.modules)"],
        capture_output=True,
        text=True,
        check=True,
    )
    imported = set(told.stdout.split())
    assert "tracker.runs.pipeline" in imported
    assert not imported & set(LATER)
