"""The runs since the server was started: what each was made of, and the way back to it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from app.state.snapshot import DRAG_SECONDS, Change, RunState
from app.state.workbench import Workbench
from tracker.parameters.catalogue import METHODS, PARAMETERS, RunParameters
from tracker.parameters.values import ParameterError, changed_values, value_of
from tracker.sequences.writing.teaching import Values, taught_values

MOST_RUNS = 50
"""Older ones are forgotten."""


@dataclass(frozen=True, slots=True)
class PastRun:
    """One run, finished or not."""

    number: int
    """From 1 on."""
    at: str
    """Time of day at which it began, as text."""
    sequence: str
    """Its name then."""
    recording: str
    """The same as long as it is open, under whatever name."""
    parameters: RunParameters
    changes: int
    """How many parameters were not at their defaults."""
    state: RunState
    """How far it was when it was last heard of."""
    taught: Values
    """The templates and the room that its sequence had."""
    moved: frozenset[str] = frozenset()
    """The keys in which it differs from the one before."""
    heard: float = 0.0
    """When it was last heard of, monotonic seconds."""


class History:
    """Writes down the runs of a workbench, newest first."""

    def __init__(self, workbench: Workbench) -> None:
        self._workbench = workbench
        self._lock = threading.Lock()
        self._runs: list[PastRun] = []
        self._counted = 0
        self.close = workbench.subscribe(self._note)

    @property
    def runs(self) -> list[PastRun]:
        """All that are remembered, newest first."""
        with self._lock:
            return list(self._runs)

    def use_again(self, number: int, restore: Callable[[Values, Mapping[str, Any]], None]) -> None:
        """Set all parameters to those of a run, and what was taught where its recording is open.

        Args:
            number: The run's.
            restore: Goes back to what was taught once and to values by key, in one change.

        Raises:
            ParameterError: If there is no such run.
        """
        run = next((run for run in self.runs if run.number == number), None)
        if run is None:
            raise ParameterError(
                "number",
                f"expected the number of a listed run, got {number}",
                "The tab Runs lists them.",
            )
        keys = (*METHODS, *PARAMETERS)
        values = {key: value_of(run.parameters, key) for key in keys}
        if run.recording == self._workbench.snapshot().sequence_key:
            restore(run.taught, values)
        else:
            self._workbench.set_parameters(values, "api")

    def _note(self, change: Change) -> None:
        if change not in ("run", "progress"):
            return
        with self._lock:
            now = self._workbench.snapshot()
            state, sequence = now.run_state, now.sequence
            if not state.key or sequence is None:
                return
            for index, run in enumerate(self._runs):
                if run.state.key == state.key:
                    self._runs[index] = replace(run, state=state, heard=time.monotonic())
                    return
            # a run that was superseded before its first step is not worth a row
            earlier = [r for r in self._runs if r.state.state != "computing" or r.state.done]
            moved, heard = frozenset[str](), time.monotonic()
            taught = taught_values(sequence)
            if earlier and earlier[0].recording == now.sequence_key:
                moved = _differing(earlier[0].parameters, now.parameters)
                same = moved and moved == earlier[0].moved and taught == earlier[0].taught
                if same and heard - earlier[0].heard < DRAG_SECONDS:
                    self._counted = earlier.pop(0).number - 1
            self._counted += 1
            changes = len(changed_values(now.parameters, now.defaults))
            at = time.strftime("%H:%M:%S")
            new = PastRun(
                self._counted, at, sequence.name, now.sequence_key, now.parameters, changes, state,
                taught, moved, heard,
            )  # fmt: skip
            self._runs = [new, *earlier][:MOST_RUNS]


def _differing(a: RunParameters, b: RunParameters) -> frozenset[str]:
    """The keys of the values that two runs do not share."""
    keys = (*METHODS, *PARAMETERS)
    return frozenset(key for key in keys if value_of(a, key) != value_of(b, key))
