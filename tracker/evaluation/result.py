"""The result of an evaluation: figures, series over time, and rows by person and track."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.evaluation.figures import SOURCES, Figure
from tracker.evaluation.pixels import CameraScore
from tracker.evaluation.settings import EvaluationSettings
from tracker.evaluation.tables import PersonRow, TrackRow


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """Figures over time: one value for each of S steps.

    OSPA, OSPA(2), GOSPA and the parts of OSPA are in the unit of the evaluation's distance, the
    parts of GOSPA in its p-th power.
    """

    ospa: Float[ndarray, " S"]
    """OSPA."""
    ospa_localisation: Float[ndarray, " S"]
    """The localisation part of OSPA."""
    ospa_cardinality: Float[ndarray, " S"]
    """The cardinality part of OSPA; the p-th powers of both parts sum to that of OSPA."""
    ospa2: Float[ndarray, " S"]
    """OSPA(2) over the window that ends at the step."""
    gospa: Float[ndarray, " S"]
    """GOSPA."""
    gospa_localisation: Float[ndarray, " S"]
    """The localisation part of GOSPA."""
    gospa_missed: Float[ndarray, " S"]
    """The part of GOSPA for missed targets."""
    gospa_false: Float[ndarray, " S"]
    """The part of GOSPA for false targets; the three parts sum to the p-th power of GOSPA."""
    truth: Int[ndarray, " S"]
    """The number of people with a certain position."""
    estimates: Int[ndarray, " S"]
    """The number of estimates that count."""
    dont_care: Int[ndarray, " S"]
    """The number of people with an uncertain position."""
    ignored: Int[ndarray, " S"]
    """The number of estimates that matched an uncertain position."""
    matches: Int[ndarray, " S"]
    """The number of pairs of a person and an estimate, by CLEAR."""
    misses: Int[ndarray, " S"]
    """The number of people without an estimate, by CLEAR."""
    false_positives: Int[ndarray, " S"]
    """The number of estimates without a person, by CLEAR."""
    id_switches: Int[ndarray, " S"]
    """The number of identity switches, by CLEAR."""


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """The M pairs of a person and a track by CLEAR, sorted by step."""

    steps: Int[ndarray, " M"]
    """The step of each pair."""
    people: Int[ndarray, " M"]
    """The id of the person."""
    tracks: Int[ndarray, " M"]
    """The id of the track."""
    distances: Float[ndarray, " M"]
    """The distance of each pair, in the unit of the evaluation's distance."""
    switch: Bool[ndarray, " M"]
    """Whether each pair is an identity switch."""


@dataclass(frozen=True, slots=True, eq=False)
class Evaluation:
    """The evaluation of tracks against ground truth."""

    settings: EvaluationSettings
    """The settings of the evaluation."""
    steps: int
    """The number of steps that are scored, from step 0 on."""
    has_truth: bool
    """Whether there is any true position; without one most figures are undefined."""
    figures: tuple[Figure, ...]
    """All figures, in the order of the tables."""
    series: Series
    """The figures over time."""
    errors: dict[int, Float[ndarray, " S"]]
    """The position error of each person over time, metres; NaN where there is no pair."""
    people: tuple[PersonRow, ...]
    """The scores of each person, by id."""
    tracks: tuple[TrackRow, ...]
    """The scores of each track, by id."""
    cameras: tuple[CameraScore, ...]
    """The scores of the boxes in each camera."""
    pairs: Pairs
    """The pairs of a person and a track."""
    notes: tuple[str, ...]
    """Sentences that readers of the figures need, for instance on what is not scored."""

    def __getitem__(self, key: str) -> float | int | None:
        """Return the value of the figure with this key."""
        return next(figure.value for figure in self.figures if figure.definition.key == key)

    def to_json(self) -> dict[str, Any]:
        """Return all fields as plain lists, numbers and text; undefined values are None."""
        return {
            "settings": self.settings.model_dump(),
            "steps": self.steps,
            "has_truth": self.has_truth,
            "figures": [
                {
                    **{k: v for k, v in asdict(figure.definition).items() if k != "settings"},
                    "value": figure.value,
                    "unit": figure.unit,
                    "stated": figure.measured_with,
                    "source": SOURCES.get(figure.definition.source, ""),
                }
                for figure in self.figures
            ],
            "series": {f.name: _plain(getattr(self.series, f.name)) for f in fields(Series)},
            "errors": {str(name): _plain(values) for name, values in self.errors.items()},
            "people": [asdict(row) for row in self.people],
            "tracks": [asdict(row) for row in self.tracks],
            "cameras": [
                {"camera": score.camera, "people": score.people, "estimates": score.estimates}
                | {name: getattr(score, name) for name in _CAMERA_FIGURES}
                for score in self.cameras
            ],
            "pairs": {f.name: _plain(getattr(self.pairs, f.name)) for f in fields(Pairs)},
            "notes": list(self.notes),
        }


_CAMERA_FIGURES = ("error", "error_95", "overlap", "found_share", "false_per_picture")


def _plain(values: ndarray) -> list[Any]:
    if values.dtype.kind != "f":
        return list(values.tolist())
    return [value if np.isfinite(value) else None for value in values.tolist()]
