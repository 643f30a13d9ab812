"""The clips of the experiment on merging and splitting: who passes whom, and how deep."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from tests.papers.clips.clip import Actor, Clip, Colour, constant_size, through, wall

SIZE = (320, 240)
HALF_WIDTH, HALF_HEIGHT = 13.0, 36.0

CLOTHES: tuple[tuple[Colour, ...], ...] = (
    ((70.0, 110.0, 190.0), (40.0, 40.0, 200.0), (120.0, 40.0, 30.0)),
    ((60.0, 100.0, 170.0), (40.0, 150.0, 50.0), (40.0, 70.0, 90.0)),
    ((80.0, 120.0, 200.0), (200.0, 60.0, 40.0), (30.0, 30.0, 30.0)),
    ((50.0, 90.0, 160.0), (30.0, 180.0, 220.0), (90.0, 30.0, 90.0)),
    ((75.0, 115.0, 195.0), (150.0, 40.0, 150.0), (40.0, 110.0, 40.0)),
)
"""Face, jacket and trousers of five people, blue, green, red."""

FULL_LIGHT = 40
"""Steps before the light changes in the clip in which it does."""

NEAR = 1.15
"""Two ellipses whose centres are this near, in half sizes of both, may be one piece."""


def _walker(number: int, steps: int, points: list[tuple[float, float, float]], seed: int) -> Actor:
    return Actor(
        f"{number + 1}",
        through(steps, points, sway=3.0, seed=100 * seed + number),
        constant_size(steps, HALF_WIDTH, HALF_HEIGHT),
        CLOTHES[number],
        seed=number,
    )


def _clip(name: str, actors: list[Actor], seed: int, light: Float[ndarray, " T"]) -> Clip:
    return Clip(name, wall(SIZE, seed=seed), tuple(actors), light, seed=seed)


def mild(seed: int) -> Clip:
    """Two walk past each other, the one further away half a height above the other."""
    steps = 90
    actors = [
        _walker(0, steps, [(0, 40, 96), (89, 280, 100)], seed),
        _walker(1, steps, [(0, 280, 136), (89, 40, 134)], seed),
    ]
    return _clip("passing", actors, seed, np.ones(steps))


def full(seed: int) -> Clip:
    """Three come together until they hide each other, and part to other sides."""
    steps = 130
    actors = [
        _walker(0, steps, [(0, 40, 120), (50, 152, 120), (75, 168, 121), (129, 285, 122)], seed),
        _walker(1, steps, [(0, 95, 60), (50, 160, 122), (75, 160, 124), (129, 225, 190)], seed),
        _walker(2, steps, [(0, 285, 116), (50, 170, 122), (75, 150, 122), (129, 35, 116)], seed),
    ]
    return _clip("three", actors, seed, np.ones(steps))


def coming_and_going(seed: int, light: Float[ndarray, " T"] | None = None) -> Clip:
    """Five people come and go over 320 steps, each passing others."""
    steps = 320
    actors = [
        _walker(0, steps, [(0, -20, 110), (130, 340, 126)], seed),
        _walker(1, steps, [(20, 340, 128), (150, -20, 112)], seed),
        _walker(2, steps, [(90, -20, 130), (190, 200, 120), (310, -20, 112)], seed),
        _walker(3, steps, [(150, 340, 112), (290, -20, 132)], seed),
        _walker(4, steps, [(200, -20, 124), (319, 330, 118)], seed),
    ]
    return _clip("street", actors, seed, np.ones(steps) if light is None else light)


CLIPS: dict[str, Callable[[int], Clip]] = {
    "passing": mild,
    "three": full,
    "street": coming_and_going,
}
"""By name, made with a seed: another wall, and other ways of walking."""


def light() -> Float[ndarray, " T"]:
    """A lamp that fades to two fifths of its light over six seconds, and comes back in four."""
    return np.interp(np.arange(320), [FULL_LIGHT, 190, 210, 310], [1.0, 0.4, 0.4, 0.8])


def together(clip: Clip) -> Bool[ndarray, "T A"]:
    """When each actor may be one piece of foreground with another."""
    boxes = np.array([clip.boxes(step) for step in range(clip.steps)])
    apart = np.abs(boxes[:, :, None, :2] - boxes[:, None, :, :2])
    reach = boxes[:, :, None, 2:] + boxes[:, None, :, 2:]
    with np.errstate(invalid="ignore"):
        near = ((apart / reach) ** 2).sum(axis=3) < NEAR**2
    near[:, np.arange(boxes.shape[1]), np.arange(boxes.shape[1])] = False
    return np.asarray(near.any(axis=2))


def true_mask(clip: Clip, step: int) -> Bool[ndarray, "h w"]:
    """The pixels that show somebody: those whose centre is in an actor's ellipse."""
    y, x = np.mgrid[: clip.size[1], : clip.size[0]]
    mask = np.zeros(x.shape, dtype=bool)
    for box in clip.boxes(step):
        if np.isfinite(box).all():
            mask |= ((x - box[0]) / box[2]) ** 2 + ((y - box[1]) / box[3]) ** 2 <= 1.0
    return mask
