"""A running viser for tests of the 3D view."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
import viser

from app.web.access.gateway import start_viser


@pytest.fixture(scope="module")
def running() -> Iterator[viser.ViserServer]:
    server = start_viser()
    yield server
    server.stop()


@pytest.fixture
def server(running: viser.ViserServer) -> viser.ViserServer:
    """One with nothing in it."""
    running.scene.reset()
    running.gui.reset()
    return running
