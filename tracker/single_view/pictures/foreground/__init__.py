"""Segmentation of images into foreground and background.

There are two models behind :class:`ForegroundModel`: one learnt once from the clip
(:mod:`~tracker.single_view.pictures.foreground.exposure`), with a memory of motion for people who
stay (:mod:`~tracker.single_view.pictures.foreground.motion`), and one whose thresholds and
background adapt to the images (:mod:`~tracker.single_view.pictures.foreground.adaptive`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import UInt8
from numpy import ndarray

from tracker.parameters.groups.foreground import ForegroundParams
from tracker.sequences.pictures.frames import Pictures
from tracker.sequences.sequence import Sequence
from tracker.single_view.pictures.foreground.adaptive import AdaptiveForeground, first_background
from tracker.single_view.pictures.foreground.exposure import (
    BackgroundModel,
    LearntForeground,
    tone_curve,
)
from tracker.single_view.pictures.foreground.motion import MovingForeground
from tracker.single_view.pictures.foreground.segmentation import (
    ForegroundModel,
    Segmentation,
    pack,
    unpack,
)
from tracker.single_view.pictures.foreground.shares import (
    box_shares,
    integral,
    shape_scores,
    shape_shares,
)

__all__ = [
    "AdaptiveForeground",
    "BackgroundModel",
    "ForegroundModel",
    "LearntForeground",
    "MovingForeground",
    "Segmentation",
    "box_shares",
    "first_background",
    "integral",
    "learn",
    "learn_background",
    "pack",
    "shape_scores",
    "shape_shares",
    "spread_steps",
    "tone_curve",
    "unpack",
]

BACKGROUND_PICTURES = 32
"""Number of images spread over the clip from which a background is learnt: a median needs the scene
empty in half of them, and each takes time before the first step."""


def learn(
    sequence: Sequence,
    camera_index: int,
    reader: Pictures,
    parameters: ForegroundParams,
    *,
    motion: bool = False,
) -> ForegroundModel | None:
    """Learn the chosen foreground model of one camera; None without any image.

    Args:
        sequence: The sequence.
        camera_index: Index of the camera.
        reader: Reader of the images.
        parameters: The kind of model and its parameters.
        motion: Whether recent motion counts as foreground where the background is uncertain, for
            methods without other information about people.
    """

    # no parameter has an effect on a background, so that a change of one does not repeat it
    if parameters.model == "adaptive":
        follow = parameters.follow_exposure
        first = reader.once(
            ("first background", camera_index, follow),
            lambda: first_background(
                _empty(sequence, camera_index, reader) or _spread(sequence, camera_index, reader),
                follow_exposure=follow,
                check=reader.check,
            ),
        )
        return None if first is None else AdaptiveForeground(first, parameters)
    background = learn_background(sequence, camera_index, reader)
    if background is None:
        return None
    if motion:
        moving = MovingForeground(background, parameters, sequence.step_time)
        if moving.memory > 0:
            return moving
    return LearntForeground(background, parameters)


def learn_background(
    sequence: Sequence, camera_index: int, reader: Pictures
) -> BackgroundModel | None:
    """Learn the empty scene of one camera once; None without any image.

    Where the recording has an image of the empty scene, the clip is used only for the
    variation of its pixels.

    Args:
        sequence: The sequence.
        camera_index: Index of the camera.
        reader: Reader of the images.
    """

    def made() -> BackgroundModel | None:
        learnt = BackgroundModel.learn(_spread(sequence, camera_index, reader), reader.check)
        empty = BackgroundModel.learn(_empty(sequence, camera_index, reader), reader.check)
        if learnt is None or empty is None:
            return learnt
        return replace(learnt, picture=empty.picture, changing_share=0.0)

    return reader.once(("background", camera_index), made)


def _empty(
    sequence: Sequence, camera_index: int, reader: Pictures
) -> list[UInt8[ndarray, "h w 3"]]:
    """The images without people, where the recording names any."""
    empty_scene = sequence.views[camera_index].background
    if isinstance(empty_scene, range):
        return _spread(sequence, camera_index, reader, empty_scene)
    picture = reader.empty(camera_index)
    return [] if picture is None else [picture]


def _spread(
    sequence: Sequence, camera_index: int, reader: Pictures, among: range | None = None
) -> list[UInt8[ndarray, "h w 3"]]:
    """Images spread over the clip, or over some of its steps."""
    steps = spread_steps(range(sequence.frames) if among is None else among)
    found = (reader.picture(camera_index, step) for step in steps)
    return [picture for picture in found if picture is not None]


def spread_steps(among: range) -> list[int]:
    """The steps of the images from which a background is learnt."""
    count = min(BACKGROUND_PICTURES, len(among))
    steps: list[int] = np.linspace(among[0], among[-1], count).astype(int).tolist()
    return steps
