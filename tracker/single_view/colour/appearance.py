"""Appearance of people in one camera: colours against the templates, and the foreground.

Boxes are ``centre_x, centre_y, half_width, half_height`` in pixels.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Int, UInt8, UInt16
from numpy import ndarray

from tracker.parameters.groups.foreground import ForegroundParams
from tracker.sequences.pictures.frames import Pictures
from tracker.sequences.sequence import Sequence
from tracker.single_view.box_sizes import BoxSizes, geometry_key
from tracker.single_view.colour.carrying import with_carried
from tracker.single_view.colour.templates import read_templates
from tracker.single_view.colour.trust import template_trust
from tracker.single_view.pictures import colour
from tracker.single_view.pictures.background import ForegroundModel
from tracker.single_view.pictures.colour import ColourSpaceName, KernelName
from tracker.single_view.pictures.foreground import integral, learn, shape_scores


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """One image, prepared for the comparison of many boxes."""

    bins: UInt16[ndarray, "h w"]
    """The histogram bin of each pixel."""
    mask: UInt8[ndarray, "h w"] | None
    """1 on the foreground; None without a background."""
    sums: Int[ndarray, "h1 w1"] | None
    """Integral image of the mask."""

    @property
    def foreground_share(self) -> float:
        """Share of foreground in the image; 0 without a background."""
        if self.mask is None or self.sums is None:
            return 0.0
        return float(self.sums[-1, -1]) / self.mask.size


class Appearance:
    """The colours of the templates, the foreground model and the possible sizes of a target.

    It is created once per camera and run. Only the state of the foreground model changes from
    step to step, and the method carries it.
    """

    def __init__(
        self,
        sequence: Sequence,
        camera_index: int,
        reader: Pictures,
        *,
        colour_space: ColourSpaceName,
        histogram_kernel: KernelName,
        size_jitter: float,
        foreground: ForegroundParams | None,
        carry_templates: bool = False,
    ) -> None:
        """Read the templates and learn the background of one camera.

        Args:
            sequence: The sequence with its templates and target.
            camera_index: Index of the camera.
            reader: Reader of the images.
            colour_space: The bins of the histograms.
            histogram_kernel: The weights of the pixels of a box.
            size_jitter: Relative spread of drawn boxes around the size of a target there.
            foreground: Parameters of the foreground model; None for no foreground.
            carry_templates: Whether templates are transferred to cameras without any of a person.

        Raises:
            ValueError: If there are no pictures or templates, or a template cannot be read.
        """
        view = sequence.views[camera_index]
        view.need_pictures(sequence.name, ", or choose single_view none to use its detections")
        if carry_templates:
            sequence = with_carried(sequence, colour_space, histogram_kernel, reader)
        self.model = read_templates(sequence, colour_space, histogram_kernel, reader)
        camera, room, half_extents = view.camera, sequence.room, sequence.target_half_extents
        # no parameter has an effect on it, so that a change of one does not repeat it
        self.sizes = reader.once(
            ("sizes", geometry_key(sequence, camera_index)),
            lambda: BoxSizes.of(camera, room, half_extents),
        )
        self._size_jitter = size_jitter
        self._image_size = view.camera.image_size
        self._foreground: ForegroundModel | None = None
        if foreground is not None:
            self._foreground = learn(sequence, camera_index, reader, foreground)
        self.trust = np.ones(len(self.model.names))
        """Trust in the foreground at each person, 0 … 1."""
        if foreground is not None and self._foreground is not None:
            trust = template_trust(sequence, camera_index, reader, foreground)
            self.trust = np.array([trust[name] for name in self.model.names])

    def start(self) -> Any:
        """The state of the foreground model before the first image."""
        return None if self._foreground is None else self._foreground.start()

    def prepare(self, state: Any, picture: UInt8[ndarray, "h w 3"]) -> tuple[Any, Scene]:
        """Prepare an image.

        Args:
            state: The state of :meth:`start`, or after the image before.
            picture: The image, BGR.

        Returns:
            The state of the foreground model after this image, and the prepared image.
        """
        bins = colour.bin_map(picture, self.model.space)
        if self._foreground is None:
            return state, Scene(bins, None, None)
        state, found = self._foreground.step(state, picture)
        return state, Scene(bins, found.mask, integral(found.mask))

    def shape_scores(
        self,
        scene: Scene,
        boxes: Float[ndarray, "N 4"],
        *,
        inside_weight: float,
        around_weight: float,
    ) -> tuple[Float[ndarray, " N"], Float[ndarray, " N"]]:
        """Compute the foreground's log factors of the likelihood of boxes, and shares inside.

        See :func:`tracker.single_view.pictures.foreground.shape_scores`; without a foreground model
        the factors are 0 and the shares 1.

        Args:
            scene: The image.
            boxes: Centre and half sizes of N boxes, pixels.
            inside_weight: a, the weight of the share inside.
            around_weight: b, the weight of the share around.
        """
        if scene.sums is None:
            return np.zeros(len(boxes)), np.ones(len(boxes))
        return shape_scores(
            scene.sums, boxes, inside_weight=inside_weight, around_weight=around_weight
        )

    def draw_on_foreground(
        self, count: int, scene: Scene, rng: np.random.Generator
    ) -> Float[ndarray, "N 4"]:
        """Draw boxes centred on foreground pixels, with possible sizes of a target there.

        Args:
            count: Number of boxes; fewer result where no target can be, none without foreground.
            scene: The image, with its foreground mask.
            rng: The generator of places and sizes.

        Returns:
            Centre and half sizes, pixels.
        """
        if scene.mask is None or count == 0:
            return np.zeros((0, 4))
        pixels = scene.mask.view(np.bool_).ravel().nonzero()[0]
        if not len(pixels):
            return np.zeros((0, 4))
        rows, columns = np.divmod(rng.choice(pixels, count), scene.mask.shape[1])
        return self._with_sizes(np.stack([columns, rows], axis=1), rng)

    def draw_anywhere(self, count: int, rng: np.random.Generator) -> Float[ndarray, "N 4"]:
        """Draw boxes centred anywhere in the image, with possible sizes of a target there.

        Args:
            count: Number of boxes; fewer result where no target can be.
            rng: The generator of places and sizes.

        Returns:
            Centre and half sizes, pixels.
        """
        width, height = self._image_size
        return self._with_sizes(rng.integers(0, [width, height], (count, 2)), rng)

    def _with_sizes(
        self, pixels: Int[ndarray, "N 2"], rng: np.random.Generator
    ) -> Float[ndarray, "N 4"]:
        centres = pixels + rng.uniform(-0.5, 0.5, pixels.shape)
        sizes, possible = self.sizes.draw(centres, rng)
        sizes *= np.exp(self._size_jitter * rng.standard_normal((len(pixels), 1)))
        return np.concatenate([centres[possible], sizes[possible]], axis=1)

    def within(self, boxes: Float[ndarray, "N 4"]) -> Float[ndarray, "N 4"]:
        """Select boxes with their centres in the image, and clip them to possible sizes."""
        clipped = boxes.copy()
        clipped[:, 2:] = np.clip(boxes[:, 2:], self.sizes.smallest, self.sizes.largest)
        last = np.array(self._image_size) - 1
        inside = ((clipped[:, :2] >= 0.0) & (clipped[:, :2] <= last)).all(axis=1)
        return np.asarray(clipped[inside])
