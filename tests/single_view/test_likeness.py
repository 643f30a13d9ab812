"""Whose colours a box has, of every method that is given pictures."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.single_view.test_scenes import truth
from tracker.parameters.groups.colour_phd import ColourPhdParams
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence
from tracker.single_view.colour import templates
from tracker.single_view.colour.templates import Likeness, appearance_of, read_templates
from tracker.single_view.pictures import colour


def likeness_of(sequence: Sequence) -> Likeness | None:
    with FrameReader(sequence) as reader:
        return Likeness.of(sequence, reader)


def test_whom_a_box_looks_like_follows_from_its_distances_to_everybody(
    heads: Sequence, reader: FrameReader
) -> None:
    picture, likeness = reader.picture(0, 3), Likeness.of(heads, reader)
    assert likeness is not None
    assert picture is not None
    height, width = picture.shape[:2]
    own = truth(heads, 3)
    corners = np.array([[0.0, 0.0, 5.0, 5.0], [width - 1.0, height - 1.0, 3.0, 9.0]])
    beyond = np.array([[-90.0, 20.0, 5.0, 5.0], [width + 60.0, height + 60.0, 9.0, 9.0],
                       [20.0, -90.0, 5.0, 5.0]])  # fmt: skip
    every = np.concatenate([own, corners, beyond])
    told = likeness.of_boxes(picture, every)
    p = ColourPhdParams()
    model = read_templates(heads, p.colour_space, p.histogram_kernel, reader)
    bins = colour.bin_map(picture, p.colour_space)
    powers = np.exp(-0.5 * (model.distances(bins, every) / p.likelihood_sigma) ** 2)
    assert_allclose(told, powers / powers.sum(axis=1, keepdims=True))
    assert_allclose(told[4:], 0.5)
    assert told[0, 0] > 0.9
    assert told[1, 1] > 0.9
    assert_allclose(likeness.of_boxes(picture, every[1:2]), told[1:2])  # whatever else asks
    assert likeness.of_boxes(picture, every[:0]).shape == (0, 2)
    looks = appearance_of(picture, every)
    roots = np.sqrt(colour.histograms(bins, every, p.colour_space, p.histogram_kernel))
    assert_allclose(looks, roots, atol=1e-3)
    assert_allclose(np.linalg.norm(looks[:4].astype(float), axis=1), 1.0, atol=1e-2)
    assert not looks[4:].any()
    # of a large box some pixels alone count, from its own edge on, wherever the picture is cut
    large = np.array([[48.0, 36.0, 30.0, 30.0]])
    roots = np.sqrt(colour.histograms(bins, large, p.colour_space, p.histogram_kernel))
    assert_allclose(appearance_of(picture, large), roots, atol=1e-3)


def test_there_is_nobody_to_tell_apart(heads: Sequence) -> None:
    alone = replace(heads, templates=heads.templates[:1])
    assert likeness_of(alone) is None
    assert likeness_of(replace(heads, templates=())) is None


def test_a_template_that_cannot_be_read_is_told_and_hinders_nobody(
    heads: Sequence, caplog: pytest.LogCaptureFixture
) -> None:
    away = replace(heads.templates[1], box=np.array([9000.0, 9000.0, 5.0, 5.0]))
    broken = replace(heads, templates=(heads.templates[0], away))
    with caplog.at_level(logging.WARNING):
        assert likeness_of(broken) is None
    assert 'template "green"' in caplog.text


def test_the_templates_of_a_run_are_read_once(
    heads: Sequence, monkeypatch: pytest.MonkeyPatch
) -> None:
    read = []
    histograms = templates.colour.histograms
    monkeypatch.setattr(
        templates.colour, "histograms", lambda *a: read.append(len(a[1])) or histograms(*a)
    )
    with FrameReader(heads) as reader:
        first = templates.read_templates(heads, "hue_saturation", "epanechnikov", reader)
        assert Likeness.of(heads, reader) is not None
        assert read == [1] * len(heads.templates)
        fewer = replace(heads, templates=heads.templates[:1])
        other = templates.read_templates(fewer, "hue_saturation", "epanechnikov", reader)
        assert len(other.roots) < len(first.roots)
