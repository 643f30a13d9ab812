"""Track management of one camera: who is there, who was and may return, who begins and ends."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.single_view.protocol import ViewEvent

UNCONFIRMED = 0
"""Label of a target that has not been found often enough to have one."""


@dataclass(frozen=True, slots=True, eq=False)
class Targets:
    """T targets in one camera's picture, by columns."""

    labels: Int[ndarray, " T"]
    """From 1 on; :data:`UNCONFIRMED` for those that are not sure yet."""
    persons: Int[ndarray, " T"]
    """Whose templates each looks like: index into the colour model's names."""
    boxes: Float[ndarray, "T 4"]
    """Centre and half sizes, pixels; of one that was not found, where it is expected."""
    velocities: Float[ndarray, "T 2"]
    """Mean displacement, pixels a step."""
    hits: Int[ndarray, " T"]
    """Steps in which it was found."""
    misses: Int[ndarray, " T"]
    """Steps since it was last found."""
    existences: Float[ndarray, " T"]
    """Probability that it is somebody; of one that was not found it fades."""

    @staticmethod
    def nobody() -> Targets:
        """No targets."""
        none = np.zeros(0, dtype=np.int64)
        return Targets(none, none, np.zeros((0, 4)), np.zeros((0, 2)), none, none, np.zeros(0))

    def __len__(self) -> int:
        return len(self.labels)

    @property
    def confirmed(self) -> Bool[ndarray, " T"]:
        """Whether each counts."""
        return np.asarray(self.labels != UNCONFIRMED)

    def take(self, chosen: ndarray) -> Targets:
        """Some of them, by index or mask."""
        return Targets(*(column[chosen] for column in self._columns))

    def joined(self, other: Targets) -> Targets:
        """These and others behind them."""
        pairs = zip(self._columns, other._columns, strict=True)
        return Targets(*(np.concatenate(pair) for pair in pairs))

    @property
    def _columns(self) -> tuple[ndarray, ...]:
        return tuple(getattr(self, column.name) for column in fields(self))

    def moved(self, velocity_share: float) -> Targets:
        """Where they are expected a step later.

        Args:
            velocity_share: How much of its mean displacement each repeats; 0 for none.
        """
        boxes = self.boxes.copy()
        boxes[:, :2] += velocity_share * self.velocities
        return replace(self, boxes=boxes, velocities=velocity_share * self.velocities)


@dataclass(frozen=True, slots=True, eq=False)
class Departed:
    """Those who vanished and may return. V of them."""

    labels: Int[ndarray, " V"]
    persons: Int[ndarray, " V"]
    ages: Int[ndarray, " V"]
    """Steps since each vanished."""

    @staticmethod
    def nobody() -> Departed:
        """None."""
        none = np.zeros(0, dtype=np.int64)
        return Departed(none, none, none)

    def take(self, chosen: ndarray) -> Departed:
        """Some of them."""
        return Departed(self.labels[chosen], self.persons[chosen], self.ages[chosen])


@dataclass(frozen=True, slots=True, eq=False)
class Tracks:
    """Who is there, who was, and the next free label."""

    targets: Targets
    departed: Departed
    next_label: int

    @staticmethod
    def empty() -> Tracks:
        """Nobody has been seen yet."""
        return Tracks(Targets.nobody(), Departed.nobody(), next_label=1)


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
    """Who is there after a step's modes have been assigned.

    A target takes its mode; without one it stays where it is expected for ``patience``
    steps, then it has vanished. A mode that no target takes is a newcomer; found in
    ``confirmation`` steps it is new, or, if somebody of the same colours vanished within
    ``memory`` steps, he has returned.

    Args:
        tracks: Before the step.
        expected: Its targets, where they were expected.
        modes: This step's, pixels.
        existences: Probability that each is somebody.
        columns: Of the hypothesis matrix, one a mode.
        vacant: Persons of the newcomers' columns.
        confirmation: Steps, ≥ 1.
        patience: Steps.
        memory: Steps.
        newcomer_misses: Steps without a mode after which an unconfirmed target is given up.
        velocity_memory: Share of the mean displacement that a new one leaves as it is.
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
    targets = updated.joined(
        Targets(
            labels=np.full(len(persons), UNCONFIRMED),
            persons=persons,
            boxes=modes[newcomers],
            velocities=np.zeros((len(persons), 2)),
            hits=np.ones(len(persons), dtype=np.int64),
            misses=np.zeros(len(persons), dtype=np.int64),
            existences=existences[newcomers],
        )
    )
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
        # the last who vanished of those who look like this one
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
    """Targets that were found at their modes, the others where they are expected."""
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
