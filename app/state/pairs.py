"""Who is whose: true positions and estimates at a step, and the tracks of two runs."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.evaluation import EvaluationSettings
from tracker.evaluation.matching import assign
from tracker.fusion.trajectories import Trajectories
from tracker.sequences.sequence import GroundTruth

GATE = float(EvaluationSettings().gate)
"""Metres: farther apart, nobody is taken for anybody."""

COMPARED_STEPS = 400
"""About so many steps tell which tracks of two runs are of one person."""


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """Pairs at one step, by their places among the people and the estimates of the step."""

    people: Int[ndarray, " M"]
    estimates: Int[ndarray, " M"]
    errors: Float[ndarray, " M"]
    """Distances in metres."""


def pairs_at(truth: GroundTruth | None, tracks: Trajectories, step: int) -> Pairs:
    """Pair the people of a step with its estimates, at most one to one and nobody beyond the gate.

    Without truth, people or estimates there are no pairs.
    """
    people = truth.positions[truth.at(step)] if truth is not None else np.zeros((0, 3))
    estimates = tracks.positions[tracks.at(step)]
    distances = np.linalg.norm(people[:, None] - estimates[None], axis=2)
    rows, columns = assign(distances, GATE)
    return Pairs(rows, columns, distances[rows, columns])


def alike(first: Trajectories, second: Trajectories, steps: int) -> dict[int, int]:
    """The track of a second run that is most often paired with each track of a first one.

    Args:
        first: Whose ids are looked up.
        second: Whose ids are found; one may be found for several.
        steps: Steps 0 … ``steps`` − 1 are compared, a few hundred of them.

    Returns:
        By the first run's ids; tracks that are never near one of the second are missing.
    """
    counts: Counter[tuple[int, int]] = Counter()
    for step in range(0, steps, max(1, steps // COMPARED_STEPS)):
        a, b = first.at(step), second.at(step)
        distances = np.linalg.norm(first.positions[a][:, None] - second.positions[b][None], axis=2)
        rows, columns = assign(distances, GATE)
        counts.update(
            zip(first.ids[a][rows].tolist(), second.ids[b][columns].tolist(), strict=True)
        )
    found: dict[int, int] = {}
    for (one, other), _ in counts.most_common():
        found.setdefault(one, other)
    return found
