"""Ctrl-C while compiled code works: it ends between two steps, as an interruption."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from app.command.computing import between_steps
from app.command.main import INTERRUPTED
from tests.app.conftest import Runs
from tracker.runs import pipeline

Heard = Callable[[], bool]


def press() -> None:
    """Ctrl-C, as a terminal sends it."""
    os.kill(os.getpid(), signal.SIGINT)


def within(work: Callable[[Heard], None]) -> None:
    """Do some work that asks whether Ctrl-C came."""
    with between_steps() as heard:
        work(heard)


def test_the_first_is_noted_and_raised_at_the_end() -> None:
    told: list[bool] = []

    def work(heard: Heard) -> None:
        told.append(heard())
        press()
        told.append(heard())

    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        within(work)
    assert told == [False, True], "what was under way came to its own end"
    assert signal.getsignal(signal.SIGINT) is before


def test_work_that_gives_up_for_it_is_interrupted() -> None:
    def work(heard: Heard) -> None:
        press()
        if heard():
            raise RuntimeError("cancelled")

    with pytest.raises(KeyboardInterrupt):
        within(work)


def test_a_second_one_does_not_wait() -> None:
    told: list[str] = []

    def work(_: Heard) -> None:
        press()
        told.append("goes on")
        press()
        told.append("goes on still")

    with pytest.raises(KeyboardInterrupt):
        within(work)
    assert told == ["goes on"]


def test_without_one_a_failure_stays_what_it_is() -> None:
    def work(_: Heard) -> None:
        raise RuntimeError("a bug")

    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(RuntimeError, match="a bug"):
        within(work)
    assert signal.getsignal(signal.SIGINT) is before


def test_in_another_thread_nothing_is_taken_over() -> None:
    before, found = signal.getsignal(signal.SIGINT), []

    def work(heard: Heard) -> None:
        found.append((heard(), signal.getsignal(signal.SIGINT)))

    thread = threading.Thread(target=within, args=(work,))
    thread.start()
    thread.join()
    assert found == [(False, before)]


@pytest.mark.parametrize("line", [("evaluate",), ("corrections", "check")])
def test_a_command_that_computes_a_run_ends_between_two_steps(
    line: tuple[str, ...], crossing: Path, run: Runs, monkeypatch: pytest.MonkeyPatch
) -> None:
    went_on: list[str] = []

    def compute(*_: object, cancelled: Heard, **options: object) -> None:
        press()
        went_on.append("to the end of its step")
        if cancelled():
            raise RuntimeError("cancelled")

    monkeypatch.setattr(pipeline, "compute", compute)
    assert run(*line, crossing)[0] == INTERRUPTED
    assert went_on
