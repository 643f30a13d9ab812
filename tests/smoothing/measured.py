"""People measured at some places, as the smoothing's kernel is given them."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy import ndarray

from tests.smoothing.known import PLAIN
from tracker.filters.models import Motion
from tracker.kernels.smoothing import passes
from tracker.kernels.smoothing.passes import SmoothedRows
from tracker.smoothing.paths import Paths
from tracker.smoothing.smoother import Fitted

STEP = 0.5
PRIOR = np.diag([100.0] * 3 + [0.7**2] * 3)


def measured(places: list[ndarray], sigma: float) -> tuple[Paths, partial[SmoothedRows]]:
    """Paths of people at some places, (T, 3) metres each, and what smooths them by how restless
    they are at each row."""
    motion = Motion.of(PLAIN.fusion, STEP)
    states = [np.hstack([own, np.zeros_like(own)]) for own in places]
    spread = [np.tile(np.eye(6), (len(own), 1, 1)) for own in places]
    paths = Paths.of(list(range(1, len(places) + 1)), [0] * len(places), states, spread, 6)
    matrices = np.tile(np.eye(3) / sigma**2, (len(paths.states), 1, 1))
    vectors = paths.states[:, :3] / sigma**2
    begins = paths.states[paths.starts[:-1]].copy()
    rule = passes.PathMotion(motion.transition, motion.noise, PRIOR)
    return paths, partial(passes.smooth_paths, paths.starts, begins, matrices, vectors, rule)


def fitted_to(paths: Paths, found: SmoothedRows, noise_scales: ndarray) -> Fitted:
    """Paths with what the kernel gave."""
    return Fitted(
        paths.with_states(found.means, found.covariances),
        found.fits, found.ahead, found.ahead_covariances, found.traces, noise_scales,
    )  # fmt: skip
