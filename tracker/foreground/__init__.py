"""What in a picture is not the background.

Two models, exchangeable behind :class:`ForegroundModel`: one learnt once from the clip
(:mod:`~tracker.foreground.exposure`), and one whose thresholds and background follow
the pictures (:mod:`~tracker.foreground.adaptive`).
"""

from __future__ import annotations

import numpy as np

from tracker.foreground.adaptive import AdaptiveForeground
from tracker.foreground.exposure import BackgroundModel, LearntForeground, tone_curve
from tracker.foreground.segmentation import ForegroundModel, Segmentation, pack, unpack
from tracker.foreground.shares import box_shares, integral, shape_scores
from tracker.parameters.foreground import ForegroundParams
from tracker.sequences.frames import FrameReader
from tracker.sequences.sequence import Sequence

__all__ = [
    "AdaptiveForeground",
    "BackgroundModel",
    "ForegroundModel",
    "LearntForeground",
    "Segmentation",
    "box_shares",
    "integral",
    "learn",
    "pack",
    "shape_scores",
    "tone_curve",
    "unpack",
]

BACKGROUND_PICTURES = 32
"""Pictures spread over the clip that a background is learnt from."""


def learn(
    sequence: Sequence, camera_index: int, reader: FrameReader, parameters: ForegroundParams
) -> ForegroundModel | None:
    """The chosen foreground model of one camera; None where it has not a single picture.

    Args:
        sequence: Whose camera.
        camera_index: Which one.
        reader: Of its pictures.
        parameters: Which model, and its numbers.
    """
    count = min(BACKGROUND_PICTURES, sequence.frames)
    steps = np.linspace(0, sequence.frames - 1, count).astype(int)
    pictures = [reader.picture(camera_index, int(step)) for step in steps]
    there = [picture for picture in pictures if picture is not None]
    if not there:
        return None
    if parameters.model == "adaptive":
        return AdaptiveForeground(there, parameters)
    background = BackgroundModel.learn(there)
    return None if background is None else LearntForeground(background, parameters.threshold)
