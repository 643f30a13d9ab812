"""What the comparisons see, and what they let pass."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.engine.synthetic import crossing, sequence
from tests.golden import files
from tests.golden.__main__ import difference
from tests.golden.combinations import Combination, alternatives, combinations, runs
from tests.golden.exact import digest, of_run
from tests.golden.fingerprint import Fingerprint, fingerprints
from tests.golden.pieces import cut
from tracker.parameters.catalogue import METHODS, PARAMETERS
from tracker.runs.pipeline import Run

STEPS = 12

CHOSEN = Combination("robust", "none", "multi_bernoulli")


@pytest.fixture(scope="module")
def run() -> Run:
    whole = sequence(crossing(40), 40)
    return next(found for _, found in runs(cut(whole, 10, 20), STEPS, [CHOSEN]))


def fingerprint(run: Run, *, short: bool = False) -> Fingerprint:
    """Of all stages."""
    told = fingerprints([(CHOSEN, run)], short=short)
    return {**told[CHOSEN.view_name], **told[CHOSEN.name]}


def moved(run: Run, share: float) -> Run:
    """One coordinate of the tracks of the middle step a little larger."""
    positions = run.tracks.positions.copy()
    positions[run.tracks.at(STEPS // 2), 0] *= 1.0 + share
    changed = Run(run.sequence, run.parameters, run.seed, run.keys)
    changed.views, changed.fused = run.views, run.fused
    changed.tracks, changed.done = replace(run.tracks, positions=positions), run.done
    return changed


def told(before: Fingerprint, after: Fingerprint) -> list[str]:
    return files.differences("here", {"run": before}, {"run": after})


def test_a_small_change_is_told_with_its_place(run: Run) -> None:
    lines = told(fingerprint(run), fingerprint(moved(run, 1e-3)))
    assert any(line.startswith(f"here / run / tracks / step {STEPS // 2} / x:") for line in lines)
    assert any(line.startswith("here / run / tracks / all / x: expected ") for line in lines)
    assert not any(" / fusion / " in line or " / single_view " in line for line in lines)
    assert told(fingerprint(run, short=True), fingerprint(moved(run, 1e-3), short=True))


def test_the_last_bits_pass_the_sums_and_not_the_digests(run: Run) -> None:
    nudged = moved(run, 1e-13)
    assert told(fingerprint(run), fingerprint(nudged)) == []
    before, after = of_run(run), of_run(nudged)
    assert before == of_run(run)
    assert "tracks / positions" in {key for key in before if before[key] != after[key]}


def test_what_is_missing_or_new_is_told(run: Run) -> None:
    found = fingerprint(run)
    without = {stage: rows for stage, rows in found.items() if stage != "fusion"}
    assert all(" / fusion / " in line for line in told(found, without))
    assert len(told(without, found)) == len(found["fusion"])
    assert files.differences("here", {"run": found}, {}) == ["here / run: not found"]
    assert files.differences("here", {}, {"run": found}) == ["here / run: not expected"]


def test_a_file_keeps_what_was_found(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(files, "FOLDER", tmp_path)
    found = {"run": fingerprint(run)}
    assert files.read("here") == {}
    files.write("here", found)
    assert files.read("here") == found


@pytest.mark.parametrize(
    ("old", "new", "agree"),
    [
        (1.0, 1.0 + 1e-7, True),
        (1.0, 1.0 + 1e-5, False),
        (0.0, 1e-12, True),
        (0.0, 1e-6, False),
        (None, None, True),
        (None, 0.0, False),
        (12, 13, False),
    ],
)
def test_the_tolerance(old: float | None, new: float | None, agree: bool) -> None:
    assert files.same(old, new) is agree


def test_digests_see_kind_shape_and_every_bit() -> None:
    values = np.arange(6.0)
    others = [values.astype(np.float32), values.reshape(2, 3), np.nextafter(values, 9.0), -values]
    assert len({digest(one) for one in [values, *others]}) == 5
    assert digest(values[::-1][::-1]) == digest(values)
    assert digest((1, 2.0)) != digest((1, 2))
    assert digest(np.array([0.0])) != digest(np.array([-0.0]))


def test_the_first_step_that_differs_is_named() -> None:
    assert difference(["a", "b", "c"], ["a", "x", "y"]) == "from step 1 on, 2 of 3 steps"
    assert difference("a", "a") is None
    assert difference("a", "b") == "differs"
    assert difference(None, "b") == "only after"
    assert difference("a", None) == "only before"
    assert difference(["a"], ["a", "b"]) == "1 steps before, 2 after"


def test_every_method_for_boxes_and_every_choice_of_the_fusion_is_run() -> None:
    boxes = sequence(crossing(10), 10)
    chosen = combinations(boxes)
    assert {one.fusion_method for one in chosen} == set(METHODS["fusion_method"])
    assert {one.single_view for one in chosen} == {"none", "detection_phd", "jpda"}
    assert len({one.name for one in chosen}) == len(chosen)
    changed = {key for one in alternatives(boxes) for key, _ in one.changes}
    choices = {key for key, one in PARAMETERS.items() if one.kind in ("choice", "bool")}
    assert {key for key in choices if key.startswith("fusion.")} <= changed


def test_a_piece_counts_from_zero() -> None:
    whole = sequence(crossing(40), 40)
    piece = cut(whole, 10, 20)
    assert piece.frames == 20
    assert piece.digest != whole.digest
    for view, other in zip(piece.views, whole.views, strict=True):
        assert view.detections is not None
        assert other.detections is not None
        assert view.first_frame == other.first_frame + 10
        own, its = view.detections.at(3), other.detections.at(13)
        assert np.array_equal(view.detections.boxes[own], other.detections.boxes[its])
    assert piece.ground_truth is not None
    assert piece.ground_truth.frames.max() < 20
