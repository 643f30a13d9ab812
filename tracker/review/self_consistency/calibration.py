"""How far the estimate lies from the true IDF1, as measured where the truth was known."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

FILE = Path(__file__).with_name("calibration.json")
"""Estimate and true IDF1 of every setting that was tried, by the recording."""

_WITHIN = 0.9
"""Share of the settings that the interval holds."""

_ALIKE = 60
"""Settings whose estimates are nearest tell how far off this one may be."""


@cache
def _measured() -> Float[ndarray, "K 2"]:
    """Estimate and true IDF1, each recording with the same weight."""
    kept = json.loads(FILE.read_text(encoding="utf-8"))
    fewest = min(len(pairs) for pairs in kept.values())
    return np.concatenate([np.array(pairs)[:fewest] for pairs in kept.values()])


def interval(score: float) -> tuple[float, float]:
    """Between which values IDF1 lay in nine of ten of the settings with the nearest estimates."""
    measured = _measured()
    near = measured[np.argsort(np.abs(measured[:, 0] - score), kind="stable")[:_ALIKE]]
    errors = near[:, 1] - near[:, 0]
    low, high = np.quantile(errors, [(1.0 - _WITHIN) / 2.0, (1.0 + _WITHIN) / 2.0])
    return float(np.clip(score + low, 0.0, 1.0)), float(np.clip(score + high, 0.0, 1.0))
