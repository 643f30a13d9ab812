"""The methods that can track a recording, and the default parameters of its runs."""

from __future__ import annotations

from tracker.parameters import MethodKey
from tracker.parameters.catalogue import FOLLOWING, METHODS, RunParameters, method_of
from tracker.sequences.sequence import Sequence


def default_parameters(sequence: Sequence) -> RunParameters:
    """Return the default parameters, with a single-view method that can work on the recording.

    That is the detection network, if one is named and there are pictures; else the first of
    :data:`tracker.parameters.catalogue.FOLLOWING` for which the recording has the pictures,
    templates and detections that it needs.

    Raises:
        ValueError: If the sequence has neither pictures nor detections.
    """
    defaults = RunParameters()
    if sequence.detector is not None and sequence.detector.named and sequence.has_pictures:
        return defaults.model_copy(update={"single_view": "onnx_detector"})
    for name in FOLLOWING:
        if _lacks(sequence, defaults, "single_view", name, bool(sequence.templates)) is None:
            return defaults.model_copy(update={"single_view": name})
    raise ValueError(
        f"{sequence.name}: every camera needs pictures (video or images), or every camera "
        "needs detections; add what is missing to sequence.toml"
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
            f"{name} runs a detection network, and none is at hand; fetch one by `multiview-phd "
            "detector get`, or start the program with --detector model.onnx."
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
