"""Target boxes in outlines: possible heads, or heads and torsos, in foreground components.

A foreground component shows all of a person, while the target may be a part of it: a
target's box begins at the crown, and its size is known from the calibrated camera. The
number of targets in a component is known from its tracks; without such a prior
:mod:`~tracker.single_view.jpda.crowns` detects them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8
from numpy import ndarray

from tracker.geometry.camera import Camera
from tracker.kernels.pictures import silhouettes
from tracker.kernels.pictures.silhouettes import Acceptance, SizeTable
from tracker.parameters.groups.association_matrix import AssociationMatrixParams
from tracker.sequences.sequence import Room
from tracker.single_view.box_sizes import BoxSizes, outline_share
from tracker.single_view.pictures.foreground import Blobs, integral, shape_scores

SIZES = 6
"""Number of sizes tried at each place; the best are averaged, so few are enough."""

STRIDE = 2
"""Distance between the columns of a component in which crowns are tried, pixels; the best
are averaged, so not every column is needed."""


@dataclass(frozen=True, slots=True, eq=False)
class Fits:
    """Boxes that fit the outlines, component by component, the best of each first."""

    boxes: Float[ndarray, "N 4"]
    """Centre and half sizes, pixels."""
    scores: Float[ndarray, " N"]
    """Log likelihood up to a constant, at most about 0."""
    owners: Int[ndarray, " N"]
    """Index of the foreground component of each box."""
    filled: Bool[ndarray, " J"]
    """Whether any box in each component has enough foreground inside."""


class Silhouettes:
    """A detector of targets in the foreground of one camera by its outline alone.

    In every second column of a component its highest pixel may be a crown;
    boxes of the sizes that a target can have there hang from it. A good one is full of
    foreground, with background above and beside it (:func:`shape_scores`); the best
    one, averaged with its neighbours, is accepted, those near it are rejected, and so on.

    The size of a target at a place depends on its distance, which one camera does not
    determine. People keep about the height at which they come in, so most of the sizes are
    those at the heights of the entrances, or of people on the floor where there are none.
    """

    def __init__(self, camera: Camera, room: Room, half_extents: Float[ndarray, " 3"]) -> None:
        """Compute the possible sizes at each place of the image."""
        self._sizes = BoxSizes.of(camera, room, half_extents, at_usual_heights=True)
        self._table, self._possible = self._sizes.quantiles(SIZES)
        self._outline = outline_share(half_extents)
        self._usual = (self._sizes.smallest[1] + self._sizes.largest[1]) / 2.0

    def half_heights(self, centres: Float[ndarray, "N 2"]) -> Float[ndarray, " N"]:
        """The median half height of a target at each place, pixels."""
        place = self._sizes.cells(centres)
        usual = self._table[place, SIZES // 2, 1]
        return np.asarray(np.where(self._possible[place], usual, self._usual))

    def fit(
        self,
        mask: UInt8[ndarray, "h w"],
        pieces: Blobs,
        wanted: Int[ndarray, " J"],
        parameters: AssociationMatrixParams,
    ) -> Fits:
        """Fit target boxes to each foreground component.

        Args:
            mask: The foreground mask.
            pieces: The components of the mask.
            wanted: Estimated number of targets in each component.
            parameters: Parameters of the scores, and the least scores of a component's best box,
                of further ones and of boxes beyond the estimated number.
        """
        p = parameters
        sizes = SizeTable(
            self._table, self._possible, self._sizes.cell, self._sizes.columns, self._sizes.rows
        )
        hanging = silhouettes.candidates(pieces.owners, pieces.boxes, sizes, self._usual, STRIDE)
        scores, inside = shape_scores(
            integral(mask),
            hanging.boxes,
            inside_weight=p.inside_weight,
            around_weight=p.around_weight,
            outline=self._outline,
        )
        good = inside >= p.least_inside
        chosen = silhouettes.choose(
            silhouettes.Candidates(hanging.boxes[good], hanging.owners[good]),
            scores[good],
            np.asarray(wanted, dtype=np.int64),
            Acceptance(p.acceptance, p.further_acceptance, p.spare_acceptance),
            p.averaging_width,
            p.apart,
        )
        filled = np.isin(np.arange(pieces.size), hanging.owners[good])
        return Fits(chosen.boxes, chosen.scores, chosen.owners, filled)
