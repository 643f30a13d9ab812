"""What is reported of the open sequence and its run: opened, begun, how far, how it ended."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Literal

from app.state.scores import Scored, Scores
from app.state.snapshot import (
    Opening,
    RunState,
)
from app.state.store import Store
from tracker.corrections import Correction
from tracker.parameters.catalogue import RunParameters
from tracker.runs.pipeline import Progress, Run
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence


class ShownRun(Store):
    """The part of the state that those who open, compute and score report to."""

    def __init__(self) -> None:
        super().__init__()
        self._last_good: Run | None = None

    def set_opening(self, opening: Opening | None) -> None:
        """How far the opening of a sequence is; None: it is over."""
        with self._edit() as now:
            if opening != now.opening:
                self._put("opening", opening=opening)

    def open(
        self,
        sequence: Sequence,
        key: str,
        reader: FrameReader,
        parameters: RunParameters,
        opened_as: str = "",
        corrections: tuple[Correction, ...] = (),
        chosen: RunParameters | None = None,
    ) -> FrameReader | None:
        """Show another sequence, from its first step; the reader of the one before, to be closed.

        Args:
            sequence: It has been read and checked.
            key: Another for every content.
            reader: Its pictures.
            parameters: Its default parameters.
            opened_as: The name or folder that opens it again; its own name where none is given.
            corrections: Those of its log.
            chosen: What its parameters begin with; its defaults, where none are given.
        """
        with self._edit() as now:
            before = now.reader
            self._last_good = None
            self._put(
                "sequence",
                sequence=sequence,
                saved=sequence,
                editing_room=False,
                opened_as=opened_as or sequence.name,
                sequence_key=key,
                reader=reader,
                opening=None,
                parameters=chosen or parameters,
                defaults=parameters,
                corrections=corrections,
                parameters_origin="",
                playhead=0,
                playhead_origin="",
                sought=False,
                selection=None,
                view=None,
                run=None,
                run_state=RunState(total=sequence.frames),
                scores=Scores(),
                offers=None,
            )
            return before

    def run_begins(self, key: str, message: str = "") -> None:
        """The parameters ask for the run with this key: from now on only its news count.

        Args:
            key: The run's.
            message: What it waits for, where it cannot begin at once.
        """
        with self._edit() as now:
            total = now.sequence.frames if now.sequence is not None else 0
            state = RunState(key=key, state="computing", total=total, message=message)
            self._put("run", run_state=state)

    def run_waits(self, key: str, message: str) -> None:
        """The run with this key comes no further for now, and why: it has no speed meanwhile."""
        with self._edit() as now:
            if key == now.run_state.key and message != now.run_state.message:
                waits = replace(
                    now.run_state, message=message, steps_per_second=0.0, seconds_left=None
                )
                self._put("progress", run_state=waits)

    def run_progresses(self, run: Run, progress: Progress) -> None:
        """A run has new steps; from its first step on it is the one that is shown."""
        with self._edit() as now:
            if run.key != now.run_state.key:  # superseded
                return
            state = replace(
                now.run_state,
                done=progress.done,
                total=progress.total,
                steps_per_second=progress.steps_per_second,
                seconds_left=progress.seconds_left,
                message=progress.stage.replace("_", " "),
            )
            if now.run is not run and (progress.done or now.run is None):
                self._put("run", run=run, run_state=state)
            else:
                self._put("progress", run_state=state)

    def run_ends(
        self,
        key: str,
        phase: Literal["done", "cancelled", "failed"],
        error: str | None = None,
        warnings: Iterable[str] = (),
    ) -> None:
        """The run with this key is over; after a failure the last good one is shown again.

        Where none was finished yet, what was shown stays: an unfinished run says more than none.

        Args:
            key: The run's.
            phase: How it ended.
            error: Why it failed, in one sentence.
            warnings: What its result lacks, a sentence each.
        """
        with self._edit() as now:
            if key != now.run_state.key:  # superseded
                return
            run = now.run
            if phase == "failed":
                run = self._last_good or run
            elif phase == "done":
                self._last_good = run
            state = replace(
                now.run_state,
                state=phase,
                seconds_left=None,
                message="",
                error=error,
                warnings=tuple(warnings),
            )
            self._put("run", run=run, run_state=state)

    def show_instead(self, run: Run) -> None:
        """Show a run that is done in the place of the one that is asked for."""
        with self._edit() as now:
            if now.sequence is run.sequence:
                self._last_good = run
                self._put("run", run=run)

    def show_kept(
        self, run: Run, number: int, stands_for: str = "", warnings: Iterable[str] = ()
    ) -> None:
        """Show a run of the library with its parameters, in one change.

        Args:
            run: Its tracks; of the open recording.
            number: Its number in the library.
            stands_for: The key that a computation with its values would have, if another.
            warnings: What of it cannot be shown, a sentence each.
        """
        with self._edit() as now:
            if now.sequence is None or run.sequence is not now.sequence:
                return
            state = RunState(
                key=run.key,
                state="done",
                done=run.done,
                total=now.sequence.frames,
                kept=number,
                stands_for=stands_for,
                warnings=tuple(warnings),
            )
            self._last_good = run
            self._put("run", run=run, run_state=state, parameters=run.parameters)
            self._pending.append("parameters")

    def scored(self, scored: Scored) -> None:
        """A run was scored against the truth."""
        with self._edit() as now:
            if now.sequence is None or scored.sequence.views is not now.sequence.views:
                return
            pinned = now.scores.pinned
            if now.run is not None and scored.key == now.run.key:
                self._put("evaluation", scores=now.scores.add(scored))
            elif pinned is not None and scored.key == pinned.key:
                self._put("evaluation", scores=now.scores.pin(scored))
