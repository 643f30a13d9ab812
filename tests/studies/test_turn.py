"""Studies that are started beside each other run one after another."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest

from tests.app.conftest import wait_until
from tests.studies.small import Serial, definition, made_up, run
from tracker.studies.store import create, turn


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("MULTIVIEW_PHD_STUDIES", str(tmp_path / "studies"))
    return tmp_path


def test_one_runs_and_the_other_waits_and_says_for_which(folder: Path) -> None:
    crew = Serial(made_up(lambda values: 0.5))
    store = create(definition(folder, "second", trials=2), folder)
    told: list[str] = []
    with turn("first", lambda words: False) as mine:
        assert mine
        thread = threading.Thread(
            target=lambda: run(store, crew, on_status=lambda status: told.append(status.words))
        )
        thread.start()
        wait_until(lambda: any("first" in words for words in told))
        assert 'waits for its turn: the study "first" has this machine\'s cores' in told
        assert store.status().state == "running"
        assert crew.done == []
    thread.join(30.0)
    assert store.status().state == "done"
    assert len(store.trials()) == 2


def test_who_waits_can_be_stopped_and_its_time_does_not_run(folder: Path) -> None:
    crew = Serial(made_up(lambda values: 0.5))
    store = create(definition(folder, "third", trials=2), folder)
    with turn("first", lambda words: False):
        status = run(store, crew, stopped=lambda: True)
    assert status.state == "stopped"
    assert crew.done == []
    assert (store.fact("spent") or 0.0) < 1.0


def test_who_computes_elsewhere_waits_for_nobody(folder: Path) -> None:
    crew = Serial(made_up(lambda values: 0.5))
    store = create(definition(folder, "far", trials=2), folder)
    with turn("first", lambda words: False):
        assert run(store, crew, beside=True).state == "done"
