"""Target boxes in outlines: where in a piece of foreground a head, or a head and torso, can be.

A piece of foreground shows all of a person, what is tracked may be a part of it: a
target's box begins at the crown, and its size is known from the calibrated camera. How
many targets a piece shows is known from its tracks; without such a prior
:mod:`~tracker.single_view.jpda.crowns` finds them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int, UInt8
from numpy import ndarray

from tracker.geometry.camera import Camera
from tracker.kernels.pictures import silhouettes
from tracker.kernels.pictures.silhouettes import Acceptance, SizeTable
from tracker.parameters import AssociationMatrixParams
from tracker.sequences.sequence import Room
from tracker.single_view.box_sizes import BoxSizes
from tracker.single_view.pictures.blobs import Blobs
from tracker.single_view.pictures.foreground import integral, shape_scores

SIZES = 6
"""Sizes of targets that are tried at each place; the best are averaged, so few are enough."""

STRIDE = 2
"""Pixels between the columns of a piece of foreground in which crowns are looked for; the best
are averaged, so not every column is needed."""


@dataclass(frozen=True, slots=True, eq=False)
class Fits:
    """Boxes that outlines fit, piece by piece, the best of a piece first."""

    boxes: Float[ndarray, "N 4"]
    """Centre and half sizes, pixels."""
    scores: Float[ndarray, " N"]
    """At most about 0; e raised to it is taken for a likelihood."""
    owners: Int[ndarray, " N"]
    """The piece of foreground that each is in."""


class Silhouettes:
    """Finds targets in the foreground of one camera by nothing but its outline.

    In every second column of a piece of foreground its highest pixel may be a crown;
    boxes of the sizes that a target can have there hang from it. A good one is full of
    foreground, with background above and beside it (:func:`shape_scores`); the best
    one, averaged with its neighbours, is taken, those near it are dropped, and so on.

    How large a target is at a place depends on its distance, which one camera does not
    tell. People keep about the height at which they come in, so most of the sizes are
    those at the heights of the entrances.
    """

    def __init__(self, camera: Camera, room: Room, half_extents: Float[ndarray, " 3"]) -> None:
        """Work out the sizes at each place of the picture."""
        self._sizes = BoxSizes.of(camera, room, half_extents, at_entrance_heights=True)
        self._table, self._possible = self._sizes.quantiles(SIZES)
        self._usual = (self._sizes.smallest[1] + self._sizes.largest[1]) / 2.0

    def half_heights(self, centres: Float[ndarray, "N 2"]) -> Float[ndarray, " N"]:
        """The usual half height of a target at each place, pixels."""
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
        """The targets in each piece of foreground.

        Args:
            mask: Foreground.
            pieces: Its pieces.
            wanted: How many targets each piece is believed to hold.
            parameters: How scores are made, and the least of a piece's best box, of its others
                and of boxes beyond the number that is believed.
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
        return Fits(chosen.boxes, chosen.scores, chosen.owners)
