"""The labelled result of a run, by columns: stage 3."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker import phd
from tracker.fusion.protocol import FusionResult
from tracker.sequences.sequence import Room


@dataclass(frozen=True, slots=True, eq=False)
class Trajectories:
    """One row a target a step, sorted by step and then id."""

    frames: Int[ndarray, " N"]
    ids: Int[ndarray, " N"]
    """Counted from 1, in the order of first appearance."""
    positions: Float[ndarray, "N 3"]
    """World metres."""
    existences: Float[ndarray, " N"]
    """Weight (PHD) or existence probability (multi-Bernoulli)."""
    sigmas: Float[ndarray, "N 3"]
    """Standard deviation of the position along x, y and z, metres."""
    seen: Bool[ndarray, "N C"]
    """Whether a box of each camera fed the target at this step; none: it is coasting."""
    components: Int[ndarray, " N"]
    """Index of the component in the step's posterior."""
    labels: Int[ndarray, " N"]
    """The component's label, of which the id is the short form."""

    def __len__(self) -> int:
        return len(self.frames)

    def at(self, frame: int) -> slice:
        """The rows of one step."""
        first, last = np.searchsorted(self.frames, [frame, frame + 1])
        return slice(int(first), int(last))

    @staticmethod
    def empty(cameras: int) -> Trajectories:
        """No rows."""
        return Trajectories(
            frames=np.zeros(0, dtype=np.int64),
            ids=np.zeros(0, dtype=np.int64),
            positions=np.zeros((0, 3)),
            existences=np.zeros(0),
            sigmas=np.zeros((0, 3)),
            seen=np.zeros((0, cameras), dtype=bool),
            components=np.zeros(0, dtype=np.int64),
            labels=np.zeros(0, dtype=np.int64),
        )


def extract(
    results: Iterable[FusionResult],
    *,
    cameras: int,
    extraction_threshold: float,
    room: Room | None = None,
    margin: float = np.inf,
    first_frame: int = 0,
    ids: dict[int, int] | None = None,
) -> Trajectories:
    """The targets of each step: components above the threshold, one a label.

    Of several components with one label the heaviest stands for it.

    Args:
        results: The posterior of each step, from ``first_frame`` on.
        cameras: C.
        extraction_threshold: T_e; a component is a target where its weight is above it.
        room: Where people are tracked; None for everywhere.
        margin: Metres beyond the room's volume within which a target still counts.
        first_frame: The step of the first result.
        ids: Label → id so far; new labels are added. To go on from an earlier
            piece, pass the same one again.
    """
    ids = {} if ids is None else ids
    rows: list[Trajectories] = []
    for offset, result in enumerate(results):
        chosen = phd.extract(result.posterior, extraction_threshold)
        if room is not None:
            chosen = chosen[room.contains(result.posterior.means[chosen, :3], margin)]
        if not len(chosen):
            continue
        labels, first = np.unique(result.posterior.labels[chosen], return_index=True)
        for label in labels.tolist():
            ids.setdefault(label, len(ids) + 1)
        numbers = np.array([ids[label] for label in labels.tolist()], dtype=np.int64)
        order = np.argsort(numbers)
        components = chosen[first][order]
        variances = np.diagonal(result.posterior.covariances[components], axis1=1, axis2=2)
        rows.append(
            Trajectories(
                frames=np.full(len(labels), first_frame + offset, dtype=np.int64),
                ids=numbers[order],
                positions=result.posterior.means[components, :3],
                existences=result.posterior.weights[components],
                sigmas=np.sqrt(variances[:, :3]),
                seen=(result.sources[:, components] >= 0).T,
                components=components,
                labels=labels[order],
            )
        )
    return concatenate(rows, cameras)


def concatenate(parts: Iterable[Trajectories], cameras: int) -> Trajectories:
    """Parts of one run, in the order of their steps."""
    all_parts = [Trajectories.empty(cameras), *parts]
    return Trajectories(
        *(
            np.concatenate([getattr(part, name) for part in all_parts])
            for name in Trajectories.__slots__
        )
    )
