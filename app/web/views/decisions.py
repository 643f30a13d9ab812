"""What smoothing made otherwise than the filter: tracks that were cut, joined or removed."""

from __future__ import annotations

from dataclasses import dataclass

from tracker.runs.run import Run
from tracker.smoothing import Decision, names_of


@dataclass(frozen=True, slots=True)
class Named:
    """A decision, with the ids of those whom it is about."""

    step: int
    track: int
    other: int | None
    """Whom it was joined to, or what was cut off; None where that has no id."""
    decision: Decision

    @property
    def words(self) -> str:
        """What was decided and why: "joined to 3 at 264: one person, 0.97 against 0.02"."""
        one = self.decision
        joined = one.kind == "joined" and self.other not in (None, self.track)
        whom = f" to {self.other}" if joined else ""
        odds = f"{one.probability:.2f} against {one.against:.2f}"
        return f"{one.kind}{whom} at {self.step}: {one.reason}, {odds}"


def decided(run: Run) -> list[Named]:
    """What was decided of every track that has an id; those of the filter alone are named by the
    filter's."""
    run = run.snapshot()
    if run.smoothed is None or run.tracks is run.filtered:
        return []
    names = dict(zip(run.filtered.labels.tolist(), run.filtered.ids.tolist(), strict=True))
    names |= names_of(run.smoothed, run.tracks)
    return [
        Named(one.step, names[one.label], names.get(one.other), one)
        for one in run.smoothed.decisions
        if one.label in names
    ]


def words_of(run: Run) -> dict[tuple[int, int, str], str]:
    """Why, of each decision by step, id and kind."""
    return {(one.step, one.track, one.decision.kind): one.words for one in decided(run)}
