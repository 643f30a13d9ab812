"""How a walking body is posed: the bones of a person at every step, from the path."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.ndimage import gaussian_filter1d

from tests.rooms.cast.paths import Path

PELVIS, CHEST, HEAD = 0, 1, 2
UPPER_ARM, FOREARM = (3, 5), (4, 6)
THIGH, SHIN, FOOT = (7, 10), (8, 11), (9, 12)
BONES = 13
"""Left before right in each pair."""

STATURE = 1.75
"""Metres: the height that the measures below are for."""
JOINTS = np.array(
    [
        [0.0, 0.0, 0.95],
        [0.0, 0.0, 1.08],
        [0.0, 0.0, 1.50],
        [0.0, 0.185, 1.42],
        [0.0, 0.215, 1.14],
        [0.0, -0.185, 1.42],
        [0.0, -0.215, 1.14],
        [0.0, 0.09, 0.92],
        [0.0, 0.09, 0.50],
        [0.0, 0.09, 0.085],
        [0.0, -0.09, 0.92],
        [0.0, -0.09, 0.50],
        [0.0, -0.09, 0.085],
    ]
)
"""Where each bone turns when the person stands upright: ahead, to the left, up."""


@dataclass(frozen=True, slots=True, eq=False)
class Poses:
    """The bones of one person over all steps."""

    rotations: Float[ndarray, "F B 3 3"]
    """From the upright body's axes to the world."""
    joints: Float[ndarray, "F B 3"]
    """World metres."""
    top: Float[ndarray, " F"]
    """Height of the crown of the head, metres."""


@dataclass(frozen=True, slots=True, eq=False)
class Sitting:
    """How far a person has sat down at every step, on a seat behind where the feet stand."""

    share: Float[ndarray, " F"]
    """0 upright, 1 seated."""
    seat: float
    """Height of the seat, metres."""


SEAT_BACK = 0.40
"""Metres from the feet back to the hips of who sits, for the height above."""
_FLESH = 0.09
"""Metres from a seat up to the hip joints."""


def _about_z(angle: ndarray) -> ndarray:
    c, s, zero, one = np.cos(angle), np.sin(angle), np.zeros_like(angle), np.ones_like(angle)
    return np.stack([c, -s, zero, s, c, zero, zero, zero, one], axis=-1).reshape(-1, 3, 3)


def _about_y(angle: ndarray) -> ndarray:
    """Positive leans the upper end ahead and swings a hanging limb back."""
    c, s, zero, one = np.cos(angle), np.sin(angle), np.zeros_like(angle), np.ones_like(angle)
    return np.stack([c, zero, s, zero, one, zero, -s, zero, c], axis=-1).reshape(-1, 3, 3)


def _about_x(angle: ndarray) -> ndarray:
    c, s, zero, one = np.cos(angle), np.sin(angle), np.zeros_like(angle), np.ones_like(angle)
    return np.stack([one, zero, zero, zero, c, -s, zero, s, c], axis=-1).reshape(-1, 3, 3)


def _turn(rotations: ndarray, offset: ndarray) -> ndarray:
    return np.asarray(np.einsum("fij,j->fi", rotations, offset))


def _along(direction: ndarray, ahead: ndarray) -> ndarray:
    """Rotations that hang a limb along ``direction`` with its front turned to ``ahead``."""
    z = -direction
    x = ahead - np.sum(ahead * z, axis=1, keepdims=True) * z
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=2)


def _wander(frames: int, seed: int, period: float) -> ndarray:
    """A slow random motion of unit size: nobody stands quite still."""
    noise = np.random.default_rng(seed).standard_normal(frames + 200)
    smooth = gaussian_filter1d(noise, period)[100:-100]
    return np.asarray(smooth / (smooth.std() + 1e-9))


def pose(path: Path, stature: float, seed: int, sitting: Sitting | None = None) -> Poses:
    """Pose a person of the given height along a path.

    The feet are on the path's prints; the legs follow by two-bone inverse
    kinematics, the pelvis as high as the legs allow; arms, chest and head swing
    with the gait. Who sits down moves the pelvis back and down onto the seat, bends
    ahead on the way, and lays the forearms on the thighs. The seed gives each person a
    manner of looking around.
    """
    scale = stature / STATURE
    joints = JOINTS * scale
    frames = len(path.speed)
    rotations = np.empty((frames, BONES, 3, 3))
    placed = np.empty((frames, BONES, 3))
    vigour = np.clip(path.speed / 1.2, 0.0, 1.2)
    cycle = 2.0 * np.pi * path.phase
    yaw = _about_z(path.heading)

    thigh = float(joints[THIGH[0], 2] - joints[SHIN[0], 2])
    shin = float(joints[SHIN[0], 2] - joints[FOOT[0], 2])
    reach = 0.992 * (thigh + shin)
    hips, ankles = [], []
    for side in range(2):
        sole = path.footprints[side]
        ankle = sole[:, :3] + [0.0, 0.0, joints[FOOT[side], 2]]
        aside = _turn(yaw, joints[THIGH[side]] * [1.0, 1.0, 0.0])[:, :2]
        hips.append(path.position + aside)
        ankles.append(ankle)
    allowed = [
        ankle[:, 2] + np.sqrt(np.maximum(reach**2 - np.sum((hip - ankle[:, :2]) ** 2, axis=1), 0.1))
        for hip, ankle in zip(hips, ankles, strict=True)
    ]
    standing = float(joints[THIGH[0], 2]) - 0.008
    hip_height = np.minimum(np.minimum(allowed[0], allowed[1]) + 0.03, standing)
    hip_height = gaussian_filter1d(hip_height, 1.5, mode="nearest")
    base, down = path.position, np.zeros(frames)
    if sitting is not None:
        down = sitting.share
        back = SEAT_BACK * scale * down[:, None] * yaw[:, :2, 0]
        base = base - back
        hips = [hip - back for hip in hips]
        hip_height = (1.0 - down) * hip_height + down * (sitting.seat + _FLESH)
    pelvis_height = hip_height + joints[PELVIS, 2] - joints[THIGH[0], 2]

    rotations[:, PELVIS] = yaw @ _about_z(0.10 * vigour * np.sin(cycle))
    placed[:, PELVIS] = np.column_stack([base, pelvis_height])
    sway = 0.012 * _wander(frames, seed, 30.0)
    lean = 0.02 + 0.05 * vigour + 0.010 * _wander(frames, seed + 1, 35.0)
    lean = lean + 2.4 * down * (1.0 - down) - 0.08 * down
    rotations[:, CHEST] = (
        yaw @ _about_z(-0.13 * vigour * np.cos(cycle)) @ _about_y(lean) @ _about_x(sway)
    )
    placed[:, CHEST] = placed[:, PELVIS] + _turn(
        rotations[:, PELVIS], joints[CHEST] - joints[PELVIS]
    )
    looking = 0.22 * _wander(frames, seed + 2, 28.0)
    nod = 0.06 + 0.05 * _wander(frames, seed + 3, 22.0)
    rotations[:, HEAD] = yaw @ _about_z(looking) @ _about_y(nod)
    placed[:, HEAD] = placed[:, CHEST] + _turn(rotations[:, CHEST], joints[HEAD] - joints[CHEST])

    ahead = np.column_stack([np.cos(path.heading), np.sin(path.heading), np.zeros(frames)])
    for side, sign in enumerate((1.0, -1.0)):
        swing = sign * np.cos(cycle)  # this arm is back while this leg is ahead
        fidget = down * _wander(frames, seed + 4 + side, 18.0)
        back = 0.42 * vigour * swing - 0.05 - 0.20 * down - 0.06 * fidget
        upper = rotations[:, CHEST] @ _about_x(np.full(frames, 0.10 * sign)) @ _about_y(back)
        bend = 0.22 + 0.18 * vigour * (1.0 - swing) + 0.66 * down + 0.12 * fidget
        rotations[:, UPPER_ARM[side]] = upper
        rotations[:, FOREARM[side]] = upper @ _about_y(-bend)
        placed[:, UPPER_ARM[side]] = placed[:, CHEST] + _turn(
            rotations[:, CHEST], joints[UPPER_ARM[side]] - joints[CHEST]
        )
        placed[:, FOREARM[side]] = placed[:, UPPER_ARM[side]] + _turn(
            upper, joints[FOREARM[side]] - joints[UPPER_ARM[side]]
        )

        hip = np.column_stack([hips[side], hip_height])
        leg = ankles[side] - hip
        length = np.linalg.norm(leg, axis=1, keepdims=True)
        direction = leg / length
        length = np.minimum(length, 0.9995 * (thigh + shin))
        ankle = hip + direction * length
        cosine = (thigh**2 + length**2 - shin**2) / (2.0 * thigh * length)
        angle = np.arccos(np.clip(cosine, -1.0, 1.0))
        front = ahead - np.sum(ahead * direction, axis=1, keepdims=True) * direction
        front /= np.linalg.norm(front, axis=1, keepdims=True)
        upper_leg = np.cos(angle) * direction + np.sin(angle) * front
        knee = hip + thigh * upper_leg
        lower_leg = (ankle - knee) / np.linalg.norm(ankle - knee, axis=1, keepdims=True)
        rotations[:, THIGH[side]] = _along(upper_leg, ahead)
        rotations[:, SHIN[side]] = _along(lower_leg, ahead)
        part = (path.phase + 0.5 * side) % 1.0
        # the heel leaves the ground before the swing, the toes point up before landing
        pitch = 0.55 * np.exp(-(((part - 0.66) / 0.08) ** 2)) - 0.25 * np.exp(
            -(((part - 0.95) / 0.06) ** 2)
        )
        rotations[:, FOOT[side]] = _about_z(path.footprints[side][:, 3]) @ _about_y(
            pitch * np.minimum(vigour, 1.0)
        )
        placed[:, THIGH[side]], placed[:, SHIN[side]] = hip, knee
        placed[:, FOOT[side]] = ankle
    return Poses(rotations, placed, _top(rotations, placed, stature))


def lay(poses: Poses, place: Float[ndarray, " 3"], heading: float, stature: float) -> Poses:
    """The same poses on the back: the middle of the body at a place, the crown to a heading."""
    middle = np.array([0.0, 0.0, 0.5 * stature])
    turn = (_about_z(np.array([heading + np.pi])) @ _about_y(np.array([-0.5 * np.pi])))[0]
    rotations = turn @ poses.rotations
    feet = poses.joints[:, PELVIS].mean(axis=0) * [1.0, 1.0, 0.0]
    placed = (poses.joints - feet - middle) @ turn.T + place
    return Poses(rotations, placed, _top(rotations, placed, stature))


def _top(rotations: ndarray, placed: ndarray, stature: float) -> ndarray:
    crown = np.array([0.0, 0.0, stature - JOINTS[HEAD, 2] * (stature / STATURE)])
    return np.asarray(placed[:, HEAD, 2] + _turn(rotations[:, HEAD], crown)[:, 2])
