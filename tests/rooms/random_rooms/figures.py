"""The people of a random room as bodies over its steps, with the truth of what is tracked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray
from scipy.ndimage import gaussian_filter1d

from tests.rooms.cast.gait import CHEST, HEAD, JOINTS, PELVIS, STATURE, Poses, Sitting, lay, pose
from tests.rooms.cast.paths import Facing, Path, walk
from tests.rooms.cast.people import Body, build
from tests.rooms.random_rooms.behaviour import Script
from tests.rooms.random_rooms.choices import Choices
from tests.rooms.scene import Figure
from tests.rooms.walls.textures import Look

SMOOTHEST = 24.0
"""Steps a second at least at which walking is worked out; slower films show some of them."""
HALF_EXTENTS = {
    "whole body": np.array([0.28, 0.28, 0.86]),
    "head and torso": np.array([0.2, 0.2, 0.36]),
}
_RISING = 1.1
"""Seconds that sitting down or getting up takes."""
_ON_BED = 0.13
"""Metres from a bed to the middle of who lies on it."""


def act(
    choices: Choices, scripts: Sequence[Script], looks: Sequence[Look], half: tuple[float, float]
) -> tuple[Figure, ...]:
    """Everybody over all steps.

    Args:
        choices: Of the room.
        scripts: What each does.
        looks: What each looks like.
        half: Half width and depth of the tracking volume, metres.
    """
    return tuple(
        _figure(choices, number, script, look, half)
        for number, (script, look) in enumerate(zip(scripts, looks, strict=True))
    )


def _figure(
    choices: Choices, number: int, script: Script, look: Look, half: tuple[float, float]
) -> Figure:
    finer = int(np.ceil(SMOOTHEST / choices.fps))
    rate = choices.fps * finer
    count = (choices.steps - 1) * finer + 1
    scale = look.stature / STATURE
    if script.bed is not None:
        path = walk(((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)), (), count, leg=0.83 * scale, rate=rate)
        upright = pose(path, look.stature, seed=_manner(choices, number))
        middle = np.array(script.bed.middle) + np.array([0.0, 0.0, _ON_BED])
        poses = lay(upright, middle, script.bed.heading, look.stature)
        path = replace(path, position=path.position + middle[:2])
    else:
        waypoints = [(time * rate, x, y) for time, x, y in _ascending(script.waypoints)]
        facings = [Facing(f.first * rate, f.last * rate, f.x, f.y) for f in script.facings]
        path = walk(waypoints, facings, count, leg=0.83 * scale, rate=rate)
        poses = pose(path, look.stature, _manner(choices, number), _sitting(script, count, rate))
    shown = slice(None, None, finer)
    path, poses = _every(path, shown), _thinned(poses, shown)
    centres = _centres(choices, poses, script)
    held = (np.abs(centres[:, :2]) <= half).all(axis=1)
    times = np.arange(choices.steps) / choices.fps
    drawn = np.ones(choices.steps, dtype=bool)
    if script.behaviour == "comes and goes":
        drawn = (times >= script.waypoints[0][0]) & (times <= script.waypoints[-1][0])
    rest = JOINTS * scale * np.array([look.build, look.build, 1.0])
    return Figure(build(look), path, poses, rest, centres, held & drawn, drawn)


def _manner(choices: Choices, number: int) -> int:
    return 1000 * choices.seed + 10 * (number + 1)


def _ascending(waypoints: Sequence[tuple[float, float, float]]) -> list[tuple[float, float, float]]:
    kept: list[tuple[float, float, float]] = []
    for point in sorted(waypoints):
        if not kept or point[0] > kept[-1][0] + 1e-3:
            kept.append(point)
    if len(kept) == 1:
        kept.append((kept[0][0] + 1.0, *kept[0][1:]))
    return kept


def _sitting(script: Script, count: int, rate: float) -> Sitting | None:
    if script.sitting is None:
        return None
    first, last, seat = script.sitting
    times = np.arange(count) / rate
    share = np.minimum(
        np.clip((times - first) / _RISING, 0.0, 1.0),
        np.clip((last + _RISING - times) / _RISING, 0.0, 1.0),
    )
    share = share * share * (3.0 - 2.0 * share)
    return Sitting(gaussian_filter1d(share, 0.08 * rate, mode="nearest"), seat.height)


def _every(path: Path, shown: slice) -> Path:
    left, right = path.footprints
    return Path(
        path.position[shown], path.heading[shown], path.speed[shown], path.phase[shown],
        (left[shown], right[shown]),
    )  # fmt: skip


def _thinned(poses: Poses, shown: slice) -> Poses:
    return Poses(poses.rotations[shown], poses.joints[shown], poses.top[shown])


def _centres(choices: Choices, poses: Poses, script: Script) -> Float[ndarray, "F 3"]:
    """The middle of what is tracked."""
    trunk = (poses.joints[:, PELVIS] + poses.joints[:, HEAD]) / 2.0
    if script.bed is not None:
        return np.asarray(trunk)
    if choices.target == "head and torso":
        return np.column_stack([trunk[:, :2], poses.top - HALF_EXTENTS["head and torso"][2]])
    # from the floor to the crown, of who sits too
    return np.column_stack([trunk[:, :2], poses.top / 2.0])


def tracked_part(choices: Choices, body: Body, look: Look) -> Bool[ndarray, " V"]:
    """The vertices that the box around what is tracked must hold."""
    if choices.target == "whole body":
        return np.ones(len(body.vertices), dtype=bool)
    trunk = np.isin(body.bones[:, 0], (PELVIS, CHEST, HEAD))
    low = look.stature - 2.0 * HALF_EXTENTS["head and torso"][2]
    return np.asarray(trunk & (body.vertices[:, 2] >= low - 0.03))
