"""Where a recording is opened."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from app.state import opening_step
from app.state.workbench import Workbench
from tests.app.scene import scene_case
from tests.app.state.test_workbench import progress
from tracker.runs.pipeline import Run


def test_with_most_people_shortly_before_a_switch() -> None:
    counts = np.array([0] * 10 + [2] * 30 + [3] * 60)
    assert opening_step.opening_step(counts, [95], fps=10.0) == 55  # four seconds before
    assert opening_step.opening_step(counts, [12, 60], fps=10.0) == 40  # the full ones alone
    assert opening_step.opening_step(counts, [45], fps=10.0) == 40  # too near: most people
    assert opening_step.opening_step(counts, [], fps=10.0) == 40
    assert opening_step.opening_step(np.zeros(5, dtype=np.int64), [3], fps=10.0) == 0
    assert opening_step.opening_step(np.zeros(0, dtype=np.int64), [], fps=10.0) == 0


def test_the_playhead_goes_there_once_unless_somebody_has_moved_it() -> None:
    of = scene_case.sequence()
    without_truth = replace(of, ground_truth=None)
    shown = scene_case.run(without_truth)
    shown.tracks = shown.tracks.take(shown.tracks.frames >= 17)
    for moved in (False, True):
        workbench = Workbench()
        end = opening_step.follow(workbench)
        scene_case.show(workbench, without_truth)
        if moved:
            workbench.seek(0)  # also who stays at the first step has chosen it
        _finish(workbench, shown)
        assert workbench.snapshot().playhead == (0 if moved else 17)
        workbench.seek(3)
        _finish(workbench, shown)
        assert workbench.snapshot().playhead == 3
        end()


def test_where_there_is_a_truth_it_waits_for_the_scores() -> None:
    of = scene_case.sequence()
    shown = scene_case.run(of)
    workbench = scene_case.opened(of, shown)
    assert not opening_step.is_settled(workbench.snapshot())


def _finish(workbench: Workbench, shown: Run) -> None:
    workbench.run_begins(shown.key)
    workbench.run_progresses(shown, progress(shown.done))
    workbench.run_ends(shown.key, "done")
