"""When people were there: whose track begins and ends where, and who was nobody."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.kernels.smoothing.presence import Habits, presence
from tracker.parameters import SmoothingParams
from tracker.smoothing.apart import shown_apart
from tracker.smoothing.paths import Paths
from tracker.smoothing.smoother import Shared, Smoother

UNSURE = 0.3
"""Existence with which a row beyond a path's ends, or within its gaps, competes for boxes."""

_MEETING = 2
"""Cameras whose boxes of anything meet somewhere."""

_SAID = 1e4
"""Votes for a person where somebody said that he is: more than any camera has against it."""


def independence(step_time: float, memory: float) -> float:
    """The share of a step's evidence that is new: pictures of one moment agree, right or wrong."""
    return min(step_time / memory, 1.0)


def misses(shared: Shared) -> Float[ndarray, " N"]:
    """log of what the cameras that should have seen each row and did not say: at most 0."""
    blind = np.log1p(-np.minimum(shared.chances, 1.0 - 1e-6))
    return np.asarray((shared.missed * blind).sum(axis=0))


def lifetimes(
    smoother: Smoother, paths: Paths, shared: Shared, parameters: SmoothingParams
) -> tuple[Float[ndarray, " N"], Float[ndarray, " n"]]:
    """The probability at each row that somebody was there, and each path's odds in its whole life.

    A camera that shows the person votes for him with as much as it would against him if it
    showed nothing, log 1/(1 − p_D): a false box that stays is no better witness than a miss.

    Where stage 1 tells how much likelier a person looks so, log Λ is added to that; its boxes are
    many, and most are false. One alone has a place somewhere on its ray whatever it shows, so
    that only its looks count. Two of something else meet somewhere in the room, a third hardly
    meets them: each beyond the second outweighs as much doubt of their looks as a vote.

    Where stage 1 may draw several boxes around a person, all that holds of boxes that show
    somebody apart from surer people (:func:`shown_apart`); others meet because there is one, and
    only looks tell a second.

    Returns:
        (N,) probabilities; (n,) log odds of a person at some step against nobody.
    """
    p = smoother.parameters
    hit = -np.log1p(-min(p.detection_probability, 1.0 - 1e-6))
    links = shared.links
    looks = np.zeros(len(links.rows))
    for c, camera in enumerate(smoother.cameras):
        own = links.cameras == c
        looks[own] = -np.log(camera.clutter_factors[links.boxes[own]])
    rows = len(paths.states)
    shown = np.bincount(links.rows, links.shares, rows)
    weight = independence(smoother.model.step_time, parameters.memory)
    survival = min(p.survival_probability, 1.0 - 1e-9)
    # within the time in which the evidence tells anew; a recording seen backwards is the same
    steps = 1.0 / weight
    come = float(np.log(min(p.birth_rate * steps * smoother.model.step_time, 1.0)))
    leave = float(np.log1p(-(survival**steps)))
    habits = Habits(float(np.log(survival)), (come + leave) / 4.0, -parameters.change)
    pinned, against = smoother.pinned(paths)[0], misses(shared)

    def by(votes: Float[ndarray, " N"]) -> tuple[Float[ndarray, " N"], Float[ndarray, " n"]]:
        votes[pinned] += _SAID
        found = presence(
            paths.starts, paths.firsts, weight * (votes + against), habits, smoother.frames - 1
        )
        return found.probabilities, found.odds

    def voted(shown: Float[ndarray, " N"]) -> Float[ndarray, " N"]:
        return _votes(hit, shown, doubt) if looks.any() else hit * shown

    doubt = np.bincount(links.rows, links.shares * looks, rows)
    there, odds = by(voted(shown))
    if not smoother.several_boxes:
        return there, odds
    apart = shown_apart(smoother, paths, shared, there, odds)
    if apart.all():
        return there, odds
    return by(voted(np.bincount(links.rows, links.shares * apart, rows)))


def _votes(
    hit: float, shown: Float[ndarray, " N"], doubt: Float[ndarray, " N"]
) -> Float[ndarray, " N"]:
    """Of so many cameras for each row, where their boxes' looks say ``doubt``, log odds."""
    outweighed = np.minimum(doubt + hit * np.maximum(shown - _MEETING, 0.0), 0.0)
    meeting = hit * np.minimum(shown, 2.0 * np.maximum(shown - 1.0, 0.0))
    return np.asarray(meeting + np.where(doubt < 0.0, outweighed, doubt))


def extended(smoother: Smoother, paths: Paths, steps: int) -> tuple[Paths, Float[ndarray, " N"]]:
    """The paths with more steps at both ends, where the motion model takes them.

    Returns:
        The longer paths, and with which existence each row may ask for boxes.
    """
    motion = smoother.model.motion
    backward = motion.transition.copy()
    backward[:3, 3:] *= -1.0  # the same process, seen from behind
    states, covariances, firsts, existences = [], [], [], []
    for i, (begin, end) in enumerate(zip(paths.starts, paths.starts[1:], strict=False)):
        before = min(steps, int(paths.firsts[i]))
        after = min(steps, smoother.frames - 1 - int(paths.lasts[i]))
        head = _carried(
            paths.states[begin], paths.covariances[begin], backward, motion.noise, before
        )
        tail = _carried(
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


def _carried(
    state: ndarray, covariance: ndarray, transition: ndarray, noise: ndarray, steps: int
) -> tuple[ndarray, ndarray]:
    """(steps, d) states and (steps, d, d) covariances of a state carried on."""
    states = np.empty((steps, len(state)))
    covariances = np.empty((steps, len(state), len(state)))
    for k in range(steps):
        state = transition @ state
        covariance = transition @ covariance @ transition.T + noise
        states[k], covariances[k] = state, covariance
    return states, covariances
