"""Where the 3D view looks from: everything in it, whatever the window's shape."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import viser
from numpy import ndarray

from app.scene import geometry, views
from app.scene.scene import Scene
from app.scene.standing import StraightView, entrance_edges
from app.scene.views import Pose, edge_on, overview
from app.state import opening_step
from app.state.workbench import Workbench
from tests.app.scene import scene_case
from tracker.runs.pipeline import Progress, Run
from tracker.sequences.sequence import Entrance

SECONDS = 20.0
ASPECTS = [0.6, 1.0, 1.4, 2.4]


def reach(pose: Pose, points: ndarray, aspect: float) -> float:
    """How far points lie from the middle of the picture: 1 at its edge; infinite behind."""
    ahead = pose.look_at - pose.position
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, pose.up)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(right, ahead), ahead], axis=1)
    x, y, z = ((points - pose.position) @ axes).T
    if (z <= 0.0).any():
        return float("inf")
    slope = np.tan(pose.fov / 2.0)
    return float(max(np.abs(y / z / slope).max(), np.abs(x / z / slope / aspect).max()))


@pytest.mark.parametrize("aspect", [0.6, 1.0, 2.2])
def test_the_view_from_above_has_everything_in_it(aspect: float) -> None:
    points = geometry.box_corners(np.array([-1.0, -4.0, 0.0]), np.array([3.0, 2.0, 2.0]))
    pose = views.from_above(points, aspect)
    assert pose.position[:2] == pytest.approx([1.0, -1.0])
    depth = pose.position[2] - points[:, 2]
    tangent = np.tan(pose.fov / 2.0)
    assert (np.abs(points[:, 0] - 1.0) / depth <= tangent * aspect).all()
    assert (np.abs(points[:, 1] + 1.0) / depth <= tangent).all()


@pytest.mark.parametrize("aspect", [0.6, 1.0, 2.4])
def test_the_overview_crops_neither_the_room_nor_a_camera(
    server: viser.ViserServer, aspect: float
) -> None:
    of = scene_case.sequence(3)
    door = Entrance(np.array([of.room.maximum[0], 0.0, 0.9]), np.array([0.4, 0.4, 0.1]))
    of = replace(of, room=replace(of.room, entrances=(door,)))
    view = Scene(server, scene_case.opened(of))
    assert view.wait(SECONDS)
    pose = view._overview(aspect)
    assert pose is not None
    corners = geometry.box_corners(of.room.minimum, of.room.maximum)
    eyes = [camera.centre for camera in of.cameras]
    doors = entrance_edges(of.room)
    assert doors[:, 0].max() > of.room.maximum[0] + 0.8
    share = reach(pose, np.concatenate([corners, eyes, doors]), aspect)
    assert 0.6 < share < 0.97  # nor is it farther away than it must be
    view.close()


def uncertain(of: scene_case.Sequence, step: int, metres: float) -> Run:
    """A run with somebody of whom little is known at a step: his ellipsoid leaves the room."""
    run = scene_case.run(of)
    covariances = run.fused[step].posterior.covariances
    covariances[0] = metres**2 * np.eye(3)
    return run


def finish(workbench: Workbench, of: scene_case.Sequence, run: Run) -> None:
    workbench.run_begins(run.key)
    workbench.run_progresses(run, Progress("tracks", run.done, of.frames, 1.0, run.done))
    workbench.run_ends(run.key, "done")


@pytest.mark.parametrize("aspect", ASPECTS)
def test_the_first_view_crops_no_ellipsoid_and_nobody(
    server: viser.ViserServer, aspect: float
) -> None:
    of = scene_case.sequence()
    run = uncertain(of, 30, 0.7)
    workbench = scene_case.opened(of)
    view = Scene(server, workbench)
    finish(workbench, of, run)
    workbench.seek(30, opening_step.ORIGIN)
    assert view.wait(SECONDS)
    pose = view._overview(aspect)
    assert pose is not None
    posterior = run.fused[30].posterior
    seen = geometry.surfaces(posterior.means[:1], *geometry.ellipsoids(posterior.covariances[:1]))
    assert np.abs(seen[:, :2]).max() > of.room.maximum[0] + 0.7  # it does leave the room
    assert reach(pose, seen, aspect) < 1.0
    # the people of the whole run, wherever they go
    people = run.tracks.positions
    for corner in geometry.box_corners(-scene_case.HALF, scene_case.HALF):
        assert reach(pose, people + corner, aspect) < 1.0
    view.close()


def test_the_view_is_framed_anew_as_more_is_seen_and_then_stands_still(
    server: viser.ViserServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    of = scene_case.sequence()
    whole, part = scene_case.run(of), scene_case.run(of, done=20)
    workbench = scene_case.opened(of)
    view = Scene(server, workbench)
    assert view.wait(SECONDS)
    placed: list[int] = []
    monkeypatch.setattr(view._views, "again", lambda: placed.append(workbench.snapshot().playhead))
    workbench.run_begins(part.key)
    workbench.run_progresses(part, Progress("fusion", 20, of.frames, 1.0, 20))
    assert view.wait(SECONDS)
    assert placed == [0]  # the first people
    finish(workbench, of, whole)
    assert view.wait(SECONDS)
    assert placed == [0, 0]  # all of them
    workbench.seek(30, opening_step.ORIGIN)
    assert view.wait(SECONDS)
    assert placed == [0, 0, 30]  # where the recording is opened
    for step in (31, 45, 30):
        workbench.seek(step)
        assert view.wait(SECONDS)
    assert placed == [0, 0, 30]
    view.close()


@pytest.mark.parametrize("turn", np.arange(0.0, 360.0, 45.0))
def test_no_picture_of_a_camera_is_seen_from_its_edge(turn: float) -> None:
    room = scene_case.ROOM
    corners = geometry.box_corners(room.minimum, room.maximum)
    angle = np.deg2rad(turn)
    eyes = np.array([[3.0, 0.3, 2.4], [0.4, 3.0, 2.4]])
    about = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    eyes[:, :2] = eyes[:, :2] @ about.T
    normals = np.array([0.0, 0.0, 0.9]) - eyes
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    middles = eyes + 0.5 * normals
    points = np.concatenate([corners, eyes, middles])
    pose = overview(points, eyes, np.array([0, 0, 1.0]), 1.4, pictures=(middles, normals))
    assert edge_on(pose.position, middles, normals) < 0.2


def test_a_picture_seen_from_its_edge_is_a_line() -> None:
    middle, ahead = np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0]])
    assert edge_on(np.array([0.0, 5.0, 0.0]), middle, ahead) == pytest.approx(1.0)
    assert edge_on(np.array([5.0, 0.0, 0.0]), middle, ahead) == 0.0
    assert edge_on(np.array([-5.0, 0.0, 0.0]), middle, ahead) == 0.0
    assert edge_on(np.zeros(3), np.zeros((0, 3)), np.zeros((0, 3))) == 0.0


def test_frusta_say_where_their_pictures_are(server: viser.ViserServer) -> None:
    of = scene_case.sequence(3)
    view = Scene(server, scene_case.opened(of))
    assert view.wait(SECONDS)
    middles, normals = view._frusta.pictures(np.array([True, False, True]))
    for row, camera in enumerate((of.cameras[0], of.cameras[2])):
        straight = StraightView(camera, 320)
        pixel = straight.pinhole.project(middles[row : row + 1])[0][0]
        np.testing.assert_allclose(pixel, (np.array(straight.pinhole.image_size) - 1) / 2, atol=1.0)
        np.testing.assert_allclose(normals[row], straight.rotation[2])
    view.close()


def test_a_picture_in_front_of_the_room_hides_little_of_it(server: viser.ViserServer) -> None:
    of = scene_case.sequence(3)
    wide = replace(of.cameras[0], intrinsics=np.diag([150.0, 150.0, 1.0]) + 0.0)
    wide.intrinsics[:2, 2] = 179.5, 143.5
    wide = replace(wide, distortion=np.zeros(5))
    of = replace(of, views=(replace(of.views[0], camera=wide), *of.views[1:]))
    view = Scene(server, scene_case.opened(of))
    assert view.wait(SECONDS)
    across = float(np.linalg.norm(of.room.maximum - of.room.minimum))
    for index, camera in enumerate(of.cameras):
        chosen = np.arange(3) == index
        corners = view._frusta.corners(chosen)[:4]
        width = np.ptp((corners - camera.centre) @ StraightView(camera, 320).rotation[0])
        assert width <= 0.125 * across + 1e-9
        assert width > 0.06 * across  # it is seen, too
    view.close()
