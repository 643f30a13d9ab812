"""Tracking in one camera by data association: who keeps which id, and what is told of whom."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

from tests.single_view.detected import detected, run
from tracker.parameters.catalogue import PRESETS, RunParameters
from tracker.parameters.values import stage_values, with_values
from tracker.single_view.jpda import method
from tracker.single_view.jpda.targets import Innovations
from tracker.single_view.protocol import ViewResult

HALF = (6.0, 12.0)
PUBLISHED = {
    key.removeprefix("jpda."): value
    for key, value in PRESETS["published"].items()
    if key.startswith("jpda.") and key != "jpda.measurements"
}


def track(steps: list[list[tuple[float, ...]]], **changes: Any) -> list[ViewResult]:
    """The results of all steps; boxes are centre x and y, and half sizes if not the usual."""
    boxes = [[(*box, *HALF)[:4] if len(box) == 2 else box for box in step] for step in steps]
    return run("jpda", detected(boxes, fps=25.0), **{"confirmation_steps": 1, **changes})


def events_of(results: list[ViewResult], kind: str) -> list[tuple[int, tuple[int, ...]]]:
    """Step and labels of all events of a kind."""
    return [(k, e.labels) for k, r in enumerate(results) for e in r.events if e.kind == kind]


def walking(steps: int, x: float = 30.0, speed: float = 1.5) -> list[tuple[float, float]]:
    return [(x + speed * k, 60.0) for k in range(steps)]


def meeting(steps: int = 60, merged: range = range(24, 36)) -> list:
    """Two pass each other; where they overlap a detector sees one box around both."""
    boxes: list = []
    for k in range(steps):
        left, right = (30.0 + 1.6 * k, 58.0), (125.0 - 1.6 * k, 62.0)
        if k in merged:
            low, high = sorted((left[0], right[0]))
            middle = (low + high) / 2.0
            boxes.append([(middle, 60.0, 6.0 + (high - low) / 2.0, 14.0)])
        else:
            boxes.append([left, right])
    return boxes


def test_two_who_pass_each_other_keep_their_labels() -> None:
    results = track(meeting())
    assert events_of(results, "new") == [(0, (1, )), (0, (2,))]  # fmt: skip
    assert not events_of(results, "vanished")
    occluded = [k for k, labels in events_of(results, "occluded") if labels == (1, 2)]
    assert set(occluded) >= set(range(26, 36))
    for k in (20, 50):
        places = dict(zip(results[k].labels.tolist(), results[k].estimates[:, 0], strict=True))
        assert places[1] == pytest.approx(30.0 + 1.6 * k, abs=3.0)
        assert places[2] == pytest.approx(125.0 - 1.6 * k, abs=3.0)
    # while nobody knows who is where, nobody is handed on
    assert len(results[26].boxes) == 0
    assert len(results[26].estimates) == 2


def test_as_published_the_occluded_stand_still_in_the_middle_of_what_is_seen() -> None:
    steps = meeting(merged=range(28, 33))
    results = track(steps, **PUBLISHED)
    assert {k for k, labels in events_of(results, "occluded") if labels == (1, 2)} >= {
        29,
        30,
        31,
        32,
    }
    middle = results[30]
    assert len(middle.boxes) == 2
    np.testing.assert_allclose(middle.boxes[0, :2], middle.boxes[1, :2])
    np.testing.assert_allclose(middle.boxes[0, :2], [77.5, 60.0], atol=0.5)
    # after it both are followed apart, who is who is anybody's guess
    assert sorted(results[-1].labels.tolist()) == [1, 2]
    assert np.ptp(results[-1].boxes[:, 0]) == pytest.approx(1.6 * 2 * 59 - 95.0, abs=4.0)


def test_two_pieces_of_one_person_are_one() -> None:
    steps: list = [[place] for place in walking(20)]
    for k in range(10, 20):
        x, y = steps[k][0]
        steps[k] = [(x, y - 4.0, 6.0, 7.0), (x, y + 5.0, 6.0, 6.0)]
    results = track(steps)
    assert events_of(results, "split")
    assert {label for result in results for label in result.estimate_labels.tolist()} == {1}
    assert results[-1].estimates[0, 3] == pytest.approx(HALF[1], abs=1.0), "the size stands"


def test_without_the_five_cases_there_is_neither_occlusion_nor_return() -> None:
    steps = meeting()
    steps[50:55] = [[]] * 5
    results = track(steps, five_cases=False)
    kinds = {event.kind for result in results for event in result.events}
    assert kinds == {"new", "vanished"}


def test_measurements_can_go_on_instead_of_estimates() -> None:
    steps: list = [[place, (140.0, 20.0 + 7.0 * (k % 9))] for k, place in enumerate(walking(30))]
    changes = {"output": "measurements", "confirmation_steps": 3}
    result = track(steps, **changes)[-1]
    kept = result.boxes[result.labels == 1]
    np.testing.assert_allclose(kept, [(*walking(30)[-1], *HALF)])
    assert len(result.measurements) == 2


def test_the_gate_is_the_quantile_of_its_probability(monkeypatch: pytest.MonkeyPatch) -> None:
    squared, inside = [np.zeros(0)], [np.zeros(0, dtype=bool)]
    original = method.associate

    def associate(found: Innovations, possible: Any, *rest: Any) -> Any:
        squared.append(found.squared.ravel())
        inside.append(possible.ravel())
        return original(found, possible, *rest)

    monkeypatch.setattr(method, "associate", associate)
    steps: list = [[place] for place in walking(15)]
    x, y = steps[-1][0]
    steps[-1] = [(x + 0.5 * k, y) for k in range(60)]
    track(steps, gate_probability=0.9)
    distances, bound = np.concatenate(squared), chi2.ppf(0.9, 2)
    np.testing.assert_array_equal(np.concatenate(inside), distances <= bound)
    ratios = distances / bound
    assert ((ratios > 0.5) & (ratios < 1.0)).any()
    assert ((ratios > 1.0) & (ratios < 2.0)).any()


def test_only_what_the_source_reads_counts() -> None:
    def groups(source: str) -> set[str]:
        chosen = {"single_view": "jpda", "jpda.measurements": source}
        values = stage_values(with_values(RunParameters(), chosen), "single_view")
        return {key.split(".")[0] for key in values}

    assert groups("foreground") == {"single_view", "jpda", "pictures", "foreground"}
    assert groups("colour") == {"single_view", "jpda", "pictures", "foreground", "colour_phd"}
    assert groups("detections") == {"single_view", "jpda", "detection_boxes"}
    chosen = {"single_view": "jpda", "jpda.measurements": "colour"}
    read = stage_values(with_values(RunParameters(), chosen), "single_view")
    assert "colour_phd.bandwidth" in read
    assert "colour_phd.survival_probability" not in read
