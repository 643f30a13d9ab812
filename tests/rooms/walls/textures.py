"""Surfaces painted by rule: noise, cloth, wood, plaster, pictures; all in linear light."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.ndimage import gaussian_filter, map_coordinates, zoom

TILE = 96
"""Width and height, in texels, of one cloth in a person's texture."""


@dataclass(frozen=True, slots=True)
class Look:
    """What a person looks like; colours as ``#rrggbb``."""

    stature: float
    """Height in metres."""
    shirt: str
    pattern: str
    """plain, stripes, checks, zip or band."""
    accent: str
    """The pattern's second colour."""
    trousers: str
    shoes: str
    hair: str
    skin: str
    long_hair: bool = False
    short_sleeves: bool = False
    build: float = 1.0
    """Girth, 1 for slim."""


def linear(colour: str) -> Float[ndarray, " 3"]:
    """Linear reflectance of an sRGB colour ``#rrggbb``."""
    value = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0
    light: ndarray = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    return light


@cache
def noise(seed: int, octaves: int = 5, size: int = 256) -> Float[ndarray, "S S"]:
    """Periodic fractal noise between about -1 and 1, standard deviation near 0.4."""
    rng = np.random.default_rng(seed)
    total = np.zeros((size, size))
    for octave in range(octaves):
        cells = 4 * 2**octave
        grid = rng.standard_normal((cells, cells))
        wrapped = np.pad(grid, 2, mode="wrap")
        fine = zoom(wrapped, size / cells, order=3, grid_mode=True, mode="nearest")
        margin = 2 * size // cells
        total += fine[margin : margin + size, margin : margin + size] * 0.55**octave
    return np.asarray(np.clip(total / (2.2 * total.std()), -1.2, 1.2))


def sample(field: ndarray, u: ndarray, v: ndarray, *, size: float) -> ndarray:
    """A periodic field at u, v in metres, where the whole field covers ``size`` metres."""
    scale = field.shape[0] / size
    return np.asarray(map_coordinates(field, [v * scale, u * scale], order=1, mode="grid-wrap"))


def clothes(look: Look) -> Float[ndarray, "96 672 3"]:
    """The texture of one person: shirt, sleeve, trousers, skin, face, hair, shoes in a row.

    In each tile the columns go around the body, from the back over the right
    side, the front (middle) and the left side to the back, and the rows from
    top to bottom.
    """
    rows, columns = np.mgrid[0:TILE, 0:TILE]
    v, u = (rows + 0.5) / TILE, (columns + 0.5) / TILE
    front = np.abs(u - 0.5)  # 0 at the front, 0.5 at the back
    fine = noise(3, octaves=6)[:TILE, :TILE]
    folds = gaussian_filter(noise(11)[:TILE, 40 : 40 + TILE], (1.5, 5.0))
    long_folds = gaussian_filter(noise(12)[:TILE, 80 : 80 + TILE], (6.0, 1.5))
    skin = _shade(linear(look.skin), 0.05 * fine)

    weave = 0.10 * fine + 0.28 * folds
    shirt = _shade(linear(look.shirt), weave)
    sleeve = _shade(linear(look.shirt), 0.10 * fine + 0.30 * folds)
    accent = linear(look.accent)
    if look.pattern == "stripes":
        for cloth, count in ((shirt, 9.0), (sleeve, 8.0)):
            cloth[(v * count) % 1.0 < 0.36] = 0.0
            cloth += ((v * count) % 1.0 < 0.36)[..., None] * _shade(accent, weave)
    elif look.pattern == "checks":
        across = ((u * 16.0) % 1.0 < 0.3).astype(float) + ((v * 10.0) % 1.0 < 0.3)
        for cloth in (shirt, sleeve):
            cloth += 0.42 * across[..., None] * (_shade(accent, weave) - cloth)
    elif look.pattern == "zip":
        shirt[front < 0.012] = accent
        pocket = (v > 0.66) & (v < 0.68) & (front > 0.05) & (front < 0.19)
        shirt[pocket] *= 0.45
    elif look.pattern == "band":
        band = (v > 0.34) & (v < 0.52)
        shirt[band] = _shade(accent, weave)[band]
        sleeve[(v > 0.30) & (v < 0.42)] = accent
    collar = v < 0.05
    shirt[collar] *= 0.6
    shirt[v > 0.965] *= 0.55
    open_neck = (v < 0.10 - 0.9 * front) & (front < 0.1)
    shirt[open_neck] = skin[open_neck]
    sleeve[v > 0.96] *= 0.6
    if look.short_sleeves:
        bare = v > 0.42
        sleeve[bare] = skin[bare]
        sleeve[(v > 0.40) & (v <= 0.42)] *= 0.6

    trousers = _shade(linear(look.trousers), 0.16 * fine + 0.35 * long_folds)
    trousers[np.abs(np.abs(u - 0.5) - 0.25) < 0.012] *= 0.7  # the seams at the sides
    knee = np.exp(-(((v - 0.5) / 0.08) ** 2)) * np.exp(-((front / 0.15) ** 2))
    trousers *= 1.0 + 0.25 * knee[..., None]

    face = skin.copy()
    blush = np.exp(-(((v - 0.58) / 0.10) ** 2)) * np.exp(-(((front - 0.10) / 0.05) ** 2))
    face *= 1.0 + blush[..., None] * np.array([0.05, -0.12, -0.10])
    dark = linear(look.hair) * 0.8
    eyes = (np.abs(v - 0.455) < 0.022) & (np.abs(front - 0.078) < 0.030)
    face[eyes] = linear("#d8d2cc")
    face[(np.abs(v - 0.455) < 0.022) & (np.abs(front - 0.076) < 0.013)] = linear("#2a2019")
    face[(np.abs(v - 0.395) < 0.016) & (np.abs(front - 0.080) < 0.042)] = dark
    face[(np.abs(v - 0.725) < 0.016) & (front < 0.060)] = linear("#9a4a42")
    face *= (1.0 - 0.25 * np.exp(-(((v - 0.47) / 0.05) ** 2)) * (front < 0.14))[..., None]
    scalp = front > 0.5 - 0.42 * np.clip(1.0 - v, 0.0, 0.62)
    face[scalp] = dark

    strands = gaussian_filter(noise(21, octaves=6)[:TILE, :TILE], (4.0, 0.5))
    hair = _shade(linear(look.hair), 0.9 * strands + 0.1 * fine)
    shoes = _shade(linear(look.shoes), 0.15 * fine)
    sole = np.abs(u - 0.5) > 0.37
    shoes[sole] = linear("#d9d4c8") if look.shoes != "#1c1a19" else linear("#111111")
    return np.concatenate([shirt, sleeve, trousers, skin, face, hair, shoes], axis=1)


def _shade(colour: ndarray, amount: ndarray) -> ndarray:
    return np.clip(colour * (1.0 + amount)[..., None], 0.0, 1.0)


def door_leaf() -> Float[ndarray, "96 96 3"]:
    """A panelled door: handle on the right, as seen from either side."""
    rows, columns = np.mgrid[0:TILE, 0:TILE]
    v, u = (rows + 0.5) / TILE, (columns + 0.5) / TILE
    leaf = np.broadcast_to(linear("#c9b394"), (TILE, TILE, 3)) * (
        1.0 + 0.06 * gaussian_filter(noise(31)[:TILE, :TILE], (8.0, 0.6))[..., None]
    )
    leaf = leaf.copy()
    for low, high in ((0.07, 0.42), (0.50, 0.93)):
        for left, right in ((0.12, 0.46), (0.54, 0.88)):
            inside = (v > low) & (v < high) & (u > left) & (u < right)
            border = inside & ~(
                (v > low + 0.014) & (v < high - 0.014) & (u > left + 0.03) & (u < right - 0.03)
            )
            leaf[inside] *= 0.93
            leaf[border] *= 0.75
    leaf[(np.abs(v - 0.50) < 0.012) & (u > 0.86) & (u < 0.95)] = linear("#8b8b8e")
    return leaf
