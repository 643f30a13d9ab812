"""Many targets in the plane, linear and Gaussian: what every filter of the field can be fed.

People of this trade compare filters on such a scene: constant velocity, positions
measured, false alarms spread evenly, births at fixed places. The targets of the first
step are given to the filter, blurred, so that nothing has to warm up.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.optimize import linear_sum_assignment

EXTENT = 1000.0
"""The scene is the square from −EXTENT to EXTENT, metres."""

SURVIVAL, DETECTION = 0.99, 0.98
CLUTTER_RATE = 60.0
"""False alarms a step."""
SIGMA = 10.0
"""Standard deviation of a measured coordinate, of a birth's place and of its speed."""
ACCELERATION = 5.0
"""Standard deviation, m/s²: the filter's only; the truth flies straight on."""

TRANSITION = np.kron(np.eye(2), np.array([[1.0, 1.0], [0.0, 1.0]]))
_GAIN = np.kron(np.eye(2), np.array([[0.5], [1.0]]))
MOTION_NOISE = ACCELERATION**2 * _GAIN @ _GAIN.T
POSITION = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])
"""State x, v_x, y, v_y → what is measured."""
NOISE = SIGMA**2 * np.eye(2)
START = SIGMA**2 * np.eye(4)
"""Covariance of the first targets and of births."""

PRUNING, MERGING = 1e-5, 4.0
CUTOFF = 100.0
"""Of OSPA, metres; its order is 1."""


@dataclass(frozen=True, slots=True, eq=False)
class Scenario:
    """What happens, and what the filter is told beforehand."""

    targets: int
    """About so many are alive at every step."""
    first: Float[ndarray, "N 4"]
    """The targets alive at the start, blurred by :data:`START`."""
    births: Float[ndarray, "S 4"]
    """Mean of each place of birth."""
    birth_weight: float
    """Expected births a place and step."""
    truth: list[Float[ndarray, "T 4"]]
    measurements: list[Float[ndarray, "M 2"]]

    @property
    def clutter_intensity(self) -> float:
        """κ, per square metre."""
        return CLUTTER_RATE / (2.0 * EXTENT) ** 2

    @property
    def most_components(self) -> int:
        """J_max: two a target."""
        return max(100, 2 * self.targets)


def scenario(targets: int, steps: int, seed: int = 1) -> Scenario:
    """About ``targets`` targets over some steps."""
    rng = np.random.default_rng([seed, targets, int(CLUTTER_RATE), 7])
    places = max(4, targets // 5)
    births = np.zeros((places, 4))
    births[:, [0, 2]] = rng.uniform(-0.9 * EXTENT, 0.9 * EXTENT, (places, 2))
    rate = (1.0 - SURVIVAL) * targets
    alive = np.zeros((targets, 4))
    alive[:, [0, 2]] = rng.uniform(-0.9 * EXTENT, 0.9 * EXTENT, (targets, 2))
    alive[:, [1, 3]] = rng.normal(0.0, SIGMA, (targets, 2))
    first = alive + rng.normal(0.0, SIGMA, alive.shape)
    truth, measurements = [], []
    for _ in range(steps):
        alive = alive @ TRANSITION.T
        stays = rng.random(len(alive)) < SURVIVAL
        alive = alive[stays & (np.abs(alive[:, [0, 2]]) < EXTENT).all(axis=1)]
        count = rng.poisson(rate)
        if count:
            place = rng.integers(0, places, count)
            alive = np.concatenate([alive, births[place] + rng.normal(0.0, SIGMA, (count, 4))])
        seen = alive[rng.random(len(alive)) < DETECTION]
        measured = seen[:, [0, 2]] + rng.normal(0.0, SIGMA, (len(seen), 2))
        false = rng.uniform(-EXTENT, EXTENT, (rng.poisson(CLUTTER_RATE), 2))
        scan = np.concatenate([measured, false])
        rng.shuffle(scan)
        truth.append(alive)
        measurements.append(scan)
    return Scenario(targets, first, births, rate / places, truth, measurements)


def ospa(found: Float[ndarray, "F 2"], true: Float[ndarray, "T 2"]) -> float:
    """OSPA of order 1 with the cut-off :data:`CUTOFF`, metres (Schuhmacher, Vo, Vo 2008)."""
    few, many = sorted((len(found), len(true)))
    if many == 0:
        return 0.0
    if few == 0:
        return CUTOFF
    distances = np.linalg.norm(found[:, None] - true[None], axis=2)
    costs = np.minimum(distances, CUTOFF)
    total = costs[linear_sum_assignment(costs)].sum() + CUTOFF * (many - few)
    return float(total / many)
