"""The 3D view beside the page: viser's server with what is in it."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from typing import TYPE_CHECKING

from app.errors import sentence
from app.state.teaching import Teaching
from app.state.workbench import Workbench
from app.web.access.gateway import Gateway
from app.web.access.viewer import Entrance, start_viser

if TYPE_CHECKING:
    from app.scene.scene import Scene

logger = logging.getLogger("app")


class Room:
    """viser's server with what is in it."""

    def __init__(self, workbench: Workbench, teaching: Teaching) -> None:
        self._workbench = workbench
        self._teaching = teaching
        self.scene: Scene | None = None
        self._parts: list[Callable[[], object]] = []

    def open(self, entrance: Entrance) -> None:
        """Start viser behind its entrance and build scene and sliders in it."""
        from app.scene.editing import RoomEditing
        from app.scene.panel import Panel
        from app.scene.scene import Scene

        server = start_viser(entrance)
        self._parts.append(server.stop)
        self.scene = Scene(server, self._workbench)
        self._parts.append(self.scene.close)
        self._parts.append(RoomEditing(server, self._workbench, self._teaching).close)
        self._parts.append(Panel(server, self._workbench).close)

    def close(self) -> None:
        """Take it down in the opposite order."""
        for part in reversed(self._parts):
            part()


async def start_room(room: Room, door: Gateway, workbench: Workbench) -> None:
    """Start it in the background; whoever waits for it is told, and of a failure the page."""
    try:
        await asyncio.to_thread(room.open, door.entrance)
        door.started()
    except Exception as error:
        logger.exception("the 3D view did not start")
        workbench.notify(
            "error",
            f"The 3D view did not start: {sentence(error)}",
            "Cameras, timeline and export work without it.",
        )
