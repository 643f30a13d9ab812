"""One order of edits, whatever they are of: undone and redone, dragged, stored, taken up."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from starlette.testclient import TestClient

from app.state import edits as module
from app.state.edits import EditError, Edits
from app.state.snapshot import Change, Event, Notice
from app.state.workbench import Workbench
from app.web.dependencies import Settings
from app.web.server import create_app
from tests.app.conftest import ADDRESS, command, run_is, wait_until
from tracker.parameters.values import value_of, with_values
from tracker.runs import pipeline
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.reader import read_sequence

P_D, P_S = "fusion.detection_probability", "fusion.survival_probability"


def opened(crossing: Path, values: Mapping[str, Any] = MappingProxyType({})) -> Workbench:
    workbench = Workbench()
    sequence = read_sequence(crossing)
    defaults = pipeline.default_parameters(sequence)
    chosen = with_values(defaults, values)
    workbench.open(sequence, "key", FrameReader(sequence), defaults, chosen=chosen)
    return workbench


@pytest.fixture
def bench(crossing: Path) -> Workbench:
    return opened(crossing)


@pytest.fixture
def edits(bench: Workbench) -> Iterator[Edits]:
    edits = followed(bench)
    yield edits
    edits.close()


class Clock:
    """What the edits take the time from."""

    now = 100.0


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(module.time, "monotonic", lambda: clock.now)
    return clock


def followed(bench: Workbench, folder: Path | None = None) -> Edits:
    edits = Edits(bench, folder)
    edits._open(bench.snapshot())
    edits.follow()
    return edits


def values(bench: Workbench) -> tuple[Any, ...]:
    return tuple(value_of(bench.snapshot().parameters, key) for key in (P_D, P_S))


def test_a_drag_is_one_edit_and_two_sliders_are_two(
    bench: Workbench, edits: Edits, clock: Clock
) -> None:
    before = values(bench)
    for value in (0.9, 0.8, 0.7):
        clock.now += 0.3
        bench.set_parameters({P_D: value}, "viser")
    bench.set_parameters({P_S: 0.9}, "viser")
    clock.now += module.DRAG_SECONDS
    bench.set_parameters({P_S: 0.8}, "viser")
    assert bench.snapshot().undo_words == "Survival probability 0.9 → 0.8"
    found = []
    for _ in range(3):
        edits.undo()
        found.append(values(bench))
    assert found == [(0.7, 0.9), (0.7, before[1]), before]
    with pytest.raises(EditError, match="nothing to undo"):
        edits.undo()
    for _ in range(3):
        edits.redo()
    assert values(bench) == (0.7, 0.8)
    with pytest.raises(EditError, match="nothing to redo"):
        edits.redo()


def test_two_values_during_one_long_run_are_two_edits(
    bench: Workbench, edits: Edits, clock: Clock
) -> None:
    """What is typed while news of a run arrive all the time is no drag."""
    before = values(bench)
    bench.set_parameters({P_D: 0.8}, "viser")
    bench.run_begins("run")
    for _ in range(20):
        clock.now += 1.0
        bench.run_waits("run", f"smoothing for {clock.now:.0f} s")
    bench.set_parameters({P_D: 0.6}, "viser")
    edits.undo()
    assert values(bench)[0] == 0.8
    edits.undo()
    assert values(bench) == before


def test_a_slow_drag_is_one_edit_that_names_both_ends(
    bench: Workbench, edits: Edits, clock: Clock
) -> None:
    """A browser that draws slowly moves a slider only between two results."""
    before = values(bench)
    for value in (0.8, 0.7, 0.6):
        bench.set_parameters({P_D: value}, "viser")
        bench.run_begins(f"run {value}")
        clock.now += module.DRAG_SECONDS - 0.1
        bench.run_ends(f"run {value}", "done")
        clock.now += module.DRAG_SECONDS - 0.1
    assert bench.snapshot().undo_words == f"Detection probability {before[0]:g} → 0.6"
    clock.now += 0.2
    bench.set_parameters({P_D: 0.7}, "viser")
    assert bench.snapshot().undo_words == "Detection probability 0.6 → 0.7"
    for _ in range(2):
        edits.undo()
    assert values(bench) == before


def test_a_preset_that_brings_the_defaults_is_called_by_its_name(
    bench: Workbench, edits: Edits
) -> None:
    bench.set_parameters({P_D: 0.5, P_S: 0.8}, "api")
    bench.apply_preset("robust")
    assert bench.snapshot().undo_words == "preset robust"
    bench.set_parameters({P_D: 0.5}, "api")
    bench.apply_preset("robust")
    assert bench.snapshot().undo_words == "preset robust"
    bench.set_parameters({P_D: 0.5, P_S: 0.8}, "api")
    bench.reset_parameters()
    assert bench.snapshot().undo_words == "all parameters reset"


def test_a_slider_that_comes_back_to_where_it_was_is_no_edit(
    bench: Workbench, edits: Edits
) -> None:
    start = values(bench)[0]
    bench.set_parameters({P_D: 0.5}, "viser")
    bench.set_parameters({P_D: start}, "viser")
    assert bench.snapshot().undo_words is None


def test_a_reset_right_after_a_drag_is_an_edit_of_its_own(bench: Workbench, edits: Edits) -> None:
    bench.set_parameters({P_D: 0.5}, "viser")
    bench.reset_parameters([P_D])
    edits.undo()
    assert values(bench)[0] == 0.5


def test_presets_one_right_after_the_other_are_two_edits(bench: Workbench, edits: Edits) -> None:
    """Also where the second brings back what the first changed."""
    bench.set_presets({"low": {P_D: 0.6}, "high": {P_D: 0.9}})
    bench.set_parameters({P_D: 0.6}, "api")
    bench.apply_preset("high")
    bench.apply_preset("low")
    edits.undo()
    assert values(bench)[0] == 0.9


def test_methods_that_are_switched_twice_are_two_edits(bench: Workbench, edits: Edits) -> None:
    usual = bench.snapshot().parameters.smoothing_method
    bench.set_parameters({"smoothing_method": "none"}, "api")
    bench.set_parameters({"smoothing_method": usual}, "api")
    edits.undo()
    assert bench.snapshot().parameters.smoothing_method == "none"
    assert bench.snapshot().redo_words == f"Smoothing method {usual}"


@given(st.lists(st.sampled_from(["p_d", "p_s", "preset", "undo", "redo"]), max_size=20))
def test_undo_and_redo_lead_through_the_same_values(acts: list[str]) -> None:
    bench = Workbench()
    sequence = SEQUENCE[0]
    bench.open(sequence, "key", FrameReader(sequence), pipeline.default_parameters(sequence))
    edits = Edits(bench)
    edits._open(bench.snapshot())
    edits.follow()
    presets: list[str] = []
    edits.own("presets", lambda names: presets.__setitem__(slice(None), list(names)))
    random = np.random.default_rng(len(acts))

    def now() -> tuple[Any, ...]:
        return (*values(bench), *presets)

    past, future = [now()], []
    for act in acts:
        if act == "undo" and len(past) > 1:
            edits.undo()
            future.append(past.pop())
        elif act == "redo" and future:
            edits.redo()
            past.append(future.pop())
        elif act in ("p_d", "p_s", "preset"):
            if act == "preset":
                before = list(presets)
                presets.append(f"own {len(presets)}")
                edits.done("a preset", "presets", before, list(presets))
            else:
                value = round(float(random.uniform(0.55, 0.95)), 6)
                bench.set_parameters({P_D if act == "p_d" else P_S: value}, f"api {value}")
            past, future = [*past, now()], []
        assert now() == past[-1]
    edits.close()


SEQUENCE: list[Any] = []


@pytest.fixture(autouse=True)
def sequence(crossing: Path) -> None:
    SEQUENCE[:] = [read_sequence(crossing)]


def test_what_cannot_be_put_back_for_good_does_not_bar_the_way(
    bench: Workbench, edits: Edits
) -> None:
    def put(_: object) -> None:
        raise ValueError("the run is gone")

    edits.own("runs", put)
    bench.set_parameters({P_D: 0.5}, "api")
    edits.done("run 3 deleted", "runs", False, True)
    with pytest.raises(EditError, match="run 3 deleted: the run is gone"):
        edits.undo()
    edits.undo()
    assert values(bench)[0] != 0.5


def test_edits_are_taken_up_after_a_start_where_they_still_fit(
    crossing: Path, tmp_path: Path
) -> None:
    bench = opened(crossing)
    edits = followed(bench, tmp_path)
    bench.set_parameters({P_D: 0.5}, "one")
    bench.set_parameters({P_D: 0.6}, "two")
    edits.done("a preset", "presets", {"mine": None}, {"mine": {}})
    assert edits.parameters_of(crossing) == {P_D: 0.6}
    edits.close()
    assert Edits(Workbench(), tmp_path).parameters_of(crossing) == {P_D: 0.6}
    again = opened(crossing, {P_D: 0.6})
    edits = followed(again, tmp_path)
    shown = []
    edits.own("presets", shown.append)
    assert again.snapshot().undo_words == "a preset"
    # the page that comes back sets what it had: nobody has edited anything
    again.set_parameters({P_D: 0.6}, "api")
    assert again.snapshot().undo_words == "a preset"
    edits.undo()
    assert shown == [{"mine": None}]
    edits.undo()
    assert values(again)[0] == 0.5
    assert again.snapshot().redo_words == "Detection probability 0.5 → 0.6"
    edits.close()
    (tmp_path / "everywhere.json").write_text("{}")
    edits = followed(opened(crossing), tmp_path)
    assert edits._done[-1].words == "Detection probability 0.95 → 0.5"
    edits.close()


@pytest.mark.full
def test_a_start_without_a_page_goes_on_where_the_last_one_was(
    data: Path, tmp_path: Path, own_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MULTIVIEW_PHD_SETTINGS", str(tmp_path / "settings"))
    settings = Settings(sequence="crossing", data=data, with_viser=False, keep_on_disk=True)
    with TestClient(create_app(settings), base_url=ADDRESS) as client:
        wait_until(run_is(client, "done"))
        command(client, "set_parameters", changes={P_D: 0.7})
        wait_until(run_is(client, "done"))
        left = client.get("/api/state").json()
    with TestClient(create_app(settings), base_url=ADDRESS) as client:
        wait_until(run_is(client, "done"))
        now = client.get("/api/state").json()
        assert now["run"]["key"] == left["run"]["key"]
        assert now["parameters"][P_D] == 0.7
        assert len(client.get("/api/runs").json()["runs"]) == 1
        client.post("/api/sequence", json={"name": "numbers"})
        wait_until(lambda: client.get("/api/state").json()["sequence"]["name"] == "numbers")
        assert client.get("/api/state").json()["changed"] == []
        client.post("/api/sequence", json={"name": "crossing"})
        wait_until(lambda: client.get("/api/state").json()["sequence"]["name"] == "crossing")
        assert command(client, "undo").json()["parameters"][P_D] != 0.7


def test_an_undo_right_after_the_opening_is_of_the_recording(
    crossing: Path, tmp_path: Path
) -> None:
    """Others are told first that it is open, and may take a while."""
    bench = opened(crossing)
    first = followed(bench, tmp_path)
    first.done("a preset saved", "presets", {"own": None}, {"own": {}})
    bench.set_parameters({P_D: 0.8}, "viser")
    first.close()
    again, told, goes_on = Workbench(), threading.Event(), threading.Event()

    def take_a_while(change: Change) -> None:
        told.set()
        assert goes_on.wait(60.0)

    second = Edits(again, tmp_path)
    again.subscribe(take_a_while)
    second.follow()
    with ThreadPoolExecutor(2) as threads:
        opening = threads.submit(
            again.open, bench.snapshot().sequence, "key", None, bench.snapshot().defaults
        )
        assert told.wait(60.0)
        undoing = threads.submit(second.undo)
        time.sleep(0.1)
        goes_on.set()
        opening.result()
        assert undoing.result().words.startswith("Detection probability")
    second.close()


def test_a_note_says_what_was_undone(crossing: Path) -> None:
    settings = Settings(sequence=str(crossing), with_viser=False)
    with TestClient(create_app(settings), base_url=ADDRESS) as client:
        wait_until(lambda: client.get("/api/state").json()["run"]["done"] > 0)
        heard: list[Event] = []
        bench: Workbench = client.app.state.workbench  # type: ignore[attr-defined]
        bench.subscribe_events(heard.append)
        command(client, "set_parameters", changes={P_D: 0.5})
        command(client, "save_preset", preset="mine")
        assert command(client, "undo").json()["presets"] == []
        assert command(client, "redo").json()["presets"] == ["mine"]
        command(client, "undo")
        command(client, "undo")
    assert [one.message for one in heard if isinstance(one, Notice)] == [
        "Undone: preset mine saved",
        "Done again: preset mine saved",
        "Undone: preset mine saved",
        "Undone: Detection probability 0.95 → 0.5",
    ]
