"""Truths and tracks to score: walks, perturbed truths, the real recordings, one by hand."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import strategies as st

from tests import world
from tracker.evaluation.matching import Comparison, GatedDistance, prepare
from tracker.geometry.camera import Camera
from tracker.sequences.reader import read_sequence
from tracker.sequences.sequence import GroundTruth, Sequence

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
HALF_EXTENTS = world.PERSON
CAMERA = Camera(
    "front", (640, 480), np.array([[500.0, 0, 320], [0, 500, 240], [0, 0, 1]]),
    np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]), np.array([-2.0, 1.0, 5.0]), np.zeros(5),
)  # fmt: skip


@dataclass(frozen=True)
class Columns:
    """Tracks as plain columns."""

    frames: np.ndarray
    ids: np.ndarray
    positions: np.ndarray


def recording(name: str) -> Sequence:
    """A real recording; the test is skipped where the recordings are not at hand."""
    if not (DATA / name / "sequence.toml").exists():
        pytest.skip(f"the recording {name} is not beside the checkout (../shared/data)")
    return read_sequence(DATA / name)


def truth_of(rows: list[tuple[int, int, float, float, float]], valid: Any = True) -> GroundTruth:
    """A truth from rows of step, id, x, y, z."""
    columns = tracks_of(rows)
    certain = np.broadcast_to(np.asarray(valid, dtype=bool), len(rows)).copy()
    return GroundTruth(columns.frames, columns.ids, columns.positions, certain)


def tracks_of(rows: list[tuple[int, int, float, float, float]]) -> Columns:
    """Tracks from rows of step, id, x, y, z."""
    table = np.array(rows, dtype=float).reshape(-1, 5)
    return Columns(table[:, 0].astype(int), table[:, 1].astype(int), table[:, 2:])


def columns_of(truth: GroundTruth) -> Columns:
    """The truth as if it were tracks."""
    return Columns(truth.frames, truth.ids, truth.positions)


def walks(seed: int, *, people: int = 4, steps: int = 40, uncertain: float = 0.0) -> GroundTruth:
    """People who walk at random through a room, come late, leave, and some come back."""
    rng = np.random.default_rng(seed)
    paths = world.together(*(world.wander(rng, steps) for _ in range(people)))
    paths += np.array([2.0, 2.0, 0.0])
    for person in range(people):
        first, last = np.sort(rng.integers(0, steps, 2))
        away = (slice(0), slice(first), slice(first, last))[person % 3]
        paths[away, person] = np.nan
    truth = world.truth(paths, 7 * np.arange(people) + 3)
    return replace(truth, valid=rng.random(len(truth.frames)) >= uncertain)


def perturbed(
    truth: GroundTruth,
    seed: int,
    *,
    noise: float = 0.15,
    missing: float = 0.1,
    false: float = 0.5,
    swaps: int = 4,
) -> Columns:
    """What a fair tracker would make of a truth: noise, misses, swapped ids, false tracks."""
    rng = np.random.default_rng(seed)
    names, index = np.unique(truth.ids, return_inverse=True)
    steps = int(truth.frames.max()) + 1
    labels = np.tile(100 + np.arange(len(names)), (steps, 1))
    for _ in range(swaps):
        when, (a, b) = rng.integers(steps), rng.choice(len(names), 2, replace=False)
        labels[when:, [a, b]] = labels[when:, [b, a]]
    kept = rng.random(len(truth.frames)) >= missing
    positions = truth.positions + rng.normal(0.0, noise, truth.positions.shape)
    low, high = truth.positions.min(axis=0) - 1.0, truth.positions.max(axis=0) + 1.0
    starts = np.flatnonzero(rng.random(steps) < false / 4.0)
    ghosts = [
        (step, 500 + k, *(place + rng.normal(0.0, 0.1, 3)))
        for k, start in enumerate(starts)
        for place in [rng.uniform(low, high)]
        for step in range(start, min(start + 1 + int(rng.integers(7)), steps))
    ]
    extra = tracks_of(ghosts)
    return Columns(
        np.concatenate([truth.frames[kept], extra.frames]),
        np.concatenate([labels[truth.frames, index][kept], extra.ids]),
        np.concatenate([positions[kept], extra.positions]),
    )


def scattered(seed: int, *, ids: int, steps: int, share: float = 0.6, size: float = 3.0) -> Columns:
    """Every id at some of the steps, anywhere: no structure at all."""
    rng = np.random.default_rng(seed)
    frames, names = np.nonzero(rng.random((steps, ids)) < share)
    return Columns(frames, names + 1, rng.uniform(0.0, size, (len(frames), 3)))


def as_truth(columns: Columns) -> GroundTruth:
    """Columns as a truth that is certain throughout."""
    return GroundTruth(
        columns.frames, columns.ids, columns.positions, np.ones(len(columns.frames), dtype=bool)
    )


def comparison(
    truth: GroundTruth | None,
    tracks: Any,
    *,
    gate: float = 1.0,
    distance: Any = "position",
    steps: int | None = None,
    half_extents: np.ndarray = HALF_EXTENTS,
) -> Comparison:
    """Both sides with "don't care" set aside."""
    if steps is None:
        frames = [t.frames for t in (truth, tracks) if t is not None and len(t.frames)]
        steps = max((int(f.max()) for f in frames), default=-1) + 1
    return prepare(truth, tracks, GatedDistance(distance, gate, half_extents), steps=steps)


def by_hand() -> tuple[GroundTruth, Columns]:
    """Two people and three tracks over four steps, on the line y = 0, z = 1.

    ====  ===========  ==================================
    step  people       tracks
    ====  ===========  ==================================
    0     1: 0   2: 5  10: 0.1            20: 5.4
    1     1: 0   2: 5  10: 0.3
    2     1: 0   2: 5  10: 5.2 (swapped)  20: 0.2
    3     1: 0   2: 5  10: 5.2            30: 9.0 (false)
    ====  ===========  ==================================
    """
    truth = truth_of([(t, k, x, 0.0, 1.0) for t in range(4) for k, x in ((1, 0.0), (2, 5.0))])
    places = [
        (0, 10, 0.1), (0, 20, 5.4), (1, 10, 0.3), (2, 10, 5.2), (2, 20, 0.2), (3, 10, 5.2),
        (3, 30, 9.0),
    ]  # fmt: skip
    return truth, tracks_of([(t, k, x, 0.0, 1.0) for t, k, x in places])


@st.composite
def point_sets(draw: st.DrawFn, most: int = 5) -> np.ndarray:
    """A few points in a small room, or none."""
    count = draw(st.integers(0, most))
    coordinate = st.floats(-2.0, 2.0, allow_nan=False, width=32)
    rows = draw(st.lists(st.tuples(*[coordinate] * 3), min_size=count, max_size=count))
    return np.array(rows, dtype=float).reshape(-1, 3)


def distances(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Euclidean distances of all pairs."""
    return np.asarray(np.linalg.norm(first[:, None] - second[None], axis=2))
