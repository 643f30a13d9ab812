"""Label recovery: a track that begins near the prediction of a lost one takes over its label."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.filters import gaussian_mixture
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.fusion.model import CONFIRMED, FusionModel
from tracker.geometry.assignment import linear_sum_assignment

_INADMISSIBLE = 1e6
"""Cost of a pair of a lost and a new track that is not admissible, far above any gate."""


@dataclass(frozen=True, slots=True, eq=False)
class Memory:
    """The confirmed tracks of a step, and the predictions of those lost a short while ago.

    The filter drops a target that no camera detects within a few steps, which is right for the
    estimate of existence and loses the label. So the last state of a confirmed track that ended
    inside the room is predicted further for ``FusionParams.memory`` seconds, and the first new
    track that is confirmed in its gate takes over its label. The estimates of the filter do not
    change.
    """

    known: GaussianMixture
    """The confirmed tracks of the last step, the heaviest component of each label."""
    lost: GaussianMixture
    """The predicted states of L lost tracks."""
    ages: Float[ndarray, " L"]
    """Time since each track was lost, seconds."""
    newer: Int[ndarray, " L"]
    """The least label that was given after each track was lost: only tracks from it on may take
    over the label of the lost track."""

    @staticmethod
    def start(dimension: int) -> Memory:
        """Make the memory without tracks, for states of the given dimension."""
        empty = GaussianMixture.empty(dimension)
        return Memory(empty, empty, np.zeros(0), np.zeros(0, dtype=np.int64))

    def relabelled(self, changed: dict[int, int]) -> Memory:
        """Rename the known tracks; a lost track whose label is given away is removed.

        Args:
            changed: New label by old one.
        """
        back = np.isin(self.lost.labels, list(changed.values()))
        still = self.take(~back)
        return Memory(self.known.relabelled(changed), still.lost, still.ages, still.newer)

    def take(self, indices: ndarray) -> Memory:
        """Select some of the lost tracks, by index or mask."""
        return Memory(self.known, self.lost.take(indices), self.ages[indices], self.newer[indices])


def recall(
    memory: Memory, mixture: GaussianMixture, model: FusionModel, first_label: int
) -> tuple[Int[ndarray, " J"], Memory]:
    """Give lost labels back to new tracks at the predicted places, and update the memory.

    Args:
        memory: The memory after the step before.
        mixture: The posterior of this step, J components, the heaviest of a label first.
        model: The motion that predicts lost tracks, and the room outside which they are dropped.
        first_label: The first label that was given in this step.

    Returns:
        The labels of this step's components, and the memory after it.
    """
    labels = mixture.labels
    if model.parameters.memory == 0.0:
        return labels, memory
    representatives = _first_of_each(labels, (mixture.weights > CONFIRMED).nonzero()[0])
    missing = _predict_lost(memory, labels[representatives], model, first_label)
    if missing.lost.size:
        labels, back = _return_labels(
            missing, mixture.take(representatives), labels, model.recovery_gate
        )
        missing = missing.take(~back)
    known = GaussianMixture(
        mixture.weights.take(representatives),
        mixture.means.take(representatives, 0),
        mixture.covariances.take(representatives, 0),
        labels.take(representatives),
    )
    return labels, Memory(known, missing.lost, missing.ages, missing.newer)


def _first_of_each(labels: Int[ndarray, " J"], among: Int[ndarray, " K"]) -> Int[ndarray, " L"]:
    """Return the index of the first component of each label, by ascending label."""
    first: dict[int, int] = {}
    for index, label in zip(among.tolist(), labels.take(among).tolist(), strict=True):
        first.setdefault(label, index)
    return np.array([first[label] for label in sorted(first)], dtype=np.int64)


def _predict_lost(
    memory: Memory, present: Int[ndarray, " L"], model: FusionModel, first_label: int
) -> Memory:
    """Predict the lost tracks to this step, with the known tracks that are lost at this step.

    Args:
        memory: The memory after the step before.
        present: Labels of the confirmed tracks of this step.
        model: The motion and the room.
        first_label: The first label that was given in this step.

    Returns:
        The memory with the lost tracks that have no label among ``present``, are inside the room,
        and have not been lost for too long.
    """
    there = set(present.tolist())
    known = memory.known
    away = [i for i, label in enumerate(known.labels.tolist()) if label not in there]
    if not away and not memory.lost.size:
        return memory
    missing = Memory(known, memory.lost, memory.ages + model.step_time, memory.newer)
    if away:
        missing = Memory(
            known,
            gaussian_mixture.concatenate([missing.lost, known.take(np.array(away))]),
            np.concatenate([missing.ages, np.full(len(away), model.step_time)]),
            np.concatenate([missing.newer, np.full(len(away), first_label)]),
        )
    absent = [i for i, label in enumerate(missing.lost.labels.tolist()) if label not in there]
    missing = missing.take(np.array(absent, dtype=np.int64))
    lost = model.motion.predict(missing.lost, 1.0)
    recoverable = model.room.contains(lost.means[:, :3])
    recoverable &= missing.ages <= model.parameters.memory + 1e-9
    missing = Memory(known, lost, missing.ages, missing.newer)
    return missing if recoverable.all() else missing.take(recoverable)


def _return_labels(
    memory: Memory, people: GaussianMixture, labels: Int[ndarray, " J"], reach: float
) -> tuple[Int[ndarray, " J"], Bool[ndarray, " L"]]:
    """Assign new tracks to lost ones by squared Mahalanobis distance, and swap their labels.

    Args:
        memory: L lost tracks, predicted to this step.
        people: The confirmed tracks of this step, one component each.
        labels: Labels of all J components of the posterior.
        reach: Largest squared Mahalanobis distance.

    Returns:
        The labels of the J components afterwards, and which lost tracks are back.
    """
    lost, back = memory.lost, np.zeros(memory.lost.size, dtype=bool)
    offsets = people.means[None, :, :3] - lost.means[:, None, :3]
    spread = lost.covariances[:, None, :3, :3] + people.covariances[None, :, :3, :3]
    solved = np.linalg.solve(spread, offsets[..., None])[..., 0]
    distances = (offsets * solved).sum(axis=2)
    may = (distances <= reach) & (people.labels[None, :] >= memory.newer[:, None])
    if not may.any():
        return labels, back
    labels = labels.copy()
    for old, newcomer in zip(
        *linear_sum_assignment(np.where(may, distances, _INADMISSIBLE)), strict=True
    ):
        if may[old, newcomer]:
            # other components with the lost label get the label of the new track
            name, other = lost.labels[old], people.labels[newcomer]
            was_old, was_new = labels == name, labels == other
            labels[was_old], labels[was_new] = other, name
            back[old] = True
    return labels, back
