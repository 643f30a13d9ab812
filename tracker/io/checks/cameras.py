"""Lenses and places of the cameras: what can be said of a calibration without any boxes."""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Sequence as Many

import numpy as np

from tracker.geometry.camera import Camera
from tracker.sequences.fields import listed
from tracker.sequences.finding import Check, good, percent, warning
from tracker.sequences.sequence import Room
from tracker.sequences.views import check_view_of_room

# The 46 cameras of 12 recordings (CMC, WILDTRACK, AV16.3, Pose2Sim's demonstration, the built-in
# rooms) are well within: off by at most 0.16, 36° to 85° wide, fx 0.91 to 1.01 times fy.
_OFF_CENTRE = 0.25  # share of the picture's size that the principal point may be off its middle
_NARROWEST, _WIDEST = np.radians(5.0), np.radians(160.0)  # of what a lens shows across
_LEAST_ASPECT, _LARGEST_ASPECT = 0.7, 1.4  # of fx to fy
_LEAST_SHARED = 0.05
"""Share of the room's volume that two cameras see below which it is named. It is 0.6 at least in
the random rooms of seeds 1500 … 1539 and in these recordings. Where one of two cameras is turned by
60°, 1 of 12 is named, none with half and 2 with twice the share; by 90° or more all are."""


def check_lenses(cameras: Many[Camera]) -> Check:
    """Is K plausible for the picture's size: principal point, field of view, aspect."""
    told: list[str] = []
    for camera in cameras:
        width, height = camera.image_size
        k = camera.intrinsics
        across = 2.0 * float(np.arctan(width / (2.0 * k[0, 0])))
        off = np.abs(k[:2, 2] / [width, height] - 0.5)
        if (off > _OFF_CENTRE).any():
            advice = "correct it"
            if (k[:2, 2] > 1.0).all():
                other = f"{2.0 * k[0, 2]:.0f}×{2.0 * k[1, 2]:.0f}"
                times = f"{width / (2.0 * k[0, 2]):.3g}"
                advice = f"K is likely of one of {other}: multiply its first two rows by {times}"
            told.append(
                f"{camera.name}: the middle of its lens, ({k[0, 2]:.0f}, {k[1, 2]:.0f}), is far "
                f"from the middle of a picture of {width}×{height}; {advice}"
            )
        elif not _NARROWEST < across < _WIDEST:
            told.append(
                f"{camera.name}: with fx = {k[0, 0]:.4g} it sees {np.degrees(across):.0f}° across "
                f"a picture of {width} pixels; K must be in pixels of this picture"
            )
        elif not _LEAST_ASPECT < k[0, 0] / k[1, 1] < _LARGEST_ASPECT:
            told.append(
                f"{camera.name}: fx = {k[0, 0]:.4g} and fy = {k[1, 1]:.4g} differ by more than "
                "pixels do; K must be in pixels, of both axes"
            )
    if told:
        return warning("lenses", "; ".join(told))
    return good("lenses", "K fits the size of the pictures")


def check_places(cameras: Many[Camera], room: Room) -> Iterator[Check]:
    """Are the cameras above the floor, look at the room, and see parts of it together."""
    below = [c.name for c in cameras if c.centre[2] < room.minimum[2] - 0.1]
    if below:
        lowest = min(float(c.centre[2]) for c in cameras)
        yield warning(
            "cameras above the floor",
            f"{listed(below)} {'is' if len(below) == 1 else 'are'} below the floor of the room "
            f"(z = {lowest:.2f} m): check the up axis, the poses' direction, and the room",
            lowest=lowest,
        )
    else:
        yield good("cameras above the floor", "all cameras are above the floor")
    steps = np.linspace(0.0, 1.0, 9)
    grid = np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(-1, 3)
    points = room.minimum + grid * (room.maximum - room.minimum)
    for sentence in (blind := list(check_view_of_room(cameras, room))):
        yield warning("cameras see the room", sentence)
    if not blind:
        yield good("cameras see the room", "every camera sees a part of the room")
    if len(cameras) < 2:
        return
    seen = np.array([camera.sees(points) for camera in cameras])
    shared = float((seen.sum(axis=0) >= 2).mean())
    if shared < _LEAST_SHARED:
        yield warning(
            "views overlap",
            f"only {percent(shared)} of the room is seen by two cameras: where only one sees, "
            "a person's place is known from the size of the box alone",
            shared=shared,
        )
    else:
        yield good(
            "views overlap", f"{percent(shared)} of the room is seen by two cameras", shared=shared
        )
