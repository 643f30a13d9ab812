"""Which boxes show somebody apart from others, and so bear witness that there is a person more."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.geometry.boxes import Boxes, paired_overlaps
from tracker.smoothing.paths import Paths
from tracker.smoothing.smoother import Shared, Smoother

ONE_PERSON = 0.3
"""Two boxes of one camera that share more than this of what both cover may be one person's, as
detectors take it that keep one box a person."""

_THERE = 0.5
"""Probability from which somebody is at a place."""

_HARDLY_EVER = 0.1
"""Share of a life below which somebody was elsewhere by a stray box."""


def shown_apart(
    smoother: Smoother,
    paths: Paths,
    shared: Shared,
    there: Float[ndarray, " N"],
    odds: Float[ndarray, " n"],
) -> Bool[ndarray, " L"]:
    """Which links are to boxes that show their person apart from every surer one.

    Around somebody a camera draws second boxes: of his limbs, one too high, one of him and what he
    carries. Those of several cameras meet beside him, or where the rays of two people's cross. So a
    box that overlaps a surer person's, or is as well his, is no witness, and none is of somebody
    who stands within a body's width of surer people as long as he is seen: he never came from
    anywhere else.

    Args:
        smoother: With the boxes.
        paths: Whose rows they may be.
        shared: Whose box each is.
        there: (N,) of the rows, the probability that somebody was there.
        odds: (n,) of the paths; who has greater ones is surer, where they are there.
    """
    links = shared.links
    rows, sure = links.rows, np.where(there > _THERE, odds[paths.owners], -np.inf)
    beside = _beside_surer(paths, sure, 2.0 * smoother.model.target.half_width)
    away = np.bincount(paths.owners[rows], links.shares * ~beside[rows], len(paths.labels))
    whole = np.bincount(paths.owners[rows], links.shares, len(paths.labels))
    apart = (away > _HARDLY_EVER * whole)[paths.owners[rows]]
    for number, camera in enumerate(smoother.cameras):
        own = np.flatnonzero(links.cameras == number)
        own = own[np.argsort(paths.steps[rows[own]], kind="stable")]
        boxes = Boxes(camera.boxes[links.boxes[own]]).left_top
        for one, other in _together(paths.steps[rows[own]]):
            over = paired_overlaps(boxes[one], boxes[other]) > ONE_PERSON
            lesser = _lesser(sure[rows[own]], one, other, over)
            apart[own[lesser]] = False
    return np.asarray(apart)


def _beside_surer(paths: Paths, sure: Float[ndarray, " N"], width: float) -> Bool[ndarray, " N"]:
    """The rows nearer than ``width``, metres on the floor, to a surer person at the same step."""
    order = np.argsort(paths.steps, kind="stable")
    places = paths.states[order, :2]
    beside = np.zeros(len(order), dtype=bool)
    for one, other in _together(paths.steps[order]):
        near = ((places[one] - places[other]) ** 2).sum(axis=1) < width**2
        beside[order[_lesser(sure[order], one, other, near)]] = True
    return beside


def _together(steps: Int[ndarray, " N"]) -> Iterator[tuple[Int[ndarray, " P"], Int[ndarray, " P"]]]:
    """All pairs of equal ones of ascending steps, some at a time."""
    for distance in range(1, len(steps)):
        one = np.flatnonzero(steps[distance:] == steps[:-distance])
        if not len(one):
            return
        yield one, one + distance


def _lesser(
    sure: Float[ndarray, " N"],
    one: Int[ndarray, " P"],
    other: Int[ndarray, " P"],
    chosen: Bool[ndarray, " P"],
) -> Int[ndarray, " K"]:
    """Of the chosen pairs those who are less sure than the other of theirs."""
    less, more = chosen & (sure[one] < sure[other]), chosen & (sure[other] < sure[one])
    return np.concatenate([one[less], other[more]])
