"""Three clips after those of the pseudo particle filter's paper, drawn with exact truth."""

from __future__ import annotations

import numpy as np

from tests.papers.clips.clip import Actor, Clip, Colour, constant_size, through, wall

SIZE = (320, 240)

CUP: tuple[Colour, ...] = ((38.0, 34.0, 176.0), (48.0, 42.0, 205.0), (30.0, 26.0, 150.0))
BALL: tuple[Colour, ...] = ((52.0, 170.0, 208.0), (34.0, 136.0, 176.0))
FACE: tuple[Colour, ...] = ((34.0, 40.0, 52.0), (108.0, 138.0, 196.0), (96.0, 124.0, 184.0))
"""Hair, forehead and cheeks: the same of all three."""

SHADE = 0.85
"""What a cloud leaves of the light."""

SPECKLE = 16.0
"""Standard deviation of a face's own light and shade, grey levels."""


def red_cup() -> Clip:
    """REDCUP: one target on an irregular path in front of a cluttered wall."""
    steps = 220
    points = [(0, 60, 60), (55, 250, 80), (110, 200, 190), (165, 70, 170), (219, 150, 90)]
    path = through(steps, points, sway=9.0, seed=11)
    cup = Actor("cup", path, constant_size(steps, 12.0, 15.0), CUP, seed=1)
    return Clip("REDCUP", wall(SIZE, seed=5), (cup,), np.ones(steps), noise=4.0, seed=21)


def two_balls() -> Clip:
    """2BALL: two targets of the same colours that come near each other three times."""
    steps = 240
    one = [
        (0, 50, 70),
        (50, 140, 108),
        (95, 60, 180),
        (150, 150, 122),
        (195, 245, 60),
        (239, 180, 110),
    ]
    other = [
        (0, 270, 170),
        (50, 176, 116),
        (95, 255, 70),
        (150, 184, 130),
        (195, 70, 190),
        (239, 148, 118),
    ]
    balls = tuple(
        Actor(
            name,
            through(steps, points, sway=6.0, seed=seed),
            constant_size(steps, 13.0, 13.0),
            BALL,
            seed=2,
        )
        for name, points, seed in (("ball1", one, 31), ("ball2", other, 32))
    )
    return Clip("2BALL", wall(SIZE, seed=6), balls, np.ones(steps), noise=4.0, seed=22)


def three_faces() -> Clip:
    """3FACE: three who look alike; one passes in front of another while a cloud passes."""
    steps = 260
    paths = {
        "face1": [(0, 55, 120), (60, 80, 112), (130, 262, 118), (190, 270, 130), (259, 60, 120)],
        "face2": [(0, 170, 60), (60, 120, 150), (95, 172, 114), (200, 200, 60), (259, 140, 190)],
        "face3": [(0, 265, 150), (70, 240, 165), (130, 90, 170), (190, 70, 160), (259, 250, 170)],
    }
    depths = {"face1": 1.0, "face2": 2.0, "face3": 3.0}
    faces = tuple(
        Actor(
            name,
            through(steps, points, sway=5.0, seed=40 + index),
            constant_size(steps, 14.0, 18.0),
            FACE,
            depth=np.full(steps, depths[name]),
            speckle=SPECKLE,
            seed=3,
        )
        for index, (name, points) in enumerate(paths.items())
    )
    here = np.arange(steps)
    cloud = np.clip(np.minimum(here - 60, 200 - here) / 40.0, 0.0, 1.0)
    light = 1.0 - (1.0 - SHADE) * cloud
    return Clip("3FACE", wall(SIZE, seed=7), faces, light, noise=4.0, seed=23)


CLIPS = {"REDCUP": red_cup, "2BALL": two_balls, "3FACE": three_faces}
"""By name."""
