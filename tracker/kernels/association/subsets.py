"""Sums over all one-to-one choices, subset by subset, compiled.

The kernel must agree with a counterpart by enumeration in the tests.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import kernel


class SubsetMarginals(NamedTuple):
    """Sums of the weights of choices of s steps among k items."""

    none: ndarray
    """(s,), over choices in which each step takes none."""
    chosen: ndarray
    """(s, k), over choices in which each step takes each item."""
    left: ndarray
    """(k,), over choices in which no step takes each item."""
    total: float
    """Sum over all choices."""


@kernel
def subset_marginals(
    skips: ndarray, pairs: ndarray, rests: ndarray, factors: ndarray
) -> SubsetMarginals:
    """Sum the weights of all one-to-one choices of items by a row of steps, over subsets of items.

    Each step takes one item that no other takes, or none. The weight of a choice is
    Π skips of steps that take none · Π pairs · Π rests of items that no step takes ·
    factors[number of items taken]. With F_s(S) the sum over the first s steps that take
    just the items S, and B_s(S) over the others given S,

        F_{s+1}(S) = F_s(S) skips_s + Σ_{i ∈ S} F_s(S \\ i) pairs_si
        B_s(S) = B_{s+1}(S) skips_s + Σ_{i ∉ S} B_{s+1}(S ∪ i) pairs_si
        Σ choices with s ← i = Σ_{S ∌ i} F_s(S) pairs_si B_{s+1}(S ∪ i)

    Args:
        skips: (s,) weight of each step taking none.
        pairs: (s, k) weight of each step and item; 0 where a step cannot take an item.
        rests: (k,) weight of each item that no step takes.
        factors: (k + 1,) factor by the number of items taken.
    """
    steps, items = pairs.shape
    subsets = 1 << items
    backward = np.zeros((steps + 1, subsets))
    for subset in range(subsets):
        weight = 1.0
        assigned = 0
        for i in range(items):
            if subset >> i & 1:
                assigned += 1
            else:
                weight *= rests[i]
        backward[steps, subset] = weight * factors[assigned]
    for s in range(steps - 1, -1, -1):
        for subset in range(subsets):
            backward[s, subset] = backward[s + 1, subset] * skips[s]
        for i in range(items):
            pair = pairs[s, i]
            if pair == 0.0:
                continue
            bit = 1 << i
            for high in range(0, subsets, 2 * bit):
                for subset in range(high, high + bit):
                    backward[s, subset] += backward[s + 1, subset + bit] * pair
    skipped = np.zeros(steps)
    chosen = np.zeros((steps, items))
    forward = np.zeros(subsets)
    following = np.zeros(subsets)
    forward[0] = 1.0
    for s in range(steps):
        total = 0.0
        for subset in range(subsets):
            following[subset] = forward[subset] * skips[s]
            total += following[subset] * backward[s + 1, subset]
        skipped[s] = total
        for i in range(items):
            pair = pairs[s, i]
            if pair == 0.0:
                continue
            bit = 1 << i
            total = 0.0
            for high in range(0, subsets, 2 * bit):
                for subset in range(high, high + bit):
                    step = forward[subset] * pair
                    following[subset + bit] += step
                    total += step * backward[s + 1, subset + bit]
            chosen[s, i] = total
        forward, following = following, forward
    left = np.zeros(items)
    for i in range(items):
        bit = 1 << i
        for high in range(0, subsets, 2 * bit):
            for subset in range(high, high + bit):
                left[i] += forward[subset] * backward[steps, subset]
    return SubsetMarginals(skipped, chosen, left, backward[0, 0])
