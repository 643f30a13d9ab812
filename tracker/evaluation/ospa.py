"""OSPA and GOSPA at each step, and OSPA(2) over tracks.

[SVV08] Schuhmacher, Vo, Vo, "A consistent metric for performance evaluation of
multi-object filters", IEEE Transactions on Signal Processing 56(8), 2008.
[BVV20] Beard, Vo, Vo, "A solution for large-scale multi-object tracking", IEEE
Transactions on Signal Processing 68, 2020.
[RGS17] Rahmathullah, García-Fernández, Svensson, "Generalized optimal sub-pattern
assignment metric", FUSION 2017.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.evaluation.figures import CUT, Definition, mean
from tracker.evaluation.matching import Comparison
from tracker.geometry.assignment import linear_sum_assignment

SVV08 = "Schuhmacher, Vo, Vo, IEEE TSP 56(8), 2008"
BVV20 = "Beard, Vo, Vo, IEEE TSP 68, 2020"
RGS17 = "Rahmathullah, García-Fernández, Svensson, FUSION 2017"


@dataclass(frozen=True, slots=True, eq=False)
class Ospa:
    """OSPA of every step with its two parts."""

    distance: Float[ndarray, " S"]
    """OSPA at each step, in the unit of the distance."""
    localisation: Float[ndarray, " S"]
    """The localisation part at each step; the p-th powers of the parts sum to that of OSPA."""
    cardinality: Float[ndarray, " S"]
    """The cardinality part at each step."""


OSPA: tuple[Definition[Ospa], ...] = (
    Definition("ospa", "OSPA", "OSPA", "{d}", "lower", 3, CUT,
        "Distance between the set of people and the set of estimates, mean over the steps.",
        lambda o: mean(o.distance), SVV08, True),
    Definition("ospa_localisation", "OSPA, localisation", "OSPA", "{d}", "lower", 3, CUT,
        "The part of OSPA that is due to positions, mean over the steps.",
        lambda o: mean(o.localisation), SVV08),
    Definition("ospa_cardinality", "OSPA, cardinality", "OSPA", "{d}", "lower", 3, CUT,
        "The part of OSPA that is due to the number of people, mean over the steps.",
        lambda o: mean(o.cardinality), SVV08),
)  # fmt: skip


def ospa_parts(
    distances: Float[ndarray, "M N"], *, cutoff: float, order: float
) -> tuple[float, float, float]:
    """Compute OSPA between two finite sets, and its localisation and cardinality part.

    With m <= n elements and d^(c) = min(d, c) [SVV08], equation (3):

        localisation^p = 1/n min over assignments Σ_i d^(c)(x_i, y_π(i))^p
        cardinality^p  = 1/n c^p (n − m)
        OSPA^p = localisation^p + cardinality^p

    Two empty sets are at distance 0; one empty set is at distance c of any other.

    Args:
        distances: The distance of every element of the first set to every one of the second.
        cutoff: c > 0, in the unit of the distances.
        order: p >= 1.
    """
    smaller, larger = sorted(distances.shape)
    if larger == 0:
        return 0.0, 0.0, 0.0
    costs = np.minimum(distances, cutoff) ** order
    near = float(costs[linear_sum_assignment(costs)].sum()) / larger if smaller else 0.0
    count = cutoff**order * (larger - smaller) / larger
    return (near + count) ** (1.0 / order), near ** (1.0 / order), count ** (1.0 / order)


def ospa(comparison: Comparison, *, cutoff: float, order: float) -> Ospa:
    """Compute OSPA at each step; see :func:`ospa_parts` for the arguments."""
    parts = [ospa_parts(d, cutoff=cutoff, order=order) for d in comparison.distances]
    columns = np.array(parts, dtype=float).reshape(-1, 3).T
    return Ospa(*columns)


@dataclass(frozen=True, slots=True, eq=False)
class Ospa2:
    """OSPA(2) over windows of steps."""

    over_time: Float[ndarray, " S"]
    """OSPA(2) over the window that ends at each step, in the unit of the distance."""
    whole: float | None
    """OSPA(2) with all steps as its window; None without steps."""


OSPA2: tuple[Definition[Ospa2], ...] = (
    Definition("ospa2", "OSPA(2)", "OSPA", "{d}", "lower", 3, (*CUT, "window"),
        "OSPA between the sets of tracks over a window that ends at each step, mean over the "
        "steps: it also sees changed identities.",
        lambda o: mean(o.over_time), BVV20),
    Definition("ospa2_whole", "OSPA(2), whole sequence", "OSPA", "{d}", "lower", 3, CUT,
        "OSPA between the sets of tracks, the window being the whole sequence.",
        lambda o: o.whole, BVV20),
)  # fmt: skip


def ospa2(comparison: Comparison, *, cutoff: float, order: float, window: int) -> Ospa2:
    """Compute OSPA(2) at each step t, OSPA between the two sets of tracks over a window, and with
    all steps as the window.

    The base distance of a true track f and an estimated track g, both restricted
    to the steps t − w + 1 … t, is the mean of the cut distance over the steps at
    which at least one of them exists [BVV20]:

        d(f, g) = 1/|D_f ∪ D_g| Σ_{s ∈ D_f ∪ D_g} d^(c)({f(s)}, {g(s)}),

    where the cut distance is min(|f(s) − g(s)|, c) where both exist and c where
    one does. OSPA of the tracks that exist in the window then follows with cut-off
    c and order p. A window without tracks on either side gives 0.

    Args:
        comparison: Truth and estimates. A don't-care step belongs to neither D_f nor D_g.
        cutoff: c > 0, in the unit of the distances.
        order: p >= 1 of the outer OSPA; the time average is of order 1.
        window: w >= 1 steps; at the first steps it is as long as there are steps.
    """
    sums, everything = _Window(comparison, cutoff), _Window(comparison, cutoff)
    values = np.zeros(comparison.steps)
    for step in range(comparison.steps):
        everything.add(step, 1)
        sums.add(step, 1)
        if step >= window:
            sums.add(step - window, -1)
        values[step] = sums.distance(order)
    return Ospa2(values, everything.distance(order) if comparison.steps else None)


class _Window:
    """Running sums over the steps in a window, for every pair of a true and an estimated track."""

    def __init__(self, comparison: Comparison, cutoff: float) -> None:
        people, tracks = len(comparison.truth.names), len(comparison.tracks.names)
        self.comparison, self.cutoff = comparison, cutoff
        self.near = np.zeros((people, tracks))  # Σ min(d, c) where both exist
        self.both = np.zeros((people, tracks), dtype=np.int64)
        self.truth_life = np.zeros(people, dtype=np.int64)
        self.track_life = np.zeros(tracks, dtype=np.int64)

    def add(self, step: int, sign: int) -> None:
        """Add a step to the window (``sign`` 1), or remove it (−1)."""
        truth, tracks = self.comparison.truth, self.comparison.tracks
        people = truth.indices[truth.at(step)]
        estimates = tracks.indices[tracks.at(step)]
        self.truth_life[people] += sign
        self.track_life[estimates] += sign
        pairs = np.ix_(people, estimates)
        self.near[pairs] += sign * np.minimum(self.comparison.distances[step], self.cutoff)
        self.both[pairs] += sign

    def distance(self, order: float) -> float:
        """Compute OSPA between the tracks in the window."""
        rows, columns = np.flatnonzero(self.truth_life), np.flatnonzero(self.track_life)
        pairs = np.ix_(rows, columns)
        together = self.both[pairs]
        union = self.truth_life[rows, None] + self.track_life[columns] - together
        # rounding may leave a rest in a running sum after the pair has left the window
        near = np.where(together > 0, np.maximum(self.near[pairs], 0.0), 0.0)
        base = (near + self.cutoff * (union - together)) / union
        return ospa_parts(base, cutoff=self.cutoff, order=order)[0]


@dataclass(frozen=True, slots=True, eq=False)
class Gospa:
    """GOSPA of every step. The three parts are p-th powers: they sum to distance^p."""

    distance: Float[ndarray, " S"]
    """GOSPA at each step, in the unit of the distance."""
    localisation: Float[ndarray, " S"]
    """Σ d^p over the pairs."""
    missed: Float[ndarray, " S"]
    """c^p/2 for each missed target."""
    false: Float[ndarray, " S"]
    """c^p/2 for each false target."""


GOSPA: tuple[Definition[Gospa], ...] = (
    Definition("gospa", "GOSPA", "GOSPA", "{d}", "lower", 3, CUT,
        "Localisation, missed and false targets in one cost (α = 2), not divided by the number "
        "of people, mean over the steps.",
        lambda g: mean(g.distance), RGS17),
    Definition("gospa_localisation", "GOSPA, localisation", "GOSPA", "{d^p}", "lower", 3, CUT,
        "Σ d^p over the pairs, mean over the steps.",
        lambda g: mean(g.localisation), RGS17),
    Definition("gospa_missed", "GOSPA, missed", "GOSPA", "{d^p}", "lower", 3, CUT,
        "c^p / 2 for each missed person, mean over the steps.",
        lambda g: mean(g.missed), RGS17),
    Definition("gospa_false", "GOSPA, false", "GOSPA", "{d^p}", "lower", 3, CUT,
        "c^p / 2 for each false estimate, mean over the steps.",
        lambda g: mean(g.false), RGS17),
)  # fmt: skip


def gospa_parts(
    distances: Float[ndarray, "M N"], *, cutoff: float, order: float
) -> tuple[float, int, int]:
    """Return the localisation cost, the number of missed and the number of false targets.

    They minimise, over all partial assignments γ, with α = 2 [RGS17], proposition 1:

        GOSPA^p = min_γ ( Σ_{(i, j) ∈ γ} d(x_i, y_j)^p + c^p/2 (missed + false) ).

    A pair at the cut-off or beyond counts as one missed and one false target.

    Args:
        distances: The distance of every true target (rows) to every estimate (columns).
        cutoff: c > 0, in the unit of the distances.
        order: p >= 1.

    Returns:
        Σ d^p over the pairs, missed, false. Two empty sets give zeros.
    """
    people, estimates = distances.shape
    if not distances.size:
        return 0.0, people, estimates
    costs = np.minimum(distances, cutoff) ** order
    rows, columns = linear_sum_assignment(costs)
    paired = distances[rows, columns] < cutoff
    pairs = int(paired.sum())
    near = float(costs[rows, columns][paired].sum())
    return near, people - pairs, estimates - pairs


def gospa(comparison: Comparison, *, cutoff: float, order: float) -> Gospa:
    """Compute GOSPA at each step; see :func:`gospa_parts` for the arguments."""
    parts = [gospa_parts(d, cutoff=cutoff, order=order) for d in comparison.distances]
    near = np.array([part[0] for part in parts], dtype=float)
    missed = np.array([part[1] for part in parts], dtype=np.int64)
    false = np.array([part[2] for part in parts], dtype=np.int64)
    half = cutoff**order / 2.0
    return Gospa(
        distance=(near + half * (missed + false)) ** (1.0 / order),
        localisation=near,
        missed=half * missed,
        false=half * false,
    )
