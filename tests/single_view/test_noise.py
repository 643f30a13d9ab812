"""The measurement noise that each method states: of four numbers, by the formula of its own."""

from __future__ import annotations

import numpy as np
from numpy import ndarray
from numpy.testing import assert_allclose

from tests import world
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.groups.colour_phd import ColourPhdParams
from tracker.parameters.groups.detections import DetectionBoxParams
from tracker.parameters.groups.foreground import ForegroundParams
from tracker.parameters.groups.jpda import JpdaParams
from tracker.parameters.groups.pseudo_particle import PseudoParticleParams
from tracker.parameters.groups.shapes import ShapesParams
from tracker.parameters.values import with_values
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence
from tracker.single_view.colour.peaks import PeakFinder
from tracker.single_view.detector_boxes import detector_sigmas
from tracker.single_view.jpda.measurements import source_of
from tracker.single_view.pseudo_particle.particles import ColourParticles
from tracker.single_view.shape.finder import log_ratios, shape_sigmas

BOXES = np.array([[40.0, 30.0, 4.0, 10.0], [9.0, 8.0, 100.0, 240.0], [5.0, 5.0, 0.0, 0.1]])
"""One of them is large, and one is smaller than a pixel."""
HALF = np.array([[4.0, 10.0], [100.0, 240.0], [0.5, 0.5]])
"""Their half sizes, half a pixel at least."""

UNSEEN = {"foreground_weight": 0.0, "surroundings_weight": 0.0, "acceptance_foreground": 0.0}
"""Of colours alone: no background has to be learnt."""


def shares(centre: float, size: float, half: ndarray = HALF) -> ndarray:
    return np.column_stack([centre * half, size * half])


def test_a_detectors_noise_is_a_share_of_the_size_and_pixels_in_quadrature() -> None:
    p = DetectionBoxParams(centre_sigma=0.1, size_sigma=0.2, width_sigma=0.5, pixel_sigma=1.5)
    # along and across a box's centre is off by a share of its height
    expected = np.array([[1.0, 1.0, 2.0, 2.0], [24.0, 24.0, 50.0, 48.0], [0.01, 0.01, 0.0, 0.02]])
    assert_allclose(detector_sigmas(BOXES, p), np.sqrt(expected**2 + 1.5**2))
    assert_allclose(detector_sigmas(BOXES, p.model_copy(update={"pixel_sigma": 0.0})), expected)


def test_a_peaks_noise_is_a_share_of_its_width_and_height_and_no_more_of_a_large_one(
    heads: Sequence, reader: FrameReader
) -> None:
    p = ColourPhdParams(
        centre_sigma=0.4, size_sigma=0.3, sigma_height=60.0, shapes="never",
        carry_templates=False, foreground_samples=0.0, **UNSEEN,
    )  # fmt: skip
    finder = PeakFinder(heads, 0, p, ForegroundParams(), reader)
    # 240 pixels high counts as 60, and 100 wide as 25
    assert_allclose(
        finder.sigmas(BOXES), shares(0.4, 0.3, np.array([[4.0, 10.0], [25.0, 60.0], [0.5, 0.5]]))
    )


def test_the_noise_of_particles_is_a_share_of_width_and_height(
    heads: Sequence, reader: FrameReader
) -> None:
    p = PseudoParticleParams(birth="picture")
    colours = ColourPhdParams(centre_sigma=0.4, size_sigma=0.3, **UNSEEN)
    model = ColourParticles(heads, 0, p, colours, ForegroundParams(), reader)
    assert_allclose(model.sigmas(BOXES), shares(0.4, 0.3))


def test_the_noise_of_associated_foreground_adds_pixels_to_its_centre(
    heads: Sequence, reader: FrameReader
) -> None:
    p = JpdaParams(centre_sigma=0.1, size_sigma=0.2, pixel_sigma=3.0, foreground_box="piece")
    source = source_of(heads, 0, RunParameters(jpda=p), reader)
    expected = shares(0.1, 0.2)
    expected[:, :2] = np.hypot(expected[:, :2], 3.0)
    assert_allclose(source.sigmas(BOXES), expected)


def test_a_target_is_occluded_within_so_many_half_sizes_of_a_peak(
    heads: Sequence, reader: FrameReader
) -> None:
    values = {
        "jpda.measurements": "colour", "jpda.cover": 1.75, "foreground.threshold": 30.0,
        "foreground.minimum_area": 4, "colour_phd.shapes": "never",
    }  # fmt: skip
    source = source_of(heads, 0, with_values(RunParameters(), values), reader)
    _, found = source.measure(
        source.start(), 4, reader.picture(0, 4), GaussianMixture.empty(4), np.random.default_rng(0)
    )
    assert len(found.boxes)
    assert_allclose(found.pieces[:, :2], found.boxes[:, :2])
    assert_allclose(found.pieces[:, 2:], 1.75 * found.boxes[:, 2:])


def test_the_noise_of_shapes_is_the_same_in_metres_everywhere() -> None:
    p = ShapesParams(place_sigma=0.06, size_sigma=0.2, pixel_sigma=2.0)
    found = shape_sigmas(BOXES, np.array([0.2, 0.4, 0.6]), p)
    expected = shares(0.06, 0.2)
    expected[:, :2] = np.hypot(expected[:, :2] / [0.3, 0.6], 2.0)
    assert_allclose(found, expected)


def test_odds_speak_for_a_shape_up_to_a_largest_ratio() -> None:
    odds = np.array([-4.0, 2.0, 3.0, 5.0, 9.0])
    assert_allclose(log_ratios(odds, 2.0, 1.5, 4.5), [-9.0, 0.0, 1.5, 4.5, 4.5])


def test_the_stated_noise_is_that_of_the_boxes_it_is_stated_of() -> None:
    """The errors of boxes that are off as the parameters say are standard normal in its units."""
    rng = np.random.default_rng(4)
    p = DetectionBoxParams(centre_sigma=0.06, size_sigma=0.06, width_sigma=0.06, pixel_sigma=2.0)
    cameras = world.ring(3)
    paths = world.together(*(world.wander(rng, 150) for _ in range(3)))
    exact = world.boxes(cameras, paths, sigma=0.0)
    noisy = world.boxes(cameras, paths, sigma=2.0, relative=0.06, rng=rng)
    errors = []
    for one, other in zip(exact, noisy, strict=True):
        truth = {
            (step, person): box
            for step, person, box in zip(one.frames, one.people, one.boxes, strict=True)
        }
        true = np.array([truth[key] for key in zip(other.frames, other.people, strict=True)])
        errors.append((other.boxes - true) / detector_sigmas(true, p))
    # a width is a share of itself, which the noise of the boxes here is not
    standard = np.concatenate(errors)[:, [0, 1, 3]]
    assert len(standard) > 1000
    assert_allclose(standard.std(axis=0), 1.0, atol=0.05)
    assert_allclose(standard.mean(axis=0), 0.0, atol=0.08)


def test_what_a_method_states_is_what_its_boxes_have(heads: Sequence, reader: FrameReader) -> None:
    """Of association matrices, whose noise shows in the result alone."""
    values = {
        "association_matrix.centre_sigma": 0.3, "association_matrix.size_sigma": 0.2,
        "association_matrix.output": "objects", "foreground.minimum_area": 4,
    }  # fmt: skip
    from tracker import single_view

    method = single_view.create(
        "association_matrix", heads, 0, with_values(RunParameters(), values), reader
    )
    _, result = method.step(method.start(), 4, reader.picture(0, 4), np.random.default_rng(0))
    assert len(result.boxes) == 2
    assert_allclose(result.sigmas, shares(0.3, 0.2, result.boxes[:, 2:]))
