"""The synthetic world is consistent: what is written is read again, boxes are where people are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests import world
from tests.synthetic import numbered_picture
from tracker.sequences.reader import read_sequence
from tracker.sequences.sequence import Template

CAMERAS = world.ring(2, image_size=(192, 144), focal=90.0)
PATHS = world.together(
    world.walk([(-1.0, 0.0), (1.0, 0.5)], [0.0, 1.0], 10.0),
    world.walk([(1.0, 1.0), (-1.0, 1.0)], [0.3, 0.8], 10.0),
)
CLOTHES = [((30.0, 30.0, 60.0), (60.0, 70.0, 200.0)), ((20.0, 70.0, 40.0), (70.0, 190.0, 60.0))]


def test_a_walk_begins_ends_and_is_where_it_should_be() -> None:
    assert PATHS.shape == (10, 2, 3)
    np.testing.assert_array_equal(
        np.isfinite(PATHS[:, 1, 0]), [*[False] * 3, *[True] * 5, *[False] * 2]
    )
    np.testing.assert_allclose(PATHS[5, 0], [0.0, 0.25, 0.85])
    assert [len(step) for step in world.views(world.boxes(CAMERAS, PATHS))] == [2] * 10


@pytest.mark.parametrize("video", [False, True])
def test_a_folder_is_read_as_it_was_built(tmp_path: Path, video: bool) -> None:
    seen = world.boxes(CAMERAS, PATHS, clutter=1.0, misses=0.2)
    template = Template("person1", "cam2", 3, np.array([60.0, 50.0, 24.0, 48.0]))
    whole = world.sequence(
        CAMERAS, PATHS, seen, templates=[template], room=world.volume(entrances=[(1.0, 2.0, 0.85)])
    )
    place = world.folder(
        tmp_path / "world", whole, lambda _, step: numbered_picture(step), video=video
    )
    found = read_sequence(place)
    assert not found.warnings
    assert (found.frames, found.fps, found.has_pictures) == (10, 10.0, True)
    for view, own in zip(found.views, whole.views, strict=True):
        assert view.detections is not None
        assert own.detections is not None
        np.testing.assert_array_equal(view.detections.boxes, own.detections.boxes)
        np.testing.assert_array_equal(view.camera.centre, own.camera.centre)
    assert found.ground_truth is not None
    np.testing.assert_array_equal(found.ground_truth.positions, world.truth(PATHS).positions)
    np.testing.assert_array_equal(found.room.entrances[0].position, [1.0, 2.0, 0.85])
    assert found.templates[0].frame == 3


def test_a_picture_shows_its_people() -> None:
    painted = world.painted(CAMERAS, PATHS, CLOTHES, noise=0.0)(0, 5)
    x, y, _, half = world.upright(CAMERAS[0], PATHS[5])[0]
    np.testing.assert_array_equal(painted[round(y + half / 2), round(x)], CLOTHES[0][1])
    np.testing.assert_array_equal(painted[round(y - half / 2), round(x)], CLOTHES[0][0])
