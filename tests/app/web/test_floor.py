"""The grid on the floor of the pictures, against the calibration itself."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy import ndarray
from starlette.testclient import TestClient

from app.web.dependencies import Settings
from app.web.overlays import NEAR, OFF, floor_of
from app.web.server import create_app
from tests.app.conftest import ADDRESS
from tests.app.scene import scene_case
from tracker.geometry.camera import Camera
from tracker.sequences.reader import read_sequence
from tracker.sequences.sequence import View


def on_floor(camera: Camera, pixels: ndarray, height: float) -> ndarray:
    """Where the rays through pixels meet the floor, world metres."""
    rays = camera.back_project(pixels)
    return np.asarray(camera.centre + rays * ((height - camera.centre[2]) / rays[:, 2])[:, None])


def between(line: list[tuple[float, float]]) -> ndarray:
    """Points all along a line as it is drawn."""
    ends = np.array(line)
    shares = np.linspace(0.0, 1.0, 9)[:, None, None]
    return np.asarray(ends[:-1] + shares * (ends[1:] - ends[:-1])).reshape(-1, 2)


@pytest.mark.parametrize("distortion", [-0.25, 0.0, 0.1])
def test_each_line_lies_on_the_floor_at_a_whole_multiple_of_the_cell(distortion: float) -> None:
    of = scene_case.sequence()
    views = tuple(View(scene_case.camera(i, 3, distortion)) for i in range(3))
    of = replace(of, views=views)
    floor = floor_of(of)
    assert floor.cell == 0.5
    assert floor.height == of.room.minimum[2]
    for told, camera in zip(floor.cameras, of.cameras, strict=True):
        assert len(told.lines) >= 8  # 5 and 5 lines inside 3 m by 3 m, most of them in sight
        for line in told.lines:
            pixels = between(line)
            inside = camera.contains(pixels)
            places = on_floor(camera, pixels[inside], floor.height)[:, :2]
            if not len(places):
                continue
            off = np.abs(places / floor.cell - np.round(places / floor.cell)) * floor.cell
            # it is the grid's in one of the two directions, as well as pixels can tell
            metres = 0.02 if camera.is_pinhole else 0.03
            assert off.max(axis=0).min() < metres
            assert (np.abs(places) < 1.5 + metres).all()
        for line in told.edges:
            pixels = between(line)
            inside = camera.contains(pixels)
            places = on_floor(camera, pixels[inside], floor.height)[:, :2]
            assert not len(places) or np.abs(np.abs(places) - 1.5).max(axis=0).min() < 0.03


def test_a_lens_bends_the_lines_and_few_points_tell_how() -> None:
    of = scene_case.sequence()
    lens = replace(of.cameras[0], distortion=np.array([-0.25, 0.0, 0.0, 0.0, 0.0]))
    bent = floor_of(replace(of, views=(View(lens),))).cameras[0]
    plain = replace(lens, distortion=np.zeros(5))
    straight = floor_of(replace(of, views=(View(plain),))).cameras[0]
    assert max(len(line) for line in straight.lines) == 2
    assert max(len(line) for line in bent.lines) > 4
    assert sum(len(line) for line in bent.lines) < 400


def test_a_camera_inside_the_room_sees_no_floor_behind_it() -> None:
    of = scene_case.sequence()
    ahead = np.array([1.0, 0.0, -0.35])
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(ahead, right), ahead])
    eye = np.array([-0.2, 0.1, 1.4])
    camera = replace(of.cameras[0], rotation=rotation, translation=-rotation @ eye)
    floor = floor_of(replace(of, views=(View(camera),))).cameras[0]
    assert floor.lines
    size = np.array(camera.image_size)
    for line in [*floor.lines, *floor.edges]:
        points = np.array(line)
        assert (np.abs(points - size / 2.0) <= (0.5 + OFF) * size + 0.1).all()
        inside = points[camera.contains(points)]
        depth = camera.to_camera(on_floor(camera, inside, of.room.minimum[2]))[:, 2]
        assert (depth > NEAR - 0.01).all()


def test_the_route_tells_the_open_room(client: TestClient, crossing: Path) -> None:
    of = read_sequence(crossing)
    told = client.get("/api/floor").json()
    assert told == floor_of(of).model_dump(mode="json")
    assert len(told["cameras"]) == len(of.views)


def test_nothing_open_has_no_floor() -> None:
    app = create_app(Settings(sequence=None, with_viser=False))
    with TestClient(app, base_url=ADDRESS) as nobody:
        assert nobody.get("/api/floor").status_code == 409
