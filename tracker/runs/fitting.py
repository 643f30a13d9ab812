"""The methods that can track a recording, and the default parameters of its runs."""

from __future__ import annotations

import numpy as np

from tracker.parameters import MethodKey
from tracker.parameters.catalogue import DEFAULT_CANDIDATES, METHODS, RunParameters, method_of
from tracker.sequences.sequence import Sequence
from tracker.single_view.box_sizes import BoxSizes

_STANDING = (0.6, 1.1)
"""Half heights of targets that are whole people who stand, metres: children and tall adults. The
networks' classes are of whole people; a head alone is none."""

_LEAST_PIXELS = 100.0
"""Least height of the median target in each camera's picture for the fetched network to be the
default, pixels. The network reduces a picture of 800 x 600 to about half. It detected 80 % of
rendered people who were 90 pixels high in such a picture, and the method "shapes" more."""


def default_parameters(sequence: Sequence) -> RunParameters:
    """Return the default parameters, with a single-view method that can work on the recording.

    That is the detection network, if one is named and there are pictures; else the first of
    :data:`tracker.parameters.catalogue.DEFAULT_CANDIDATES` for which the recording has the
    pictures, templates and detections that it needs, where the fetched network takes the place of
    shapes if one is at hand and people are large enough for it.

    Raises:
        ValueError: If the sequence has neither pictures nor detections.
    """
    defaults = RunParameters()
    if sequence.detector is not None and sequence.detector.named and sequence.has_pictures:
        return defaults.model_copy(update={"single_view": "onnx_detector"})
    for name in DEFAULT_CANDIDATES:
        if _lacks(sequence, defaults, "single_view", name, bool(sequence.templates)) is None:
            if name == "shapes" and sequence.detector is not None and suits_detector(sequence):
                name = "onnx_detector"
            return defaults.model_copy(update={"single_view": name})
    raise ValueError(
        f"{sequence.name}: every camera needs pictures (video or images), or every camera "
        "needs detections; add what is missing to sequence.toml"
    )


def suits_detector(sequence: Sequence) -> bool:
    """Whether the pictures show standing people who are large enough for a fetched network.

    Args:
        sequence: The recording; calibration, room and target tell how large people are.
    """
    half_extents = sequence.target_half_extents
    if not sequence.has_pictures or not _STANDING[0] <= half_extents[2] <= _STANDING[1]:
        return False
    for camera in sequence.cameras:
        half_heights = BoxSizes.of(camera, sequence.room, half_extents).sizes[:, 1]
        if not len(half_heights) or 2.0 * np.median(half_heights) < _LEAST_PIXELS:
            return False
    return True


def advice(sequence: Sequence, parameters: RunParameters) -> str | None:
    """Say that boxes of some cameras alone are not used, or that a detection network can be
    fetched, where it would be the default method.

    Args:
        sequence: The recording.
        parameters: The parameters of the run.
    """
    without = [view.camera.name for view in sequence.views if view.detections is None]
    used = method_of("single_view", parameters.single_view).used(parameters)
    if 0 < len(without) < len(sequence.views) and not used.detections:
        return f"no camera's boxes are used, since {_listed(without)} has none"
    by_shape = parameters.single_view == default_parameters(sequence).single_view == "shapes"
    if not by_shape or sequence.detector is not None or not suits_detector(sequence):
        return None
    return (
        "people are found by shape, which misses some who keep still; a detection network finds "
        "them too: Teach fetches one, or `multiview-phd detector get`"
    )


def unfit_methods(sequence: Sequence, parameters: RunParameters) -> dict[MethodKey, dict[str, str]]:
    """Return the methods that cannot work on a sequence with these values, and why.

    Args:
        sequence: The recording, with its templates.
        parameters: The parameters of the run; a method that is not chosen is judged with them too.

    Returns:
        For each parameter that chooses a method, a sentence by the name of the method.
    """
    return {
        key: {
            name: why
            for name in METHODS[key]
            if (why := _lacks(sequence, parameters, key, name, bool(sequence.templates)))
        }
        for key in METHODS
    }


def _lacks(
    sequence: Sequence, parameters: RunParameters, key: MethodKey, name: str, templates: bool
) -> str | None:
    """Say what a method needs that the sequence lacks, and what to do; None if it lacks nothing."""
    used = method_of(key, name).used(parameters)
    if used.pictures and not sequence.has_pictures:
        without = [view.camera.name for view in sequence.views if not view.has_pictures]
        return (
            f"{name} needs pictures of every camera, and {_listed(without)} of {sequence.name} "
            "has none; name a video or images in sequence.toml."
        )
    if used.detections and not sequence.has_detections:
        without = [view.camera.name for view in sequence.views if view.detections is None]
        return (
            f"{name} needs a detector's boxes of every camera, and {_listed(without)} of "
            f"{sequence.name} has none; name a file of detections in sequence.toml."
        )
    if used.detector and sequence.detector is None:
        return (
            f"{name} runs a detection network, and none is at hand; fetch one under Teach or by "
            "`multiview-phd detector get`, or start the program with --detector model.onnx."
        )
    if used.templates == "needed" and not templates:
        return (
            f"{name} looks for the colours of templates, and {sequence.name} has none; "
            "press C and drag a box around a person in a picture."
        )
    return None


def _listed(cameras: list[str]) -> str:
    more = f" and {len(cameras) - 1} more" if len(cameras) > 1 else ""
    return f'camera "{cameras[0]}"{more}' if cameras else "every camera"
