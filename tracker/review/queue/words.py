"""What is asked of a doubtful moment, as a person reads it."""

from __future__ import annotations

import numpy as np

from tracker.review.queue.linking import Move
from tracker.runs.run import Run


def words_of(run: Run, move: Move) -> tuple[str, str]:
    """The question and why it is asked: a title, and a sentence without its full stop."""
    i, j = move.earlier[0], move.later[-1]
    far = _far(run, i.track, j.track, i.last, j.first)
    if move.kind == "gap":
        seconds = (j.first - i.last) * run.sequence.step_time
        return f"{i.track} is gone for {seconds:.1f} s", move.why
    if move.kind == "fast":
        return f"{i.track} jumps", move.why
    if move.kind == "crossing":
        return f"{i.track} and {j.track} pass closely", move.why
    if move.joins:
        return f"{i.track} goes on as {j.track}?", f"{i.track} ends and {j.track} begins {far}"
    if move.kind == "cut":
        return f"{i.track} is two people?", f"after step {i.last} it goes on {far}"
    others = [one.track for one in (*move.earlier, *move.later) if one.track != i.track]
    if not others:
        return f"{i.track} goes on elsewhere?", f"another piece of {i.track} fits, {far}"
    if i.track != j.track:
        return (
            f"{i.track} and {j.track} exchanged?",
            f"{j.track} is where {i.track} may have gone on, {far}",
        )
    other = others[0]
    return (
        f"{i.track} and {other} exchanged?",
        f"{other} fits what {i.track} does from step {j.first} on",
    )


def _far(run: Run, one: int, other: int, last: int, first: int) -> str:
    """How far apart in space and time two pieces are."""
    tracks, ground = run.tracks, []
    for track, step in ((one, last), (other, first)):
        own = np.flatnonzero(tracks.ids == track)
        nearest = own[np.argmin(np.abs(tracks.frames[own] - step))]
        ground.append(tracks.positions[nearest, :2])
    metres = float(np.hypot(*(ground[1] - ground[0])))
    seconds = (first - last) * run.sequence.step_time
    away = "at the same place" if metres < 0.05 else f"{metres:.1f} m away"
    if seconds < 0.0:
        return f"{away}, {-seconds:.1f} s before that"
    return f"{away}, {seconds:.1f} s later"
