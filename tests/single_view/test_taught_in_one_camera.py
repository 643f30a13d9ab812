"""People who never leave, taught by one camera's templates, are known to all of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy import ndarray

from tests.engine.painted import GREEN, RED, painted_sequence
from tests.engine.synthetic import CAMERAS, HALF_EXTENTS, walk
from tracker import pipeline
from tracker.boxes import Boxes
from tracker.parameters import ForegroundParams, RunParameters
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence
from tracker.single_view.box_sizes import upright_boxes
from tracker.single_view.colour.carrying import with_carried
from tracker.single_view.colour.trust import template_trust

STEPS = 16
SEATED = np.tile([0.35, -0.3, 1.0], (STEPS, 1))
WALKER = walk((-1.0, 0.2, 1.05), (0.0, 0.6, 1.05), STEPS)


def filmed(folder: Path, hidden_from: str = "") -> Sequence:
    """Somebody who walks and somebody who sits, in three cameras; templates of the first alone."""
    parts = []
    for camera in CAMERAS:
        own = folder / camera.name
        own.mkdir()
        paths = [WALKER, SEATED]
        if camera.name == hidden_from:
            paths = [WALKER, SEATED + np.array([0.0, 0.0, 0.8])]  # above the picture
        parts.append(painted_sequence(own, paths, [RED, GREEN], camera=camera))
    views = tuple(part.views[0] for part in parts)
    return replace(parts[0], views=views, digest=f"filmed {hidden_from}")


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Sequence:
    return filmed(tmp_path_factory.mktemp("room"))


def carried_by(sequence: Sequence) -> dict[tuple[str, str], ndarray]:
    with FrameReader(sequence) as reader:
        carried = with_carried(sequence, "hue_saturation", "epanechnikov", reader)
    new = carried.templates[len(sequence.templates) :]
    return {(t.name, t.camera): Boxes.from_left_top(t.box[None]).centred[0] for t in new}


@pytest.mark.full
def test_templates_are_carried_to_the_other_cameras(room: Sequence) -> None:
    carried = carried_by(room)
    assert set(carried) == {(f"person{i}", c) for i in (1, 2) for c in ("right", "back")}
    for (name, camera), box in carried.items():
        view = next(c for c in room.cameras if c.name == camera)
        place = (WALKER if name == "person1" else SEATED)[room.templates[0].frame]
        truth = upright_boxes(view, place[None], HALF_EXTENTS)[0][0]
        assert (np.abs(box[:2] - truth[:2]) < 0.5 * truth[2:]).all(), (name, camera)
        np.testing.assert_allclose(box[2:] / truth[2:], 1.0, atol=0.2)


def test_nothing_is_carried_to_a_camera_that_does_not_show_the_person(tmp_path: Path) -> None:
    carried = carried_by(filmed(tmp_path, hidden_from="back"))
    assert ("person2", "right") in carried
    assert ("person2", "back") not in carried


def test_a_camera_with_a_template_of_its_own_gets_none(room: Sequence) -> None:
    own = replace(room.templates[0], camera="back")
    carried = carried_by(replace(room, templates=(*room.templates, own)))
    assert ("person1", "back") not in carried
    assert ("person1", "right") in carried


def test_the_foreground_is_believed_of_who_walks_and_not_of_who_sits(room: Sequence) -> None:
    with FrameReader(room) as reader:
        for camera in range(3):
            trust = template_trust(room, camera, reader, ForegroundParams())
            assert trust["person1"] == 1.0
            assert trust["person2"] == 0.0


@pytest.mark.full
def test_both_are_found_with_the_defaults(room: Sequence) -> None:
    run = pipeline.compute(room, RunParameters())
    for path in (WALKER, SEATED):
        near = [
            bool((np.linalg.norm(at - path[step], axis=1) < 0.25).any())
            for step in range(STEPS)
            if len(at := run.tracks.positions[run.tracks.frames == step]) or True
        ]
        assert np.mean(near) > 0.8
    assert len(run.tracks.frames) < 2.2 * STEPS
