"""Who is whose at one step: true positions and estimates, paired as the evaluation pairs them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.evaluation import EvaluationSettings
from tracker.evaluation.matching import assign
from tracker.sequences.sequence import GroundTruth
from tracker.trajectories import Trajectories

GATE = float(EvaluationSettings().gate)
"""Metres: farther apart, nobody is taken for anybody."""


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
