"""Colour likelihoods of the boxes of one camera, added to the results of every method.

[ZW21] Zhu, Wang, "3D target position tracking based on probability hypothesis
density filtering", 2021.
"""

from __future__ import annotations

import logging

import numpy as np
from jaxtyping import Float, Float16, Int, UInt8, UInt16
from numpy import ndarray

from tracker.geometry.boxes import Boxes
from tracker.parameters.groups.colour_phd import ColourPhdParams
from tracker.sequences.pictures.frames import Pictures
from tracker.sequences.sequence import Sequence
from tracker.single_view.colour.templates import read_templates
from tracker.single_view.pictures import colour
from tracker.single_view.pictures.colour import ColourModel, ColourSpaceName

logger = logging.getLogger(__name__)

_NUMBERS = ColourPhdParams()
"""The colour parameters, the same for all methods, so that likelihoods are comparable."""


class Likeness:
    """The people with templates, and the likelihood of a box's colours for each of them.

        p_g(z) ∝ exp(−D_g(z)² / 2σ²)

    with the Bhattacharyya distance D_g to the nearest template of person g: the
    likelihood of [ZW21] for each person, so that a box of other colours is uninformative.
    """

    def __init__(self, model: ColourModel) -> None:
        self._model = model

    @staticmethod
    def of(sequence: Sequence, reader: Pictures) -> Likeness | None:
        """Read the templates; None with fewer than two people.

        A template that cannot be read is reported in the log, for a method may need none.

        Args:
            sequence: The sequence with its templates.
            reader: Reader of the images.
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
        """Compute the probability of each of P people for each box, given that it is of one.

        Args:
            picture: The image, BGR.
            boxes: Centre and half sizes, pixels; equal probabilities outside the image.
        """
        from scipy.special import softmax  # a server starts without it

        people = len(self._model.names)
        likenesses = np.full((len(boxes), people), 1.0 / people)
        inside, bins, corner = _covered(picture, boxes, self._model.space)
        if not len(inside):
            return likenesses
        distances = self._model.distances(bins, boxes[inside] - corner)
        likenesses[inside] = softmax(-0.5 * (distances / _NUMBERS.likelihood_sigma) ** 2, axis=1)
        return likenesses


def appearance_of(
    picture: UInt8[ndarray, "h w 3"], boxes: Float[ndarray, "N 4"]
) -> Float16[ndarray, "N A"]:
    """Compute the root of each box's colour histogram: a unit vector, 0 outside the image.

    The product of two is the Bhattacharyya coefficient of their histograms.

    Args:
        picture: The image, BGR.
        boxes: Centre and half sizes of N boxes, pixels.
    """
    space, kernel = _NUMBERS.colour_space, _NUMBERS.histogram_kernel
    roots = np.zeros((len(boxes), colour.BINS[space]), dtype=np.float16)
    inside, bins, corner = _covered(picture, boxes, space)
    if len(inside):
        roots[inside] = np.sqrt(colour.histograms(bins, boxes[inside] - corner, space, kernel))
    return roots


def _covered(
    picture: UInt8[ndarray, "h w 3"], boxes: Float[ndarray, "N 4"], space: ColourSpaceName
) -> tuple[Int[ndarray, " K"], UInt16[ndarray, "h2 w2"], Float[ndarray, " 4"]]:
    """The boxes in the image, the histogram bins of the area that they cover together, and the
    offset that is subtracted from a box in that area.

    Boxes are few and the image may be large: the rest of it is not processed.
    """
    height, width = picture.shape[:2]
    low = np.floor(np.clip(Boxes(boxes).low - 1.0, 0.0, [width, height]))
    high = np.ceil(np.clip(Boxes(boxes).high + 2.0, 0.0, [width, height]))
    inside = np.flatnonzero((high > low).all(axis=1))
    if not len(inside):
        return inside, np.zeros((0, 0), dtype=np.uint16), np.zeros(4)
    left, top = low[inside].min(axis=0).astype(int)
    right, bottom = high[inside].max(axis=0).astype(int)
    bins = colour.bin_map(picture[top:bottom, left:right], space)
    return inside, bins, np.array([left, top, 0.0, 0.0])
