"""A figure is a run's when it is made of the tracks that the finished run ended with."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.state.evaluator import Evaluator
from app.state.keeper import Keeper
from app.state.opening_step import is_settled
from app.state.scores import Scored
from app.state.workbench import Workbench
from app.web.api import export_tracks
from tests.app.conftest import wait_until
from tests.app.folders import FRAMES
from tracker.evaluation import evaluate_sequence
from tracker.runs import pipeline
from tracker.runs.pipeline import Progress, Run
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.reader import read_sequence

PART = 40


@pytest.fixture
def bench(crossing: Path) -> Iterator[Workbench]:
    workbench = Workbench()
    sequence = read_sequence(crossing)
    with FrameReader(sequence) as reader:
        workbench.open(sequence, "key", reader, pipeline.default_parameters(sequence))
        yield workbench


def begun(bench: Workbench) -> str:
    """Have the workbench wait for the run of its parameters; the run's key."""
    now = bench.snapshot()
    assert now.sequence is not None
    key = pipeline.stage_keys(now.sequence, now.parameters, 0)["tracks"]
    bench.run_begins(key)
    return key


def scored(run: Run, steps: int) -> Scored:
    """The first steps of a run's tracks as they are now, with their figures."""
    tracks = run.tracks.take(np.arange(run.tracks.at(steps).start))
    evaluation = evaluate_sequence(run.sequence, tracks, steps=steps)
    return replace(Scored.of(run), steps=steps, evaluation=evaluation)


def test_a_run_that_was_scored_in_part_is_kept_with_the_figures_of_its_end(
    bench: Workbench, tmp_path: Path
) -> None:
    path = tmp_path / "library.sqlite3"
    keeper, evaluator = Keeper(bench, path), Evaluator(bench)
    now, key = bench.snapshot(), begun(bench)
    assert now.sequence is not None
    shown: list[int] = []

    def report(run: Run, progress: Progress) -> None:
        bench.run_progresses(run, progress)
        if PART < run.done < FRAMES and not shown:
            wait_until(lambda: bench.snapshot().scores.shown is not None)
            part = bench.snapshot().scores.shown
            assert part is not None
            shown.append(part.steps)

    run = pipeline.compute(now.sequence, now.parameters, wanted=lambda: PART, on_progress=report)
    bench.run_ends(key, "done")
    wait_until(lambda: bool(keeper.library().runs()))
    (kept,) = keeper.library().runs()
    result = keeper.library().result(kept.id)
    evaluator.close()
    keeper.close()
    assert 0 < shown[0] < FRAMES
    true = evaluate_sequence(run.sequence, run.tracks)
    assert result.figures == {one.definition.key: one.value for one in true.figures}
    assert kept.mota == true["mota"]
    np.testing.assert_allclose(result.ospa, true.series.ospa, atol=1e-3)
    np.testing.assert_array_equal(result.kept.tracks.positions, run.tracks.positions)


def test_tracks_exported_before_smoothing_say_so(bench: Workbench) -> None:
    now, key = bench.snapshot(), begun(bench)
    assert now.sequence is not None
    files: list[bytes] = []

    def report(run: Run, progress: Progress) -> None:
        bench.run_progresses(run, progress)
        if run.complete and run.tracks is run.filtered:
            files.append(bytes(export_tracks(bench).body))

    pipeline.compute(now.sequence, now.parameters, on_progress=report)
    bench.run_ends(key, "done")
    words = b"# incomplete: these are the filter's tracks, since the smoothing is not finished\n"
    assert files
    assert all(words in file for file in files)
    assert words not in bytes(export_tracks(bench).body)


@pytest.mark.parametrize("steps", [PART, FRAMES])
def test_before_smoothing_nothing_is_settled_pinned_or_finished(
    bench: Workbench, steps: int
) -> None:
    now, key = bench.snapshot(), begun(bench)
    assert now.sequence is not None
    seen: list[tuple[bool, bool, bool]] = []

    def report(run: Run, progress: Progress) -> None:
        bench.run_progresses(run, progress)
        if run.complete and run.tracks is run.filtered:
            bench.scored(scored(run, steps))
            after = bench.snapshot()
            seen.append((is_settled(after), bench.pin(), after.scores.finished is not None))

    run = pipeline.compute(now.sequence, now.parameters, on_progress=report)
    assert run.smoothed is not None
    assert set(seen) == {(False, False, False)}
    bench.run_ends(key, "done")
    assert not is_settled(bench.snapshot())
    bench.scored(scored(run, FRAMES))
    assert is_settled(bench.snapshot())
    assert bench.pin()


def test_a_run_that_was_stopped_while_it_was_smoothed_is_not_settled(bench: Workbench) -> None:
    now, key = bench.snapshot(), begun(bench)
    assert now.sequence is not None
    stopped = False

    def report(run: Run, progress: Progress) -> None:
        nonlocal stopped
        bench.run_progresses(run, progress)
        stopped = stopped or run.complete

    with pytest.raises(pipeline.Cancelled):
        pipeline.compute(
            now.sequence, now.parameters, on_progress=report, cancelled=lambda: stopped
        )
    bench.run_ends(key, "cancelled")
    run = bench.snapshot().run
    assert run is not None
    assert run.complete
    bench.scored(scored(run, FRAMES))
    assert not is_settled(bench.snapshot())


def test_a_finished_run_has_its_figures_while_the_next_one_has_no_step_yet(
    bench: Workbench,
) -> None:
    now, key = bench.snapshot(), begun(bench)
    assert now.sequence is not None
    pipeline.compute(now.sequence, now.parameters, on_progress=bench.run_progresses)
    bench.run_ends(key, "done")
    bench.run_begins("of other parameters", "waits for pictures")
    evaluator = Evaluator(bench)
    wait_until(lambda: bench.snapshot().scores.shown is not None)
    evaluator.close()
    shown = bench.snapshot().scores.shown
    assert shown is not None
    assert (shown.key, shown.steps, shown.final) == (key, FRAMES, True)
