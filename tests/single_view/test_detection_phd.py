"""The GM-PHD filters over boxes: one step by Bayes' rule, who begins, and what goes on."""

from __future__ import annotations

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal

from tests import world
from tests.single_view.scenery import ANYWHERE, CAMERA, detected, normal
from tracker import single_view
from tracker.filters.gaussian_mixture import GaussianMixture, gate_distance
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.groups.detections import DetectionPhdParams
from tracker.parameters.values import with_values
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence
from tracker.single_view.box_phd import BoxPhdState
from tracker.single_view.box_sizes import entrance_boxes
from tracker.single_view.colour_phd import ColourPhd, ColourPhdState
from tracker.single_view.detection_phd import DetectionPhd
from tracker.single_view.detector_boxes import detector_sigmas

NUMBERS: dict[str, object] = {
    "survival_probability": 0.95, "pruning_threshold": 1e-8, "clutter_rate": 3.0,
    "score_clutter": 2.0, "detection_probability": 0.8, "birth_rate": 0.7, "motion_sigma": 0.9,
    "growth_sigma": 0.3, "merging_threshold": 1e-6, "extraction_threshold": 0.4,
}  # fmt: skip
FPS = 10.0


@pytest.fixture(autouse=True)
def numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Constants that keep every component and show in the result."""
    for name, value in NUMBERS.items():
        monkeypatch.setattr(DetectionPhdParams, name, value)


def parameters(**changes: object) -> RunParameters:
    values = {f"detection_phd.{key}": value for key, value in changes.items()}
    return with_values(RunParameters(), ANYWHERE | values)


def people(boxes: ndarray, weights: list[float], first_label: int = 1) -> GaussianMixture:
    covariances = np.tile(np.diag([9.0, 16.0, 4.0, 9.0]), (len(boxes), 1, 1))
    labels = first_label + np.arange(len(boxes))
    return GaussianMixture(np.array(weights), boxes, covariances, labels)


KNOWN = np.array([[300.0, 300.0, 20.0, 50.0], [312.0, 306.0, 22.0, 52.0]])
SEEN = np.array([[303.0, 302.0, 21.0, 51.0], [318.0, 310.0, 20.0, 50.0], [900.0, 90.0, 15.0, 40.0]])
SCORES = [0.9, 0.3, 0.6]


def walked(boxes: ndarray, time: float = 1.0 / FPS) -> ndarray:
    """Variances of one step: in half heights along and across, and of the half sizes in shares."""
    height, width = boxes[:, 3], boxes[:, 2]
    sigmas = np.column_stack([0.9 * height, 0.9 * height, 0.3 * width, 0.3 * height])
    return sigmas**2 * time


def test_a_step_is_bayes_rule_with_a_clutter_that_falls_with_the_score() -> None:
    p = parameters()
    method = DetectionPhd(detected([SEEN], SCORES, fps=FPS), 0, p)
    state = BoxPhdState(people(KNOWN, [0.9, 0.6]), np.zeros((0, 4)), next_label=3)
    after, result = method.step(state, 0, None, np.random.default_rng(0))
    width, height = CAMERA.image_size
    clutter = 3.0 * np.exp(2.0 * 2.0 * (0.5 - np.array(SCORES))) / (width * height) ** 2 * 4.0
    spread = np.diag([9.0, 16.0, 4.0, 9.0]) + walked(KNOWN)[:, :, None] * np.eye(4)
    noise = detector_sigmas(SEEN, p.detection_boxes)[:, :, None] ** 2 * np.eye(4)
    pairs = np.zeros((2, 3))
    for j, z in np.ndindex(2, 3):
        offset, covariance = SEEN[z] - KNOWN[j], spread[j] + noise[z]
        if offset @ np.linalg.solve(covariance, offset) <= gate_distance(0.9999, 4):
            pairs[j, z] = 0.8 * 0.95 * [0.9, 0.6][j] * normal(offset, covariance)
    weights = pairs / (clutter + pairs.sum(axis=0))
    behind = weights.sum(axis=0)
    believed = behind > 0.5
    assert believed.any()
    assert not believed.all()
    assert_allclose(result.boxes, SEEN[believed])
    assert_allclose(result.weights, behind[believed])
    assert_allclose(result.sigmas, np.sqrt(np.diagonal(noise[believed], axis1=1, axis2=2)))
    assert_array_equal(result.labels, 1 + weights[:, believed].argmax(axis=0))
    assert_array_equal(after.unexplained, SEEN[behind < 0.5])
    missed = 0.95 * (1.0 - 0.8) * 1.5
    assert after.mixture.cardinality == pytest.approx(missed + weights.sum(), abs=1e-6)
    assert result.information == {
        "candidates": 3.0, "cardinality": after.mixture.cardinality,
    }  # fmt: skip
    assert_array_equal(result.measurements, SEEN)
    assert_array_equal(result.measurement_scores, SCORES)
    # a component of one measurement is a Kalman update of its own
    mean = KNOWN[0] + spread[0] @ np.linalg.solve(spread[0] + noise[0], SEEN[0] - KNOWN[0])
    assert np.abs(after.mixture.means - mean).max(axis=1).min() < 1e-9
    assert_array_equal(result.estimates, after.mixture.means[after.mixture.weights > 0.4])


def test_a_newcomer_begins_where_a_box_was_left_unexplained_as_unsure_as_box_and_step(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    p = parameters()
    for rate, weight in ((0.7, 0.07), (50.0, 1.0)):  # at most one person a box
        monkeypatch.setattr(DetectionPhdParams, "birth_rate", rate)
        method = DetectionPhd(detected([[], []], fps=FPS), 0, p)
        state = BoxPhdState(GaussianMixture.empty(4), SEEN, next_label=5)
        after, _ = method.step(state, 0, None, np.random.default_rng(0))
        assert_allclose(after.mixture.weights, 0.2 * weight)
        assert_array_equal(np.sort(after.mixture.labels), [5, 6, 7])
        assert after.next_label == 8
        assert after.unexplained.shape == (0, 4)
        order = np.argsort(after.mixture.labels)
        assert_allclose(after.mixture.means[order], SEEN)
        born = detector_sigmas(SEEN, p.detection_boxes) ** 2 + walked(SEEN)
        assert_allclose(after.mixture.covariances[order], born[:, :, None] * np.eye(4))
        later, _ = method.step(after, 1, None, np.random.default_rng(0))
        assert_allclose(later.mixture.weights, 0.95 * 0.2**2 * weight)
        order = np.argsort(later.mixture.labels)
        assert_allclose(
            later.mixture.covariances[order], (born + walked(SEEN))[:, :, None] * np.eye(4)
        )


def test_estimates_go_on_where_asked_as_sure_as_the_filter() -> None:
    method = DetectionPhd(detected([SEEN], SCORES, fps=FPS), 0, parameters(output="estimates"))
    state = BoxPhdState(people(KNOWN, [0.9, 0.9]), np.zeros((0, 4)), next_label=3)
    after, result = method.step(state, 0, None, np.random.default_rng(0))
    assert len(result.boxes) > 0
    assert_array_equal(result.boxes, result.estimates)
    assert_array_equal(result.labels, result.estimate_labels)
    for box, sigma in zip(result.boxes, result.sigmas, strict=True):
        row = np.flatnonzero((after.mixture.means == box).all(axis=1))[0]
        assert_allclose(sigma**2, np.diagonal(after.mixture.covariances[row]))


def test_without_detections_the_methods_say_what_to_do() -> None:
    bare = world.sequence((CAMERA,), np.zeros((0, 0, 3)))
    for name in ("none", "detection_phd"):
        with pytest.raises(ValueError, match="has no detections; name a CSV file"):
            single_view.create(name, bare, 0, RunParameters(), None)  # type: ignore[arg-type]


# ── the filter on colours, where it needs no picture


def colour_phd(heads: Sequence, reader: FrameReader, **changes: object) -> ColourPhd:
    numbers = {
        "birth_rate": 0.8, "survival_probability": 0.9, "motion_sigma": 2.0, "growth_sigma": 0.5,
        "centre_sigma": 0.4, "size_sigma": 0.3, "merging_threshold": 1e-6, "shapes": "never",
        "pruning_threshold": 1e-6, "carry_templates": False, "foreground_weight": 0.0,
        "surroundings_weight": 0.0, "acceptance_foreground": 0.0, "foreground_samples": 0.0,
    }  # fmt: skip
    values = {f"colour_phd.{key}": value for key, value in (numbers | changes).items()}
    made = single_view.create("colour_phd", heads, 0, with_values(RunParameters(), values), reader)
    assert isinstance(made, ColourPhd)
    return made


@pytest.mark.parametrize("birth", ["peaks", "entrances", "both"])
def test_without_a_picture_people_walk_and_begin_where_the_parameters_say(
    heads: Sequence, reader: FrameReader, birth: str
) -> None:
    method = colour_phd(heads, reader, birth=birth)
    time = heads.step_time
    known, peaks = np.array([[30.0, 30.0, 3.0, 5.0]]), np.array([[60.0, 40.0, 4.0, 6.0]])
    before = ColourPhdState(BoxPhdState(people(known, [0.7]), peaks, 5), None)
    state, result = method.step(before, 3, None, np.random.default_rng(0))
    after = state.targets
    entrances = entrance_boxes(heads.cameras[0], heads.room, heads.target_half_extents, 0.8 * time)
    assert entrances.size == 2
    count = {"peaks": 1, "entrances": 2, "both": 3}[birth]
    assert after.next_label == 5 + count
    assert after.unexplained.shape == (0, 4)
    assert len(result.boxes) == len(result.samples) == len(result.measurements) == 0
    by_label = {int(label): row for row, label in enumerate(after.mixture.labels)}
    assert sorted(by_label) == [1, *range(5, 5 + count)]
    row = by_label[1]
    assert after.mixture.weights[row] == pytest.approx(0.9 * 0.7)
    moved = np.array([2.0 * 3.0, 2.0 * 5.0, 0.5 * 3.0, 0.5 * 5.0]) ** 2 * time
    assert_allclose(after.mixture.covariances[row], np.diag([9.0, 16.0, 4.0, 9.0]) + np.diag(moved))
    if birth != "entrances":
        row = by_label[5]
        assert after.mixture.weights[row] == pytest.approx(0.8 * time)
        assert_allclose(after.mixture.means[row], peaks[0])
        around = np.diag([1.6, 2.4, 1.2, 1.8]) ** 2
        assert_allclose(after.mixture.covariances[row], around)
    if birth != "peaks":
        for index in range(2):
            row = by_label[5 + count - 2 + index]
            assert after.mixture.weights[row] == pytest.approx(0.8 * time)
            assert_allclose(after.mixture.means[row], entrances.means[index])
            assert_allclose(after.mixture.covariances[row], entrances.covariances[index])
    assert_array_equal(result.estimates, after.mixture.means[after.mixture.weights > 0.5])
