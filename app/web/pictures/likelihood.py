"""Likelihood maps as pictures: where a camera's picture looks like one of the templates."""

from __future__ import annotations

import hashlib
import threading

import cv2
import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray

from app.errors import sentence
from app.state.snapshot import Snapshot
from app.web.pictures import address
from tracker.parameters.groups.colour_phd import ColourPhdParams
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence
from tracker.single_view.box_sizes import BoxSizes
from tracker.single_view.colour.templates import likelihood_map, read_templates
from tracker.single_view.pictures.colour import ColourModel

LOW, HIGH = (200, 84, 26), (150, 255, 190)
"""Blue, green, red of a small and of the largest likelihood: hues that neither skin, wood nor the
marks of boxes have."""

DIM, OPAQUE = 110, 235
"""Opacities of 255: of the shade over what looks like nobody, and where the colours are just a
template's."""

missing = address.missing("no_likelihood")
"""The answer where there is no map."""


def key_of(sequence: Sequence, parameters: ColourPhdParams) -> str:
    """Names what a map depends on besides its picture, so that it may be kept for ever."""
    parts = (
        sequence.digest,
        parameters.colour_space,
        parameters.histogram_kernel,
        parameters.likelihood_sigma,
        parameters.acceptance_distance,
        (LOW, HIGH, DIM, OPAQUE),
    )
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:16]


def shown_colours(snapshot: Snapshot) -> ColourPhdParams:
    """The numbers of the run that is shown, else those that are chosen."""
    run = snapshot.run
    return (run.parameters if run is not None else snapshot.parameters).of(ColourPhdParams)


class Likelihoods:
    """Makes the maps; keeps the colour model and the sizes of those asked for last."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._key = ""
        self._model: ColourModel | None = None
        self._sizes: dict[int, BoxSizes] = {}

    def png(
        self,
        sequence: Sequence,
        reader: FrameReader,
        parameters: ColourPhdParams,
        camera: int,
        picture: UInt8[ndarray, "h w 3"],
    ) -> bytes:
        """One map as a transparent PNG of a pixel a cell.

        Args:
            sequence: Whose templates.
            reader: Of the pictures that they are in.
            parameters: Of the colours.
            camera: Index.
            picture: Of this camera, BGR.

        Raises:
            ApiError: If there is no template to compare it with.
        """
        model, sizes = self._prepared(sequence, reader, parameters, camera)
        sigma = parameters.likelihood_sigma
        least = -0.5 * (parameters.acceptance_distance / sigma) ** 2
        return heat(likelihood_map(picture, model, sizes, sigma), least)

    def _prepared(
        self, sequence: Sequence, reader: FrameReader, parameters: ColourPhdParams, camera: int
    ) -> tuple[ColourModel, BoxSizes]:
        key = key_of(sequence, parameters)
        with self._lock:
            if key != self._key or self._model is None:
                space, kernel = parameters.colour_space, parameters.histogram_kernel
                try:
                    self._model = read_templates(sequence, space, kernel, reader)
                except ValueError as error:
                    raise missing(sentence(error), None) from None
                self._key, self._sizes = key, {}
            if camera not in self._sizes:
                self._sizes[camera] = BoxSizes.of(
                    sequence.cameras[camera], sequence.room, sequence.target_half_extents
                )
            return self._model, self._sizes[camera]


def heat(values: Float[ndarray, "rows columns"], least: float) -> bytes:
    """Log-likelihoods as a transparent PNG: the likelier, the brighter and the denser.

    All else lies in shade, or what is likely would be lost in a bright picture.

    Args:
        values: 0 at most.
        least: What is at least so likely is seen; below 0.
    """
    share = np.clip(1.0 - values / least, 0.0, 1.0)[:, :, None]
    picture = np.empty((*values.shape, 4), dtype=np.uint8)
    seen = np.minimum(1.0, 8.0 * share)  # out of the shade there is no hard edge
    picture[:, :, :3] = np.rint(seen * (np.array(LOW) * (1.0 - share) + np.array(HIGH) * share))
    picture[:, :, 3] = np.rint(DIM + (OPAQUE - DIM) * np.sqrt(share[:, :, 0]))
    done, data = cv2.imencode(".png", picture)
    assert done, "a picture of four channels can be written as PNG"
    return bytes(data)
