"""The colour likelihood of a target's box at every place of an image, on a coarse grid.

It shows everywhere what filters evaluate at their samples: for display, and for judging
templates before any filter runs.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray

from tracker.single_view.box_sizes import BoxSizes
from tracker.single_view.pictures import colour
from tracker.single_view.pictures.colour import ColourModel

COLUMNS = 72
"""Number of cells across an image, as fine as a pane can show."""


def likelihood_map(
    picture: UInt8[ndarray, "h w 3"],
    model: ColourModel,
    sizes: BoxSizes,
    sigma: float,
    columns: int = COLUMNS,
) -> Float[ndarray, "rows columns"]:
    """Compute ln l = −D² / 2σ² of the box of a target centred in each cell.

    It is 0 where the colours equal a template's; D is the distance to the nearest
    template, as in :meth:`ColourModel.distances`. A box has the median size of a target at that
    place; where no target can be centred l is 0.

    Args:
        picture: The image, BGR.
        model: The colour model of the templates.
        sizes: Possible sizes of targets in this camera.
        sigma: σ of the likelihood, in units of D.
        columns: Number of cells across; they are square.
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
