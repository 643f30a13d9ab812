"""Walkers whose boxes are known to be theirs, and people measured at some places."""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy import ndarray

from tests import world
from tracker.filters.models import Motion
from tracker.fusion.protocol import Associations, FusionResult
from tracker.geometry.camera import Camera
from tracker.kernels.smoothing import passes
from tracker.kernels.smoothing.passes import SmoothedRows
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.values import with_values
from tracker.sequences.sequence import Sequence
from tracker.single_view.protocol import ViewResult
from tracker.smoothing.paths import CameraBoxes, Links, Paths
from tracker.smoothing.smoother import Fitted, Smoother

CAMERAS = world.ring(3)
PLAIN = with_values(
    RunParameters(single_view="none"), {"fusion.posture_share": 0.0, "smoothing.learning": False}
)

Step = tuple[ViewResult, ...]


@dataclass(frozen=True)
class Known:
    """Walkers, their boxes, and which box is whose."""

    whole: Sequence
    seen: list[world.Boxes]
    """The boxes of each camera; every one is a person's."""
    places: ndarray
    """(steps, people, 3), NaN where a person is not followed."""

    @property
    def views(self) -> list[Step]:
        """Stage 1 of every step."""
        return world.views(self.seen)

    def smoother(self, parameters: RunParameters = PLAIN, **changes: bool) -> Smoother:
        """With all boxes."""
        learning = parameters.smoothing.learning
        values = {"learning": learning, **changes}
        return Smoother(self.whole, parameters.fusion, self.views, **values)

    def paths(self, sigma: float = 1.0) -> tuple[Paths, Links]:
        """A path a person from the first place to the last, at rest, and all boxes as theirs."""
        first, states = [], []
        for person in range(self.places.shape[1]):
            there = np.flatnonzero(np.isfinite(self.places[:, person, 0]))
            first.append(int(there[0]))
            own = self.places[there[0] : there[-1] + 1, person]
            states.append(np.hstack([own, np.zeros_like(own)]))
        spread = [np.tile(sigma**2 * np.eye(6), (len(own), 1, 1)) for own in states]
        paths = Paths.of(list(range(1, len(states) + 1)), first, states, spread, 6)
        cameras = np.repeat(np.arange(len(self.seen)), [len(one.frames) for one in self.seen])
        boxes = np.concatenate([np.arange(len(one.frames)) for one in self.seen])
        people = np.concatenate([one.people for one in self.seen])
        frames = np.concatenate([one.frames for one in self.seen])
        rows = paths.starts[people] + frames - paths.firsts[people]
        return paths, Links(cameras, rows, boxes, np.ones(len(rows)))

    def fused(self, labels: ndarray) -> list[FusionResult]:
        """Stage 2 of every step: everybody at the place, under a label; of label -1 nobody.

        Args:
            labels: (steps, people).
        """
        results = []
        for step, (places, names) in enumerate(zip(self.places, labels, strict=True)):
            there = np.flatnonzero((names >= 0) & np.isfinite(places[:, 0]))
            posterior = world.gaussians(places[there], weights=0.99, sigma=0.05)
            posterior = posterior.relabelled(
                dict(zip(posterior.labels.tolist(), names[there].tolist(), strict=True))
            )
            sources = np.full((len(self.seen), len(there)), -1, dtype=np.int64)
            for c, one in enumerate(self.seen):
                own = one.people[slice(*np.searchsorted(one.frames, [step, step + 1]).tolist())]
                for component, person in enumerate(there.tolist()):
                    sources[c, component] = next(iter(np.flatnonzero(own == person)), -1)
            cameras, components = np.nonzero(sources >= 0)
            pairs = Associations(
                cameras.astype(np.int32), components.astype(np.int32),
                sources[cameras, components].astype(np.int32), np.ones(len(cameras), np.float32),
            )  # fmt: skip
            weights = (sources >= 0).astype(float)
            nobody = np.full_like(sources, -1)
            results.append(
                FusionResult(posterior, 0.95 + 0.0 * weights, sources, weights, nobody, pairs)
            )
        return results


def known(
    places: ndarray,
    *,
    cameras: Many[Camera] = CAMERAS,
    sigma: float = 2.0,
    seed: int = 0,
    fps: float = 10.0,
    hidden: world.Hidden = lambda camera, person, step: False,
) -> Known:
    """Walkers of some paths, (steps, people, 3), whom every camera sees but where it does not."""
    rng = np.random.default_rng(seed)
    seen = world.boxes(cameras, places, sigma, rng, hidden=hidden)
    return Known(world.sequence(cameras, places, seen, fps=fps), seen, places)


def backwards(forward: Known) -> Known:
    """The last step first."""
    last = len(forward.places) - 1
    seen = []
    for one in forward.seen:
        order = np.argsort(last - one.frames, kind="stable")
        rows = one.boxes[order], one.sigmas[order], one.people[order]
        seen.append(world.Boxes(last - one.frames[order], *rows, one.steps))
    places = forward.places[::-1]
    whole = world.sequence(forward.whole.cameras, places, seen, fps=forward.whole.fps)
    return Known(whole, seen, places)


def given(camera: CameraBoxes, boxes: ndarray, measured: ndarray) -> CameraBoxes:
    """The camera with other boxes of some indices: with these centres, tops and bottoms."""
    found = camera.boxes.copy()
    found[boxes, 0] = measured[:, 0]
    found[boxes, 1] = (measured[:, 1] + measured[:, 2]) / 2.0
    found[boxes, 3] = (measured[:, 2] - measured[:, 1]) / 2.0
    return replace(camera, boxes=found)


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
