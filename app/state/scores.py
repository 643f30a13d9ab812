"""The runs that have been scored: the shown one, the one before it, the pinned one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from tracker.evaluation import Evaluation
from tracker.fusion.trajectories import Trajectories
from tracker.parameters.catalogue import RunParameters
from tracker.runs.pipeline import Run
from tracker.sequences.sequence import Sequence

Reference = Literal["pinned", "previous"]
"""What the shown run is set against: the pinned one, else the finished one before it."""


@dataclass(frozen=True, slots=True, eq=False)
class Scored:
    """A run's tracks and their figures; without what the cameras found, which is large."""

    key: str
    sequence: Sequence
    parameters: RunParameters
    seed: int
    tracks: Trajectories
    steps: int
    """Steps 0 … ``steps`` − 1 are there."""
    revision: int
    """Of the run's tracks, as :attr:`Run.revision` counts them."""
    final: bool
    """Whether these are the tracks that a finished run ended with: of all steps, smoothed and
    corrected. Figures of any others are provisional."""
    evaluation: Evaluation | None = None
    """None until it is made, and where there is no truth."""

    @staticmethod
    def of(run: Run) -> Scored:
        """A run as far as it is computed, not scored yet."""
        # in this order: the tracks may grow and be smoothed meanwhile
        final, steps, revision = run.finished, run.done, run.revision
        return Scored(
            run.key, run.sequence, run.parameters, run.seed, run.tracks, steps, revision, final
        )

    def is_of(self, run: Run) -> bool:
        """Whether these are the tracks of a run as they are now, at least of its first steps."""
        return self.key == run.key and self.revision == run.revision

    def is_final_of(self, run: Run) -> bool:
        """Whether the figures are those of a finished run: made of the tracks that it ended with.

        Only such a figure is stored, exported, or compared with another run's.
        """
        return self.evaluation is not None and self.final and self.tracks is run.tracks


@dataclass(frozen=True, slots=True, eq=False)
class Scores:
    """All of them, as an immutable value: :meth:`add` and :meth:`pin` return another."""

    shown: Scored | None = None
    """The newest that was scored; while a run computes, this may be the one before."""
    finished: Scored | None = None
    """The last one of a finished run."""
    previous: Scored | None = None
    """The one of a finished run before that, with other parameters."""
    pinned: Scored | None = None

    def add(self, scored: Scored) -> Scores:
        """With one that has just been scored."""
        new = self
        if self.pinned is not None and self.pinned.key == scored.key and scored.final:
            new = replace(new, pinned=scored)
        if scored.final:
            before = self.finished
            if before is not None and before.key != scored.key:
                new = replace(new, previous=before)
            new = replace(new, finished=scored)
        return replace(new, shown=scored)

    def pin(self, scored: Scored) -> Scores:
        """With one pinned; figures that it has already are taken along."""
        if scored.evaluation is None:
            for known in (self.previous, self.finished):
                if known is not None and known.key == scored.key:
                    scored = known
        return replace(self, pinned=scored)

    @property
    def reference(self) -> tuple[Reference, Scored] | None:
        """What the shown run is set against, if there is anything."""
        if self.pinned is not None:
            return "pinned", self.pinned
        return ("previous", self.before) if self.before is not None else None

    @property
    def before(self) -> Scored | None:
        """The last finished run with other parameters than the shown one's."""
        shown, finished = self.shown, self.finished
        if shown is not None and finished is not None and shown.key == finished.key:
            return self.previous
        return finished
