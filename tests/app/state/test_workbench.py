"""The store: what it takes, what it refuses, whom it tells."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest

from app.state.jobs import silence
from app.state.snapshot import LAYERS, Change, Command, Event, Notice, clamp
from app.state.workbench import Workbench
from tracker.parameters.catalogue import PARAMETERS, PRESETS
from tracker.parameters.values import ParameterError, value_of
from tracker.runs import pipeline
from tracker.runs.pipeline import Progress, Run
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.reader import read_sequence

P_D = "fusion.detection_probability"


@pytest.fixture
def bench(crossing: Path) -> Workbench:
    workbench = Workbench()
    sequence = read_sequence(crossing)
    workbench.open(sequence, "key", FrameReader(sequence), pipeline.default_parameters(sequence))
    return workbench


def run_of(bench: Workbench, seed: int = 0) -> Run:
    now = bench.snapshot()
    assert now.sequence is not None
    keys = pipeline.stage_keys(now.sequence, now.parameters, seed)
    return Run(now.sequence, now.parameters, seed, keys)


def progress(done: int) -> Progress:
    return Progress("fusion", done, 120, 1.0, done)


def finished(bench: Workbench) -> Run:
    """A run of the workbench's parameters, up to its end."""
    run = run_of(bench)
    bench.run_begins(run.key)
    bench.run_progresses(run, progress(120))
    bench.run_ends(run.key, "done")
    return run


def test_values_are_taken_all_or_none(bench: Workbench) -> None:
    bench.set_parameters({P_D: 0.7}, "test")
    with pytest.raises(ParameterError, match="must be between"):
        bench.set_parameters({P_D: 0.6, "fusion.clutter_rate": 1e9}, "test")
    assert value_of(bench.snapshot().parameters, P_D) == 0.7
    assert bench.snapshot().parameters_origin == "test"


def test_numbers_of_the_sliders_are_moved_into_their_range(bench: Workbench) -> None:
    ranges = {
        key: (p.minimum, p.maximum)
        for key, p in PARAMETERS.items()
        if p.minimum is not None and p.maximum is not None
    }
    for index, beyond in enumerate((-1.0, 1.0)):
        sent = {key: bounds[index] + beyond for key, bounds in ranges.items()}
        bench.set_parameters(sent, "viser")
        now = bench.snapshot().parameters
        taken = {key: value_of(now, key) for key in ranges}
        assert taken == {key: bounds[index] for key, bounds in ranges.items()}


def test_what_is_no_number_is_refused_from_sliders_too(bench: Workbench) -> None:
    for bad in ("much", None, float("nan")):
        with pytest.raises(ParameterError):
            bench.set_parameters({P_D: bad}, "viser")


def test_whole_numbers_stay_whole() -> None:
    assert clamp("fusion.max_components", 20.4) == 20


def test_reset_of_some_and_of_all(bench: Workbench) -> None:
    bench.set_parameters({P_D: 0.7, "fusion.clutter_rate": 2.0}, "test")
    bench.reset_parameters([P_D])
    now = bench.snapshot()
    assert value_of(now.parameters, P_D) == value_of(now.defaults, P_D)
    assert value_of(now.parameters, "fusion.clutter_rate") == 2.0
    bench.reset_parameters()
    assert bench.snapshot().parameters == now.defaults
    with pytest.raises(ParameterError, match="no such parameter"):
        bench.reset_parameters(["fusion.nonsense"])


def test_a_preset_replaces_every_number_and_the_fusion(bench: Workbench) -> None:
    bench.set_parameters({P_D: 0.7}, "test")
    bench.apply_preset("published")
    now = bench.snapshot()
    assert now.parameters.single_view == "none"
    for key, published in PRESETS["published"].items():
        assert value_of(now.parameters, key) == published
    bench.apply_preset("robust")
    assert value_of(bench.snapshot().parameters, P_D) == value_of(now.defaults, P_D)
    with pytest.raises(ParameterError, match="robust, published"):
        bench.apply_preset("magic")


def test_the_playhead_stays_in_the_sequence(bench: Workbench) -> None:
    assert bench.seek(10**9) == 119
    assert bench.seek(-5) == 0
    assert bench.seek(7, "me") == 7
    assert bench.snapshot().playhead_origin == "me"


def test_an_empty_workbench_takes_everything_but_goes_nowhere() -> None:
    bench = Workbench()
    assert bench.seek(5) == 0
    bench.select(None)
    bench.set_parameters({P_D: 0.7}, "test")
    bench.reset_parameters()
    assert bench.snapshot().run is None
    assert not bench.snapshot().step_is_computed


def test_layers(bench: Workbench) -> None:
    assert bench.layers == {name: name != "truth" for name in LAYERS}
    bench.set_layers({"truth": False})
    assert not bench.layers["truth"]
    with pytest.raises(ParameterError, match="expected one of boxes"):
        bench.set_layers({"clouds": True})


def test_only_what_changed_is_told_and_only_while_subscribed(bench: Workbench) -> None:
    told: list[Change] = []
    end = bench.subscribe(told.append)
    bench.seek(3)
    bench.seek(3)
    bench.select(2)
    bench.select(2)
    bench.set_parameters({P_D: 0.7}, "test")
    bench.set_parameters({P_D: 0.7}, "test")
    bench.set_layers({"boxes": True})
    assert told == ["playhead", "selection", "parameters"]
    end()
    end()
    bench.seek(4)
    assert len(told) == 3


def test_the_3d_view_looks_through_cameras_that_there_are(bench: Workbench) -> None:
    cameras = len(bench.snapshot().sequence.views)
    told: list[Change] = []
    bench.subscribe(told.append)
    for view in (cameras - 1, "top", "top", None):
        bench.look(view)
    assert told == ["view"] * 3
    for wrong in (cameras, -1):
        with pytest.raises(ParameterError, match=f"below {cameras}, top or null"):
            bench.look(wrong)
    bench.set_theme("light")
    bench.set_theme("light")
    assert told[3:] == ["theme"]


def test_events_pass_and_leave_no_trace(bench: Workbench) -> None:
    heard: list[Event] = []
    end = bench.subscribe_events(heard.append)
    version = bench.snapshot().version
    bench.command("play")
    bench.notify("warn", "so", "do")
    assert heard == [Command("play"), Notice("warn", "so", "do")]
    assert bench.snapshot().version == version
    end()


def test_whoever_is_told_may_wait_for_another_who_asks(bench: Workbench) -> None:
    """A subscriber with a lock of its own must not wait for ours while we wait for its."""
    asked = threading.Event()

    def told(_: Change) -> None:
        thread = threading.Thread(target=lambda: (bench.select(9), asked.set()))
        if not asked.is_set():
            asked.set()
            thread.start()
            thread.join(5.0)
            assert not thread.is_alive()

    bench.subscribe(told)
    bench.seek(5)
    assert bench.snapshot().selection == 9


def test_changes_from_many_threads_are_all_counted(bench: Workbench) -> None:
    before = bench.snapshot().version

    def work(start: int) -> None:
        for i in range(50):
            bench.select(start + i)

    threads = [threading.Thread(target=work, args=(1000 * n,)) for n in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert bench.snapshot().version == before + 200


def test_news_of_a_superseded_run_are_dropped(bench: Workbench) -> None:
    old = run_of(bench)
    bench.run_begins(old.key)
    bench.set_parameters({P_D: 0.7}, "test")
    new = run_of(bench)
    assert new.key != old.key
    bench.run_begins(new.key)
    bench.run_progresses(old, progress(10))
    bench.run_ends(old.key, "done")
    now = bench.snapshot()
    assert now.run is None
    assert now.run_state.state == "computing"
    assert now.run_state.key == new.key


def test_the_run_before_is_shown_until_the_new_one_has_a_step(bench: Workbench) -> None:
    old = finished(bench)
    bench.set_parameters({P_D: 0.7}, "test")
    new = run_of(bench)
    bench.run_begins(new.key, "ending the run before")
    assert bench.snapshot().run_state.message == "ending the run before"
    bench.run_progresses(new, progress(0))
    assert bench.snapshot().run is old
    assert bench.snapshot().run_state.message == "fusion"
    bench.run_progresses(new, progress(1))
    assert bench.snapshot().run is new


def test_a_run_that_is_silent_has_no_speed_and_says_what_it_does(bench: Workbench) -> None:
    run = run_of(bench)
    bench.run_begins(run.key)
    bench.run_progresses(run, progress(60))
    assert bench.snapshot().run_state.steps_per_second > 0.0
    for done, words in ((60, "no new step for 7 s"), (120, "smoothing for 7 s")):
        bench.run_progresses(run, progress(done))
        bench.run_waits(run.key, silence(bench.snapshot().run_state, 7.2))
        state = bench.snapshot().run_state
        assert (state.message, state.steps_per_second, state.seconds_left) == (words, 0.0, None)
        assert silence(state, 7.2, "compiling, 2 of 9") == f"{words}; compiling, 2 of 9"


def test_a_failure_shows_the_last_good_run_again(bench: Workbench) -> None:
    good = finished(bench)
    bench.set_parameters({P_D: 0.7}, "test")
    bad = run_of(bench)
    bench.run_begins(bad.key)
    bench.run_progresses(bad, progress(3))
    assert bench.snapshot().run is bad
    bench.run_ends(bad.key, "failed", "it broke")
    now = bench.snapshot()
    assert now.run is good
    assert (now.run_state.state, now.run_state.error) == ("failed", "it broke")
