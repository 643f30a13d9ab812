"""Consensus of pairs of boxes that triangulate to people of one height and one vertical direction.

Two cameras see head and foot of a person as four rays. Rays of the same person meet, in front
of both lenses; rays of different people, or of cameras with a wrong calibration, meet by chance
only. All people stand in the same direction and are of about one height, so the vectors from
foot to head (here *rises*) are nearly equal, in whatever axes and unit the
world has. Points are triangulated by the midpoint method: the middle of the shortest segment
between two rays (Hartley, Sturm, "Triangulation", Computer Vision and Image Understanding
68(2), 1997, §5.3).
"""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence as Many
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.geometry.consistency.observed import PairsOfBoxes, Pose, Rays, in_world

# Halved and doubled, the constants below leave all interpretations as they are in the random rooms
# of seeds 1300 … 1303, correct and with one mistake each (camera-to-world poses, y up, frames
# counted from 1, exchanged calibrations); the rooms that are estimated change by 0.2 m at most by
# the first two, and not at all by the others.
LARGEST_GAP = 0.15
"""Largest distance between two rays of one point, as a share of the person's height there."""

SPREAD = 0.25
"""Largest distance of a rise from the common one, as a share of the length of the common one."""

_LEAST_SINE = 0.05  # sine of the angle between two rays below which their depth is undetermined
_LARGEST_RATIO = 2.5  # largest ratio of one person's heights by two cameras, for steep views
_HYPOTHESES = 200  # number of rises that are tried as the common one
_MOST_VOTES = 2000  # largest number of rises that are compared with each of these


@dataclass(frozen=True, slots=True, eq=False)
class TriangulatedPairs:
    """N pairs of boxes whose rays nearly intersect, in the world's axes and unit."""

    pairs: Int[ndarray, " N"]
    """Index into the pairs of boxes."""
    feet: Float[ndarray, "N 3"]
    """Triangulated feet."""
    rises: Float[ndarray, "N 3"]
    """Vectors from foot to head."""
    gaps: Float[ndarray, " N"]
    """The larger of the distances between the two rays to the head and between those to the foot,
    as a share of the person's height."""


@dataclass(frozen=True, slots=True, eq=False)
class Consensus:
    """The consensus of all pairs of boxes, with N agreeing pairs, in the world's axes and unit."""

    rise: Float[ndarray, " 3"]
    """The common vector from foot to head; zero without any pair."""
    share: float
    """:attr:`agreeing` / :attr:`possible`, 0 … 1."""
    shares: Mapping[tuple[int, int], float]
    """The same share by the indices of two cameras that have boxes at the same steps."""
    agreeing: int
    """N: number of pairs of boxes with a rise near the common one, each box in one pair at most."""
    possible: int
    """Largest possible number of such pairs: :attr:`PairsOfBoxes.most`, summed over the cameras."""
    steps: Int[ndarray, " N"]
    """Step of each agreeing pair."""
    feet: Float[ndarray, "N 3"]
    """Triangulated foot of each agreeing pair."""
    rises: Float[ndarray, "N 3"]
    """Vector from foot to head of each agreeing pair."""
    gaps: Float[ndarray, " N"]
    """Distance between the rays of each agreeing pair, as in :class:`TriangulatedPairs`."""
    fits: Float[ndarray, " N"]
    """Weight of each agreeing pair, 1 … 0: (1 − (gap / :data:`LARGEST_GAP`)²) (1 − (distance of the
    rise from the common one / :data:`SPREAD`)²)."""
    cameras: Int[ndarray, "N 2"]
    """Indices of the two cameras of each agreeing pair."""

    @property
    def height(self) -> float:
        """The length of the common rise, in the world's unit."""
        return float(np.linalg.norm(self.rise))


def triangulate_pairs(
    pairs: PairsOfBoxes, first: Rays, second: Rays, one: Pose, other: Pose
) -> TriangulatedPairs:
    """Triangulate heads and feet of pairs of boxes, and select the pairs that may be one person.

    The gap between the rays is below :data:`LARGEST_GAP`, both points are in front of both cameras,
    and the heights of the person by the two cameras differ by a factor of at most 2.5.

    Args:
        pairs: Pairs of boxes of two cameras.
        first: Rays of the first camera's boxes.
        second: Rays of the second camera's boxes.
        one: Pose of the first camera.
        other: Pose of the second camera.

    Returns:
        The selected pairs, in the order of ``pairs``.
    """
    whole = np.flatnonzero(first.whole[pairs.first] & second.whole[pairs.second])
    rows, columns = pairs.first[whole], pairs.second[whole]
    base = other.centre - one.centre
    heads_one, heads_other = in_world(one, first.heads), in_world(other, second.heads)
    feet_one, feet_other = in_world(one, first.feet), in_world(other, second.feet)
    heads, near_h, far_h, gap_h, good_h = _between(base, heads_one[rows], heads_other[columns])
    feet, near_f, far_f, gap_f, good_f = _between(base, feet_one[rows], feet_other[columns])
    seen_one = (near_h + near_f) / 2.0 * first.extents[rows]
    seen_other = (far_h + far_f) / 2.0 * second.extents[columns]
    with np.errstate(divide="ignore", invalid="ignore"):
        size = np.minimum(seen_one, seen_other)
        gaps = np.maximum(gap_h, gap_f) / size
        ratio = np.maximum(seen_one, seen_other) / size
        good = good_h & good_f & (gaps < LARGEST_GAP) & (ratio < _LARGEST_RATIO)
    kept = np.flatnonzero(good)
    return TriangulatedPairs(
        whole[kept], one.centre + feet[kept], heads[kept] - feet[kept], gaps[kept]
    )


def _between(
    base: Float[ndarray, " 3"], one: Float[ndarray, "N 3"], other: Float[ndarray, "N 3"]
) -> tuple[ndarray, ndarray, ndarray, ndarray, ndarray]:
    """Triangulate rays from the origin and from ``base`` by the midpoint method.

    Args:
        base: Second camera's position relative to the first one's, world axes and unit.
        one: Unit directions from the first camera, world axes.
        other: Unit directions from the second camera, world axes.

    Returns:
        Midpoints relative to the first camera, distances along both rays, gaps between the rays,
        and whether the depth is determined and in front of both cameras.
    """
    together = np.einsum("ni,ni->n", one, other)
    sine_squared = np.maximum(1.0 - together**2, 1e-12)
    on_one, on_other = one @ base, other @ base
    along_one = (on_one - together * on_other) / sine_squared
    along_other = (together * on_one - on_other) / sine_squared
    at_one = along_one[:, None] * one
    at_other = base + along_other[:, None] * other
    gaps = np.linalg.norm(at_one - at_other, axis=1)
    ahead = (along_one > 0.0) & (along_other > 0.0) & (sine_squared > _LEAST_SINE**2)
    return (at_one + at_other) / 2.0, along_one, along_other, gaps, ahead


def consensus(
    rays: Many[Rays],
    poses: Many[Pose],
    pairs: Mapping[tuple[int, int], PairsOfBoxes],
) -> Consensus:
    """Find the rise that most pairs of boxes have in common, and the pairs that agree with it.

    Where there are many rises they are sampled with the seed 0, so that the result is always the
    same.

    Args:
        rays: Rays of the boxes of each camera.
        poses: Pose of each camera.
        pairs: Pairs of boxes by the indices of two cameras, of
            :func:`tracker.geometry.consistency.observed.pair_up`.
    """
    found = {
        (a, b): triangulate_pairs(own, rays[a], rays[b], poses[a], poses[b])
        for (a, b), own in pairs.items()
    }
    rises = np.concatenate([np.zeros((0, 3)), *(met.rises for met in found.values())])
    rise = _common_rise(rises, np.random.default_rng(0))
    shares: dict[tuple[int, int], float] = {}
    agreeing = 0
    feet, all_rises, gaps, fits = (
        [np.zeros((0, 3))],
        [np.zeros((0, 3))],
        [np.zeros(0)],
        [np.zeros(0)],
    )
    cameras: list[tuple[int, int]] = []
    steps = [np.zeros(0, dtype=np.int64)]
    for key, met in found.items():
        own = pairs[key]
        near = np.flatnonzero(_is_near(met.rises, rise))
        kept = near[_one_to_one(own.first[met.pairs[near]], own.second[met.pairs[near]],
                                met.gaps[near])]  # fmt: skip
        agreeing += len(kept)
        shares[key] = len(kept) / own.most if own.most else 0.0
        steps.append(rays[key[0]].frames[own.first[met.pairs[kept]]])
        feet.append(met.feet[kept])
        all_rises.append(met.rises[kept])
        gaps.append(met.gaps[kept])
        away = ((met.rises[kept] - rise) ** 2).sum(axis=1) / (SPREAD**2 * float(rise @ rise))
        fits.append((1.0 - (met.gaps[kept] / LARGEST_GAP) ** 2) * (1.0 - away))
        cameras += [key] * len(kept)
    possible = sum(own.most for own in pairs.values())
    return Consensus(
        rise,
        agreeing / possible if possible else 0.0,
        shares,
        agreeing,
        possible,
        np.concatenate(steps),
        np.concatenate(feet),
        np.concatenate(all_rises),
        np.concatenate(gaps),
        np.concatenate(fits),
        np.array(cameras, dtype=np.int64).reshape(-1, 2),
    )


def _is_near(rises: Float[ndarray, "N 3"], rise: Float[ndarray, " 3"]) -> Bool[ndarray, " N"]:
    """Whether each rise is within :data:`SPREAD` of a common one."""
    height = float(np.linalg.norm(rise))
    return np.asarray(np.linalg.norm(rises - rise, axis=1) < SPREAD * height)


def _common_rise(rises: Float[ndarray, "N 3"], rng: np.random.Generator) -> Float[ndarray, " 3"]:
    """Find the rise with the most others near it, and refine it to their median (RANSAC).

    Source: Fischler, Bolles, "Random sample consensus", Communications of the ACM 24(6), 1981.
    """
    if not len(rises):
        return np.zeros(3)
    votes = rises
    if len(votes) > _MOST_VOTES:
        votes = votes[rng.choice(len(votes), _MOST_VOTES, replace=False)]
    tried = votes
    if len(tried) > _HYPOTHESES:
        tried = tried[rng.choice(len(tried), _HYPOTHESES, replace=False)]
    # |v − u|² < s² |u|²  ⇔  2 v·u − |v|² − (1 − s²) |u|² > 0
    ones = np.ones((len(tried), 1))
    own = np.hstack([2.0 * tried, -ones, (SPREAD**2 - 1.0) * (tried**2).sum(axis=1)[:, None]])
    all_ = np.hstack([votes, (votes**2).sum(axis=1)[:, None], np.ones((len(votes), 1))])
    near = own @ all_.T > 0.0
    best = tried[int(np.argmax(near.sum(axis=1)))]
    for _ in range(3):
        around = rises[_is_near(rises, best)]
        if not len(around):
            break
        best = np.median(around, axis=0)
    return np.asarray(best)


def _one_to_one(
    first: Int[ndarray, " N"], second: Int[ndarray, " N"], gaps: Float[ndarray, " N"]
) -> Int[ndarray, " K"]:
    """Indices of the pairs that have the smallest gap of all pairs of either of their boxes."""
    order = np.argsort(gaps, kind="stable")
    best_of_first = np.zeros(len(gaps), dtype=bool)
    best_of_second = np.zeros(len(gaps), dtype=bool)
    best_of_first[order[np.unique(first[order], return_index=True)[1]]] = True
    best_of_second[order[np.unique(second[order], return_index=True)[1]]] = True
    return np.flatnonzero(best_of_first & best_of_second)
