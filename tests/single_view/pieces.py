"""Foreground drawn by hand: rectangles of one colour each, as a tracker of objects sees them."""

from __future__ import annotations

from collections.abc import Sequence as Many

import numpy as np
from numpy import ndarray

from tracker.parameters.groups.association_matrix import AssociationMatrixParams
from tracker.single_view.association_matrix.track_transfer import (
    Situation,
    advance,
    object_histograms,
)
from tracker.single_view.pictures.foreground import Blobs, blobs
from tracker.single_view.protocol import ViewEvent

SIZE = (80, 200)
COLOURS = 8

PUBLISHED = AssociationMatrixParams(
    overlap="boxes", output="objects", confirmation_steps=1, join_gap=0.0
)

Rectangle = tuple[int, int, int, int, int]
"""left, top, width, height, colour."""


def draw(rectangles: Many[Rectangle]) -> tuple[Blobs, ndarray]:
    """The pieces, and the bin of every pixel; later rectangles hide earlier ones."""
    mask, bins = np.zeros(SIZE, np.uint8), np.zeros(SIZE, np.uint16)
    for left, top, width, height, colour in rectangles:
        mask[top : top + height, left : left + width] = 1
        bins[top : top + height, left : left + width] = colour
    return blobs(mask, 1), bins


def person(
    left: int, colour: int, *, top: int = 20, width: int = 10, height: int = 30
) -> Rectangle:
    """Somebody."""
    return left, top, width, height, colour


def play(
    steps: Many[Many[Rectangle]],
    parameters: AssociationMatrixParams = PUBLISHED,
    situation: Situation | None = None,
) -> tuple[Situation, list[list[ViewEvent]]]:
    """Every step in turn: the last situation, and what happened at each step."""
    situation = situation or Situation.start()
    told = []
    for rectangles in steps:
        seen, bins = draw(rectangles)
        histograms = object_histograms(bins, seen.owners, seen.size, COLOURS)
        situation, events = advance(situation, seen, histograms, parameters)
        told.append(events)
    return situation, told


def labels_by_place(situation: Situation) -> list[tuple[int, ...]]:
    """Whom the objects show, from left to right."""
    return [one.labels for one in sorted(situation.objects, key=lambda one: one.box[0])]
