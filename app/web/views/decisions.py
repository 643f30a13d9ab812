"""What hindsight made otherwise than the filter: tracks that were cut, joined or removed."""

from __future__ import annotations

from tracker.runs.run import Run
from tracker.smoothing import Decision, names_of


def decided(run: Run) -> list[tuple[int, int, Decision]]:
    """Step, id and what was decided, of every track that has an id; those of the filter alone are
    named by the filter's."""
    if run.smoothed is None or run.tracks is run.filtered:
        return []
    names = dict(zip(run.filtered.labels.tolist(), run.filtered.ids.tolist(), strict=True))
    names |= names_of(run.smoothed, run.tracks)
    return [
        (decision.step, names[decision.label], decision)
        for decision in run.smoothed.decisions
        if decision.label in names
    ]


def words_of(run: Run) -> dict[tuple[int, int, str], str]:
    """Why, of each decision by step, id and kind: "joined: one person, 0.97 against 0.02"."""
    return {
        (step, name, one.kind): (
            f"{one.kind}: {one.reason}, {one.probability:.2f} against {one.against:.2f}"
        )
        for step, name, one in decided(run)
    }
