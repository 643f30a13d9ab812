"""Small runs and libraries for tests."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np

from tracker.fusion.trajectories import Trajectories
from tracker.library.columns import KeptTracks
from tracker.library.records import NewRecording, NewRun
from tracker.library.store import Library
from tracker.parameters.catalogue import RunParameters

RECORDING = NewRecording("room44-3p", "room44-3p", "rendered", "d", 2, 500, 25.0, True, False, 3)


def tracks(steps: int = 40, people: int = 3, *, cameras: int = 2, seed: int = 0) -> KeptTracks:
    """People who wander, all of them at all steps."""
    rng = np.random.default_rng(seed)
    count = steps * people
    ways = rng.normal(0.0, 0.02, (steps, people, 3)).cumsum(axis=0)
    ways[:, :, 2] += 0.9
    sigmas = rng.uniform(0.02, 0.06, (count, 3))
    correlations = np.repeat(0.6 * np.sin(np.arange(steps) / 50.0), people)
    rows = Trajectories(
        frames=np.repeat(np.arange(steps), people),
        ids=np.tile(np.arange(1, people + 1), steps),
        positions=ways.reshape(-1, 3),
        existences=1.0 - 10.0 ** rng.uniform(-9.0, -1.0, count),
        sigmas=sigmas,
        seen=rng.random((count, cameras)) > 0.1,
        components=np.tile(np.arange(people), steps),
        labels=np.tile(np.arange(people) + 40, steps),
        covariances_xy=correlations * sigmas[:, 0] * sigmas[:, 1],
        heights=np.tile(np.linspace(1.5, 1.9, people), steps),
        sigma_heights=np.tile(np.linspace(0.1, 0.01, people), steps),
    )
    probabilities = np.where(rng.random((count, cameras)) < 0.7, 0.95, rng.random((count, cameras)))
    return KeptTracks(rows, probabilities.round(3))


KEPT = tracks()


def run(number: int, *, kept: KeptTracks = KEPT, **values: object) -> NewRun:
    """A run that differs from others by its number."""
    return NewRun(
        **{
            "key": f"key-{number}",
            "digest": "d",
            "began": 1000.0 + number,
            "seconds": 2.0,
            "steps": int(kept.tracks.frames[-1]) + 1,
            "single_view": "colour_phd",
            "fusion_method": "multi_bernoulli",
            "changes": {"fusion.clutter_rate": 1.5},
            "parameters": RunParameters().model_dump(mode="json"),
            "seed": 0,
            "version": "0.1.0",
            "code": "c",
            "machine": "m",
            "source": "track",
            "targets": 3,
            "figures": {"mota": 0.9, "idf1": 0.8, "hota": None, "ospa": 0.1, "misses": 4},
            "kept": kept,
            **values,
        }  # type: ignore[arg-type]
    )


def filled(path: Path, count: int) -> Library:
    """A library with runs 1 … count."""
    library = Library(path)
    for number in range(count):
        library.keep(RECORDING, run(number))
    return library


def made_by_the_version_before(path: Path) -> None:
    """Have the file as it was before it told final figures from provisional ones."""
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        for column in ("final", "latest", "taught"):
            connection.execute(f"ALTER TABLE runs DROP COLUMN {column}")
        connection.execute("PRAGMA user_version = 2")
