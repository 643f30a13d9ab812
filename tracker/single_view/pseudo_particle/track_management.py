"""Track management of one camera by colours: targets that begin, end, or return.

The hypothesis matrix ([SG08]) has assigned the modes to targets, to new targets or to the
background. A target returns as the last vanished one with the colours of the same person, wherever
it is; by place, as in :mod:`~tracker.single_view.jpda.targets`, one that comes in
elsewhere would be new.

[SG08] Sun, Guo, "Multiple object tracking with a pseudo particle filter", 2008.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.single_view.protocol import ViewEvent
from tracker.steps.table import Table

UNCONFIRMED = 0
"""Label of a target that has not been detected often enough."""


@dataclass(frozen=True, slots=True, eq=False)
class Targets(Table):
    """T targets in one camera, by columns."""

    labels: Int[ndarray, " T"]
    """Ids from 1 on; :data:`UNCONFIRMED` for targets that are not confirmed yet."""
    persons: Int[ndarray, " T"]
    """Person of each target's colours: index into the colour model's names."""
    boxes: Float[ndarray, "T 4"]
    """Centre and half sizes, pixels; predicted ones for a target that was not detected."""
    velocities: Float[ndarray, "T 2"]
    """Mean displacement, pixels per step."""
    hits: Int[ndarray, " T"]
    """Number of steps with a mode."""
    misses: Int[ndarray, " T"]
    """Number of steps since the last mode."""
    existences: Float[ndarray, " T"]
    """Existence probability, which decreases without modes."""

    @staticmethod
    def none() -> Targets:
        """Make an empty set of targets."""
        none = np.zeros(0, dtype=np.int64)
        return Targets(none, none, np.zeros((0, 4)), np.zeros((0, 2)), none, none, np.zeros(0))

    def __len__(self) -> int:
        return len(self.labels)

    @property
    def confirmed(self) -> Bool[ndarray, " T"]:
        """Whether each target is confirmed."""
        return np.asarray(self.labels != UNCONFIRMED)

    def moved(self, velocity_share: float) -> Targets:
        """Predict the targets one step.

        Args:
            velocity_share: Share of its mean displacement that each repeats; 0 for none.
        """
        boxes = self.boxes.copy()
        boxes[:, :2] += velocity_share * self.velocities
        return replace(self, boxes=boxes, velocities=velocity_share * self.velocities)


@dataclass(frozen=True, slots=True, eq=False)
class Departed(Table):
    """V targets that vanished and may return."""

    labels: Int[ndarray, " V"]
    """Id of each target."""
    persons: Int[ndarray, " V"]
    """Person of each target's colours."""
    ages: Int[ndarray, " V"]
    """Number of steps since each vanished."""

    @staticmethod
    def none() -> Departed:
        """Make an empty set of vanished targets."""
        none = np.zeros(0, dtype=np.int64)
        return Departed(none, none, none)


@dataclass(frozen=True, slots=True, eq=False)
class Tracks:
    """Present and vanished targets, and the next free label."""

    targets: Targets
    """The present targets."""
    departed: Departed
    """The targets that vanished and may return."""
    next_label: int
    """The first label that is free."""

    @staticmethod
    def empty() -> Tracks:
        """The tracks before the first step."""
        return Tracks(Targets.none(), Departed.none(), next_label=1)


def manage(
    tracks: Tracks,
    expected: Targets,
    modes: Float[ndarray, "M 4"],
    existences: Float[ndarray, " M"],
    columns: Int[ndarray, " M"],
    vacant: Int[ndarray, " A"],
    *,
    confirmation: int,
    patience: int,
    memory: int,
    newcomer_misses: int,
    velocity_memory: float,
) -> tuple[Tracks, tuple[ViewEvent, ...]]:
    """Update the targets after a step's modes have been assigned.

    A target has the box of its mode; without one it is predicted for ``patience``
    steps, then it has vanished. A mode without target is a new target; detected in
    ``confirmation`` steps it is confirmed, or, if a target of the same colours vanished within
    ``memory`` steps, it has returned.

    Args:
        tracks: The tracks before the step.
        expected: The predicted targets.
        modes: Boxes of this step's modes, pixels.
        existences: Existence probability of each mode.
        columns: Column of each mode in the hypothesis matrix.
        vacant: Person of each column of a new target.
        confirmation: Number of steps with a mode after which a target is confirmed, at least 1.
        patience: Number of steps without a mode after which a confirmed target has vanished.
        memory: Number of steps after which a vanished target cannot return.
        newcomer_misses: Steps without a mode after which an unconfirmed target ends.
        velocity_memory: Weight of the old mean displacement, 0 … 1.
    """
    count = len(expected)
    known = columns < count
    newcomers = (columns >= count) & (columns < count + len(vacant))
    persons = vacant[columns[newcomers] - count]
    updated = _updated(
        tracks.targets,
        expected,
        modes[known],
        existences[known],
        columns[known],
        patience,
        velocity_memory,
    )
    new = Targets(
        labels=np.full(len(persons), UNCONFIRMED),
        persons=persons,
        boxes=modes[newcomers],
        velocities=np.zeros((len(persons), 2)),
        hits=np.ones(len(persons), dtype=np.int64),
        misses=np.zeros(len(persons), dtype=np.int64),
        existences=existences[newcomers],
    )
    targets = Targets.concatenate([updated, new])
    lost = targets.misses > np.where(targets.confirmed, patience, newcomer_misses - 1)
    gone = targets.take(lost & targets.confirmed)
    targets = targets.take(~lost)
    departed = tracks.departed
    departed = Departed(departed.labels, departed.persons, departed.ages + 1)
    departed = departed.take(departed.ages <= memory)
    events = [ViewEvent("vanished", (int(label),)) for label in gone.labels]

    labels, next_label = targets.labels.copy(), tracks.next_label
    due = ~targets.confirmed & (targets.hits >= confirmation) & (targets.misses == 0)
    for index in np.flatnonzero(due):
        # the last vanished target with the same colours
        alike = np.flatnonzero(departed.persons == targets.persons[index])
        if len(alike):
            back = alike[departed.ages[alike].argmin()]
            labels[index] = departed.labels[back]
            departed = departed.take(np.arange(len(departed.labels)) != back)
            events.append(ViewEvent("returned", (int(labels[index]),)))
        else:
            labels[index] = next_label
            events.append(ViewEvent("new", (next_label,)))
            next_label += 1
    departed = Departed(
        np.concatenate([departed.labels, gone.labels]),
        np.concatenate([departed.persons, gone.persons]),
        np.concatenate([departed.ages, np.zeros(len(gone), dtype=np.int64)]),
    )
    after = Tracks(replace(targets, labels=labels), departed, next_label)
    return after, tuple(events)


def _updated(
    before: Targets,
    expected: Targets,
    modes: Float[ndarray, "K 4"],
    found: Float[ndarray, " K"],
    owners: Int[ndarray, " K"],
    patience: int,
    velocity_memory: float,
) -> Targets:
    """Targets with modes get their boxes, the others remain as predicted."""
    boxes, velocities = expected.boxes.copy(), expected.velocities.copy()
    hits, misses = expected.hits.copy(), expected.misses + 1
    existences = expected.existences * np.exp(-1.0 / (patience + 1.0))
    boxes[owners] = modes
    shifts = modes[:, :2] - before.boxes[owners, :2]
    velocities[owners] = (
        velocity_memory * before.velocities[owners] + (1.0 - velocity_memory) * shifts
    )
    hits[owners] += 1
    misses[owners] = 0
    existences[owners] = found
    return Targets(expected.labels, expected.persons, boxes, velocities, hits, misses, existences)
