"""Boxes drawn where a target can be, particles that walk, and what counts as in the picture."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tests.single_view.test_scenes import SMALL
from tracker.parameters.groups.colour_phd import ColourPhdParams
from tracker.parameters.groups.foreground import ForegroundParams
from tracker.parameters.groups.pseudo_particle import PseudoParticleParams
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence
from tracker.single_view.colour.appearance import Appearance
from tracker.single_view.pseudo_particle.particles import ColourParticles

FOREGROUND = ForegroundParams(
    minimum_area=int(SMALL["foreground.minimum_area"]), threshold=SMALL["foreground.threshold"]
)


def appearance(
    heads: Sequence, reader: FrameReader, jitter: float, foreground: ForegroundParams | None = None
) -> Appearance:
    return Appearance(
        heads, 0, reader, colour_space="rgb", histogram_kernel="flat", size_jitter=jitter,
        foreground=foreground,
    )  # fmt: skip


def test_boxes_are_drawn_all_over_the_picture_in_sizes_that_are_possible_there(
    heads: Sequence, reader: FrameReader
) -> None:
    one, rng = appearance(heads, reader, 0.0), np.random.default_rng(0)
    width, height = heads.cameras[0].image_size
    boxes = one.draw_anywhere(6000, rng)
    possible = one.sizes.contains(one.sizes.places()).mean()
    assert len(boxes) / 6000 == pytest.approx(possible, abs=0.05)
    assert one.sizes.contains(boxes[:, :2]).all()
    assert (boxes[:, 2:] >= one.sizes.smallest).all()
    assert (boxes[:, 2:] <= one.sizes.largest).all()
    assert (boxes[:, :2] >= -0.5).all()
    assert (boxes[:, :2] <= [width - 0.5, height - 0.5]).all()
    share = boxes[:, :2] - np.floor(boxes[:, :2])
    assert np.abs(share.mean(axis=0) - 0.5).max() < 0.03
    # a jitter multiplies both sizes by one number
    again = appearance(heads, reader, 0.3).draw_anywhere(6000, np.random.default_rng(0))
    factors = np.log(again[:, 2:] / boxes[:, 2:])
    assert_allclose(factors[:, 0], factors[:, 1])
    assert factors[:, 0].std() == pytest.approx(0.3, rel=0.05)
    assert factors[:, 0].mean() == pytest.approx(0.0, abs=0.02)
    assert one.draw_anywhere(0, rng).shape == (0, 4)


def test_boxes_on_foreground_are_centred_on_its_pixels(
    heads: Sequence, reader: FrameReader
) -> None:
    one, rng = appearance(heads, reader, 0.0, FOREGROUND), np.random.default_rng(0)
    picture = reader.picture(0, 3)
    assert picture is not None
    _, scene = one.prepare(one.start(), picture)
    assert scene.mask is not None
    boxes = one.draw_on_foreground(500, scene, rng)
    columns, rows = np.floor(boxes[:, :2] + 0.5).astype(int).T
    assert scene.mask[rows, columns].all()
    assert len(np.unique(columns + 1000 * rows)) > 0.4 * scene.mask.sum()
    assert scene.foreground_share == pytest.approx(scene.mask.mean())
    assert len(one.draw_on_foreground(0, scene, rng)) == 0
    blind = appearance(heads, reader, 0.0)
    _, bare = blind.prepare(blind.start(), picture)
    assert bare.mask is None
    assert bare.foreground_share == 0.0
    assert len(blind.draw_on_foreground(9, bare, rng)) == 0
    factors, shares = blind.shape_scores(bare, boxes, inside_weight=1.0, around_weight=1.0)
    assert_array_equal(factors, np.zeros(len(boxes)))
    assert_array_equal(shares, np.ones(len(boxes)))


def test_a_centre_in_the_outer_pixels_is_in_the_picture_and_sizes_are_cut(
    heads: Sequence, reader: FrameReader
) -> None:
    one = appearance(heads, reader, 0.0)
    width, height = heads.cameras[0].image_size
    small, large = one.sizes.smallest, one.sizes.largest
    right, low = width - 1.0, height - 1.0
    inside = [[0.0, 0.0], [right, low], [0.0, low], [5.0, 5.0]]
    outside = [[-1e-9, 0.0], [0.0, -1e-9], [np.nextafter(right, 1e9), 0.0],
               [0.0, np.nextafter(low, 1e9)]]  # fmt: skip
    sizes = np.tile([0.5 * small, 2.0 * large, small, large], (2, 1))
    found = one.within(np.column_stack([[*inside, *outside], sizes]))
    assert_array_equal(found[:, :2], inside)
    assert_array_equal(found[:, 2:], [small, large, small, large])


def test_particles_walk_in_half_sizes_and_grow_as_a_whole(
    heads: Sequence, reader: FrameReader
) -> None:
    p = PseudoParticleParams(birth="picture")
    colours = ColourPhdParams(
        motion_sigma=0.8, growth_sigma=0.1, foreground_weight=0.0, surroundings_weight=0.0,
        acceptance_foreground=0.0,
    )  # fmt: skip
    model = ColourParticles(heads, 0, p, colours, ForegroundParams(), reader)
    sizes = appearance(heads, reader, 0.0).sizes
    middle = np.sqrt(sizes.smallest * sizes.largest)
    before = np.tile([48.0, 36.0, *middle], (5000, 1))
    after = model.move(before, np.random.default_rng(1))
    root = np.sqrt(heads.step_time)
    assert len(after) == 5000
    assert_allclose((after - before)[:, :2].std(axis=0), 0.8 * root * middle, rtol=0.04)
    assert_allclose((after - before)[:, :2].mean(axis=0), 0.0, atol=0.05)
    growth = np.log(after[:, 2:] / before[:, 2:])
    assert np.median(np.abs(growth)) == pytest.approx(0.6745 * 0.1 * root, rel=0.1)
    assert_array_equal(before, np.tile([48.0, 36.0, *middle], (5000, 1)))
