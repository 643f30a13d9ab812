"""The fusion's tracks as paths, with the association probabilities that the run recorded."""

from __future__ import annotations

from collections.abc import Sequence as Many

import numpy as np
from jaxtyping import Bool
from numpy import ndarray

from tracker.fusion.protocol import FusionResult
from tracker.fusion.trajectories import Trajectories
from tracker.smoothing.paths import Links, Paths
from tracker.smoothing.recording import CameraBoxes

_WIDE = 1.0
"""Square metres and (m/s)²: how little is known of a state within a gap, at first."""


def read_paths(
    fused: Many[FusionResult], tracks: Trajectories, dimension: int
) -> tuple[Paths, Bool[ndarray, " N"]]:
    """One path a label, from the first step at which the fusion had it to its last report.

    Where the fusion had lost a label for a while the states are drawn straight through the gap.

    Returns:
        The paths, and at which of their rows the fusion had them.
    """
    order = np.lexsort((tracks.frames, tracks.labels))
    of_label, frames = tracks.labels[order], tracks.frames[order]
    labels, begins = np.unique(of_label, return_index=True)
    ends = np.append(begins[1:], len(order))
    earlier = _before_their_report(fused, dict(zip(labels.tolist(), frames[begins], strict=True)))
    firsts, states, covariances, had = [], [], [], []
    for label, begin, end in zip(labels.tolist(), begins, ends, strict=True):
        known = [*earlier.get(label, ()), *zip(
            frames[begin:end].tolist(), tracks.components[order[begin:end]].tolist(), strict=True
        )]  # fmt: skip
        steps = np.array([step for step, _ in known])
        means = np.array([fused[step].posterior.means[component] for step, component in known])
        spread = np.array(
            [fused[step].posterior.covariances[component] for step, component in known]
        )
        first, last = steps[0], steps[-1]
        every = np.arange(first, last + 1)
        filled = np.stack(
            [np.interp(every, steps, means[:, axis]) for axis in range(dimension)], axis=1
        )
        wide = np.tile(_WIDE * np.eye(dimension), (len(every), 1, 1))
        wide[steps - first] = spread
        own = np.zeros(len(every), dtype=bool)
        own[steps - first] = True
        had.append(own)
        firsts.append(int(first))
        states.append(filled)
        covariances.append(wide)
    paths = Paths.of(labels.tolist(), firsts, states, covariances, dimension)
    return paths, np.concatenate([np.zeros(0, dtype=bool), *had])


def _before_their_report(
    fused: Many[FusionResult], reported: dict[int, int]
) -> dict[int, list[tuple[int, int]]]:
    """Of each label the steps before its first report at which a box fed it, and the component."""
    found: dict[int, list[tuple[int, int]]] = {}
    for step, result in enumerate(fused):
        fed = np.flatnonzero((result.sources >= 0).any(axis=0))
        there: set[int] = set()
        labels = result.posterior.labels[fed].tolist()
        for component, label in zip(fed.tolist(), labels, strict=True):
            if label not in there and step < reported.get(label, -1):
                there.add(label)
                found.setdefault(label, []).append((step, component))
    return found


def read_links(fused: Many[FusionResult], paths: Paths, cameras: Many[CameraBoxes]) -> Links:
    """The association probabilities that the fusion recorded, for the rows of the paths."""
    row_of = {label: i for i, label in enumerate(paths.labels.tolist())}
    lasts = paths.lasts
    found: list[tuple[ndarray, ...]] = []
    for step, result in enumerate(fused):
        told = result.associations
        if not len(told.cameras):
            continue
        of_component = np.array(
            [row_of.get(label, -1) for label in result.posterior.labels.tolist()], dtype=np.int64
        )
        path = of_component[told.components]
        alive = (path >= 0) & (paths.firsts[path] <= step) & (step <= lasts[path])
        path, which = path[alive], told.cameras[alive].astype(np.int64)
        begins = np.array([camera.starts[step] for camera in cameras])
        found.append(
            (
                which,
                paths.starts[path] + step - paths.firsts[path],
                begins[which] + told.boxes[alive],
                told.probabilities[alive].astype(float),
            )
        )
    return Links.joined([Links(*part) for part in found])
