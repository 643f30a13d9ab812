"""Handles in 3D on the room's six faces and on its entrances, while somebody edits the room.

What is dragged is drawn at once, with its numbers; on release the sequence gets the new
value, and the run follows. Outside the mode there are no handles, and late events of one are
ignored.
"""

from __future__ import annotations

import threading
from collections.abc import Set
from dataclasses import dataclass
from typing import Any

import numpy as np
import viser
from jaxtyping import Float
from numpy import ndarray

from app.colours import PALETTES
from app.errors import sentence
from app.scene import geometry
from app.scene.nodes import Lines, Tag, Tags
from app.scene.worker import Follower
from app.state.snapshot import Change, Snapshot
from app.state.teaching import Side, Teaching
from app.state.workbench import Workbench
from tracker.sequences.errors import SequenceError
from tracker.sequences.sequence import Room
from tracker.sequences.writing.teaching import AXES

LEAST_ROOM = 0.1
"""Metres that stay between two faces, however far one is dragged."""

DIGITS = 2
"""Of a dragged place, metres: nobody drags more exactly."""

FACE_HANDLE, ENTRANCE_HANDLE = 0.16, 0.2
"""Lengths of the handles as shares of the room's shorter side, metres at most."""


@dataclass(frozen=True, slots=True)
class Face:
    """One of the six."""

    side: Side
    axis: int


Grip = Face | int
"""What a handle moves: a face, or an entrance by its index."""

SIDES: tuple[Side, ...] = ("min", "max")
FACES = tuple(Face(side, axis) for side in SIDES for axis in range(3))


class RoomEditing(Follower):
    """The handles, kept where the room is; a drag of one teaches the sequence."""

    def __init__(self, server: viser.ViserServer, workbench: Workbench, teaching: Teaching) -> None:
        """Make the handles of the faces, hidden, and follow the workbench from now on."""
        super().__init__("room editing", workbench)
        self._server = server
        self._teaching = teaching
        self._lock = threading.Lock()
        self._held: dict[Grip, Float[ndarray, " 3"]] = {}
        """Where what is being dragged is now."""
        self._released: dict[Grip, Float[ndarray, " 3"]] = {}
        self.handles: dict[Grip, viser.TransformControlsHandle] = {}
        """By what they move; those of entrances are made as they are needed."""
        self._box = Lines(server, "/editing/box", 2.0)
        self._words = Tags(server, "/editing/words", 1, 0.85)
        for face in FACES:
            self._make(face)
        self.follow()

    def _make(self, grip: Grip) -> None:
        face = isinstance(grip, Face)
        axes = tuple(not isinstance(grip, Face) or grip.axis == axis for axis in range(3))
        name = f"{grip.side}_{AXES[grip.axis]}" if isinstance(grip, Face) else f"entrance_{grip}"
        handle = self._server.scene.add_transform_controls(
            f"/editing/{name}",
            active_axes=(axes[0], axes[1], axes[2]),
            disable_sliders=face,
            disable_rotations=True,
            depth_test=False,
            wxyz=_outward(grip),
            visible=False,
        )

        @handle.on_update
        async def _(event: Any) -> None:  # on viser's loop, so that the phases keep their order
            self._drag(grip, event.phase, np.array(event.target.position, dtype=float))

        self.handles[grip] = handle

    # what happens elsewhere: these return at once

    def _note(self, change: Change) -> None:
        if change in ("sequence", "taught", "editing", "theme"):
            self._worker.ask("refresh")

    def _drag(self, grip: Grip, phase: str, position: Float[ndarray, " 3"]) -> None:
        with self._lock:
            if phase == "end":
                # where it was dragged to; the handle itself may have been put back meanwhile
                self._released[grip] = self._held.pop(grip, position)
            else:
                self._held[grip] = position
        self._worker.ask("drag")

    # the worker's thread

    def _work(self, _: Set[str]) -> None:
        with self._lock:
            released, self._released = self._released, {}
            held = dict(self._held)
        if self._workbench.snapshot().editing_room:
            for grip, position in released.items():
                self._teach(grip, position)
        self._show(self._workbench.snapshot(), held)

    def _teach(self, grip: Grip, position: Float[ndarray, " 3"]) -> None:
        sequence = self._workbench.snapshot().sequence
        if sequence is None:
            return
        room = dragged(sequence.room, grip, position)
        try:
            if isinstance(grip, Face):
                corner = room.minimum if grip.side == "min" else room.maximum
                self._teaching.set_face(grip.side, grip.axis, float(corner[grip.axis]))
            elif grip < len(room.entrances):
                place = room.entrances[grip].position
                self._teaching.set_entrance(grip, "position", dict(enumerate(place.tolist())))
        except SequenceError as error:
            self._workbench.notify("error", f"The room stays as it was: {sentence(error)}")

    def _show(self, snapshot: Snapshot, held: dict[Grip, Float[ndarray, " 3"]]) -> None:
        sequence = snapshot.sequence
        if sequence is None or not snapshot.editing_room:
            with self._server.atomic():
                for handle in self.handles.values():
                    handle.visible = False
                self._box.show(np.zeros((0, 2, 3)), (0, 0, 0))
                self._words.show([])
            self._server.flush()
            return
        room = sequence.room
        for grip, position in held.items():
            room = dragged(room, grip, position)
        for index in range(len(room.entrances)):
            if index not in self.handles:
                self._make(index)
        places = grips(room)
        # viser ends a drag when any handle is moved or resized meanwhile
        standing = sequence.room
        side = float(min((standing.maximum - standing.minimum)[:2].min(), 6.0))
        edges = geometry.box_edges(
            (room.minimum + room.maximum)[None] / 2.0, (room.maximum - room.minimum) / 2.0
        )[0]
        with self._server.atomic():
            self._box.show(edges, PALETTES[snapshot.theme].entrance)
            for grip, handle in self.handles.items():
                handle.visible = grip in places
                scale = side * (FACE_HANDLE if isinstance(grip, Face) else ENTRANCE_HANDLE)
                if handle.scale != scale and not held:
                    handle.scale = scale
                with self._lock:
                    if grip in places and not self._held:
                        handle.position = places[grip]
            # what is not dragged has its numbers in Teach; here they would lie over each other
            self._words.show([_words(grip, places[grip]) for grip in held if grip in places])
        self._server.flush()


def dragged(room: Room, grip: Grip, position: Float[ndarray, " 3"]) -> Room:
    """A room with one face or entrance where it was dragged, to whole centimetres.

    A face stays on its side of the opposite one; of its place only the coordinate across
    the face counts.
    """
    position = np.round(position, DIGITS) + 0.0
    low, high, entrances = room.minimum.copy(), room.maximum.copy(), list(room.entrances)
    if isinstance(grip, Face):
        axis = grip.axis
        if grip.side == "min":
            low[axis] = min(position[axis], round(high[axis] - LEAST_ROOM, DIGITS))
        else:
            high[axis] = max(position[axis], round(low[axis] + LEAST_ROOM, DIGITS))
    elif grip < len(entrances):
        entrances[grip] = type(entrances[grip])(position, entrances[grip].sigma)
    return Room(low, high, tuple(entrances))


def grips(room: Room) -> dict[Grip, tuple[float, float, float]]:
    """Where the handles of a room are: in the middle of its faces, and at its entrances."""
    middle = (room.minimum + room.maximum) / 2.0
    places: dict[Grip, tuple[float, float, float]] = {}
    for face in FACES:
        place = middle.copy()
        place[face.axis] = (room.minimum if face.side == "min" else room.maximum)[face.axis]
        places[face] = (float(place[0]), float(place[1]), float(place[2]))
    for index, entrance in enumerate(room.entrances):
        x, y, z = entrance.position.tolist()
        places[index] = (x, y, z)
    return places


def _outward(grip: Grip) -> tuple[float, float, float, float]:
    """The turn of a handle, w x y z: the arrow of a face points out of the room."""
    if isinstance(grip, int) or grip.side == "max":
        return (1.0, 0.0, 0.0, 0.0)
    return (0.0, 1.0, 0.0, 0.0) if grip.axis == 2 else (0.0, 0.0, 0.0, 1.0)


def _words(grip: Grip, place: tuple[float, float, float]) -> Tag:
    if isinstance(grip, Face):
        return Tag(place, f"{AXES[grip.axis]} {place[grip.axis]:.2f} m".replace("-", "−"))
    where = "  ".join(f"{value:.2f}" for value in place).replace("-", "−")
    return Tag(place, f"entrance {grip + 1}: {where} m")
