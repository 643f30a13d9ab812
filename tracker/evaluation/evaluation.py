"""The evaluation of tracks against ground truth: all figures at once, series over time, and rows by
person and track."""

from __future__ import annotations

from collections.abc import Sequence as Items
from dataclasses import asdict, dataclass, fields, replace
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.evaluation.clear import CLEAR, clear
from tracker.evaluation.figures import Definition, Figure, figures
from tracker.evaluation.hota import HOTA, hota
from tracker.evaluation.identity import IDENTITY, identity
from tracker.evaluation.matching import Comparison, GatedDistance, prepare
from tracker.evaluation.ospa import GOSPA, OSPA, OSPA2, gospa, ospa, ospa2
from tracker.evaluation.pixels import PICTURES, CameraScore, pixels, together
from tracker.evaluation.positions import POSITIONS, positions
from tracker.evaluation.settings import EvaluationSettings
from tracker.evaluation.tables import PersonRow, TrackRow, person_rows, track_rows
from tracker.geometry.camera import Camera
from tracker.io.checks.truth import check_truth
from tracker.sequences.sequence import GroundTruth, LabelledPositions, Sequence

DEFINITIONS: tuple[Definition[Any], ...] = (
    *CLEAR, *IDENTITY, *HOTA, *OSPA, *OSPA2, *GOSPA, *POSITIONS, *PICTURES,
)  # fmt: skip
"""The definitions of all figures, in the order of the tables."""

BY_KEY = {definition.key: definition for definition in DEFINITIONS}
"""All definitions by key."""


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
                    **{name: getattr(figure.definition, name) for name in _DEFINED},
                    "value": figure.value,
                    "unit": figure.unit,
                    "stated": figure.measured_with,
                }
                for figure in self.figures
            ],
            "series": {f.name: _plain(getattr(self.series, f.name)) for f in fields(Series)},
            "errors": {str(name): _plain(values) for name, values in self.errors.items()},
            "people": [asdict(row) for row in self.people],
            "tracks": [asdict(row) for row in self.tracks],
            "cameras": [
                {name: getattr(score, field) for name, field in _CAMERA_FIGURES.items()}
                for score in self.cameras
            ],
            "pairs": {f.name: _plain(getattr(self.pairs, f.name)) for f in fields(Pairs)},
            "notes": list(self.notes),
        }


_DEFINED = ("key", "name", "group", "direction", "digits", "help", "source", "headline")
_CAMERA_FIGURES = {
    name: name
    for name in ("camera", "people", "estimates", "error", "error_95", "overlap", "found_share")
} | {"false_per_picture": "false_per_step"}


def _plain(values: ndarray) -> list[Any]:
    if values.dtype.kind != "f":
        return list(values.tolist())
    return [value if np.isfinite(value) else None for value in values.tolist()]


def evaluate(
    truth: GroundTruth | None,
    tracks: LabelledPositions,
    settings: EvaluationSettings | None = None,
    *,
    steps: int | None = None,
    half_extents: Float[ndarray, " 3"] | None = None,
    cameras: Items[Camera] = (),
) -> Evaluation:
    """Score tracks against ground truth.

    Rows may be in any order, and an id may end and appear again. Rows that cannot be scored are
    left out and noted. Empty truth, empty tracks and a single step have defined figures, which are
    None where they have no meaning.

    Args:
        truth: The ground truth; if it is None or has no rows, every estimate is false.
        tracks: Steps, ids and positions by columns.
        settings: Distance, gate and so on; the defaults if None.
        steps: Steps 0 … ``steps`` − 1 are scored, for instance those that a run has computed; if
            None, all up to the last row of either side.
        half_extents: Half width, depth and height of a target, metres; needed for the
            box distance and for the pictures.
        cameras: The cameras in whose pictures the tracks are scored.

    Raises:
        ValueError: If ``half_extents`` is missing where it is needed.
    """
    settings = settings or EvaluationSettings()
    if half_extents is None and (settings.distance == "box" or len(cameras)):
        raise ValueError(
            "half_extents is missing: the box distance and the pictures need the half width, "
            "depth and height of a target in metres; pass the sequence's target_half_extents"
        )
    if steps is None:
        ends = [int(rows.frames.max()) for rows in (truth, tracks) if rows and len(rows.frames)]
        steps = max([-1, *ends]) + 1
    size = np.zeros(3) if half_extents is None else np.asarray(half_extents, dtype=float)
    measure = GatedDistance(settings.distance, settings.effective_gate, size)
    comparison = prepare(truth, tracks, measure, steps=steps)
    return _score(comparison, settings, cameras)


def evaluate_sequence(
    sequence: Sequence,
    tracks: LabelledPositions,
    settings: EvaluationSettings | None = None,
    *,
    steps: int | None = None,
) -> Evaluation:
    """Score tracks against a sequence's ground truth, in space and in every camera's picture.

    Args:
        sequence: The sequence; if it has no truth, every estimate is false.
        tracks: Steps, ids and positions by columns.
        settings: Distance, gate and so on; the defaults if None.
        steps: The number of steps that a run has computed; all of the sequence if None.

    Returns:
        All figures; its notes say where the truth contradicts the boxes.
    """
    evaluation = evaluate(
        sequence.ground_truth,
        tracks,
        settings,
        steps=sequence.frames if steps is None else min(steps, sequence.frames),
        half_extents=sequence.target_half_extents,
        cameras=sequence.cameras,
    )
    agreement = check_truth(sequence)
    if agreement.status != "warning":
        return evaluation
    return replace(evaluation, notes=(f"{agreement.sentence}.", *evaluation.notes))


def _score(
    comparison: Comparison, settings: EvaluationSettings, cameras: Items[Camera]
) -> Evaluation:
    """Compute all figures of a comparison of tracks with the truth."""
    cost = {"cutoff": settings.cutoff, "order": settings.order}
    clr, idt, hta = clear(comparison), identity(comparison), hota(comparison)
    osp, gsp = ospa(comparison, **cost), gospa(comparison, **cost)
    osp2 = ospa2(comparison, **cost, window=settings.window)
    pos = positions(comparison, near=settings.near)
    views = pixels(comparison, cameras, overlap=settings.overlap)
    truth, tracks, matches = comparison.truth, comparison.tracks, clr.matches
    return Evaluation(
        settings=settings,
        steps=comparison.steps,
        has_truth=bool(len(truth) or len(comparison.dont_care)),
        figures=(
            *figures(CLEAR, clr, settings),
            *figures(IDENTITY, idt, settings),
            *figures(HOTA, hta, settings),
            *figures(OSPA, osp, settings),
            *figures(OSPA2, osp2, settings),
            *figures(GOSPA, gsp, settings),
            *figures(POSITIONS, pos, settings),
            *figures(PICTURES, together(views), settings),
        ),
        series=Series(
            ospa=osp.distance,
            ospa_localisation=osp.localisation,
            ospa_cardinality=osp.cardinality,
            ospa2=osp2.over_time,
            gospa=gsp.distance,
            gospa_localisation=gsp.localisation,
            gospa_missed=gsp.missed,
            gospa_false=gsp.false,
            truth=truth.counts,
            estimates=tracks.counts,
            dont_care=comparison.dont_care.counts,
            ignored=comparison.ignored.counts,
            matches=truth.counts - clr.misses,
            misses=clr.misses,
            false_positives=clr.false_positives,
            id_switches=clr.id_switches,
        ),
        errors=dict(zip(truth.names.tolist(), pos.by_person, strict=True)),
        people=person_rows(comparison, clr, idt, pos),
        tracks=track_rows(comparison, clr),
        cameras=views,
        pairs=Pairs(
            steps=truth.frames[matches.truth_rows],
            people=truth.ids[matches.truth_rows],
            tracks=tracks.ids[matches.track_rows],
            distances=clr.distances,
            switch=clr.switch,
        ),
        notes=_notes(comparison),
    )


def _notes(comparison: Comparison) -> tuple[str, ...]:
    """Return the sentences that readers of the figures need."""
    notes = []
    if not len(comparison.truth) and not len(comparison.dont_care):
        notes.append("There is no truth for these steps: every estimate counts as false.")
    if len(comparison.dont_care):
        notes.append(
            f"{_many(len(comparison.dont_care), 'true position')} of uncertain place (valid = 0) "
            f"and {_many(len(comparison.ignored), 'estimate')} that matched one count on neither "
            "side."
        )
    if comparison.unknown:
        notes.append(
            f"Of {_many(comparison.unknown, 'step')} the truth says nothing: they count on neither "
            "side."
        )
    if comparison.left_out:
        notes.append(
            f"{_many(comparison.left_out, 'estimate')} left out: outside the steps compared, at a "
            "position that is not finite, or repeating an id within a step."
        )
    return tuple(notes)


def _many(count: int, word: str) -> str:
    return f"{count} {word}{'' if count == 1 else 's'}"
