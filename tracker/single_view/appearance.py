"""What people look like to one camera: their colours against the templates, and the foreground.

Boxes are ``centre_x, centre_y, half_width, half_height`` in pixels.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int, UInt8, UInt16
from numpy import ndarray

from tracker import colour, foreground
from tracker.colour import ColourSpaceName, KernelName
from tracker.foreground import BackgroundModel
from tracker.sequences.frames import FrameReader
from tracker.sequences.sequence import Sequence
from tracker.single_view.box_sizes import BoxSizes
from tracker.single_view.templates import read_templates

BACKGROUND_PICTURES = 32
"""Pictures spread over the clip that the background is learnt from."""

SIZE_JITTER = 0.1
"""Relative spread around the size that the target has at a place of the room: people differ."""

# in half sizes from a box's centre, left, top, right, bottom: inside, above, left and right
_PARTS = np.array(
    [
        [-1.0, -1.0, 1.0, 1.0],
        [-1.0, -2.0, 1.0, -1.3],
        [-2.2, -1.0, -1.4, 0.3],
        [1.4, -1.0, 2.2, 0.3],
    ]
)


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """One picture, prepared for the comparison of many boxes."""

    bins: UInt16[ndarray, "h w"]
    """The histogram bin of each pixel."""
    mask: UInt8[ndarray, "h w"] | None
    """1 on the foreground; None where no background was learnt."""
    sums: Int[ndarray, "h1 w1"] | None
    """The mask's integral."""

    @property
    def foreground_share(self) -> float:
        """Of the picture; 0 where no background was learnt."""
        return float(self.mask.mean()) if self.mask is not None else 0.0


class Appearance:
    """The templates' colours, the learnt background and the sizes that a target can have.

    Made once per camera and run; nothing of it changes from step to step.
    """

    def __init__(
        self,
        sequence: Sequence,
        camera_index: int,
        reader: FrameReader,
        *,
        colour_space: ColourSpaceName,
        histogram_kernel: KernelName,
        with_foreground: bool,
    ) -> None:
        """Read the templates and learn the background.

        Args:
            sequence: Its templates and target.
            camera_index: Whose pictures.
            reader: Of the pictures.
            colour_space: The histograms' bins.
            histogram_kernel: How the pixels of a box count.
            with_foreground: Whether the background is learnt.

        Raises:
            ValueError: If there are no pictures or templates, or a template cannot be read.
        """
        view = sequence.views[camera_index]
        if not view.has_pictures:
            raise ValueError(
                f'camera "{view.camera.name}" of {sequence.name} has no pictures; give it a video '
                "or images in sequence.toml, or choose single_view none to use its detections"
            )
        self.model = read_templates(sequence, colour_space, histogram_kernel, reader)
        self.sizes = BoxSizes.of(view.camera, sequence.room, sequence.target_half_extents)
        self._image_size = view.camera.image_size
        self._background: BackgroundModel | None = None
        if with_foreground:
            count = min(BACKGROUND_PICTURES, sequence.frames)
            steps = np.linspace(0, sequence.frames - 1, count).astype(int)
            pictures = (reader.picture(camera_index, int(step)) for step in steps)
            self._background = BackgroundModel.learn(p for p in pictures if p is not None)

    def look(self, picture: UInt8[ndarray, "h w 3"], foreground_threshold: float) -> Scene:
        """Prepare a picture."""
        bins = colour.bin_map(picture, self.model.space)
        if self._background is None:
            return Scene(bins, None, None)
        mask = self._background.foreground(picture, foreground_threshold)
        return Scene(bins, mask, foreground.integral(mask))

    def distances(self, scene: Scene, boxes: Float[ndarray, "N 4"]) -> Float[ndarray, "N G"]:
        """Bhattacharyya distance D of each box to each person's nearest template."""
        return self.model.distances(scene.bins, boxes)

    def shape_scores(
        self,
        scene: Scene,
        boxes: Float[ndarray, "N 4"],
        *,
        inside_weight: float,
        around_weight: float,
    ) -> tuple[Float[ndarray, " N"], Float[ndarray, " N"]]:
        """What the foreground says of each box: log factors of the likelihood, and shares inside.

        A box on a person is full of foreground, with background above and beside it:
        a ln(inside + 0.02) - b (above + (left + right) / 2). Without a learnt background
        the factors are 0 and the shares 1.

        Args:
            scene: The picture.
            boxes: Pixels.
            inside_weight: a.
            around_weight: b.
        """
        if scene.sums is None:
            return np.zeros(len(boxes)), np.ones(len(boxes))
        middles, half_sizes = boxes[:, [0, 1, 0, 1]], boxes[:, [2, 3, 2, 3]]
        inside, above, left, right = (
            foreground.box_shares(scene.sums, middles + part * half_sizes) for part in _PARTS
        )
        around = above + (left + right) / 2.0
        return inside_weight * np.log(inside + 0.02) - around_weight * around, inside

    def draw_on_foreground(
        self, count: int, scene: Scene, rng: np.random.Generator
    ) -> Float[ndarray, "N 4"]:
        """Boxes centred on foreground pixels, of the sizes that a target can have there.

        Fewer than ``count`` where no target can be; none without foreground.
        """
        if scene.mask is None or count == 0:
            return np.zeros((0, 4))
        pixels = np.flatnonzero(scene.mask)
        if not len(pixels):
            return np.zeros((0, 4))
        rows, columns = np.divmod(rng.choice(pixels, count), scene.mask.shape[1])
        return self._with_sizes(np.stack([columns, rows], axis=1), rng)

    def draw_anywhere(self, count: int, rng: np.random.Generator) -> Float[ndarray, "N 4"]:
        """Boxes centred anywhere in the picture, of the sizes that a target can have there.

        Fewer than ``count`` where no target can be.
        """
        width, height = self._image_size
        return self._with_sizes(rng.integers(0, [width, height], (count, 2)), rng)

    def _with_sizes(
        self, pixels: Int[ndarray, "N 2"], rng: np.random.Generator
    ) -> Float[ndarray, "N 4"]:
        centres = pixels + rng.uniform(-0.5, 0.5, pixels.shape)
        sizes, possible = self.sizes.draw(centres, rng)
        sizes *= np.exp(SIZE_JITTER * rng.standard_normal((len(pixels), 1)))
        return np.concatenate([centres[possible], sizes[possible]], axis=1)

    def within(self, boxes: Float[ndarray, "N 4"]) -> Float[ndarray, "N 4"]:
        """The boxes whose centre is in the picture, with sizes that a target can have."""
        clipped = boxes.copy()
        clipped[:, 2:] = np.clip(boxes[:, 2:], self.sizes.smallest, self.sizes.largest)
        last = np.array(self._image_size) - 1
        inside = ((clipped[:, :2] >= 0.0) & (clipped[:, :2] <= last)).all(axis=1)
        return np.asarray(clipped[inside])
