"""Entrances that a run's tracks tell of."""

from __future__ import annotations

from tracker.geometry.consistency.entrances import Door, not_yet_there, suggest_entrances
from tracker.runs.run import Run


def entrances_of(run: Run) -> list[Door]:
    """Where the tracks of a run begin and end, without what its room has already."""
    tracks = run.tracks
    found = suggest_entrances(
        tracks.frames, tracks.ids, tracks.positions, steps=run.done, fps=run.sequence.fps
    )
    return not_yet_there(found, [entrance.position for entrance in run.sequence.room.entrances])
