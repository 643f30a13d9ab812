"""Which side of a box is the head's: cameras may be rolled, and hang upside down.

A detector's boxes lie along the picture's sides, whatever way people stand in it. Which way that
is follows from the poses once the world's way up is known; where it is not, the few ways that are
usual are tried, and the boxes of several cameras meet only with the right one.
"""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Sequence as Many
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.geometry.consistency.consensus import Consensus
from tracker.geometry.consistency.observed import Pose
from tracker.geometry.consistency.standing import turn_of
from tracker.io.conventions.level import horizon

_NEAR = np.cos(np.radians(40.0))  # boxes lean as much as cameras are rolled, or look down
_BELOW = 0.75  # heights of a person, and
_BELOW_METRES = 1.0  # so much below people's middle no camera stands
_LOOKS_DOWN = 0.3


def turns_tried(poses: Many[Pose]) -> Iterator[tuple[int, ...]]:
    """Where heads may be in the pictures of all cameras: at the top, or as a way up would have it.

    The ways up are the world's axes and what is level to the cameras. Of two opposite ways one
    is tried: with both the same boxes meet.
    """
    ups = [*np.eye(3), horizon(poses), horizon(poses, [1] * len(poses))]
    found = {(0,) * len(poses)}
    yield from found
    for up in ups:
        if up is None:
            continue
        turns = tuple(turn_of(pose.rotation @ up) for pose in poses)
        reverse = tuple((turn + 2) % 4 for turn in turns)
        if turns not in found and reverse not in found:
            found.add(turns)
            yield turns if turns.count(0) >= turns.count(2) else reverse


def standing(agreed: Consensus) -> Float[ndarray, " 3"] | None:
    """The way in which people stand, by which head and foot are found exactly in every box.

    Returns:
        The world's axis that is nearest to how the boxes rise; None where none is near enough to
        be meant.
    """
    if agreed.height <= 0.0:
        return None
    rise = agreed.rise / agreed.height
    axis = np.zeros(3)
    nearest = int(np.argmax(np.abs(rise)))
    axis[nearest] = np.sign(rise[nearest])
    return axis if axis @ rise > _NEAR else None


def upside_down(
    agreed: Consensus, poses: Many[Pose], metres: float, claimed: Float[ndarray, " 3"] | None
) -> bool:
    """Whether the heads that boxes show are feet, since the cameras hang upside down.

    The picture's way up is believed where cameras do not contradict it, and they do where they
    would stand below the people's feet. A way that the file claims is believed where cameras are
    above people and look down by it. Of cameras that are rolled by a quarter nobody knows more.

    Args:
        agreed: What the boxes agree on.
        poses: Of the cameras.
        metres: How long the world's unit may be.
        claimed: The way up that the file claims; None where it claims none.
    """
    if not agreed.agreeing:
        return False
    rise = agreed.rise / agreed.height
    centres = np.array([pose.centre for pose in poses])
    middles = agreed.feet + agreed.rises / 2.0
    above = float(np.median((centres[agreed.cameras] - middles[:, None]) @ rise))
    down = -float(np.mean([pose.rotation[2] @ rise for pose in poses]))
    ups = [pose.rotation @ rise for pose in poses]
    pictured = float(np.mean([-up[1] / max(float(np.linalg.norm(up[:2])), 1e-9) for up in ups]))
    if claimed is not None and abs(claimed @ rise) > _NEAR:
        side = float(np.sign(claimed @ rise))
        if side * (above / agreed.height + down) > _LOOKS_DOWN:
            return side < 0.0
    if above < -_BELOW * agreed.height and above * metres < -_BELOW_METRES:
        return True
    if abs(pictured) < 0.5:
        return above / agreed.height + down < 0.0
    return pictured < 0.0


def reversed_(agreed: Consensus) -> Consensus:
    """The same with heads for feet."""
    return replace(agreed, rise=-agreed.rise, feet=agreed.feet + agreed.rises, rises=-agreed.rises)
