"""Opening and computing in the background: newest wins, the last always runs, failures are told."""

from __future__ import annotations

import concurrent.futures
import threading
import time
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.state.crashes import Crashes, Note
from app.state.jobs import Jobs
from app.state.snapshot import Change, Event, Notice, Snapshot
from app.state.workbench import Workbench
from tests.app.conftest import wait_until
from tests.app.folders import write_crossing
from tests.synthetic import write_sequence
from tracker.files.validated import write_json
from tracker.parameters.values import value_of
from tracker.runs import pipeline
from tracker.runs.pipeline import Cancelled, Run
from tracker.sequences.errors import SequenceError
from tracker.sequences.sequence import Sequence

P_D = "fusion.detection_probability"


class Desk:
    """A workbench with its jobs."""

    def __init__(self, data: Path, **others: Any) -> None:
        self.bench = Workbench()
        self.jobs = Jobs(self.bench, data=data, **others)
        self.notices: list[Notice] = []
        self.bench.subscribe_events(self._hear)
        self.runs: list[str] = []
        """The keys of those that began."""
        self.bench.subscribe(self._count)

    def _count(self, change: Change) -> None:
        key = self.now.run_state.key
        if change == "run" and key not in self.runs[-1:]:
            self.runs.append(key)

    def _hear(self, event: Event) -> None:
        if isinstance(event, Notice):
            self.notices.append(event)

    @property
    def now(self) -> Snapshot:
        return self.bench.snapshot()

    def open(self, name: str = "crossing") -> None:
        self.jobs.open(name).result(30.0)
        self.wait("done")

    def wait(self, phase: str) -> None:
        wait_until(lambda: self.now.run_state.state == phase)


@pytest.fixture
def desk(data: Path) -> Iterator[Desk]:
    desk = Desk(data)
    yield desk
    desk.jobs.close()


@pytest.fixture
def slow(monkeypatch: pytest.MonkeyPatch) -> dict[str, int]:
    """Runs take a while, step by step; counts how many there were, at once, and stopped midway."""
    counts = {"runs": 0, "now": 0, "most": 0, "stopped": 0}
    real = pipeline.compute
    lock = threading.Lock()

    def compute(*args: Any, **kwargs: Any) -> Run:
        cancelled = kwargs.pop("cancelled", lambda: False)

        def slowly() -> bool:
            time.sleep(0.002)
            return bool(cancelled())

        with lock:
            counts["runs"] += 1
            counts["now"] += 1
            counts["most"] = max(counts["most"], counts["now"])
        try:
            return real(*args, cancelled=slowly, **kwargs)
        except Cancelled:
            counts["stopped"] += 1
            raise
        finally:
            with lock:
                counts["now"] -= 1

    monkeypatch.setattr(pipeline, "compute", compute)
    return counts


def engine(desk: Desk) -> Run:
    """The same run, straight from the engine."""
    assert desk.now.sequence is not None
    return pipeline.compute(desk.now.sequence, desk.now.parameters, seed=0)


def assert_same_tracks(run: Run | None, other: Run) -> None:
    assert run is not None
    assert run.key == other.key
    for name in ("frames", "ids", "positions", "existences", "sigmas", "seen"):
        np.testing.assert_array_equal(getattr(run.tracks, name), getattr(other.tracks, name))


def test_opening_shows_a_sequence_and_runs_it(desk: Desk) -> None:
    desk.open()
    assert desk.now.sequence is not None
    assert desk.now.sequence.name == "crossing"
    assert desk.now.opening is None
    assert desk.now.run_state.done == 120
    assert len(set(engine(desk).tracks.ids.tolist())) >= 2
    assert_same_tracks(desk.now.run, engine(desk))


def test_a_run_that_finds_nobody_says_at_which_gate_they_fell(desk: Desk, tmp_path: Path) -> None:
    folder = write_sequence(tmp_path / "noise", frames=6)
    desk.jobs.open(str(folder)).result(30.0)
    desk.wait("done")
    strict = {"colour_phd.acceptance_distance": 0.05, "colour_phd.shapes": "never"}
    desk.bench.set_parameters(strict, "test")
    wait_until(lambda: desk.now.run_state.state == "done" and desk.now.run is not None
               and desk.now.run.parameters == desk.now.parameters)  # fmt: skip
    assert desk.now.run is not None
    assert not len(desk.now.run.tracks.ids)
    for camera in ("cam1", "cam2"):
        about = f'camera "{camera}": '
        (told,) = [one for one in desk.now.run_state.warnings if one.startswith(about)]
        assert "candidates a picture, dropped" in told
        assert "0.0 passed on" in told


def test_twenty_changes_end_in_one_run_equal_to_the_engines(
    desk: Desk, slow: dict[str, int]
) -> None:
    desk.open()
    slow.update(runs=0, most=0)
    for number in range(20):
        desk.bench.set_parameters({P_D: 0.70 + 0.01 * number}, "test")
    desk.wait("done")
    assert desk.now.run_state.done == 120
    assert slow["most"] == 1
    assert slow["runs"] < 20, "superseded runs should have been skipped or stopped"
    assert desk.now.parameters.fusion.detection_probability == pytest.approx(0.89)
    assert_same_tracks(desk.now.run, engine(desk))
    runs = slow["runs"]
    time.sleep(0.05)
    assert slow["runs"] == runs, "nothing may run after the last"


@pytest.mark.full
def test_changes_from_many_threads_still_end_in_the_stores_parameters(
    desk: Desk, slow: dict[str, int]
) -> None:
    desk.open()

    def work(offset: int) -> None:
        for number in range(8):
            desk.bench.set_parameters({P_D: 0.5 + 0.01 * (4 * number + offset)}, "test")

    threads = [threading.Thread(target=work, args=(n,)) for n in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert desk.now.sequence is not None
    wanted = pipeline.stage_keys(desk.now.sequence, desk.now.parameters, 0)["tracks"]
    wait_until(lambda: desk.now.run_state.state == "done" and desk.now.run_state.key == wanted)
    assert slow["most"] == 1
    assert_same_tracks(desk.now.run, engine(desk))


def test_who_waits_for_a_run_gets_that_of_the_values_as_they_are(
    desk: Desk, slow: dict[str, int]
) -> None:
    desk.open()
    desk.bench.set_parameters({P_D: 0.7}, "test")
    assert desk.jobs.settled(0.0).run_state.state == "computing", "there is no patience"
    now = desk.jobs.settled(60.0)
    assert now.run_state.state == "done"
    assert now.run is not None
    assert now.run.parameters == now.parameters
    assert slow["runs"] == 2, "that of the defaults before it"


@pytest.mark.full
def test_a_superseded_run_stops_midway(desk: Desk, slow: dict[str, int]) -> None:
    desk.open()
    desk.bench.set_parameters({P_D: 0.7}, "test")
    wait_until(lambda: slow["now"] == 1)
    runs = slow["runs"]
    said: list[str] = []
    desk.bench.subscribe(lambda change: said.append(desk.now.run_state.message))
    desk.bench.set_parameters({P_D: 0.8}, "test")
    assert "ending the run before" in said
    wait_until(lambda: slow["runs"] == runs + 1)
    assert slow["stopped"] == 1
    desk.wait("done")


def test_a_change_back_and_forth_needs_no_run_of_stages_that_are_there(desk: Desk) -> None:
    desk.open()
    assert desk.now.run is not None
    before = desk.now.run
    desk.bench.set_parameters({"fusion.extraction_threshold": 0.7}, "test")
    desk.wait("done")
    assert desk.now.run is not None
    assert desk.now.run is not before
    assert all(a is b for a, b in zip(desk.now.run.fused, before.fused, strict=True))
    desk.bench.set_parameters({P_D: 0.7}, "test")
    desk.wait("done")
    assert all(a is b for a, b in zip(desk.now.run.views, before.views, strict=True))


def test_a_parameter_that_nothing_depends_on_starts_nothing(
    desk: Desk, slow: dict[str, int]
) -> None:
    desk.open()
    assert desk.now.parameters.single_view == "none"
    runs, run = slow["runs"], desk.now.run
    desk.bench.set_parameters({"colour_phd.samples": 300}, "test")
    time.sleep(0.05)
    assert slow["runs"] == runs
    assert desk.now.run is run
    assert desk.now.run_state.state == "done"


@pytest.mark.full
def test_cancel_keeps_the_steps_and_goes_on_when_asked(desk: Desk, slow: dict[str, int]) -> None:
    desk.open()
    desk.bench.set_parameters({P_D: 0.7}, "test")
    wait_until(lambda: 0 < desk.now.run_state.done < 120)
    desk.jobs.cancel()
    desk.wait("cancelled")
    run = desk.now.run
    assert run is not None
    assert 0 < run.done < 120
    assert not run.complete
    desk.jobs.run_again()
    desk.wait("done")
    assert_same_tracks(desk.now.run, engine(desk))


def test_cancelling_nothing_does_nothing(desk: Desk) -> None:
    desk.jobs.cancel()
    desk.jobs.run_again()
    desk.open()
    desk.jobs.cancel()
    assert desk.now.run_state.state == "done"


def test_a_failed_run_is_told_in_a_sentence_and_the_last_good_one_stays(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    desk.open()
    good = desk.now.run
    real = pipeline.compute

    def fail(*_: Any, **__: Any) -> Run:
        raise ValueError("the numbers do not add up")

    monkeypatch.setattr(pipeline, "compute", fail)
    desk.bench.set_parameters({P_D: 0.7}, "test")
    desk.wait("failed")
    assert desk.now.run is good
    assert desk.now.run_state.error == "the numbers do not add up"
    assert desk.notices == []  # the state tells it, until a run that does not fail
    monkeypatch.setattr(pipeline, "compute", real)
    desk.bench.set_parameters({P_D: 0.75}, "test")
    desk.wait("done")


def test_a_failure_before_any_run_was_finished_leaves_what_was_computed_shown(
    desk: Desk,
) -> None:
    desk.open()
    unfinished = desk.now.run
    assert unfinished is not None
    desk.bench._last_good = None  # as if the failure had come while the first run computed
    desk.bench.run_begins("another")
    desk.bench.run_ends("another", "failed", "the numbers do not add up")
    assert desk.now.run is unfinished
    assert desk.now.run_state.state == "failed"


def test_what_cannot_be_opened_leaves_what_was_open(desk: Desk, tmp_path: Path) -> None:
    desk.open()
    before = desk.now
    broken = write_crossing(tmp_path / "broken", 10)
    (broken / "left.csv").write_text("frame,left,top,width,height,score\n0,1,2,x,4,1\n")
    with pytest.raises(SequenceError, match=r"left\.csv"):
        desk.jobs.open(str(broken)).result(10.0)
    assert desk.now.sequence is before.sequence
    assert desk.now.run is before.run
    assert desk.now.opening is None
    assert "left.csv" in desk.notices[-1].message
    assert "line 2" in desk.notices[-1].message


def test_who_is_about_to_be_shown_is_shown_before_a_newer_opening(
    desk: Desk, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    one, other = (str(write_crossing(tmp_path / name, 30, name=name)) for name in "ab")
    show, newer = desk.bench.open, []

    def late(sequence: Sequence, *arguments: Any) -> Any:
        if sequence.name == "a":
            newer.append(desk.jobs.open(other))
            concurrent.futures.wait(newer, 1.0)  # as long as the newer one would need
        return show(sequence, *arguments)

    monkeypatch.setattr(desk.bench, "open", late)
    desk.jobs.open(one).result(30.0)
    newer[0].result(30.0)
    assert desk.now.sequence is not None
    assert desk.now.sequence.name == "b"


def test_of_two_openings_the_newer_wins(desk: Desk, tmp_path: Path) -> None:
    slower = desk.jobs.open(str(write_crossing(tmp_path / "a", 40, name="a")))
    newer = desk.jobs.open(str(write_crossing(tmp_path / "b", 30, name="b")))
    newer.result(30.0)
    if slower.exception(30.0) is not None:
        assert isinstance(slower.exception(), Cancelled)
    desk.wait("done")
    assert desk.now.sequence is not None
    assert desk.now.sequence.name == "b"
    assert desk.now.run is not None
    assert desk.now.run.sequence is desk.now.sequence


def test_another_sequence_starts_from_its_own_defaults(desk: Desk, tmp_path: Path) -> None:
    desk.open()
    desk.bench.set_parameters({P_D: 0.7}, "test")
    desk.bench.seek(100)
    desk.bench.select(1)
    desk.open(str(write_crossing(tmp_path / "short", 30)))
    now = desk.now
    assert (now.playhead, now.selection) == (0, None)
    assert now.parameters == now.defaults
    assert now.run_state.total == 30


def value_at_the_start(desk: Desk) -> Any:
    return value_of(desk.now.parameters, P_D)


def test_a_recording_begins_with_the_parameters_it_was_left_with(data: Path) -> None:
    desk = Desk(data, left_with=lambda folder: {P_D: 0.7} if folder.name == "crossing" else {})
    desk.open()
    assert value_at_the_start(desk) == 0.7
    assert desk.runs == [engine(desk).key]
    desk.jobs.open("crossing", {}).result(30.0)
    assert desk.now.parameters == desk.now.defaults  # who says which gets those
    desk.jobs.close()


def test_parameters_that_no_longer_fit_are_left(data: Path) -> None:
    desk = Desk(data, left_with=lambda folder: {P_D: 7.0})
    desk.open()
    assert desk.now.parameters == desk.now.defaults
    desk.jobs.close()


@pytest.mark.parametrize(("good", "begins"), [({P_D: 0.8}, 0.8), (None, 0.95)])
def test_what_crashed_comes_back_with_no_start(
    data: Path, tmp_path: Path, good: dict[str, Any] | None, begins: float
) -> None:
    first = Desk(data, left_with=lambda folder: {P_D: 0.7})
    first.open()
    key = first.now.run_state.key
    first.jobs.close()
    note = Note("crossing", run=key, values={P_D: 0.7}, good=good)
    write_json(tmp_path / "start-999999999.json", asdict(note))
    (tmp_path / "start-999999999.txt").write_text("Fatal Python error")
    assert len(Crashes(tmp_path).tidy()) == 1
    for _ in range(2):  # at all later ones too, which know of no crash
        crashes = Crashes(tmp_path)
        assert crashes.tidy() == []
        desk = Desk(data, left_with=lambda folder: {P_D: 0.7}, crashes=crashes)
        desk.open()
        assert value_at_the_start(desk) == begins
        assert desk.runs == [engine(desk).key]
        assert "under which the program crashed" in desk.notices[0].message
        desk.bench.set_parameters({P_D: 0.7}, "api")
        desk.wait("failed")
        assert "left out until it is asked for again" in str(desk.now.run_state.error)
        desk.jobs.close()
    desk = Desk(data, left_with=lambda folder: {P_D: 0.7}, crashes=Crashes(tmp_path))
    desk.open()
    desk.bench.set_parameters({P_D: 0.7}, "api")
    desk.wait("failed")
    desk.jobs.run_again()
    desk.wait("done")
    assert desk.now.run_state.key == key
    desk.jobs.close()
    assert Crashes(tmp_path).left_out == {}


def test_closing_stops_a_run_midway(data: Path, slow: dict[str, int]) -> None:
    desk = Desk(data)
    desk.jobs.open("crossing").result(30.0)
    wait_until(lambda: slow["now"] == 1)
    desk.jobs.close()
    wait_until(lambda: slow["now"] == 0)
    assert slow["stopped"] == 1
