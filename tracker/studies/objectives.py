"""The objectives of studies: any figure of the evaluation, speed, or identity without truth."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from tracker.evaluation import DEFINITIONS
from tracker.studies.errors import StudyError

Of = Literal["truth", "run", "agreement"]
"""The data from which a figure is computed: ground truth, the run alone, or variants of the run."""


@dataclass(frozen=True, slots=True)
class Objective:
    """A figure by which trials are judged."""

    key: str
    """The key of the figure."""
    name: str
    """The name that is displayed."""
    higher: bool
    """Whether larger values are better."""
    of: Of
    """The data from which the figure is computed."""
    unit: str = ""
    """The unit that is displayed; empty for a figure without unit."""
    digits: int = 3
    """The number of decimals that are displayed."""
    help: str = ""
    """The explanation, in full sentences."""

    def better(self, one: float, other: float) -> bool:
        """Whether one value is better than another."""
        return one > other if self.higher else one < other

    def words(self, value: float, spread: float | None) -> str:
        """Format a value for a table, with its standard deviation over the seeds if known."""
        about = "" if spread is None else f" ± {spread:.{self.digits}f}"
        return f"{value:.{self.digits}f}{about}"


SCORE = Objective(
    "score", "(HOTA + IDF1) / 2", True, "truth", "", 4,
    "Mean of HOTA and IDF1: where people are, and who they are.",
)  # fmt: skip
SPEED = Objective(
    "speed", "Speed", True, "run", "steps/s", 1,
    "Steps a second of processor time, whether or not stage 1 was taken from an earlier run.",
)  # fmt: skip
IDENTITY = Objective(
    "identity", "Identity without truth", True, "agreement", "", 3,
    "J = IDF1(forward, backwards) × mean over cameras of IDF1(all, all but one); no trial whose "
    "people overlap less with a camera that was left out than the default's is ever best.",
)  # fmt: skip

OBJECTIVES: dict[str, Objective] = {
    **{
        d.key: Objective(
            d.key, d.name, d.direction == "higher", "truth", d.unit.replace("{d}", "m"), d.digits,
            d.help,
        )
        for d in DEFINITIONS
        if d.direction in ("higher", "lower")
    },
    **{one.key: one for one in (SCORE, SPEED, IDENTITY)},
}  # fmt: skip
"""All objectives by key."""

HELD_OUT = Objective(
    "held_out", "Held-out camera", True, "agreement", "", 3,
    "Each camera in turn is left out: how far its boxes overlap the people whom the others found, "
    "intersection over union, mean over cameras. It vetoes trials and is no objective: by itself "
    "it ranks settings badly.",
)  # fmt: skip

BESIDE: dict[str, Objective] = {
    HELD_OUT.key: HELD_OUT,
    **{key: OBJECTIVES[key] for key in ("idf1", "hota", "ospa", "position_error")},
}
"""Figures that are shown beside the objectives of trials that have them."""

WITH_TRUTH = ("hota", "idf1", "speed")
"""The default objectives if all recordings have ground truth."""

SELF_CONSISTENCY = ("identity",)
"""The default objectives if a recording has no ground truth."""

VETO = 0.05
"""Largest decrease of the held-out overlap (intersection over union, mean over cameras) below that
of the defaults with which a trial is not vetoed."""


def chosen(objectives: Sequence[str], has_truth: Mapping[str, bool]) -> tuple[Objective, ...]:
    """Return the objectives of a study; if none is named, the default ones for its recordings.

    Args:
        objectives: The keys of the objectives; empty for the default ones.
        has_truth: Whether each recording has ground truth, by name.

    Raises:
        StudyError: If an objective needs ground truth that a recording does not have.
    """
    if not objectives:
        objectives = WITH_TRUTH if all(has_truth.values()) else SELF_CONSISTENCY
    found = tuple(OBJECTIVES[key] for key in dict.fromkeys(objectives))
    for one in found:
        for recording, there in has_truth.items():
            if one.of == "truth" and not there:
                raise StudyError(
                    f"objectives: {one.key} needs a truth, and {recording} has none; take "
                    "identity, or leave that recording out"
                )
    return found


@dataclass(frozen=True, slots=True)
class Mean:
    """The mean of a figure over recordings and seeds."""

    value: float
    """The mean, in the unit of the figure."""
    spread: float | None
    """Standard deviation over the seeds of the mean over the recordings; None if fewer than two
    seeds have values on all recordings."""


def mean_over(values: Mapping[tuple[str, int], float]) -> Mean:
    """Compute the mean over recordings of the mean over seeds, and the spread over seeds.

    Args:
        values: The values by recording and seed.
    """
    recordings = sorted({recording for recording, _ in values})
    seeds = sorted({seed for _, seed in values})
    of_recording = [np.mean([v for (r, _), v in values.items() if r == one]) for one in recordings]
    whole = [seed for seed in seeds if all((recording, seed) in values for recording in recordings)]
    spread = None
    if len(whole) > 1:
        of_seed = [np.mean([values[recording, seed] for recording in recordings]) for seed in whole]
        spread = float(np.std(of_seed, ddof=1))
    return Mean(float(np.mean(of_recording)), spread)


def front(
    rows: Iterable[tuple[int, Sequence[float]]], objectives: Sequence[Objective]
) -> list[int]:
    """Return the numbers of the trials on the Pareto front: those that no other trial dominates.

    Args:
        rows: The number and the values of each trial.
        objectives: The objectives, one for each value.
    """
    every = list(rows)
    if not every:
        return []
    signs = np.array([1.0 if one.higher else -1.0 for one in objectives])
    values = np.array([v for _, v in every], dtype=np.float64) * signs
    kept = []
    for index, (number, _) in enumerate(every):
        no_worse = (values >= values[index]).all(axis=1)
        if not (no_worse & (values > values[index]).any(axis=1)).any():
            kept.append(number)
    return kept
