"""Existence of tracks over time: where each begins and ends, and which are false."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.geometry.boxes import Boxes, paired_overlaps
from tracker.kernels.smoothing.passes import ExistenceTransitions, presence
from tracker.parameters.groups.smoothing import SmoothingParams
from tracker.smoothing.paths import Paths
from tracker.smoothing.smoother import BoxAssociations, Smoother

UNSURE = 0.3
"""Prior existence probability, for the association of boxes, of a row beyond a path's ends or in a
gap. Within a second of the ends of the filter's tracks, the person was there and followed by no
other track in 40 % of 424 such rows in ten random crowds, in 26 % of 295 in a piece of
``wildtrack-points-300`` and in 22 % of 36 in one of ``cmc2``."""

_MEETING_BY_CHANCE = 2
"""Number of cameras whose false boxes always have rays that nearly intersect somewhere."""

_CONSTRAINT_LOG_ODDS = 1e4
"""Log odds for existence where a correction states a position, more than all cameras can
contradict."""

_ONE_PERSON = 0.3
"""Intersection over union above which two boxes of one camera may be of one person, as in the
non-maximum suppression of detectors."""

_PRESENT = 0.5
"""Existence probability above which a track is present: it is likelier than not."""

_STRAY_SHARE = 0.1
"""Share of a track's boxes below which those away from other tracks are taken as stray."""


def independent_share(step_time: float, memory: float) -> float:
    """Compute the share of a step's evidence that is independent of the steps before, 0 … 1.

    Args:
        step_time: Time between two steps, seconds.
        memory: Time within which errors are correlated, seconds.
    """
    return min(step_time / memory, 1.0)


def log_miss_likelihoods(shared: BoxAssociations) -> Float[ndarray, " N"]:
    """Compute the log likelihood of the misses at each row, Σ_c P(c misses) log(1 − p_D), at most
    0."""
    blind = np.log1p(-np.minimum(shared.chances, 1.0 - 1e-6))
    return np.asarray((shared.missed * blind).sum(axis=0))


def estimate_lifetimes(
    smoother: Smoother, paths: Paths, shared: BoxAssociations, parameters: SmoothingParams
) -> tuple[Float[ndarray, " N"], Float[ndarray, " n"]]:
    """Estimate the existence probability at each row, and the log odds of each path as a whole.

    A detection by a camera has log odds of log 1/(1 − p_D) for existence, as much as a miss has
    against it: a persistent false box is no better evidence than persistent misses.

    Where stage 1 gives a likelihood ratio Λ of a box's appearance, log Λ is added; most of these
    boxes are false. A single false box always has a place on its ray, so only its appearance
    counts. The rays of two false boxes nearly intersect somewhere in the room, those of three
    rarely do: each box beyond the second offsets up to log 1/(1 − p_D) of a negative log Λ.

    Where stage 1 may give several boxes of a person, the detections count only for boxes apart
    from tracks of greater odds (:func:`select_separate_links`), for other boxes may be of these
    tracks.

    Args:
        smoother: The models and the boxes.
        paths: n paths, with N rows.
        shared: Association and miss probabilities of the rows.
        parameters: Time constant of correlated evidence, and cost of a change of existence.

    Returns:
        Existence probability of the N rows; log odds of the n paths, of existing at any step.
    """
    p = smoother.parameters
    hit = -np.log1p(-min(p.detection_probability, 1.0 - 1e-6))
    links = shared.links
    log_ratios = np.zeros(len(links.rows))
    for c, camera in enumerate(smoother.cameras):
        own = links.cameras == c
        log_ratios[own] = -np.log(camera.clutter_factors[links.boxes[own]])
    rows = len(paths.states)
    shown = np.bincount(links.rows, links.shares, rows)
    weight = independent_share(smoother.model.step_time, parameters.memory)
    survival = min(p.survival_probability, 1.0 - 1e-9)
    # probabilities within the time of independent evidence, symmetric under reversal of time
    steps = 1.0 / weight
    come = float(np.log(min(p.birth_rate * steps * smoother.model.step_time, 1.0)))
    leave = float(np.log1p(-(survival**steps)))
    transitions = ExistenceTransitions(
        float(np.log(survival)), (come + leave) / 4.0, -parameters.change
    )
    with_place, against = smoother.rows_with_places(paths)[0], log_miss_likelihoods(shared)

    def existence(
        log_odds: Float[ndarray, " N"],
    ) -> tuple[Float[ndarray, " N"], Float[ndarray, " n"]]:
        """The existence probabilities and log odds, given the log odds of the detections."""
        log_odds[with_place] += _CONSTRAINT_LOG_ODDS
        found = presence(
            paths.starts,
            paths.firsts,
            weight * (log_odds + against),
            transitions,
            smoother.frames - 1,
        )
        return found.probabilities, found.odds

    def detections(shown: Float[ndarray, " N"]) -> Float[ndarray, " N"]:
        """The log odds of the detections, given the number of cameras with one at each row."""
        return _detection_odds(hit, shown, appearance) if log_ratios.any() else hit * shown

    appearance = np.bincount(links.rows, links.shares * log_ratios, rows)
    there, odds = existence(detections(shown))
    if not smoother.several_boxes:
        return there, odds
    apart = select_separate_links(smoother, paths, shared, there, odds)
    if apart.all():
        return there, odds
    return existence(detections(np.bincount(links.rows, links.shares * apart, rows)))


def _detection_odds(
    hit: float, shown: Float[ndarray, " N"], appearance: Float[ndarray, " N"]
) -> Float[ndarray, " N"]:
    """Compute the log odds for existence by the detections of each row.

    Args:
        hit: log 1/(1 − p_D).
        shown: Expected number of cameras with a detection at each of N rows.
        appearance: Sum of the log likelihood ratios of these boxes' appearance.
    """
    offset = hit * np.maximum(shown - _MEETING_BY_CHANCE, 0.0)
    meeting = hit * np.minimum(shown, 2.0 * np.maximum(shown - 1.0, 0.0))
    return np.asarray(meeting + np.minimum(appearance + offset, np.maximum(appearance, 0.0)))


def extend_paths(
    smoother: Smoother, paths: Paths, steps: int
) -> tuple[Paths, Float[ndarray, " N"]]:
    """Extend the paths at both ends by prediction with the motion model.

    Args:
        smoother: The motion model, and the number of steps of the recording.
        paths: The paths.
        steps: Number of steps at each end, fewer at the ends of the recording.

    Returns:
        The longer paths, and the prior existence probability of each row.
    """
    motion = smoother.model.motion
    backward = motion.transition.copy()
    backward[:3, 3:] *= -1.0  # the same process in reversed time
    states, covariances, firsts, existences = [], [], [], []
    for i, (begin, end) in enumerate(zip(paths.starts, paths.starts[1:], strict=False)):
        before = min(steps, int(paths.firsts[i]))
        after = min(steps, smoother.frames - 1 - int(paths.lasts[i]))
        head = _predict_steps(
            paths.states[begin], paths.covariances[begin], backward, motion.noise, before
        )
        tail = _predict_steps(
            paths.states[end - 1], paths.covariances[end - 1], motion.transition, motion.noise,
            after,
        )  # fmt: skip
        states.append(np.concatenate([head[0][::-1], paths.states[begin:end], tail[0]]))
        covariances.append(np.concatenate([head[1][::-1], paths.covariances[begin:end], tail[1]]))
        firsts.append(int(paths.firsts[i]) - before)
        own = np.full(len(states[-1]), UNSURE)
        own[before : before + end - begin] = 1.0
        existences.append(own)
    longer = Paths.of(paths.labels.tolist(), firsts, states, covariances, motion.dimension)
    return longer, np.concatenate([np.zeros(0), *existences])


def _predict_steps(
    state: ndarray, covariance: ndarray, transition: ndarray, noise: ndarray, steps: int
) -> tuple[ndarray, ndarray]:
    """Predict a state over some steps; returns (steps, d) states and (steps, d, d) covariances."""
    states = np.empty((steps, len(state)))
    covariances = np.empty((steps, len(state), len(state)))
    for k in range(steps):
        state = transition @ state
        covariance = transition @ covariance @ transition.T + noise
        states[k], covariances[k] = state, covariance
    return states, covariances


def select_separate_links(
    smoother: Smoother,
    paths: Paths,
    shared: BoxAssociations,
    there: Float[ndarray, " N"],
    odds: Float[ndarray, " n"],
) -> Bool[ndarray, " L"]:
    """Select the L links to boxes that are apart from every track of greater odds.

    A detector gives further boxes around a person: of limbs, one too high, one with a load. The
    rays of such boxes of several cameras intersect beside the person, or where rays to two people
    cross. So a box that overlaps that of a track of greater odds is no evidence, and neither is any
    box of a track that is always within a body's width of tracks of greater odds.

    Args:
        smoother: The models and the boxes.
        paths: n paths, with N rows.
        shared: Association probabilities of the rows, with L links.
        there: Existence probability of each of the N rows.
        odds: Log odds of each of the n paths, which rank them where they are present.
    """
    links = shared.links
    rows, sure = links.rows, np.where(there > _PRESENT, odds[paths.owners], -np.inf)
    beside = _beside_likelier(paths, sure, 2.0 * smoother.model.target.half_width)
    away = np.bincount(paths.owners[rows], links.shares * ~beside[rows], len(paths.labels))
    whole = np.bincount(paths.owners[rows], links.shares, len(paths.labels))
    apart = (away > _STRAY_SHARE * whole)[paths.owners[rows]]
    for number, camera in enumerate(smoother.cameras):
        own = np.flatnonzero(links.cameras == number)
        own = own[np.argsort(paths.steps[rows[own]], kind="stable")]
        boxes = Boxes(camera.boxes[links.boxes[own]]).left_top
        for one, other in _pairs_at_one_step(paths.steps[rows[own]]):
            over = paired_overlaps(boxes[one], boxes[other]) > _ONE_PERSON
            lesser = _lower_of_pairs(sure[rows[own]], one, other, over)
            apart[own[lesser]] = False
    return np.asarray(apart)


def _beside_likelier(paths: Paths, sure: Float[ndarray, " N"], width: float) -> Bool[ndarray, " N"]:
    """The rows within ``width``, metres on the floor, of a track of greater odds at that step."""
    order = np.argsort(paths.steps, kind="stable")
    places = paths.states[order, :2]
    beside = np.zeros(len(order), dtype=bool)
    for one, other in _pairs_at_one_step(paths.steps[order]):
        near = ((places[one] - places[other]) ** 2).sum(axis=1) < width**2
        beside[order[_lower_of_pairs(sure[order], one, other, near)]] = True
    return beside


def _pairs_at_one_step(
    steps: Int[ndarray, " N"],
) -> Iterator[tuple[Int[ndarray, " P"], Int[ndarray, " P"]]]:
    """All pairs of entries with equal steps, given in ascending order, as batches of indices."""
    for distance in range(1, len(steps)):
        one = np.flatnonzero(steps[distance:] == steps[:-distance])
        if not len(one):
            return
        yield one, one + distance


def _lower_of_pairs(
    sure: Float[ndarray, " N"],
    one: Int[ndarray, " P"],
    other: Int[ndarray, " P"],
    chosen: Bool[ndarray, " P"],
) -> Int[ndarray, " K"]:
    """The entry with the lower value of each chosen pair.

    Args:
        sure: Log odds of N entries.
        one: Index of the first entry of each of P pairs.
        other: Index of the second entry.
        chosen: Which of the pairs are considered.
    """
    less, more = chosen & (sure[one] < sure[other]), chosen & (sure[other] < sure[one])
    return np.concatenate([one[less], other[more]])
