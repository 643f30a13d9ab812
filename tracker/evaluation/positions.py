"""Position errors in metres and errors of cardinality, regardless of identity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.evaluation.measures.matching import (
    Comparison,
    GatedDistance,
    Matches,
    assign,
    distances_by_step,
    gather,
    match,
)


@dataclass(frozen=True, slots=True, eq=False)
class Positions:
    """Position errors of the pairs of the matching protocol, with each step paired on its own."""

    matches: Matches
    errors: Float[ndarray, " M"]
    """Distance of each pair in metres: in 3D, or on the ground plane where that is chosen."""
    by_person: Float[ndarray, "K S"]
    """The error of each person at each step; NaN where there is no pair."""
    found: Int[ndarray, " K"]
    """The number of steps at which each person is paired with an estimate within the near
    distance."""
    present: Int[ndarray, " K"]
    """The number of steps at which each person is present."""
    stray: Int[ndarray, " S"]
    """The number of estimates at each step that have no person within the near distance."""

    @property
    def mean(self) -> float | None:
        """Mean error of all pairs, metres; None without pairs."""
        return float(self.errors.mean()) if len(self.errors) else None

    @property
    def percentile_95(self) -> float | None:
        """95th percentile of the error of all pairs, metres; None without pairs."""
        return float(np.percentile(self.errors, 95)) if len(self.errors) else None

    @property
    def found_share(self) -> float | None:
        """Share of all true positions found within the near distance; None without people."""
        people = int(self.present.sum())
        return float(self.found.sum()) / people if people else None


def positions(comparison: Comparison, *, near: float) -> Positions:
    """Score the positions.

    Args:
        comparison: Truth and estimates with the gate of the evaluation.
        near: The gate, in metres, of a second pairing: people that it pairs are found,
            estimates that it leaves unpaired are stray.
    """
    truth, tracks, measure = comparison.truth, comparison.tracks, comparison.measure
    metres = GatedDistance(
        "ground" if measure.distance == "ground" else "position", near, measure.half_extents
    )
    distances = (
        distances_by_step(truth, tracks, metres)
        if measure.distance == "box"
        else comparison.distances
    )
    close = gather(comparison, [assign(matrix, near) for matrix in distances])
    matches = match(comparison)
    errors = metres.between(
        truth.positions[matches.truth_rows], tracks.positions[matches.track_rows]
    )
    by_person = np.full((len(truth.names), comparison.steps), np.nan)
    by_person[truth.indices[matches.truth_rows], truth.frames[matches.truth_rows]] = errors
    found_at = np.bincount(truth.frames[close.truth_rows], minlength=comparison.steps)
    return Positions(
        matches=matches,
        errors=errors,
        by_person=by_person,
        found=np.bincount(truth.indices[close.truth_rows], minlength=len(truth.names)),
        present=np.bincount(truth.indices, minlength=len(truth.names)),
        stray=tracks.counts - found_at,
    )


def cardinality_error(comparison: Comparison) -> tuple[float | None, float | None]:
    """Return the mean of |estimates − people| over the steps, and of estimates − people (the bias).

    Don't-care rows and the estimates that matched them count on neither side.
    Both values are None without steps.
    """
    if not comparison.steps:
        return None, None
    surplus = comparison.tracks.counts - comparison.truth.counts
    return float(np.abs(surplus).mean()), float(surplus.mean())
