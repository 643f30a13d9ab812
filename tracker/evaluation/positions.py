"""Position errors in metres and errors of cardinality, regardless of identity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.evaluation.figures import GATED, Definition, mean, percentile_95
from tracker.evaluation.matching import (
    Comparison,
    GatedDistance,
    assign,
    distances_by_step,
    gather,
    match,
)


@dataclass(frozen=True, slots=True, eq=False)
class Errors:
    """The errors of estimates in space or in the pictures of a camera, regardless of identity."""

    errors: Float[ndarray, " M"]
    """The distance of each pair of a person and an estimate, metres or pixels."""
    people: int
    """The number of true positions or boxes, over all steps."""
    found: int
    """The number of them that have an estimate of their own so near that they count as found."""
    estimates: int
    """The number of estimates, over all steps."""
    steps: int
    """The number of steps that are scored."""

    @property
    def error(self) -> float | None:
        """Mean error of the pairs; None without pairs."""
        return mean(self.errors)

    @property
    def error_95(self) -> float | None:
        """95th percentile of the error of the pairs; None without pairs."""
        return percentile_95(self.errors)

    @property
    def found_share(self) -> float | None:
        """Share of the true positions that are found; None without people."""
        return self.found / self.people if self.people else None

    @property
    def false_per_step(self) -> float | None:
        """Mean number of estimates that found nobody at a step; None without steps."""
        return (self.estimates - self.found) / self.steps if self.steps else None


@dataclass(frozen=True, slots=True, eq=False)
class Positions(Errors):
    """The errors in space, in 3D or on the ground plane, with each step paired on its own."""

    by_person: Float[ndarray, "K S"]
    """The error of each person at each step, metres; NaN where there is no pair."""
    found_by_person: Int[ndarray, " K"]
    """The number of steps at which each person is found."""
    surplus: Int[ndarray, " S"]
    """The number of estimates less the number of people at each step."""


POSITIONS: tuple[Definition[Positions], ...] = (
    Definition("position_error", "Position error", "Positions", "m", "lower", 3, GATED,
        "Mean distance of the pairs, each step paired by itself.",
        lambda p: p.error, headline=True),
    Definition("position_error_95", "Position error, 95 %", "Positions", "m", "lower", 3, GATED,
        "95 of 100 pairs are nearer than this.",
        lambda p: p.error_95),
    Definition("found_share", "Found", "Positions", "", "higher", 3, ("near",),
        "Share of the true positions that have an estimate of their own so near.",
        lambda p: p.found_share),
    Definition("false_per_step", "False a step", "Positions", "1/step", "lower", 3, ("near",),
        "Estimates a step without a true position of their own so near.",
        lambda p: p.false_per_step),
    Definition("cardinality_error", "Cardinality error", "Positions", "people", "lower", 3, (),
        "Mean of |estimates − people| over the steps.",
        lambda p: mean(np.abs(p.surplus))),
    Definition("cardinality_bias", "Cardinality bias", "Positions", "people", "zero", 3, (),
        "Mean of estimates − people over the steps: above 0 there are too many.",
        lambda p: mean(p.surplus)),
)  # fmt: skip


def positions(comparison: Comparison, *, near: float) -> Positions:
    """Score the positions.

    Don't-care rows and the estimates that matched them count on neither side.

    Args:
        comparison: Truth and estimates with the gate of the evaluation.
        near: The gate, in metres, of a second pairing: people that it pairs are found.
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
    errors = comparison.apart(matches, metres)
    by_person = np.full((len(truth.names), comparison.steps), np.nan)
    by_person[truth.indices[matches.truth_rows], truth.frames[matches.truth_rows]] = errors
    return Positions(
        errors=errors,
        people=len(truth),
        found=len(close),
        estimates=len(tracks),
        steps=comparison.steps,
        by_person=by_person,
        found_by_person=np.bincount(truth.indices[close.truth_rows], minlength=len(truth.names)),
        surplus=tracks.counts - truth.counts,
    )
