"""What a parameter would change on the shown recording: a few runs of other values, on demand.

The curves are computed one after the other in the background, kept for as long as the recording
is open, and given up at once when somebody works: moves a slider, teaches, opens another
recording, plays or seeks.

[HHL14] Hutter, Hoos, Leyton-Brown, "An efficient approach for assessing hyperparameter
importance", ICML 2014 (fANOVA).
"""

from __future__ import annotations

import logging
import math
import threading
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from app.errors import sentence
from app.state.snapshot import Change, Snapshot, Task
from app.state.threads import CLOSING_SECONDS, be_nice
from app.state.workbench import Workbench
from tracker.evaluation import EvaluationSettings, evaluate_sequence
from tracker.parameters.catalogue import PARAMETERS, Parameter, RunParameters
from tracker.parameters.values import current_key, value_of, with_values
from tracker.runs import pipeline
from tracker.runs.pipeline import Cancelled, Run

logger = logging.getLogger("app")

SHARES = {"single_view": (0.15, 0.5, 0.85), "fusion": (0.1, 0.3, 0.5, 0.7, 0.9)}
"""Where on its range a number is tried, by stage; the last stage as the second: of those that look
at pictures again fewer, for they take minutes."""

MOST_CHOICES = 7

ENDS: frozenset[Change] = frozenset({"parameters", "sequence", "taught", "editing", "playhead"})
"""What a person does: from then on the machine is theirs."""


@dataclass(frozen=True, slots=True)
class Curve:
    """What a parameter would change, as far as it is computed."""

    key: str
    measure: str
    """MOTA; where there is no truth the number of tracks."""
    values: tuple[Any, ...]
    """Ascending, or the choices."""
    scores: tuple[float | None, ...]
    """One a value; None where the run failed."""
    whole: bool
    """Whether there is nothing more to come."""


def values_to_try(parameter: Parameter, now: Any) -> tuple[Any, ...]:
    """Three to seven values of a parameter, with the one that it has now.

    Numbers lie evenly on the parameter's slider, which may be logarithmic, away from its ends.
    """
    if parameter.kind == "bool":
        return (False, True)
    if parameter.kind == "choice":
        others = [choice for choice in parameter.choices if choice != now]
        return (now, *others[: MOST_CHOICES - 1])
    low, high = float(parameter.minimum or 0.0), float(parameter.maximum or 0.0)
    shares = SHARES["single_view" if parameter.stage == "single_view" else "fusion"]
    if parameter.log:
        tried = [math.exp(math.log(low) + s * math.log(high / low)) for s in shares]
    else:
        tried = [low + s * (high - low) for s in shares]
    rounded = {float(f"{value:.2g}") for value in tried}
    inside = {min(max(value, low), high) for value in rounded}
    if parameter.kind == "int":
        inside = {round(value) for value in inside}
    return tuple(sorted(inside | {now}))


def shares(curves: Mapping[str, Curve]) -> dict[str, float]:
    """Return the share of the variance of the measure that each parameter explains alone, by key.

    The variance is that of the scores along the parameter's curve, and the shares sum to one over
    all curves that are whole. It is the first-order share of fANOVA [HHL14], which studies report,
    where one parameter is moved at a time and the others stay. Empty for fewer than two parameters.
    """
    spread: dict[str, float] = {}
    for key, curve in curves.items():
        known = [score for score in curve.scores if score is not None]
        if curve.whole and len(known) > 1:
            mean = sum(known) / len(known)
            spread[key] = sum((score - mean) ** 2 for score in known) / len(known)
    total = sum(spread.values())
    if len(spread) < 2:
        return {}
    return {key: one / total if total else 0.0 for key, one in spread.items()}


class Sensitivity:
    """Computes curves in a thread of its own; the newest request wins."""

    def __init__(self, workbench: Workbench, seed: int = 0) -> None:
        """Begin to follow the workbench.

        Args:
            workbench: Whose recording and parameters.
            seed: Of all runs, the same as of those that are shown.
        """
        self._workbench = workbench
        self._seed = seed
        self._settings = EvaluationSettings()
        self._condition = threading.Condition()
        self._wanted: list[str] = []
        self._cancelled = threading.Event()
        self._closed = False
        self._curves: dict[tuple[str, str], Curve] = {}
        self._last: Run | None = None
        """Stages are taken from it where the shown run is not finished; not kept for longer."""
        self._done = self._total = 0
        """Runs of what was asked for last."""
        self._unsubscribe = workbench.subscribe(self._on_change)
        self._thread = threading.Thread(target=self._work, name="sensitivity", daemon=True)
        self._thread.start()

    def ask(self, keys: Iterable[str]) -> None:
        """Compute the curves of some parameters, one after the other.

        Raises:
            ParameterError: If there is no such parameter.
        """
        now, keys = self._workbench.snapshot(), list(map(current_key, keys))
        for key in keys:
            if key not in PARAMETERS:
                with_values(now.parameters, {key: None})  # says what is wrong
        tried = [values_to_try(PARAMETERS[key], value_of(now.parameters, key)) for key in keys]
        with self._condition:
            self._cancelled.set()
            self._cancelled = threading.Event()
            self._wanted = keys
            self._done, self._total = 0, sum(map(len, tried))
            self._condition.notify_all()
        self._publish()

    @property
    def under_way(self) -> list[str]:
        """The keys whose curves are still to come."""
        with self._condition:
            return list(self._wanted)

    def curves(self) -> dict[str, Curve]:
        """Those that hold for the parameters as they are, by key."""
        now = self._workbench.snapshot()
        if now.sequence is None:
            return {}
        with self._condition:
            known = dict(self._curves)
        return {
            key: known[key, basis]
            for key in dict.fromkeys(key for key, _ in known)
            for basis in [self._basis(now, key)]
            if (key, basis) in known
        }

    def close(self) -> None:
        """Stop; a run under way ends after its step."""
        self._unsubscribe()
        with self._condition:
            self._closed = True
            self._cancelled.set()
            self._condition.notify_all()
        self._thread.join(timeout=CLOSING_SECONDS)

    def _basis(self, now: Snapshot, key: str) -> str:
        """Names recording and parameters but for the one: whatever that is, its curve holds."""
        assert now.sequence is not None
        first = values_to_try(PARAMETERS[key], PARAMETERS[key].default)[0]
        other = with_values(now.parameters, {key: first})
        return pipeline.stage_keys(now.sequence, other, self._seed)["tracks"]

    def _on_change(self, change: Change) -> None:
        if change not in ENDS:
            return
        with self._condition:
            if change == "sequence":
                self._curves.clear()
                self._last = None
                self._total = 0
            elif not self._wanted:
                return
            self._wanted = []
            self._cancelled.set()
        self._publish()

    def _publish(self) -> None:
        with self._condition:
            of = self._workbench.snapshot().sequence_key
            state = "computing" if self._wanted else "done"
            task = (
                Task(of=of, state=state, done=self._done, total=self._total)
                if self._total
                else None
            )
        self._workbench.show_task("effects", task)

    def _work(self) -> None:
        be_nice()
        while True:
            with self._condition:
                self._condition.wait_for(lambda: self._closed or bool(self._wanted))
                if self._closed:
                    return
                key, cancelled = self._wanted[0], self._cancelled
            self._publish()
            try:
                self._compute(key, cancelled)
            except Cancelled:
                pass
            except Exception:
                logger.exception("the curve of %s failed", key)
            with self._condition:
                if cancelled is self._cancelled and self._wanted[:1] == [key]:
                    self._wanted = self._wanted[1:]
                if not self._wanted:
                    self._last = None
            self._publish()

    def _compute(self, key: str, cancelled: threading.Event) -> None:
        now = self._workbench.snapshot()
        if now.sequence is None:
            return
        basis, values = (
            self._basis(now, key),
            values_to_try(PARAMETERS[key], value_of(now.parameters, key)),
        )
        before = self._curves.get((key, basis))
        known = dict(zip(before.values, before.scores, strict=True)) if before else {}
        values = tuple(dict.fromkeys((*values, *known)))
        if PARAMETERS[key].kind in ("float", "int"):
            values = tuple(sorted(values))
        measure = "MOTA" if now.sequence.ground_truth is not None else "tracks"
        for value in values:
            if value not in known:
                parameters = with_values(now.parameters, {key: value})
                known[value] = self._score(now, parameters, cancelled)
            there = [value for value in values if value in known]
            with self._condition:
                self._done = min(self._done + 1, self._total)
                self._curves[key, basis] = Curve(
                    key,
                    measure,
                    tuple(there),
                    tuple(known[value] for value in there),
                    whole=len(there) == len(values),
                )
            self._publish()

    def _score(
        self, now: Snapshot, parameters: RunParameters, cancelled: threading.Event
    ) -> float | None:
        """What a run of these parameters reaches; None where they do not fit the recording."""
        sequence, shown = now.sequence, now.run
        assert sequence is not None
        if shown is not None and shown.only_tracks:
            shown = None
        try:
            run = pipeline.compute(
                sequence,
                parameters,
                seed=self._seed,
                reader=now.reader,
                previous=shown if shown is not None and shown.complete else self._last,
                cancelled=cancelled.is_set,
                thread_begins=be_nice,
            )
        except ValueError as error:
            logger.info("%s", sentence(error))
            return None
        self._last = run
        if sequence.ground_truth is None:
            return float(len(set(run.tracks.ids.tolist())))
        evaluation = evaluate_sequence(sequence, run.tracks, self._settings)
        figures = {figure.definition.key: figure.value for figure in evaluation.figures}
        return figures["mota"]
