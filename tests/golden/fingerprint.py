"""Sums of what the stages of a run found: of all steps together, and of one step by itself."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Sequence as Items
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tests.golden.combinations import Combination
from tracker.evaluation import evaluate_sequence
from tracker.runs.pipeline import Run

COLUMNS: dict[str, tuple[str, ...]] = {
    "single_view": (
        "boxes", "centre_x", "centre_y", "half_width", "half_height", "weight", "sigma",
        "estimates", "measurements",
    ),
    "fusion": (
        "components", "weight", "x", "y", "z", "deviation", "detection_probability", "fed",
        "association",
    ),
    "tracks": ("tracks", "id", "x", "y", "z", "existence", "deviation", "seen"),
    "evaluation": (
        "mota", "idf1", "hota", "ospa2_whole", "position_error", "misses", "false_positives",
        "id_switches", "pixel_error",
    ),
}  # fmt: skip
"""What the numbers of a row are: counts (the first), else sums; figures of the evaluation."""

DIGITS = 8
"""Significant digits that are kept: rounding stays far below the tolerance of the comparison."""

Row = list[float | int | None]
Stage = dict[str, Row]
"""By step, or ``all`` for the sum over the steps."""
Fingerprint = dict[str, Stage]
"""By stage; the first one is told of each camera: ``single_view cam1``."""


def fingerprints(
    found: Iterable[tuple[Combination, Run]], *, short: bool = False
) -> dict[str, Fingerprint]:
    """Of all runs by name: of stage 1, which several share, and of what each makes of it.

    Args:
        found: The runs.
        short: All cameras and steps together, and no fusion, which the tracks follow from;
            else each camera by itself, and the step in the middle.
    """
    told: dict[str, Fingerprint] = {}
    for combination, run in found:
        if combination.view_name not in told:
            told[combination.view_name] = _of_views(run, short)
        own = told[combination.name] = {}
        shown = () if short else (run.done // 2,)
        if not short:
            own["fusion"] = _rows([_posterior(one) for one in run.fused[: run.done]], shown)
        own["tracks"] = _rows([_tracks(run, step) for step in range(run.done)], shown)
        own["evaluation"] = {"all": _figures(run)}
    return told


def _of_views(run: Run, short: bool) -> Fingerprint:
    steps = run.views[: run.done]
    if short:
        return {"single_view": _rows([_boxes(view) for views in steps for view in views], ())}
    return {
        f"single_view {camera.name}": _rows(
            [_boxes(views[index]) for views in steps], (run.done // 2,)
        )
        for index, camera in enumerate(run.sequence.cameras)
    }


def _boxes(view: Any) -> Float[ndarray, " 9"]:
    counted = [len(view.estimates), len(view.measurements)]
    sums = [*view.boxes.sum(axis=0), view.weights.sum(), view.sigmas.sum()]
    return np.array([len(view.boxes), *sums, *counted], dtype=float)


def _posterior(result: Any) -> Float[ndarray, " 9"]:
    mixture = result.posterior
    variances = np.diagonal(mixture.covariances, axis1=1, axis2=2)
    return np.array(
        [
            len(mixture.weights),
            mixture.weights.sum(),
            *mixture.means[:, :3].sum(axis=0),
            np.sqrt(variances).sum(),
            result.detection_probabilities.sum(),
            (result.sources >= 0).sum(),
            result.associations.probabilities.sum(dtype=float),
        ],
        dtype=float,
    )


def _tracks(run: Run, step: int) -> Float[ndarray, " 8"]:
    tracks = run.tracks
    rows = tracks.at(step)
    return np.array(
        [
            rows.stop - rows.start,
            tracks.ids[rows].sum(),
            *tracks.positions[rows].sum(axis=0),
            tracks.existences[rows].sum(),
            tracks.sigmas[rows].sum(),
            tracks.seen[rows].sum(),
        ],
        dtype=float,
    )


def _figures(run: Run) -> Row:
    evaluation = evaluate_sequence(run.sequence, run.tracks, steps=run.done)
    return [_rounded(evaluation[key]) for key in COLUMNS["evaluation"]]


def _rows(steps: list[ndarray], shown: Items[int]) -> Stage:
    table = np.array(steps)
    rows = {"all": table.sum(axis=0)} | {f"step {step}": table[step] for step in shown}
    return {name: [_rounded(value) for value in row.tolist()] for name, row in rows.items()}


def _rounded(value: float | int | None) -> float | int | None:
    if value is None:
        return None
    number = float(f"{value:.{DIGITS}g}")
    return int(number) if number.is_integer() else number
