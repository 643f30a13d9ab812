"""The sequence's templates: boxes whose colour histograms model the people.

The likelihood of a box's colours is added to the results of every method, and shown at every place
of an image on a coarse grid: everywhere what filters evaluate at their samples, for display, and
for judging templates before any filter runs.

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
from tracker.sequences.errors import SequenceError
from tracker.sequences.pictures.frames import Picture, Pictures
from tracker.sequences.sequence import Sequence
from tracker.single_view.box_sizes import BoxSizes
from tracker.single_view.pictures import colour
from tracker.single_view.pictures.colour import ColourModel, ColourSpaceName, KernelName


def read_templates(
    sequence: Sequence, space: ColourSpaceName, kernel: KernelName, reader: Pictures
) -> ColourModel:
    """Read the colour model of the sequence's templates, once for all cameras.

    Args:
        sequence: The sequence; templates of one name are of one person.
        space: The bins of the histograms.
        kernel: The weights of the pixels of a box.
        reader: Reader of the images.

    Raises:
        ValueError: If there is no template, or the image or box of one cannot be used.
    """
    if not sequence.templates:
        raise ValueError(
            f"{sequence.name} has no template of a person's colours; add at least one [[template]] "
            "with camera, frame and box to sequence.toml"
        )
    what = [(t.name, t.camera, t.frame, t.box.tobytes()) for t in sequence.templates]
    return reader.once(
        ("templates", space, kernel, *what), lambda: _read(sequence, space, kernel, reader)
    )


def template_picture(reader: Pictures, camera: int, step: int) -> Picture | None:
    """Read the image of a template, once: in a video it is far from the frames read otherwise.

    Args:
        reader: Reader of the images.
        camera: Index of the camera.
        step: Step of the template.
    """
    return reader.once(("template picture", camera, step), lambda: reader.picture(camera, step))


def _read(
    sequence: Sequence, space: ColourSpaceName, kernel: KernelName, reader: Pictures
) -> ColourModel:
    """Read the histograms of all templates, or raise an error that names the template."""
    names = [camera.name for camera in sequence.cameras]
    histograms = []
    for template in sequence.templates:
        place = (
            f'{sequence.folder.name}/sequence.toml, template "{template.name}" '
            f"({template.camera}, frame {template.frame})"
        )
        if template.camera not in names:
            raise SequenceError(f"{place}: there is no such camera; expected {', '.join(names)}")
        picture = template_picture(reader, names.index(template.camera), template.frame)
        if picture is None:
            raise SequenceError(f"{place}: its picture cannot be read; choose another frame")
        box = Boxes.from_left_top(template.box[None]).centred
        histogram = colour.histograms(colour.bin_map(picture, space), box, space, kernel)[0]
        if not histogram.any():
            raise SequenceError(
                f"{place}: the box {template.box.tolist()} lies outside the picture of "
                f"{picture.shape[1]}x{picture.shape[0]}; move it inside"
            )
        histograms.append(histogram)
    return ColourModel.of(
        np.array(histograms),
        [template.name for template in sequence.templates],
        space,
        kernel,
    )


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
