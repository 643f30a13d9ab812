"""Rooms drawn by a seed: reproducible, varied, with truth that agrees with the pictures."""

from __future__ import annotations

import csv
import json
from collections import Counter
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import cv2
import numpy as np
import pytest

from tests.rooms import RenderCancelled, choose, render_random
from tests.rooms.random_rooms.behaviour import direct
from tests.rooms.random_rooms.boxes import seen_by
from tests.rooms.random_rooms.film import prepare
from tests.rooms.random_rooms.furnishing import furnish_randomly
from tests.rooms.random_rooms.rig import drawn_by, mount
from tests.rooms.random_rooms.sensors import record
from tests.rooms.random_rooms.shell import build_shell
from tests.rooms.walls.background import Background
from tracker.geometry.camera import Camera
from tracker.sequences.reader import read_sequence

pytestmark = pytest.mark.full  # the generator is no part of the program

SEED = 71
STEPS = 70
"""A small room, and its first steps: three people who come and go, and a screen."""


@pytest.fixture(scope="module")
def rendered(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("random") / "room"
    render_random(SEED, folder, detections=True, frames=STEPS)
    return folder


def test_a_hundred_seeds_draw_everything_that_is_asked_for() -> None:
    chosen = [choose(seed) for seed in range(100)]
    assert {c.cameras for c in chosen} == set(range(2, 9))
    assert {c.people for c in chosen} >= set(range(1, 7))
    assert {c.fps for c in chosen} == {5.0, 10.0, 15.0, 25.0, 30.0, 60.0}
    assert {min(c.image_size) for c in chosen} >= {240, 288, 360, 480, 720}
    behaviours = Counter(b for c in chosen for b in c.behaviours)
    assert set(behaviours) == {"walks", "stands", "sits", "rises", "lies", "comes and goes"}
    values: dict[str, set[str]] = {}
    for choices in chosen:
        for name, value in choices.causes().items():
            values.setdefault(name, set()).add(value)
    assert all(len(found) > 1 for found in values.values())
    assert values["light"] == {"steady", "drifting", "switched", "clouds", "flickering"}


def test_the_seed_alone_decides() -> None:
    assert choose(7) == choose(7)
    assert choose(7) != choose(8)
    with pytest.raises(ValueError, match="must be 0 or more, got -1"):
        choose(-1)


def test_a_room_has_only_so_many_steps(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"frames must be 1 … \d+ in random room 71, got 9999"):
        render_random(SEED, tmp_path / "room", frames=9999)


def test_pictures_and_files_are_the_same_again(tmp_path: Path, rendered: Path) -> None:
    render_random(SEED, tmp_path / "again", frames=STEPS)
    """But for a detector's boxes, which are there only when they are asked for."""
    cameras = choose(SEED).cameras
    files = sorted(path.name for path in (tmp_path / "again").iterdir())
    boxes = [f"cam{number + 1}.csv" for number in range(cameras)]
    assert sorted([*files, *boxes]) == sorted(path.name for path in rendered.iterdir())
    for name in set(files) - {"sequence.toml", "SHA256SUMS"}:
        assert (rendered / name).read_bytes() == (tmp_path / "again" / name).read_bytes(), name
    assert not read_sequence(tmp_path / "again").has_detections


def test_a_room_opens_as_any_sequence(rendered: Path) -> None:
    sequence, choices = read_sequence(rendered), choose(SEED)
    assert len(sequence.views) == choices.cameras
    assert sequence.frames == STEPS
    assert sequence.fps == choices.fps
    assert sequence.has_pictures
    assert sequence.has_detections
    assert sequence.warnings == ()
    assert sequence.ground_truth is not None
    assert sequence.room.contains(sequence.ground_truth.positions).all()
    names = {template.name for template in sequence.templates}
    labels = json.loads((rendered / "labels.json").read_text())
    assert names == set(labels["people_with_template"])
    assert labels["seed"] == SEED
    assert labels["causes"] == choices.causes()


def test_true_positions_project_into_the_true_boxes(rendered: Path) -> None:
    """Of who is wholly in a picture, through the written calibration."""
    sequence = read_sequence(rendered)
    truth = sequence.ground_truth
    assert truth is not None
    where = {
        (int(f), int(i)): p
        for f, i, p in zip(truth.frames, truth.ids, truth.positions, strict=True)
    }
    cameras = {camera.name: camera for camera in sequence.cameras}
    checked = 0
    with (rendered / "boxes.csv").open() as file:
        for row in csv.DictReader(file):
            key = int(row["frame"]), int(row["id"])
            camera = cameras[row["camera"]]
            left, top, width, height = (float(row[k]) for k in ("left", "top", "width", "height"))
            right, bottom = np.array(camera.image_size) - 1.5
            inside = left > 0.5 and top > 0.5 and left + width < right and top + height < bottom
            if key not in where or not inside:
                continue
            (pixel,), _ = camera.project(where[key][None])
            assert left - 1 < pixel[0] < left + width + 1
            assert abs(pixel[1] - top - height / 2.0) < 0.25 * height
            checked += 1
    assert checked > 50


def test_the_visible_are_different_from_the_empty_room(rendered: Path) -> None:
    """Where somebody is seen the picture differs from the same pixels with nobody there."""
    with (rendered / "boxes.csv").open() as file:
        rows = list(csv.DictReader(file))
    video = cv2.VideoCapture(str(rendered / "cam1.avi"))
    pictures = []
    while True:
        there, picture = video.read()
        if not there:
            break
        pictures.append(picture.astype(float))
    assert len(pictures) == STEPS
    median = np.median(pictures[::4], axis=0)
    shares = []
    for row in rows:
        if row["camera"] != "cam1" or float(row["visible"]) < 0.9:
            continue
        left, top, width, height = (
            round(float(row[k])) for k in ("left", "top", "width", "height")
        )
        own = np.s_[max(0, top) : top + height, max(0, left) : left + width]
        changed = np.abs(pictures[int(row["frame"])][own] - median[own]).max(axis=2) > 25.0
        shares.append(changed.mean())
    assert len(shares) > 10
    assert np.median(shares) > 0.3


def test_cancelling_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(RenderCancelled):
        render_random(SEED, tmp_path / "room", cancelled=lambda: True)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("seed", range(12))
def test_nobody_walks_through_furniture_or_far_too_near_another(seed: int) -> None:
    choices = choose(seed)
    cameras = mount(choices)
    room = build_shell(choices, cameras, "#a83a24")
    furnish_randomly(room, choices, cameras)
    scripts = direct(choices, room)
    assert len(scripts) == choices.people
    for script in scripts:
        times = [point[0] for point in script.waypoints]
        assert times == sorted(times)
        if script.behaviour not in ("walks", "stands"):
            continue
        places = script.place_at(np.linspace(0.0, choices.duration, 60))
        assert room.free(places, 0.0).mean() > 0.97
    # a camera hangs in no wall, and all look into the room
    for camera in cameras:
        assert np.all(np.abs(camera.centre[:2]) < room.half)
        assert camera.centre[2] < choices.ceiling
        (middle,), (valid,) = camera.project(np.array([[0.0, 0.0, 1.0]]))
        assert valid
        assert np.all(np.abs(middle - np.array(camera.image_size) / 2.0) < camera.image_size)


@pytest.mark.parametrize("seed", range(4))
def test_light_that_wavers_stays_about_what_the_camera_is_exposed_for(seed: int) -> None:
    short = replace(
        choose(seed), steps=60, fps=60.0, light="clouds", exposure="hunting",
        white_balance="wandering",
    )  # fmt: skip
    grey = SimpleNamespace(room=np.full((4, 6, 3), 0.105))
    camera = SimpleNamespace(image_size=(6, 4))
    (film,) = record(short, [cast(Camera, camera)], [cast(Background, grey)])
    levels = np.log(film.gains)
    assert np.abs(levels.mean(axis=(0, 1))).max() < 0.6
    assert np.abs(levels).max() < 1.5
    assert levels.std(axis=0).min() > 0.05  # and does waver


def test_large_pictures_are_drawn_at_half_their_size() -> None:
    """And both cameras see a point at the same place of the picture."""
    camera = mount(replace(choose(0), image_size=(1280, 720), turned="upright"))[0]
    smaller, times = drawn_by(camera)
    assert times == 2
    assert smaller.image_size == (640, 360)
    points = np.array([[0.3, 0.2, 1.1], [-0.4, 0.1, 0.4]])
    (full, _), (half, _) = camera.project(points), smaller.project(points)
    np.testing.assert_allclose((half + 0.5) * 2.0 - 0.5, full)


def test_boxes_are_cut_at_the_border_and_absent_outside() -> None:
    camera = Camera("cam1", (100, 50), np.eye(3), np.eye(3), np.zeros(3), np.zeros(5))
    corners = np.array([[[[-10.5, 9.5, 9.5, 29.5]], [[200.0, 5.0, 220.0, 20.0]]]])
    seen = seen_by([camera], corners, np.ones((1, 2, 1)))
    np.testing.assert_allclose(seen.boxes[0, 0, 0], [-0.5, 9.5, 10.0, 20.0])
    assert seen.framed[0, 0, 0] == 0.5
    assert np.isnan(seen.boxes[0, 1, 0]).all()
    assert seen.framed[0, 1, 0] == 0.0


def test_who_sits_and_who_lies_is_lower_than_who_stands() -> None:
    choices = replace(
        choose(8), cameras=2, image_size=(320, 240), behaviours=("rises", "sits", "lies", "walks")
    )
    figures = prepare(choices).studio.scene.figures
    heights = dict(zip(choices.behaviours, (f.poses.top for f in figures), strict=True))
    assert heights["lies"].max() < 0.75
    assert 1.0 < heights["sits"].mean() < 1.45
    assert heights["walks"].min() > 1.3
    assert np.ptp(heights["rises"]) > 0.3
