"""What was decided, in words and with its odds: where a track was cut, and what was joined."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from jaxtyping import Int
from numpy import ndarray

from tracker.smoothing.identity.pieces import Pairs, same_label
from tracker.smoothing.paths import Paths
from tracker.smoothing.result import Decision

_REASONS = {
    0: "past and future do not fit",
    1: "whose boxes these are was near a draw",
    2: "past and future do not fit",
    3: "nobody saw it, or it was not there",
}


def cuts(
    cut: Paths,
    before: Paths,
    kept: Int[ndarray, " M"],
    reasons: Int[ndarray, " N"],
    chains: list[list[int]],
    labels: list[int],
) -> list[Decision]:
    """The cuts after which a track did not go on as the filter had it."""
    chain_of = {piece: number for number, chain in enumerate(chains) for piece in chain}
    found = []
    for piece, after in same_label(cut):
        one, other = chain_of.get(piece), chain_of.get(after)
        if one is None or one == other:
            continue
        last, first = kept[cut.starts[piece + 1] - 1], kept[cut.starts[after]]
        why = int(np.max(reasons[last + 1 : first], initial=0))
        if (reasons[last + 1 : first] == 1).any():
            why = 1
        step = int(before.steps[first])
        found.append(
            Decision("cut", step, labels[one], int(cut.labels[piece]), 1.0, 0.0, _REASONS[why])
        )
    return found


def joins(
    cut: Paths,
    pairs: Pairs,
    chains: list[list[int]],
    labels: list[int],
    anew: float,
    told: set[tuple[int, int]],
) -> list[Decision]:
    """The joins of what the filter held for two people, with the odds against the best other."""
    gain = {
        (i, j): g
        for i, j, g in zip(
            pairs.earlier.tolist(), pairs.later.tolist(), pairs.gains.tolist(), strict=True
        )
    }
    by_later: dict[int, list[float]] = {}
    for (_, j), g in gain.items():
        by_later.setdefault(j, []).append(g)
    found = []
    for chain, label in zip(chains, labels, strict=True):
        for i, j in pairwise(chain):
            if cut.labels[i] == cut.labels[j]:
                continue
            if (i, j) in told or (i, j) not in gain:
                name = int(cut.labels[j] if cut.labels[j] != label else cut.labels[i])
                step = int(cut.firsts[j])
                found.append(Decision("joined", step, label, name, 1.0, 0.0, "a person said so"))
                continue
            every = np.array([*by_later[j], anew])
            weights = np.exp(every - every.max())
            chances = weights / weights.sum()
            which = int(np.argmin(np.abs(every - gain[i, j])))
            own, rest = float(chances[which]), np.delete(chances, which)
            found.append(
                Decision(
                    "joined",
                    int(cut.firsts[j]),
                    label,
                    int(cut.labels[j] if cut.labels[j] != label else cut.labels[i]),
                    own,
                    float(rest.max(initial=0.0)),
                    "one person goes on" if cut.firsts[j] - cut.lasts[i] < 2 else "one person",
                )
            )
    return found
