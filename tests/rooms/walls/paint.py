"""The painters: the colour of every point of the room's surfaces, by the solid's finish."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy import ndarray

from tests.rooms.walls.interior import Finish, Solid
from tests.rooms.walls.textures import linear, noise, sample

Painter = Callable[[Finish, ndarray, ndarray, ndarray], ndarray]
"""From the finish, two coordinates on the face from -1 to 1 times its half sizes in
metres, and the world places, to linear colours."""


def paint(
    solids: Sequence[Solid], hits: ndarray, own: ndarray, face: ndarray, places: ndarray
) -> tuple[ndarray, ndarray]:
    """Reflectance (N, 3) and own light (N, 3) of points on solids.

    Args:
        solids: All solids of the room.
        hits: (N,), the solid of each point.
        own: (N, 3), the point in the solid's own axes, metres.
        face: (N,), the axis of a box's face, 3 on a round solid.
        places: (N, 3), world metres.
    """
    colour = np.empty((len(hits), 3), np.float32)
    glow = np.zeros((len(hits), 3), np.float32)
    order = np.argsort(hits, kind="stable")
    borders = np.flatnonzero(np.diff(hits[order])) + 1
    for rows in np.split(order, borders):
        if not len(rows):
            continue
        solid = solids[int(hits[rows[0]])]
        finish = solid.finish
        painted = np.empty((len(rows), 3))
        faces = face[rows]
        for axis in range(4):
            on = np.flatnonzero(faces == axis)
            if not len(on):
                continue
            first, second = ((1, 2), (0, 2), (0, 1), (0, 2))[axis]
            uv = own[rows[on]][:, [first, second]]
            half = np.array([solid.half[first], solid.half[second]])
            painted[on] = PAINTERS[finish.kind](finish, uv, half, places[rows[on]])
        colour[rows] = np.clip(painted, 0.0, 1.0)
        if finish.glow:
            glow[rows] = finish.glow * colour[rows]
    return colour, glow


def _tint(finish: Finish, amount: ndarray) -> ndarray:
    return np.asarray(linear(finish.colour) * (1.0 + amount)[:, None])


def _plain(finish: Finish, uv: ndarray, half: ndarray, places: ndarray) -> ndarray:
    return _tint(finish, 0.02 * sample(noise(1), uv[:, 0], uv[:, 1], size=0.7))


def _plaster(finish: Finish, uv: ndarray, half: ndarray, places: ndarray) -> ndarray:
    rough = sample(noise(finish.seed, octaves=6), uv[:, 0], uv[:, 1], size=1.3)
    stains = sample(noise(finish.seed + 50, octaves=3), uv[:, 0], uv[:, 1], size=4.0)
    return _tint(finish, 0.035 * rough + 0.05 * stains)


def _ceiling(finish: Finish, uv: ndarray, half: ndarray, places: ndarray) -> ndarray:
    seam = np.minimum(np.abs((uv[:, 0] / 0.6) % 1.0 - 0.5), np.abs((uv[:, 1] / 0.6) % 1.0 - 0.5))
    specks = sample(noise(2, octaves=6), uv[:, 0], uv[:, 1], size=0.4)
    return _tint(finish, 0.05 * specks - 0.35 * (seam < 0.012))


def _wood(finish: Finish, uv: ndarray, half: ndarray, places: ndarray) -> ndarray:
    width, length = 0.13, 1.1
    x, y = places[:, 0] + 10.0, places[:, 1] + 10.0
    board = np.floor(x / width)
    start = (board * 0.618 * length) % length
    piece = np.floor((y + start) / length)
    pick = np.sin(board * 12.9898 + piece * 78.233 + finish.seed) * 43758.5453
    pick -= np.floor(pick)
    grain = sample(noise(finish.seed + 1, octaves=6), x * 7.0 + pick * 9.0, y, size=2.6)
    rings = np.sin(40.0 * (x + 0.05 * grain) + 6.0 * pick)
    across = np.minimum(x % width, width - x % width)
    along = (y + start) % length
    along = np.minimum(along, length - along)
    gap = (across < 0.0022) | (along < 0.0025)
    amount = 0.34 * (pick - 0.5) + 0.16 * grain + 0.04 * rings - 0.45 * gap
    tone = np.stack([np.ones_like(pick), 1.0 - 0.06 * pick, 1.0 - 0.14 * pick], axis=1)
    return np.asarray(_tint(finish, amount) * tone)


def _tiles(finish: Finish, uv: ndarray, half: ndarray, places: ndarray) -> ndarray:
    size = 0.42
    x, y = places[:, 0] + 10.0, places[:, 1] + 10.0
    pick = np.sin(np.floor(x / size) * 12.9898 + np.floor(y / size) * 78.233) * 43758.5453
    pick -= np.floor(pick)
    cloud = sample(noise(finish.seed + 1), x + 3.0 * pick, y, size=0.9)
    edge = np.minimum(np.minimum(x % size, size - x % size), np.minimum(y % size, size - y % size))
    return _tint(finish, 0.16 * (pick - 0.5) + 0.12 * cloud - 0.42 * (edge < 0.004))


def _veneer(finish: Finish, uv: ndarray, half: ndarray, places: ndarray) -> ndarray:
    grain = sample(noise(finish.seed, octaves=6), uv[:, 0], uv[:, 1] * 9.0, size=1.8)
    edge = (half - np.abs(uv)).min(axis=1)
    return _tint(finish, 0.22 * grain - 0.25 * (edge < 0.006))


def _fabric(finish: Finish, uv: ndarray, half: ndarray, places: ndarray) -> ndarray:
    along = places[:, 1] + places[:, 0]
    weave = sample(noise(finish.seed, octaves=7), along, places[:, 2], size=0.5)
    folds = sample(noise(finish.seed + 1, octaves=3), places[:, 1], places[:, 2], size=0.8)
    return _tint(finish, 0.10 * weave + 0.16 * folds)


def _books(finish: Finish, uv: ndarray, half: ndarray, places: ndarray) -> ndarray:
    palette = np.stack(
        [
            linear(c)
            for c in (
                "#5b4a3a",
                "#c8bfae",
                "#3c3f46",
                "#8a7a5c",
                "#e2ddd0",
                "#57606b",
                "#75705f",
                "#2f2b2a",
            )
        ]
    )
    rng = np.random.default_rng(finish.seed + round(1000 * float(places[:, 2].mean())) // 300)
    edges = np.cumsum(rng.uniform(0.018, 0.05, size=64)) - half[0]
    number = np.searchsorted(edges, uv[:, 0])
    tall = rng.uniform(0.55, 1.0, size=65)
    colours = palette[rng.integers(0, len(palette), size=65)] * rng.uniform(0.7, 1.2, (65, 1))
    height = (uv[:, 1] + half[1]) / (2.0 * half[1])
    painted = colours[number]
    label = (np.abs(height - 0.35 * tall[number]) < 0.03) & (number % 3 == 0)
    painted[label] = linear("#cbb67a")
    painted[height > tall[number] * 0.92] = linear("#1a1512")
    return painted


def _picture(finish: Finish, uv: ndarray, half: ndarray, places: ndarray) -> ndarray:
    rng = np.random.default_rng(finish.seed)
    u, v = uv[:, 0] / half[0], uv[:, 1] / half[1]
    border = np.maximum(np.abs(u), np.abs(v)) > 0.84
    sky, land, sun = (linear(c) for c in ("#a9bfc9", "#4f6455", "#e3c67e"))
    blend = np.clip(0.5 + 0.5 * v, 0.0, 1.0)[:, None]
    painted = sky * blend + linear("#e5d9c3") * (1.0 - blend)
    for layer in range(3):
        ridge = -0.1 - 0.28 * layer
        ridge = ridge + 0.18 * np.sin(u * rng.uniform(2, 5) + rng.uniform(0, 6))
        ridge = ridge + 0.06 * np.sin(u * rng.uniform(8, 14) + rng.uniform(0, 6))
        painted[v < ridge] = land * (0.9 - 0.22 * layer) * rng.uniform(0.8, 1.2, 3)
    x, y = rng.uniform(-0.5, 0.5), rng.uniform(0.2, 0.5)
    painted[np.hypot((u - x) * half[0] / half[1], v - y) < 0.12] = sun
    painted[border] = linear("#e8e4da")
    return np.asarray(painted)


def _outside(finish: Finish, uv: ndarray, half: ndarray, places: ndarray) -> ndarray:
    height = uv[:, 1] / half[1]
    painted = np.broadcast_to(linear("#e9f0f5"), (len(uv), 3)).copy()
    painted *= (0.85 + 0.15 * height)[:, None]
    trees = sample(noise(finish.seed + 30, octaves=5), uv[:, 0] + 3.0, uv[:, 1], size=1.4)
    edge = -0.15 + 0.35 * trees
    painted[height < edge] = linear("#8fa487")
    painted[height < edge - 0.45] = linear("#7d8f78")
    return painted


def _slats(finish: Finish, uv: ndarray, half: ndarray, places: ndarray) -> ndarray:
    return _tint(finish, -0.35 * ((uv[:, 1] / 0.028) % 1.0 < 0.28))


def _ribs(finish: Finish, uv: ndarray, half: ndarray, places: ndarray) -> ndarray:
    return _tint(finish, -0.45 * ((uv[:, 0] / 0.075) % 1.0 < 0.22) * (np.abs(uv[:, 1]) < 0.27))


def _screen(finish: Finish, uv: ndarray, half: ndarray, places: ndarray) -> ndarray:
    u, v = uv[:, 0] / half[0], uv[:, 1] / half[1]
    painted = _tint(finish, 0.3 * v)
    painted[(np.abs(u) < 0.55) & (np.abs(v - 0.1) < 0.45)] = linear("#d5dce2")
    painted[np.maximum(np.abs(u), np.abs(v)) > 0.93] = linear("#101114")
    return painted


def _board(finish: Finish, uv: ndarray, half: ndarray, places: ndarray) -> ndarray:
    u, v = uv[:, 0], uv[:, 1]
    painted = _tint(finish, 0.02 * sample(noise(8), u, v, size=0.5))
    for row, end in enumerate((0.18, 0.02, 0.24, -0.08)):
        wave = 0.012 * np.sin(90.0 * u + row) * np.sin(37.0 * u + 2 * row)
        written = (np.abs(v - 0.15 + 0.09 * row - wave) < 0.006) & (u > -0.3) & (u < end)
        painted[written] = linear("#2c3f74")
    return painted


def _clock(finish: Finish, uv: ndarray, half: ndarray, places: ndarray) -> ndarray:
    u, v = uv[:, 0], uv[:, 1]
    painted = _tint(finish, np.zeros(len(u)))
    painted[(np.abs(u) < 0.005) & (v > -0.01) & (v < 0.09)] = linear("#1a1a1a")
    painted[(np.abs(v - 0.5 * u) < 0.006) & (u > 0.0) & (u < 0.06)] = linear("#1a1a1a")
    return painted


def _rug(finish: Finish, uv: ndarray, half: ndarray, places: ndarray) -> ndarray:
    if half.min() < 0.01:  # the rug's own thickness
        return _tint(finish, np.full(len(uv), -0.6))
    edge = (half - np.abs(uv)).min(axis=1)
    pile = sample(noise(finish.seed, octaves=7), uv[:, 0], uv[:, 1], size=0.7)
    painted = _tint(finish, 0.22 * pile)
    lines = ((edge > 0.06) & (edge < 0.09)) | ((edge > 0.13) & (edge < 0.20))
    diamonds = (np.abs((uv[:, 0] / 0.3) % 1.0 - 0.5) + np.abs((uv[:, 1] / 0.3) % 1.0 - 0.5)) < 0.16
    pattern = lines | (diamonds & (edge > 0.26))
    painted[pattern] = (linear(finish.second) * (1.0 + 0.22 * pile)[:, None])[pattern]
    return painted


def _mirror(finish: Finish, uv: ndarray, half: ndarray, places: ndarray) -> ndarray:
    return np.zeros((len(uv), 3))  # a mirror has no colour: what it shows is traced


PAINTERS: dict[str, Painter] = {
    "mirror": _mirror,
    "plain": _plain,
    "plaster": _plaster,
    "ceiling": _ceiling,
    "wood": _wood,
    "tiles": _tiles,
    "veneer": _veneer,
    "fabric": _fabric,
    "books": _books,
    "picture": _picture,
    "outside": _outside,
    "slats": _slats,
    "ribs": _ribs,
    "screen": _screen,
    "board": _board,
    "clock": _clock,
    "rug": _rug,
}
