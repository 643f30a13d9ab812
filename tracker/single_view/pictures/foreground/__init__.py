"""What in a picture is not the background.

Two models, exchangeable behind :class:`ForegroundModel`: one learnt once from the clip
(:mod:`~tracker.single_view.pictures.foreground.exposure`), with a memory of motion where people
stay (:mod:`~tracker.single_view.pictures.foreground.motion`), and one whose thresholds and
background follow the pictures (:mod:`~tracker.single_view.pictures.foreground.adaptive`).
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
"""Pictures spread over the clip that a background is learnt from: a median needs the scene empty in
half of them, and each takes time before the first step."""


def learn(
    sequence: Sequence,
    camera_index: int,
    reader: Pictures,
    parameters: ForegroundParams,
    *,
    motion: bool = False,
) -> ForegroundModel | None:
    """The chosen foreground model of one camera; None where it has not a single picture.

    Args:
        sequence: Whose camera.
        camera_index: Which one.
        reader: Of its pictures.
        parameters: Which model, and its numbers.
        motion: Whether what moved lately counts where the background is not to be believed, for
            who knows nothing else of people.
    """

    # no slider has a say in a background, so that a moved one does not wait for it again
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
    """The empty scene as one camera sees it, learnt once; None where it has not a single picture.

    Where the recording says what the empty scene looks like, the clip tells only how much
    its pixels vary.

    Args:
        sequence: Whose camera.
        camera_index: Which one.
        reader: Of its pictures.
    """

    def made() -> BackgroundModel | None:
        learnt = BackgroundModel.learn(_spread(sequence, camera_index, reader), reader.check)
        empty = BackgroundModel.learn(_empty(sequence, camera_index, reader), reader.check)
        if learnt is None or empty is None:
            return learnt
        return replace(learnt, picture=empty.picture, restlessness=0.0)

    return reader.once(("background", camera_index), made)


def _empty(
    sequence: Sequence, camera_index: int, reader: Pictures
) -> list[UInt8[ndarray, "h w 3"]]:
    """Pictures on which nobody is, as far as the recording tells of some."""
    stated = sequence.views[camera_index].background
    if isinstance(stated, range):
        return _spread(sequence, camera_index, reader, stated)
    picture = reader.empty(camera_index)
    return [] if picture is None else [picture]


def _spread(
    sequence: Sequence, camera_index: int, reader: Pictures, among: range | None = None
) -> list[UInt8[ndarray, "h w 3"]]:
    """Pictures spread over the clip, or over some of its steps."""
    steps = spread_steps(range(sequence.frames) if among is None else among)
    found = (reader.picture(camera_index, step) for step in steps)
    return [picture for picture in found if picture is not None]


def spread_steps(among: range) -> list[int]:
    """The steps whose pictures a background is learnt from."""
    count = min(BACKGROUND_PICTURES, len(among))
    steps: list[int] = np.linspace(among[0], among[-1], count).astype(int).tolist()
    return steps
