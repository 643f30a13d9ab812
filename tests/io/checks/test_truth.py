"""Truth that stands elsewhere than the boxes is named by check and by evaluate."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.app.conftest import Runs, run
from tests.app.folders import write_crossing
from tests.random_rooms import random_room
from tracker.evaluation import evaluate_sequence
from tracker.io.checks import check
from tracker.io.checks.truth import check_truth
from tracker.sequences.sequence import Sequence

__all__ = ["run"]


def moved(sequence: Sequence, factor: float, by: float) -> Sequence:
    """The sequence with truth in another unit, or with another origin."""
    truth = sequence.ground_truth
    assert truth is not None
    return replace(
        sequence, ground_truth=replace(truth, positions=factor * truth.positions + [by, 0.0, 0.0])
    )


@pytest.mark.parametrize("seed", range(4))
def test_right_truth_raises_no_alarm_and_another_unit_or_origin_does(seed: int) -> None:
    sequence = random_room(seed)
    right = check_truth(sequence)
    assert (right.status, right.numbers["share"] > 0.8) == ("good", True)
    for factor, by in ((100.0, 0.0), (0.01, 0.0), (1.0, 20.0)):
        wrong = check_truth(moved(sequence, factor, by))
        assert wrong.status == "warning", (factor, by, wrong.sentence)
        assert "origin, axes, grid, unit or frame numbers may be others" in wrong.sentence
    found = {one.name: one.status for one in check(moved(sequence, 100.0, 0.0), quick=True)}
    assert found[right.name] == "warning"


def test_without_truth_or_boxes_there_is_nothing_to_compare() -> None:
    sequence = random_room(0)
    assert check_truth(replace(sequence, ground_truth=None)).status == "absent"
    bare = replace(sequence, views=tuple(replace(view, detections=None) for view in sequence.views))
    assert check_truth(bare).status == "absent"


def test_evaluate_says_it(run: Runs, tmp_path: Path) -> None:
    folder = write_crossing(tmp_path / "crossing", 40)
    path = folder / "truth.csv"
    head, *rows = path.read_text().splitlines()
    tracks = tmp_path / "tracks.txt"
    cells = np.array([row.split(",")[:5] for row in rows], dtype=float)
    tracks.write_text(
        "".join(
            f"{frame + 1:.0f},{who:.0f},{x - 0.3},{y - 0.3},0.6,0.6,1,{x},{y},{z}\n"
            for frame, who, x, y, z in cells
        )
    )
    status, _, stderr = run("evaluate", folder, tracks)
    assert (status, "lie in boxes" in stderr) == (0, False), stderr
    path.write_text(
        "\n".join(
            [
                head,
                *(
                    f"{frame:.0f},{who:.0f},{100 * x},{100 * y},{100 * z}"
                    + ",1" * head.count("valid")
                    for frame, who, x, y, z in cells
                ),
            ]
        )
    )
    status, _, stderr = run("evaluate", folder, tracks)
    assert status == 0
    assert stderr.count("0 % of the truth's places lie in boxes of the cameras that see them") == 1


def test_figures_against_truth_that_stands_elsewhere_say_so() -> None:
    right = random_room(0)
    wrong = moved(right, 1.0, 20.0)
    truth = right.ground_truth
    assert truth is not None
    assert not any("boxes" in note for note in evaluate_sequence(right, truth).notes)
    note, *_ = evaluate_sequence(wrong, truth).notes
    assert note == f"{check_truth(wrong).sentence}."
