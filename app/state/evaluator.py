"""The thread that scores runs against the truth, beside the event loop and the runs."""

from __future__ import annotations

import logging
import threading
import time
from collections import OrderedDict
from dataclasses import replace

from app.errors import sentence
from app.state.scores import Scored
from app.state.snapshot import Change, Snapshot
from app.state.threads import CLOSING_SECONDS, be_nice
from app.state.workbench import Workbench
from tracker.evaluation import Evaluation, EvaluationSettings, evaluate_sequence
from tracker.fusion.trajectories import Trajectories

logger = logging.getLogger("app")

SECONDS_BETWEEN = 1.0
"""A run under way is scored at most this often."""

SETTLED_SECONDS = 0.25
"""A finished run is scored when no other one has taken its place for so long: whoever drags a
slider wants the next run, and scoring would take the interpreter from it."""

SHARE = 0.1
"""And with at most this share of one core: scoring a long run is not free."""

KEPT = 8
"""Evaluations of the first steps of a run, for comparing with one under way."""


class Evaluator:
    """Scores the shown run whenever it has grown, and the pinned one; the newest wins."""

    def __init__(self, workbench: Workbench, settings: EvaluationSettings | None = None) -> None:
        self.settings = settings or EvaluationSettings()
        self._workbench = workbench
        self._condition = threading.Condition()
        self._closed = False
        self._not_before = 0.0
        self._newest: tuple[str, bool] = ("", False)
        self._newest_since = 0.0
        self._failed: set[tuple[str, int, bool]] = set()
        self._beginnings: OrderedDict[tuple[str, int], tuple[Trajectories, Evaluation]] = (
            OrderedDict()
        )
        self._unsubscribe = workbench.subscribe(self._on_change)
        self._thread = threading.Thread(target=self._work, name="evaluation", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop; an evaluation under way is not waited for longer than a moment."""
        self._unsubscribe()
        with self._condition:
            self._closed = True
            self._condition.notify_all()
        self._thread.join(timeout=CLOSING_SECONDS)

    def beginning(self, scored: Scored, steps: int) -> Evaluation:
        """The first steps of a run by themselves. Takes a moment the first time."""
        if steps == scored.steps and scored.evaluation is not None:
            return scored.evaluation
        key = (scored.key, steps)
        with self._condition:
            tracks, known = self._beginnings.get(key, (None, None))
        if known is None or tracks is not scored.tracks:
            known = self._score(replace(scored, steps=steps))
            with self._condition:
                self._beginnings[key] = scored.tracks, known
                while len(self._beginnings) > KEPT:
                    self._beginnings.popitem(last=False)
        return known

    def _score(self, scored: Scored) -> Evaluation:
        tracks = scored.tracks
        rows = slice(0, tracks.at(scored.steps).start)
        return evaluate_sequence(
            scored.sequence, tracks.take(rows), self.settings, steps=scored.steps
        )

    def _on_change(self, change: Change) -> None:
        if change in ("sequence", "run", "progress", "pinned"):
            with self._condition:
                self._condition.notify_all()

    def _next(self, snapshot: Snapshot) -> tuple[Scored | None, float | None]:
        """What is to be scored now; else how many seconds to wait, None for the next news."""
        sequence, run, scores = snapshot.sequence, snapshot.run, snapshot.scores
        if sequence is None or sequence.ground_truth is None:
            return None, None
        pinned = scores.pinned
        if pinned is not None and pinned.evaluation is None:
            if _named(pinned) not in self._failed:
                return pinned, None
        if run is not None and run.done:
            scored, shown = Scored.of(run), scores.shown
            is_new = shown is None or _named(shown) != _named(scored)
            is_new = is_new or (shown is not None and shown.tracks is not scored.tracks)
            if is_new and _named(scored) not in self._failed:
                state = snapshot.run_state
                computing, replaced = state.state == "computing", run.key != state.key
                if computing and run.complete and not replaced:
                    return None, None  # its smoothed tracks are about to come
                # of another run that is about to come the first steps may take long
                over = not computing or (scored.final and not replaced)
                if self._newest != (scored.key, over):
                    self._newest, self._newest_since = (scored.key, over), time.monotonic()
                since = self._newest_since
                ready = (
                    since + SETTLED_SECONDS
                    if over
                    else max(self._not_before, since + SECONDS_BETWEEN)
                )
                wait = ready - time.monotonic()
                return (scored, None) if wait <= 0.0 else (None, wait)
        return None, None

    def _work(self) -> None:
        be_nice()
        while True:
            with self._condition:
                while True:
                    if self._closed:
                        return
                    scored, seconds = self._next(self._workbench.snapshot())
                    if scored is not None:
                        break
                    self._condition.wait(seconds)
            begin = time.monotonic()
            try:
                evaluation = self._score(scored)
            except Exception as error:
                logger.exception("scoring a run failed")
                self._failed.add(_named(scored))
                self._workbench.notify(
                    "error",
                    f"The tracks were not scored against the truth: {sentence(error)}",
                    "Tracks and export are as they were.",
                )
            else:
                self._workbench.scored(replace(scored, evaluation=evaluation))
            end = time.monotonic()
            self._not_before = end + max(SECONDS_BETWEEN, (end - begin) / SHARE)


def _named(scored: Scored) -> tuple[str, int, bool]:
    """What tells the states of a run apart that are scored one after the other."""
    return scored.key, scored.steps, scored.final
