"""Whose colours the boxes of one camera have: told of every method that is given pictures."""

from __future__ import annotations

import logging

import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray
from scipy.special import softmax

from tracker import colour
from tracker.boxes import Boxes
from tracker.colour import ColourModel
from tracker.parameters import ColourPhdParams
from tracker.sequences.frames import Pictures
from tracker.sequences.sequence import Sequence
from tracker.single_view.colour.templates import read_templates

logger = logging.getLogger(__name__)

_NUMBERS = ColourPhdParams()
"""Who looks like whom is asked with one set of numbers, whichever method found the boxes."""


class Likeness:
    """The people with templates, and what a box's colours say of them.

        p_g(z) ∝ exp(−D_g(z)² / 2σ²)

    with the Bhattacharyya distance D_g to the nearest template of person g: the
    likelihood of [ZW21] for each person, so that a box of nobody's colours tells nothing.
    """

    def __init__(self, model: ColourModel) -> None:
        self._model = model

    @staticmethod
    def of(sequence: Sequence, reader: Pictures) -> Likeness | None:
        """Read the templates; None where there are not two people to tell apart.

        A template that cannot be read is told to the log: a method that needs none goes on.
        """
        if len({template.name for template in sequence.templates}) < 2:
            return None
        try:
            model = read_templates(
                sequence, _NUMBERS.colour_space, _NUMBERS.histogram_kernel, reader
            )
        except ValueError as error:
            logger.warning("nobody of %s is known by colours: %s", sequence.name, error)
            return None
        return Likeness(model)

    def of_boxes(
        self, picture: UInt8[ndarray, "h w 3"], boxes: Float[ndarray, "N 4"]
    ) -> Float[ndarray, "N P"]:
        """Probability of each of P people for each box, if it is one's.

        Args:
            picture: BGR.
            boxes: Centre and half sizes, pixels; equal probabilities outside the picture.
        """
        people = len(self._model.names)
        height, width = picture.shape[:2]
        low = np.floor(np.clip(Boxes(boxes).low - 1.0, 0.0, [width, height]))
        high = np.ceil(np.clip(Boxes(boxes).high + 2.0, 0.0, [width, height]))
        told = np.full((len(boxes), people), 1.0 / people)
        inside = np.flatnonzero((high > low).all(axis=1))
        if not len(inside):
            return told
        # only what the boxes cover is looked at: they are few and the picture may be large
        left, top = low[inside].min(axis=0).astype(int)
        right, bottom = high[inside].max(axis=0).astype(int)
        bins = colour.bin_map(picture[top:bottom, left:right], self._model.space)
        distances = self._model.distances(bins, boxes[inside] - [left, top, 0.0, 0.0])
        told[inside] = softmax(-0.5 * (distances / _NUMBERS.likelihood_sigma) ** 2, axis=1)
        return told
