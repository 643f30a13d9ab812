"""Handles on the room: only in the mode, live while dragged, taught on release."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator

import numpy as np
import pytest
import viser
from viser import _messages

from app.scene.editing import FACES, Face, RoomEditing, dragged, grips
from app.state.edits import Edits
from app.state.teaching import Teaching
from app.state.workbench import Workbench
from tests.app.scene import scene_case
from tracker.parameters.catalogue import RunParameters
from tracker.sequences.pictures.frames import FrameReader

RIGHT = Face("max", 0)


@pytest.fixture
def bench(server: viser.ViserServer) -> Iterator[tuple[Workbench, RoomEditing]]:
    """A room of two by three metres and more, with handles."""
    workbench = Workbench()
    teaching = Teaching(workbench, Edits(workbench))
    editing = RoomEditing(server, workbench, teaching)
    of = scene_case.sequence()
    workbench.open(of, of.name, FrameReader(of), RunParameters(single_view="none"))
    assert editing.wait(5.0)
    yield workbench, editing
    editing.close()
    teaching.close()


def send(server: viser.ViserServer, editing: RoomEditing, grip: Face | int, *places: list) -> None:
    """What a browser sends while somebody drags a handle: start, places, end."""
    scene, name = server.scene, editing.handles[grip].name
    turn = (1.0, 0.0, 0.0, 0.0)

    async def drag() -> None:
        await scene._handle_transform_controls_drag_start(
            0, _messages.TransformControlsDragStartMessage(name)
        )
        for x, y, z in places:
            message = _messages.TransformControlsUpdateMessage(name, turn, (x, y, z))
            await scene._handle_transform_controls_updates(0, message)

    asyncio.run_coroutine_threadsafe(drag(), server.get_event_loop()).result(5.0)
    assert editing.wait(5.0)


def let_go(server: viser.ViserServer, editing: RoomEditing, grip: Face | int) -> None:
    message = _messages.TransformControlsDragEndMessage(editing.handles[grip].name)
    asyncio.run_coroutine_threadsafe(
        server.scene._handle_transform_controls_drag_end(0, message), server.get_event_loop()
    ).result(5.0)
    assert editing.wait(5.0)


def room(workbench: Workbench) -> list[float]:
    sequence = workbench.snapshot().sequence
    assert sequence is not None
    return [*sequence.room.minimum.tolist(), *sequence.room.maximum.tolist()]


def test_there_are_handles_in_the_mode_only(
    server: viser.ViserServer, bench: tuple[Workbench, RoomEditing]
) -> None:
    workbench, editing = bench
    assert not any(handle.visible for handle in editing.handles.values())
    workbench.edit_room(True)
    assert editing.wait(5.0)
    assert {grip for grip, handle in editing.handles.items() if handle.visible} == {*FACES, 0}
    for face in FACES:
        assert editing.handles[face].active_axes == tuple(axis == face.axis for axis in range(3))
    assert editing.handles[RIGHT].position.tolist() == [1.5, 0.0, 1.0]
    workbench.edit_room(False)
    assert editing.wait(5.0)
    assert not any(handle.visible for handle in editing.handles.values())
    send(server, editing, RIGHT, [2.0, 0.0, 1.0])
    let_go(server, editing, RIGHT)
    assert room(workbench)[3] == 1.5


def test_a_face_is_shown_while_it_moves_and_taught_on_release(
    server: viser.ViserServer, bench: tuple[Workbench, RoomEditing]
) -> None:
    workbench, editing = bench
    workbench.edit_room(True)
    assert editing.wait(5.0)
    changes: list[str] = []
    workbench.subscribe(changes.append)
    send(server, editing, RIGHT, [1.6, 0.3, 1.0], [1.8349, 0.3, 1.0])
    assert room(workbench)[3] == 1.5  # not yet
    words = [node.text for node in editing._words._nodes if node.visible]
    assert words == ["x 1.83 m"]
    assert editing.handles[Face("min", 1)].position.tolist() == [0.0, -1.5, 1.0]
    let_go(server, editing, RIGHT)
    assert editing.handles[Face("min", 1)].position.tolist() == pytest.approx([0.165, -1.5, 1.0])
    assert room(workbench) == [-1.5, -1.5, 0.0, 1.83, 1.5, 2.0]
    assert changes.count("taught") == 1
    assert editing.handles[RIGHT].position.tolist() == [1.83, 0.0, 1.0]


def test_an_entrance_moves_and_new_ones_get_a_handle(
    server: viser.ViserServer, bench: tuple[Workbench, RoomEditing]
) -> None:
    workbench, editing = bench
    workbench.edit_room(True)
    assert editing.wait(5.0)
    send(server, editing, 0, [0.5, -1.234, 0.9])
    let_go(server, editing, 0)
    sequence = workbench.snapshot().sequence
    assert sequence is not None
    assert sequence.room.entrances[0].position.tolist() == [0.5, -1.23, 0.9]
    assert sequence.room.entrances[0].sigma.tolist() == [0.3, 0.3, 0.1]
    editing._teaching.add_entrance()
    assert editing.wait(5.0)
    assert editing.handles[1].visible
    assert editing.handles[1].position.tolist() == [0.0, 0.0, 0.9]
    editing._teaching.remove_entrance(1)
    assert editing.wait(5.0)
    assert not editing.handles[1].visible
    send(server, editing, 1, [0.0, 0.0, 1.0])  # somebody still held it
    let_go(server, editing, 1)
    assert workbench.snapshot().sequence is not None
    assert len(workbench.snapshot().sequence.room.entrances) == 1  # type: ignore[union-attr]


def test_a_face_stays_on_its_side(
    server: viser.ViserServer, bench: tuple[Workbench, RoomEditing]
) -> None:
    workbench, editing = bench
    workbench.edit_room(True)
    assert editing.wait(5.0)
    send(server, editing, RIGHT, [-9.0, 0.0, 1.0])
    let_go(server, editing, RIGHT)
    assert room(workbench)[3] == pytest.approx(-1.4)
    assert editing.handles[RIGHT].position.tolist() == pytest.approx([-1.4, 0.0, 1.0])


def test_handles_stand_on_what_they_move() -> None:
    of = scene_case.ROOM
    places = grips(of)
    assert set(places) == {*FACES, 0}
    for grip, place in places.items():
        same = dragged(of, grip, np.array(place))
        assert np.allclose([same.minimum, same.maximum], [of.minimum, of.maximum])
        moved = dragged(of, grip, np.array(place) + 0.25)
        assert grips(moved)[grip] != place
