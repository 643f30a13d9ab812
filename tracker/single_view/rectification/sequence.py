"""Conversion of a recording for stage 1, and of its results; check for cameras that shake."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from tracker.geometry.boxes import Boxes
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.values import with_values
from tracker.sequences.finding import Check, absent, good, warning
from tracker.sequences.pictures.frames import FrameReader, Picture, Pictures
from tracker.sequences.sequence import Sequence
from tracker.single_view.pictures.background import pack, unpack
from tracker.single_view.protocol import ViewResult, pack_samples, unpack_samples
from tracker.single_view.rectification.stabilisation import StabilisedReader
from tracker.single_view.rectification.view import RectifiedView, rectified_view

if TYPE_CHECKING:
    from tracker.parameters.catalogue import RunParameters


_Made = TypeVar("_Made")


@dataclass(frozen=True, slots=True, eq=False)
class RectifiedSequence:
    """A recording whose images are reduced and rotated for stage 1."""

    sequence: Sequence
    """The sequence with the calibrations and templates of the rectified images."""
    reader: Pictures
    """Reader of the rectified images."""
    views: tuple[RectifiedView | None, ...]
    """The conversion of each camera; None where its own images are used."""

    @staticmethod
    def of(sequence: Sequence, parameters: RunParameters, reader: Pictures) -> RectifiedSequence:
        """Prepare the images for the chosen method of stage 1.

        Args:
            sequence: The recording.
            parameters: The method, and the resolution of the images.
            reader: Reader of the recording's images.
        """
        views: tuple[RectifiedView | None, ...] = (None,) * len(sequence.views)
        used = parameters.method("single_view").used(parameters)
        if not used.pictures:
            return RectifiedSequence(sequence, reader, views)
        if used.reads_parameter("pictures", "level_from"):
            reduced = used.reads_parameter("pictures", "lines")
            views = tuple(
                rectified_view(
                    camera,
                    sequence.room,
                    sequence.target_half_extents,
                    parameters.pictures,
                    reduced=reduced,
                )
                for camera in sequence.cameras
            )
        if any(view is not None for view in views):
            sequence, reader = _reduced(sequence, views), _RectifiedReader(reader, views)
        if used.reads_parameter("pictures", "steady_from"):
            reader = StabilisedReader(sequence, reader, views, parameters.pictures.steady_from)
        return RectifiedSequence(sequence, reader, views)

    def shake(self, camera: int) -> float:
        """Standard deviation of a shake that is compensated, in the camera's own pixels, else 0."""
        if not isinstance(self.reader, StabilisedReader):
            return 0.0
        view = self.views[camera]
        return self.reader.shake(camera) / (1.0 if view is None else view.scale)

    def back(self, camera: int, result: ViewResult) -> ViewResult:
        """Convert a result from rectified pixels to the camera's own.

        Args:
            camera: Index of the camera.
            result: The result of stage 1 in the rectified image.
        """
        view = self.views[camera]
        if view is None:
            return result
        foreground = result.foreground
        points, weights = unpack_samples(result.samples)
        return replace(
            result,
            boxes=view.boxes_back(result.boxes),
            sigmas=view.sigmas_back(result.sigmas),
            estimates=view.boxes_back(result.estimates),
            measurements=view.boxes_back(result.measurements),
            samples=pack_samples(view.points_back(points), weights),
            dropped=replace(
                result.dropped, boxes=view.boxes_back(result.dropped.boxes).astype(np.float32)
            ),
            gates=view.gates_back(result.gates),
            foreground=None if foreground is None else pack(view.mask(unpack(foreground))),
        )


def _reduced(sequence: Sequence, views: tuple[RectifiedView | None, ...]) -> Sequence:
    """The recording with the calibrations and templates of the rectified images."""
    cameras = {view.full.name: view for view in views if view is not None}
    templates = []
    for template in sequence.templates:
        view = cameras.get(template.camera)
        if view is not None:
            drawn = Boxes.from_left_top(template.box[None]).centred[0]
            box = Boxes(view.drawn_box(drawn, sequence.target_half_extents)).left_top
            template = replace(template, box=box)
        templates.append(template)
    return replace(
        sequence,
        views=tuple(
            own if view is None else replace(own, camera=view.camera)
            for own, view in zip(sequence.views, views, strict=True)
        ),
        templates=tuple(templates),
    )


class _RectifiedReader:
    """A reader of the rectified images, from another reader's images."""

    def __init__(self, reader: Pictures, views: tuple[RectifiedView | None, ...]) -> None:
        self._reader = reader
        self._views = views
        self._key = tuple(None if view is None else view.key for view in views)

    def picture(self, camera: int, step: int) -> Picture | None:
        return self._rectify(camera, self._reader.picture(camera, step))

    def iterate(self, camera: int, first: int = 0) -> Iterator[Picture | None]:
        for picture in self._reader.iterate(camera, first):
            yield self._rectify(camera, picture)

    def empty(self, camera: int) -> Picture | None:
        return self._rectify(camera, self._reader.empty(camera))

    def once(self, name: Hashable, make: Callable[[], _Made]) -> _Made:
        return self._reader.once(("rectified", self._key, name), make)

    def check(self) -> None:
        self._reader.check()

    def _rectify(self, camera: int, picture: Picture | None) -> Picture | None:
        view = self._views[camera]
        return picture if view is None or picture is None else view.picture(picture)


_NAME = "cameras hold still"


def check_shake(sequence: Sequence, reader: Pictures | None = None) -> list[Check]:
    """Find the cameras that shake by more than a run tolerates, ``pictures.steady_from``.

    Args:
        sequence: The sequence.
        reader: Reader of its images; None to open one.

    Returns:
        A warning for each camera that shakes; one check without any, or if it is unknown.

    Raises:
        OSError: If an image file cannot be read.
    """
    if not sequence.has_pictures:
        return [absent(_NAME, "it needs pictures of every camera")]
    if reader is None:
        with FrameReader(sequence) as opened:
            return check_shake(sequence, opened)
    parameters = with_values(RunParameters(), {"single_view": "shapes"})  # it needs no templates
    rectified = RectifiedSequence.of(sequence, parameters, reader)
    found = []
    for number, camera in enumerate(sequence.cameras):
        shake = rectified.shake(number)
        if shake > 0.0:
            found.append(
                warning(
                    _NAME,
                    f'camera "{camera.name}" shakes by {shake:.1f} pixels; a run holds its '
                    "pictures still, but places are the less exact the more it turns: mount it "
                    "firmly",
                    shake=shake,
                )
            )
    return found or [good(_NAME, "no camera is seen to shake")]
