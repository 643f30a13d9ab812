"""Whose colours a box has, of every method that is given pictures."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.engine.painted import GREEN, RED, painted_sequence
from tests.engine.standing import line
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence
from tracker.single_view.box_sizes import upright_boxes
from tracker.single_view.colour import templates
from tracker.single_view.colour.likeness import Likeness

STEPS = 40


@pytest.fixture(scope="module")
def painted(tmp_path_factory: pytest.TempPathFactory) -> Sequence:
    """A red and a green head that pass before one camera."""
    folder = tmp_path_factory.mktemp("painted")
    return painted_sequence(folder, paths(), [RED, GREEN])


def paths() -> list[np.ndarray]:
    """A metre apart, half a metre along."""
    first = line([(-0.6, 0.0), (-0.3, 0.4)], [0, 1], STEPS)[:STEPS]
    second = line([(0.6, 0.4), (0.4, 0.0)], [0, 1], STEPS)[:STEPS]
    return [first, second]


def likeness_of(sequence: Sequence) -> Likeness | None:
    with FrameReader(sequence) as reader:
        return Likeness.of(sequence, reader)


def test_each_head_looks_like_itself_and_the_wall_like_nobody(painted: Sequence) -> None:
    step = 8
    heads, _ = upright_boxes(
        painted.cameras[0], np.array([path[step] for path in paths()]), painted.target_half_extents
    )
    width, height = painted.cameras[0].image_size
    corner = np.array([[0.0, 0.0, 5.0, 5.0]])
    beyond = np.array([[-90.0, 20.0, 5.0, 5.0], [width + 60.0, height + 60.0, 9.0, 9.0]])
    with FrameReader(painted) as reader:
        likeness = Likeness.of(painted, reader)
        picture = reader.picture(0, step)
    assert likeness is not None
    assert picture is not None
    told = likeness.of_boxes(picture, np.concatenate([heads, corner, beyond]))
    assert_allclose(told.sum(axis=1), 1.0)
    assert told[0, 0] > 0.95
    assert told[1, 1] > 0.95
    assert told[2].max() < 0.9, "a grey wall has no person's colours"
    assert_allclose(told[3:], 0.5)
    assert_allclose(likeness.of_boxes(picture, heads[1:]), told[1:2], err_msg="whatever else asks")
    assert likeness.of_boxes(picture, heads[:0]).shape == (0, 2)


def test_there_is_nobody_to_tell_apart(painted: Sequence) -> None:
    alone = replace(painted, templates=painted.templates[:1])
    assert likeness_of(alone) is None
    assert likeness_of(replace(painted, templates=())) is None


def test_a_template_that_cannot_be_read_is_told_and_hinders_nobody(
    painted: Sequence, caplog: pytest.LogCaptureFixture
) -> None:
    away = replace(painted.templates[1], box=np.array([9000.0, 9000.0, 5.0, 5.0]))
    broken = replace(painted, templates=(painted.templates[0], away))
    with caplog.at_level(logging.WARNING):
        assert likeness_of(broken) is None
    assert 'template "person2"' in caplog.text


def test_the_templates_of_a_run_are_read_once(
    painted: Sequence, monkeypatch: pytest.MonkeyPatch
) -> None:
    read = []
    histograms = templates.colour.histograms
    monkeypatch.setattr(
        templates.colour, "histograms", lambda *a: read.append(len(a[1])) or histograms(*a)
    )
    with FrameReader(painted) as reader:
        first = templates.read_templates(painted, "hue_saturation", "epanechnikov", reader)
        assert Likeness.of(painted, reader) is not None
        assert read == [1] * len(painted.templates)
        fewer = replace(painted, templates=painted.templates[:1])
        other = templates.read_templates(fewer, "hue_saturation", "epanechnikov", reader)
        assert len(other.roots) < len(first.roots)
