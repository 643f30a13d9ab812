"""The usual mistakes with a calibration and its boxes, made on purpose in a good sequence."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy import ndarray

from tracker.geometry.camera import Camera
from tracker.io.conventions.reading import FLIP, upright
from tracker.sequences.sequence import Detections, Sequence


def _with_cameras(sequence: Sequence, change: Callable[[Camera], Camera]) -> Sequence:
    views = [replace(view, camera=change(view.camera)) for view in sequence.views]
    return replace(sequence, views=tuple(views))


def _posed(camera: Camera, rotation: ndarray, translation: ndarray) -> Camera:
    return Camera(
        camera.name, camera.image_size, camera.intrinsics, rotation, translation, camera.distortion
    )


def millimetres(sequence: Sequence) -> Sequence:
    """Translations in millimetres."""
    return _with_cameras(sequence, lambda c: _posed(c, c.rotation, 1000.0 * c.translation))


def camera_to_world(sequence: Sequence) -> Sequence:
    """R and t lead from the camera to the world."""
    return _with_cameras(sequence, lambda c: _posed(c, c.rotation.T, c.centre))


def transposed(sequence: Sequence) -> Sequence:
    """R transposed, t as it is: points in rows."""
    return _with_cameras(sequence, lambda c: _posed(c, c.rotation.T, c.translation))


def positions(sequence: Sequence) -> Sequence:
    """The cameras' positions as t."""
    return _with_cameras(sequence, lambda c: _posed(c, c.rotation, c.centre))


def opengl(sequence: Sequence) -> Sequence:
    """Camera axes with y up and z back."""
    return _with_cameras(sequence, lambda c: _posed(c, FLIP @ c.rotation, FLIP @ c.translation))


def y_up(sequence: Sequence) -> Sequence:
    """The world's y axis points up."""
    return _with_cameras(sequence, lambda c: _posed(c, c.rotation @ upright("y"), c.translation))


def _with_boxes(sequence: Sequence, change: Callable[[Detections, Camera], Detections]) -> Sequence:
    views = [
        view
        if view.detections is None
        else replace(view, detections=change(view.detections, view.camera))
        for view in sequence.views
    ]
    return replace(sequence, views=tuple(views))


def corners(sequence: Sequence) -> Sequence:
    """left, top, right, bottom in the columns of left, top, width, height."""

    def change(own: Detections, _: Camera) -> Detections:
        low, size = own.boxes[:, :2], own.boxes[:, 2:]
        return replace(own, boxes=np.concatenate([low, low + size], axis=1))

    return _with_boxes(sequence, change)


def counted_from_one(sequence: Sequence) -> Sequence:
    """Frames of the boxes counted from 1."""
    longer = _with_boxes(sequence, lambda own, _: replace(own, frames=own.frames + 1))
    return replace(longer, frames=sequence.frames + 1)


def normalised(sequence: Sequence) -> Sequence:
    """Boxes in parts of the picture's size."""

    def change(own: Detections, camera: Camera) -> Detections:
        width, height = camera.image_size
        pixels = own.boxes + np.array([0.5, 0.5, 0.0, 0.0])
        return replace(own, boxes=pixels / [width, height, width, height])

    return _with_boxes(sequence, change)


def exchanged(sequence: Sequence) -> Sequence:
    """The calibrations of the first two cameras exchanged."""
    first, second, *others = sequence.views

    def posed(view_of: Camera, like: Camera) -> Camera:
        return Camera(
            view_of.name,
            like.image_size,
            like.intrinsics,
            like.rotation,
            like.translation,
            like.distortion,
        )

    views = (
        replace(first, camera=posed(first.camera, second.camera)),
        replace(second, camera=posed(second.camera, first.camera)),
        *others,
    )
    return replace(sequence, views=views)


MISTAKES: dict[str, tuple[Callable[[Sequence], Sequence], str]] = {
    "millimetres": (millimetres, "--unit mm"),
    "camera to world": (camera_to_world, "--pose camera-to-world"),
    "OpenGL axes": (opengl, "--axes opengl"),
    "y up": (y_up, "--up y"),
    "corners": (corners, "--boxes xyxy"),
    "counted from 1": (counted_from_one, "--first-index 1"),
    "normalised": (normalised, "--boxes ltwh-normalised"),
    "exchanged": (exchanged, "--swap cam1=cam2"),
}
"""Of each: how it is made, and the remedy that must be named."""
