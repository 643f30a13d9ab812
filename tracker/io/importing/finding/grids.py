"""The grid of places that are numbered: its columns, cells and origin from the annotated boxes.

Cell i of a grid of W columns lies at x = x₀ + s (i mod W), y = y₀ + s ⌊i / W⌋, or with x and y
exchanged. One coordinate of the feet grows with i by s / W a cell; of all W that one is taken with
which the other coordinate follows from i mod W.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.geometry.camera import Camera
from tracker.io.read.pieces import TruthPiece

_FEWEST = 50
"""Rows with feet from which a grid is inferred."""

_SAMPLED = 1000
"""Rows of which the grid is inferred, at most."""

_COMPARED = 200
"""Rows of these by which counts of columns are compared."""

_MOST_COLUMNS = 10_000

_LARGEST_CELL = 1.0
"""Metres."""

_USUAL = (1.0, 2.0, 2.5, 4.0, 5.0)
"""The first digits of usual sizes."""

_ROUNDING = 0.05
"""Relative error of a cell's size that is taken for the boxes' error."""

_LARGEST_ERROR = 0.25
"""Median distance of the feet from the middles of their cells, metres."""


def feet_on_floor(
    piece: TruthPiece, views: Sequence[str | None], cameras: Sequence[Camera], floor: float
) -> Float[ndarray, "G 2"]:
    """Return where the annotated boxes of each row stand, the median over the cameras.

    Args:
        piece: The truth, with the feet of its rows in the pictures.
        views: The name of each camera in the file; None for one that it does not have.
        cameras: The cameras in metres, z up.
        floor: z of the floor, metres.

    Returns:
        x and y in metres; NaN for a row that no camera sees.
    """
    found = np.full((len(cameras), len(piece.frames), 2), np.nan)
    for place, view, camera in zip(found, views, cameras, strict=True):
        pixels = piece.feet.get(view or "", np.zeros((0, 2)))
        rows = np.flatnonzero(np.isfinite(pixels).all(axis=1))
        rays = camera.back_project(pixels[rows])
        down = rays[:, 2] < 0.0  # the others never meet the floor
        along = (floor - camera.centre[2]) / rays[down, 2]
        place[rows[down]] = camera.centre[:2] + along[:, None] * rays[down, :2]
    seen = np.isfinite(found).any(axis=(0, 2))
    result = np.full((len(piece.frames), 2), np.nan)
    result[seen] = np.nanmedian(found[:, seen], axis=0)
    return result


def infer_grid(
    cells: Int[ndarray, " G"], feet: Float[ndarray, "G 2"]
) -> tuple[Float[ndarray, "G 2"], str] | None:
    """Infer the grid that explains where the boxes stand.

    Args:
        cells: The number of the cell of each row.
        feet: Where the row's boxes stand, metres; NaN for none.

    Returns:
        The place of each row in metres, and a phrase about the grid; None if no grid fits.
    """
    known = np.flatnonzero(np.isfinite(feet).all(axis=1))
    if len(known) < _FEWEST:
        return None
    known = known[np.linspace(0, len(known) - 1, min(_SAMPLED, len(known))).astype(int)]
    best: tuple[float, Float[ndarray, "G 2"], str] | None = None
    for slow in (1, 0):
        fast = 1 - slow
        slope = _slope(cells[known].astype(float), feet[known, slow])
        for sign in (1, -1):
            columns = _columns(cells[known], feet[known, fast], sign * abs(slope))
            cell = _rounded(abs(slope) * columns)
            places = np.empty((len(cells), 2))
            places[:, fast] = sign * cell * (cells % columns)
            places[:, slow] = np.sign(slope) * cell * (cells // columns)
            origin = np.median(feet[known] - places[known], axis=0)
            origin = np.round(origin / cell) * cell
            places += origin
            error = float(np.median(np.linalg.norm(feet[known] - places[known], axis=1)))
            words = (
                f"{columns} columns of {100.0 * cell:.3g} cm along {'xy'[fast]} from "
                f"({origin[0]:.3g}, {origin[1]:.3g}) m"
            )
            if error < _LARGEST_ERROR and (best is None or error < best[0]):
                best = error, places, words
    return None if best is None else best[1:]


def _slope(cells: Float[ndarray, " N"], along: Float[ndarray, " N"]) -> float:
    """Return metres a cell number, by least squares without the worst tenth of the rows."""
    keep = np.ones(len(cells), dtype=bool)
    slope = 0.0
    for _ in range(3):
        slope, at_zero = np.polyfit(cells[keep], along[keep], 1)
        off = np.abs(along - at_zero - slope * cells)
        keep = off <= np.quantile(off, 0.9)
    return float(slope) or 1.0


def _columns(cells: Int[ndarray, " N"], along: Float[ndarray, " N"], slope: float) -> int:
    """Return the count of columns with which the other coordinate scatters least."""
    some = slice(None, None, max(1, len(cells) // _COMPARED))
    counts = np.arange(2, min(_MOST_COLUMNS, 3 + int(_LARGEST_CELL / abs(slope))))
    scatters = []
    for few in np.array_split(counts[:, None], len(counts) // _COMPARED + 1):
        off = along[some] - slope * few * (cells[some] % few)
        scatters.append(np.median(np.abs(off - np.median(off, axis=1)[:, None]), axis=1))
    return int(counts[np.argmin(np.concatenate(scatters))])


def _rounded(cell: float) -> float:
    """Return the usual size that is nearest, if it is that but for the error of the boxes."""
    usual = np.outer(_USUAL, 10.0 ** np.arange(-3.0, 1.0)).ravel()
    nearest = float(usual[np.argmin(np.abs(np.log(usual / cell)))])
    return nearest if abs(nearest / cell - 1.0) < _ROUNDING else cell
