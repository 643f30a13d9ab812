"""The colour likelihood of a person's box at every place of a picture, on a coarse grid.

What the filters see through the few boxes that they draw, seen everywhere: good for
looking at, and for judging templates before any filter runs.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray

from tracker.single_view.box_sizes import BoxSizes
from tracker.single_view.pictures import colour
from tracker.single_view.pictures.colour import ColourModel

COLUMNS = 72
"""Places across a picture: as fine as the eye follows in a pane."""


def likelihood_map(
    picture: UInt8[ndarray, "h w 3"],
    model: ColourModel,
    sizes: BoxSizes,
    sigma: float,
    columns: int = COLUMNS,
) -> Float[ndarray, "rows columns"]:
    """ln l = −D² / 2σ² of the box that a target centred in each cell would have.

    It is 0 where the colours are just a template's; D is the distance to the nearest
    template, as in :meth:`ColourModel.distances`. A box's size is the middle one that
    the calibrated camera allows there; where no target can be centred l is 0.

    Args:
        picture: BGR.
        model: The templates.
        sizes: What targets look like to this camera.
        sigma: σ of the likelihood, in units of D.
        columns: Cells across; they are square, so their rows follow from the picture.
    """
    height, width = picture.shape[:2]
    rows = max(1, round(columns * height / width))
    y, x = np.mgrid[0:rows, 0:columns]
    centres = np.stack(
        [(x + 0.5) * width / columns - 0.5, (y + 0.5) * height / rows - 0.5], axis=-1
    ).reshape(-1, 2)
    boxes, possible = sizes.typical(centres)
    bins = colour.bin_map(picture, model.space)
    values = np.full(len(centres), -np.inf)
    if possible.any():
        there = np.concatenate([centres, boxes], axis=1)[possible]
        distances = model.distances(bins, there).min(axis=1)
        values[possible] = -0.5 * (distances / sigma) ** 2
    return values.reshape(rows, columns)
