"""What the sampler was asked and told: Optuna's lines in a file that one process writes."""

from __future__ import annotations

import heapq
import json
import os
from collections.abc import Container, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tracker.studies.errors import StudyError

BEST = 100
LAST = 400
"""Of a long search by TPE its best and its last trials are looked at for the next one. TPE sets
at most 25 good ones against all others, of which it weighs the old ones little: the good ones are
the same, and the time of a trial does not grow with their number."""


class Journal:
    """A backend of Optuna's without a lock, each write at once.

    What a killed program had not written to its end is cut off. The system holds what was
    written: only a machine that loses its power can lose the last trials' values, and their
    results are kept apart.
    """

    def __init__(self, path: Path) -> None:
        """Open the file, or make it.

        Raises:
            ValueError: If it holds what is no journal.
        """
        whole = path.read_bytes() if path.exists() else b""
        complete = whole[: whole.rfind(b"\n") + 1]
        if len(complete) < len(whole):
            with path.open("r+b") as file:
                file.truncate(len(complete))
        self._path = path
        self._lines: list[dict[str, Any]] = [json.loads(one) for one in complete.splitlines()]
        self._first = 0
        self._file = path.open("ab", buffering=0)
        self._size = len(complete)
        self._waiting: list[bytes] | None = None

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def read_logs(self, log_number_from: int) -> Iterator[dict[str, Any]]:
        """The lines from a number on; what Optuna has read it does not ask for again."""
        del self._lines[: log_number_from - self._first]
        self._first = max(self._first, log_number_from)
        yield from list(self._lines)

    def append_logs(self, logs: list[dict[str, Any]]) -> None:
        """Write lines, all or none.

        Raises:
            StudyError: If they cannot be written.
        """
        texts = [json.dumps(one, separators=(",", ":")).encode() + b"\n" for one in logs]
        if self._waiting is None:
            self._write(b"".join(texts))
        else:
            self._waiting += texts
        self._lines += [json.loads(one) for one in texts]

    @contextmanager
    def together(self) -> Iterator[None]:
        """What is told within is written by one write at the end, all or nothing."""
        self._waiting = []
        try:
            yield
        finally:
            waiting, self._waiting = self._waiting, None
            self._write(b"".join(waiting))

    def _write(self, data: bytes) -> None:
        try:
            if data and self._file.write(data) != len(data):
                raise OSError(28, "No space left on device")
        except OSError as error:
            os.ftruncate(self._file.fileno(), self._size)
            raise StudyError(
                f"{self._path}: cannot be written ({error.strerror}); free some space and go on "
                "by `multiview-phd study resume`: every run that ended is kept"
            ) from None
        self._size += len(data)


def storage(journal: Any, *, minimized: bool | None) -> Any:
    """Optuna's storage over a journal.

    Args:
        journal: A :class:`Journal`, which Optuna takes for a backend as it stands.
        minimized: Of a search by TPE whether the smallest value is the best; None of other
            searches, which look at all trials.
    """
    from optuna.storages import JournalStorage
    from optuna.trial import TrialState

    class Storage(JournalStorage):
        """Neither what waits to be tried nor what ended is sought among all trials each time."""

        _waits = True  # what an earlier start left, until it is looked for

        def create_new_trial(self, study_id: int, template_trial: Any = None) -> int:
            self._waits |= template_trial is not None
            number: int = super().create_new_trial(study_id, template_trial)
            return number

        def get_all_trials(
            self, study_id: int, deepcopy: bool = True, states: Container[Any] | None = None
        ) -> list[Any]:
            if states == (TrialState.WAITING,):
                if not self._waits:
                    return []
                waiting: list[Any] = super().get_all_trials(study_id, deepcopy, states)
                self._waits = bool(waiting)
                return waiting
            found: list[Any] = super().get_all_trials(study_id, deepcopy, states)
            if minimized is None or states is None or TrialState.COMPLETE not in states:
                return found
            if len(found) <= BEST + LAST:
                return found
            last = found[-LAST:]
            early = [one for one in found[:-LAST] if one.state == TrialState.COMPLETE]
            sign = 1.0 if minimized else -1.0
            best = heapq.nsmallest(BEST, early, key=lambda one: sign * one.value)
            return sorted([*best, *last], key=lambda one: one.number)

    return Storage(journal)
