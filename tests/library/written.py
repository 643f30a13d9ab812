"""A run of two people who cross a room, found a few centimetres beside where they are."""

from __future__ import annotations

import dataclasses

import numpy as np

from tests.engine import synthetic
from tracker.export.exported_run import ExportedRun
from tracker.fusion.trajectories import Trajectories
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.values import with_values
from tracker.sequences.sequence import GroundTruth, Sequence

STEPS = 60


def sequence(steps: int = STEPS) -> Sequence:
    """With a truth, of which a few positions are not certain."""
    made = synthetic.sequence(synthetic.crossing(steps), steps)
    truth = made.ground_truth
    assert truth is not None
    doubtful = GroundTruth(truth.frames, truth.ids, truth.positions, truth.frames % 17 != 3)
    return dataclasses.replace(made, ground_truth=doubtful)


def written(steps: int = STEPS) -> ExportedRun:
    """Tracks with errors, a gap, a switch and a false one."""
    of = sequence(steps)
    truth = of.ground_truth
    assert truth is not None
    rng = np.random.default_rng(3)
    ids = np.where(truth.frames > steps // 2, 3 - truth.ids % 2, truth.ids % 2 + 1)
    kept = (rng.random(len(ids)) > 0.1) & ~((truth.frames > 20) & (truth.frames < 24))
    frames = np.append(truth.frames[kept], np.arange(5, 9))
    ids = np.append(ids[kept], np.full(4, 9))
    places = truth.positions[kept] + rng.normal(0.0, 0.15, (int(kept.sum()), 3))
    places = np.concatenate([places, np.full((4, 3), [1.0, -1.2, 1.0])])
    order = np.lexsort((ids, frames))
    count = len(order)
    tracks = Trajectories(
        frames=frames[order],
        ids=ids[order],
        positions=places[order],
        existences=rng.uniform(0.5, 1.0, count),
        sigmas=rng.uniform(0.02, 0.06, (count, 3)),
        seen=rng.random((count, len(of.views))) > 0.2,
        components=np.zeros(count, dtype=np.int64),
        labels=ids[order] + 40,
        covariances_xy=rng.uniform(-4e-4, 4e-4, count),
        heights=np.linspace(1.5, 1.9, count),
        sigma_heights=np.linspace(0.1, 0.01, count),
    )
    parameters = with_values(RunParameters(), {"fusion.survival_probability": 0.97})
    return ExportedRun(of, tracks, parameters, seed=5)
