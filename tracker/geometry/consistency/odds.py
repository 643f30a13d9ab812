"""Log odds between interpretations whose evidence is known by moment.

Looks at the same scene are not independent, so nats are not odds: a difference that every part of
the recording shows is trusted, one that a few moments make is not. Over n blocks of time the
difference ΔE has mean over standard error z, and

    Λ = min{ΔE, (n / 2) ln(1 + z² / (n − 1))},

the logarithm of the likelihood ratio of Student's test against a difference of zero.
"""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float
from numpy import ndarray

BLOCKS = 20
"""n: number of blocks of time."""

DECISIVE = math.log(1000.0)
"""Log odds from which an interpretation is decided."""


def log_odds(one: Float[ndarray, " M"], other: Float[ndarray, " M"]) -> float:
    """Log odds of one interpretation over another one, by their evidence at M moments.

    Args:
        one: E by moment, nats, in the order of time.
        other: E by moment of the other one.

    Returns:
        Λ; negative where the other one is likelier, and 0 with fewer than 3 moments.
    """
    difference = np.asarray(one - other, dtype=float)
    total = float(difference.sum())
    blocks = min(BLOCKS, len(difference))
    if blocks < 3:
        return 0.0
    edges = np.linspace(0, len(difference), blocks + 1).astype(int)
    sums = np.add.reduceat(difference, edges[:-1])
    spread = float(sums.std(ddof=1))
    if spread == 0.0:
        return total
    z = float(sums.mean()) / (spread / math.sqrt(blocks))
    bound = 0.5 * blocks * math.log1p(z * z / (blocks - 1))
    return math.copysign(min(abs(total), bound), total)
