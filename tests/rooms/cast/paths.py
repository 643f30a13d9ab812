"""Where a person walks: timed waypoints in, a smooth path with heading and gait phase out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import gaussian_filter1d

FRAMES_PER_SECOND = 25.0
FASTEST = 1.5
"""Metres per second: no rendered person walks faster."""
_LEAD = 60
"""Steps computed before step 0 and after the last, so that smoothing has no border."""


@dataclass(frozen=True, slots=True)
class Facing:
    """From one step to another the person looks at a point of the floor."""

    first: float
    last: float
    x: float
    y: float


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """The walk of one person over all steps of a scene."""

    position: Float[ndarray, "F 2"]
    """Of the pelvis over the floor, metres."""
    heading: Float[ndarray, " F"]
    """Radians from the world's x axis, without jumps of a full turn."""
    speed: Float[ndarray, " F"]
    """Metres per second."""
    phase: Float[ndarray, " F"]
    """Gait cycles walked since the start; one cycle is a step of each foot."""
    footprints: tuple[Float[ndarray, "F 4"], Float[ndarray, "F 4"]]
    """Left and right foot: x, y and height of the sole, and its heading."""


def walk(
    waypoints: Sequence[tuple[float, float, float]],
    facings: Sequence[Facing],
    frames: int,
    *,
    leg: float,
    rate: float = FRAMES_PER_SECOND,
) -> Path:
    """The smooth walk through timed waypoints.

    Between waypoints each coordinate is a monotone cubic of time, so that a
    pause is two waypoints at one place; a Gaussian of 0.16 s then rounds the
    changes of speed. Where the waypoints ask for constant velocity, neither
    moves the person in time.

    Args:
        waypoints: ``(step, x, y)`` in ascending steps; the person stands still
            before the first and after the last.
        facings: Where the person looks other than ahead, for pauses.
        frames: Number of steps.
        leg: Length of a leg in metres; scales the stride.
        rate: Steps a second.
    """
    steps = np.arange(-_LEAD, frames + _LEAD, dtype=float)
    times = np.array([w[0] for w in waypoints])
    places = np.array([w[1:] for w in waypoints])
    clamped = np.clip(steps, times[0], times[-1])
    position = np.asarray(PchipInterpolator(times, places)(clamped))
    slower = rate / FRAMES_PER_SECOND
    position = gaussian_filter1d(position, 4.0 * slower, axis=0, mode="nearest")
    velocity = np.gradient(position, axis=0) * rate
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    heading = _heading(steps, position, velocity, speed, facings, 5.0 * slower)
    turning = np.abs(np.gradient(heading))
    cycle = (0.75 + 0.5 * speed) * leg / 0.83
    progress = speed / rate / cycle + turning / (2.0 * np.pi) * np.exp(-3.0 * speed)
    phase = np.cumsum(progress + 1e-6)
    feet = [
        _foot(phase + offset, position, heading, speed, side)
        for offset, side in ((0.0, 1.0), (0.5, -1.0))
    ]
    shown = slice(_LEAD, _LEAD + frames)
    return Path(
        position[shown],
        heading[shown],
        speed[shown],
        phase[shown],
        (feet[0][shown], feet[1][shown]),
    )


def _heading(
    steps: ndarray,
    position: ndarray,
    velocity: ndarray,
    speed: ndarray,
    facings: Sequence[Facing],
    rounding: float,
) -> ndarray:
    """Ahead while walking, towards the point looked at in a pause, and smooth between."""
    wanted = np.arctan2(velocity[:, 1], velocity[:, 0])
    known = speed > 0.15
    for facing in facings:
        looking = (steps >= facing.first) & (steps <= facing.last)
        wanted[looking] = np.arctan2(
            facing.y - position[looking, 1], facing.x - position[looking, 0]
        )
        known |= looking
    if not known.any():
        return np.zeros(len(steps))
    turned = np.unwrap(wanted[known])
    return np.asarray(
        gaussian_filter1d(np.interp(steps, steps[known], turned), rounding, mode="nearest")
    )


def _foot(
    phase: ndarray, position: ndarray, heading: ndarray, speed: ndarray, side: float
) -> ndarray:
    """One foot: on its print for six tenths of the cycle, then swung over to the next.

    A print lies where the body is in the middle of the foot's time on the ground,
    half a hip's width aside, so that a planted foot never slides.
    """
    cycle = np.floor(phase)
    part = phase - cycle
    half_width = 0.075
    left = np.stack([-np.sin(heading), np.cos(heading)], axis=1)
    under = position + side * half_width * left

    def print_of(number: ndarray) -> ndarray:
        middle = number + 0.3
        return np.stack(
            [np.interp(middle, phase, column) for column in (*under.T, heading)], axis=1
        )

    swing = np.clip((part - 0.6) / 0.4, 0.0, 1.0)
    carried = swing * swing * (3.0 - 2.0 * swing)
    place = print_of(cycle) + carried[:, None] * (print_of(cycle + 1.0) - print_of(cycle))
    lift = 0.09 * np.sin(np.pi * swing) ** 2
    # who stands still puts the foot down beside the other
    moving = np.clip(speed / 0.35, 0.0, 1.0)
    moving = gaussian_filter1d(moving * moving * (3.0 - 2.0 * moving), 2.0, mode="nearest")
    standing = np.column_stack([under, heading])
    place = standing + moving[:, None] * (place - standing)
    return np.column_stack([place[:, :2], lift * moving, place[:, 2]])
