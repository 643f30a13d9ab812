"""People by shape as measurements of the data association in one camera."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray
from scipy.special import expit

from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.parameters.groups.shapes import ShapesParams
from tracker.sequences.pictures.frames import Pictures
from tracker.sequences.sequence import Sequence
from tracker.single_view.jpda import Jpda
from tracker.single_view.jpda.measurements import Measured
from tracker.single_view.protocol import CANDIDATES, DROPPED
from tracker.single_view.shape.channels import ChannelState
from tracker.single_view.shape.finder import ShapeFinder

if TYPE_CHECKING:
    from tracker.parameters import RunParameters


def shapes(
    sequence: Sequence, camera_index: int, parameters: RunParameters, reader: Pictures
) -> Jpda:
    """The method for one camera: :class:`~tracker.single_view.jpda.Jpda` over people by shape.

    Raises:
        ValueError: If the camera has no pictures.
    """
    view = sequence.views[camera_index]
    if not view.has_pictures:
        raise ValueError(
            f'camera "{view.camera.name}" of {sequence.name} has no pictures; give it a video '
            "or images in sequence.toml"
        )
    source = ShapeSource(sequence, camera_index, parameters.of(ShapesParams), reader)
    return Jpda(sequence, camera_index, parameters, reader, source=source)


class ShapeSource:
    """People by the shape of head and trunk, who may be anywhere on the room's floor."""

    def __init__(
        self, sequence: Sequence, camera_index: int, parameters: ShapesParams, reader: Pictures
    ) -> None:
        """Learn the background of one camera.

        Args:
            sequence: Whose camera.
            camera_index: Which one.
            parameters: From which odds on somebody is there, and the measurement noise.
            reader: Of the pictures.
        """
        self._parameters = parameters
        half = sequence.target_half_extents
        self._extents = np.array([(half[0] + half[1]) / 2.0, half[2]])
        self._finder = ShapeFinder(sequence, camera_index, reader)

    def start(self) -> ChannelState | None:
        """The state before the first step."""
        return self._finder.start()

    def measure(
        self,
        state: ChannelState | None,
        frame: int,
        picture: UInt8[ndarray, "h w 3"] | None,
        expected: GaussianMixture,
        rng: np.random.Generator,
    ) -> tuple[ChannelState | None, Measured]:
        """The people of one picture; nobody where there is none."""
        if picture is None:
            return state, Measured.nothing()
        p = self._parameters
        state, found = self._finder.find(state, picture, p.least_odds, p.overlap)
        information = {
            CANDIDATES: float(len(found.boxes) + found.unlikely),
            DROPPED + "shape": float(found.unlikely),
        }
        return state, Measured(
            found.boxes,
            expit(found.log_odds),
            self.sigmas(found.boxes),
            found.boxes * [1.0, 1.0, p.cover, p.cover],
            information=information,
        )

    def sigmas(self, boxes: Float[ndarray, "N 4"]) -> Float[ndarray, "N 4"]:
        """Measurement noise: the same in metres for who is near and far, and some pixels."""
        p = self._parameters
        half_sizes = np.maximum(boxes[:, 2:], 0.5)
        centres = np.hypot(p.place_sigma * half_sizes / self._extents, p.pixel_sigma)
        return np.concatenate([centres, p.size_sigma * half_sizes], axis=1)
