"""The evaluation of tracks against ground truth: all figures at once."""

from __future__ import annotations

from collections.abc import Sequence as Items

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.evaluation.figures import DEFINITIONS, Figure
from tracker.evaluation.measures.clear import clear
from tracker.evaluation.measures.gospa import gospa
from tracker.evaluation.measures.hota import hota
from tracker.evaluation.measures.identity import identity
from tracker.evaluation.measures.matching import Comparison, GatedDistance, Tracks, prepare
from tracker.evaluation.measures.ospa import ospa, ospa2, ospa2_whole
from tracker.evaluation.pixels import CameraScore, pixels
from tracker.evaluation.positions import cardinality_error, positions
from tracker.evaluation.result import Evaluation, Pairs, Series
from tracker.evaluation.settings import EvaluationSettings
from tracker.evaluation.tables import person_rows, track_rows
from tracker.geometry.camera import Camera
from tracker.sequences.sequence import GroundTruth, Sequence


def evaluate(
    truth: GroundTruth | None,
    tracks: Tracks,
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
    return _score(comparison, settings, size, cameras)


def evaluate_sequence(
    sequence: Sequence,
    tracks: Tracks,
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
    """
    return evaluate(
        sequence.ground_truth,
        tracks,
        settings,
        steps=sequence.frames if steps is None else min(steps, sequence.frames),
        half_extents=sequence.target_half_extents,
        cameras=sequence.cameras,
    )


def _score(
    comparison: Comparison,
    settings: EvaluationSettings,
    half_extents: Float[ndarray, " 3"],
    cameras: Items[Camera],
) -> Evaluation:
    """Compute all figures of a comparison of tracks with the truth."""
    cost = {"cutoff": settings.cutoff, "order": settings.order}
    clr, idt, hta = clear(comparison), identity(comparison), hota(comparison)
    osp, gsp = ospa(comparison, **cost), gospa(comparison, **cost)
    window = ospa2(comparison, **cost, window=settings.window)
    whole = ospa2_whole(comparison, **cost)
    pos = positions(comparison, near=settings.near)
    views = pixels(comparison, cameras, half_extents, overlap=settings.overlap)
    surplus, bias = cardinality_error(comparison)
    pictures = _all_cameras(views)
    values: dict[str, float | int | None] = {
        "mota": clr.mota,
        "motp": clr.motp,
        "misses": int(clr.misses.sum()),
        "false_positives": int(clr.false_positives.sum()),
        "id_switches": int(clr.id_switches.sum()),
        "fragmentations": int(clr.fragmentations.sum()),
        "mostly_tracked": clr.mostly_tracked,
        "partly_tracked": clr.partly_tracked,
        "mostly_lost": clr.mostly_lost,
        "idf1": idt.f1,
        "idp": idt.precision,
        "idr": idt.recall,
        "hota": _mean(hta.hota) if hta else None,
        "deta": _mean(hta.detection) if hta else None,
        "assa": _mean(hta.association) if hta else None,
        "loca": _mean(hta.localisation) if hta and len(clr.matches) else None,
        "ospa": _mean(osp.distance),
        "ospa_localisation": _mean(osp.localisation),
        "ospa_cardinality": _mean(osp.cardinality),
        "ospa2": _mean(window),
        "ospa2_whole": whole,
        "gospa": _mean(gsp.distance),
        "gospa_localisation": _mean(gsp.localisation),
        "gospa_missed": _mean(gsp.missed),
        "gospa_false": _mean(gsp.false),
        "position_error": pos.mean,
        "position_error_95": pos.percentile_95,
        "found_share": pos.found_share,
        "false_per_step": _mean(pos.stray),
        "cardinality_error": surplus,
        "cardinality_bias": bias,
        "pixel_error": pictures.error,
        "pixel_overlap": pictures.overlap,
        "pixel_found": pictures.found_share,
    }
    truth, tracks = comparison.truth, comparison.tracks
    matches = clr.matches
    return Evaluation(
        settings=settings,
        steps=comparison.steps,
        has_truth=bool(len(truth) or len(comparison.dont_care)),
        figures=tuple(
            Figure(d, values[d.key], d.unit_for(settings), settings.in_words(d.settings))
            for d in DEFINITIONS
        ),
        series=Series(
            ospa=osp.distance,
            ospa_localisation=osp.localisation,
            ospa_cardinality=osp.cardinality,
            ospa2=window,
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
            distances=comparison.measure.between(
                truth.positions[matches.truth_rows], tracks.positions[matches.track_rows]
            ),
            switch=clr.switch,
        ),
        notes=_notes(comparison),
    )


def _mean(values: ndarray) -> float | None:
    return float(values.mean()) if len(values) else None


def _all_cameras(scores: Items[CameraScore]) -> CameraScore:
    none = [np.zeros(0)]
    return CameraScore(
        camera="all",
        errors=np.concatenate(none + [score.errors for score in scores]),
        overlaps=np.concatenate(none + [score.overlaps for score in scores]),
        people=sum(score.people for score in scores),
        estimates=sum(score.estimates for score in scores),
        steps=sum(score.steps for score in scores),
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
