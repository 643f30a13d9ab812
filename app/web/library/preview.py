"""A kept run in small: lanes, people, and its tracks' ways from above."""

from __future__ import annotations

import numpy as np

from app.models import TrackLife
from app.web.library.models import Course
from app.web.views.timeline import Window, lives_of
from tracker.fusion.trajectories import Trajectories
from tracker.library.keeping import stride

BUCKETS = 600
"""Values a curve and a lane: as wide as it is drawn."""

POINTS_A_SECOND = 4
"""Of a track's way."""


def lanes(tracks: Trajectories, steps: int, fps: float) -> list[TrackLife]:
    """The tracks' lives, as wide as they are drawn."""
    return lives_of(tracks, steps, fps, Window.of(steps, buckets=BUCKETS))


def people(tracks: Trajectories, steps: int) -> list[float]:
    """The mean number of targets in each of equally many steps."""
    count = np.bincount(tracks.frames, minlength=steps)[:steps]
    starts = np.arange(0, steps, stride(steps, BUCKETS))
    sizes = np.diff(np.append(starts, steps))
    mean: list[float] = (np.add.reduceat(count, starts) / sizes).round(2).tolist() if steps else []
    return mean


def courses(tracks: Trajectories, fps: float) -> list[Course]:
    """Each track's way, a few points a second."""
    every = max(1, round(fps / POINTS_A_SECOND))
    found = []
    for number in np.unique(tracks.ids).tolist():
        rows = np.flatnonzero(tracks.ids == number)
        points = tracks.positions[rows[:: every if len(rows) > every else 1], :2].round(2)
        found.append(Course(id=number, points=[(x, y) for x, y in points.tolist()]))
    return found
