"""Scored runs as the messages of :mod:`app.web.evaluation.models`."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from numpy import ndarray

from app.models import Model
from app.state.scores import Reference, Scored
from app.web.evaluation import models
from app.web.views.timeline import Window
from tracker.evaluation import Evaluation, compare
from tracker.parameters.values import changed_values, value_of
from tracker.runs import pipeline

DECIMALS = 4
"""Decimals of the series, metres."""


def evaluation_of(scored: Scored, evaluation: Evaluation) -> models.EvaluationInfo:
    """The figures, and the rows by person, track and camera."""
    pairs = evaluation.pairs
    switched = pairs.tracks[pairs.switch]
    return models.EvaluationInfo(
        run=scored.key,
        steps=scored.steps,
        partial=not scored.final,
        settings=evaluation.settings.model_dump(),
        figures=[
            models.FigureInfo(
                name=figure.definition.key,
                label=figure.definition.name,
                group=figure.definition.group,
                value=figure.value,
                unit=figure.unit,
                digits=figure.definition.digits,
                direction=figure.definition.direction,
                help=figure.definition.help,
                settings=figure.measured_with,
                source=figure.definition.source,
                headline=figure.definition.headline,
            )
            for figure in evaluation.figures
        ],
        per_person=[
            models.PersonInfo(mean_error=row.error, **_shared(row, models.PersonInfo))
            for row in evaluation.people
        ],
        per_track=[
            models.ScoredTrackInfo(
                mean_error=row.error,
                switches=int((switched == row.id).sum()),
                **_shared(row, models.ScoredTrackInfo),
            )
            for row in evaluation.tracks
        ],
        cameras=[
            models.CameraScoreInfo(
                false_per_picture=row.false_per_step, **_shared(row, models.CameraScoreInfo)
            )
            for row in evaluation.cameras
        ],
        notes=list(evaluation.notes),
        changes=len(changed(scored)),
    )


def _shared(row: Any, model: type[Model]) -> dict[str, Any]:
    return {name: getattr(row, name) for name in model.model_fields if hasattr(row, name)}


def series_of(
    scored: Scored,
    evaluation: Evaluation,
    of: Literal["shown", "pinned", "previous"],
    window: Window,
) -> models.EvaluationSeries:
    """Everything over time, of each bucket of the window the worst step."""
    settings, series = evaluation.settings, evaluation.series
    names = set(type(series).__slots__) & set(models.EvaluationSeries.model_fields)
    rows = {name: window.worst(getattr(series, name)) for name in ("ospa", "ospa2", "gospa")}
    pairs = evaluation.pairs
    tracks = {track: _of_track(evaluation, track) for track in np.unique(pairs.tracks).tolist()}
    shown = {
        name: getattr(series, name)[rows.get(name.partition("_")[0], rows["ospa"])]
        for name in names
    }
    mean = _mean(tracks, window, len(series.ospa))
    return models.EvaluationSeries(
        run=scored.key,
        of=of,
        steps=scored.steps,
        partial=not scored.final,
        first=window.first,
        stride=window.stride,
        unit=settings.unit,
        cost=settings.in_words(("cutoff", "order")),
        gate=settings.in_words(("distance", "gate")),
        errors=[
            models.PersonError(person=person, **_trimmed(values, window))
            for person, values in evaluation.errors.items()
        ],
        track_errors=[
            models.TrackError(track=track, **_trimmed(values, window))
            for track, values in tracks.items()
        ],
        switches=switches_of(evaluation),
        ospa_share=_share(shown["ospa_localisation"], shown["ospa_cardinality"]),
        gospa_share=_share(
            shown["gospa_localisation"], shown["gospa_missed"] + shown["gospa_false"]
        ),
        mean_error=[value if value == value else None for value in mean.round(DECIMALS).tolist()],
        axes={
            "ospa": axis_end(series.ospa),
            "gospa": axis_end(series.gospa),
            "error": axis_end(pairs.distances),
        },
        **{name: values.round(DECIMALS).tolist() for name, values in shown.items()},
    )


def _share(part: ndarray, rest: ndarray) -> list[float]:
    whole = part + rest
    share = np.divide(part, whole, out=np.zeros_like(whole), where=whole > 0.0)
    return [float(value) for value in share.round(3)]


def _mean(tracks: dict[int, ndarray], window: Window, steps: int) -> ndarray:
    """Mean over the paired tracks of each track's largest error within a bucket."""
    starts = window.starts(steps)
    values = [values[window.worst(values)] for values in tracks.values()]
    table = np.array(values).reshape(len(values), len(starts))
    count = np.isfinite(table).sum(axis=0)
    sums = np.nansum(table, axis=0)
    mean: ndarray = np.divide(sums, count, out=np.full(len(starts), np.nan), where=count > 0)
    return mean


def axis_end(values: ndarray) -> float:
    """A round number that all but the largest two in a hundred values stay below: 0.1, 0.2, 0.5, …

    Args:
        values: None below 0; those that are not numbers do not count.
    """
    known = np.sort(values[np.isfinite(values)])
    most = max(float(known[math.ceil(0.98 * len(known)) - 1]) if len(known) else 0.0, 0.1)
    ten = 10.0 ** math.floor(math.log10(most) + 1e-9)
    return round(ten * next((k for k in (1, 2, 5) if k * ten >= most - 1e-9), 10), 9)


def _of_track(evaluation: Evaluation, track: int) -> ndarray:
    pairs = evaluation.pairs
    values = np.full(evaluation.steps, np.nan)
    rows = pairs.tracks == track
    values[pairs.steps[rows]] = pairs.distances[rows]
    return values


def _trimmed(values: ndarray, window: Window) -> dict[str, Any]:
    """From the first to the last bucket that has a value."""
    starts, shown = window.starts(len(values)), values[window.worst(values)]
    there = np.flatnonzero(np.isfinite(shown))
    if not len(there):
        return {"first": window.first, "values": []}
    kept = shown[there[0] : there[-1] + 1].round(DECIMALS).tolist()
    return {
        "first": int(starts[there[0]]),
        "values": [value if value == value else None for value in kept],
    }


def switches_of(evaluation: Evaluation) -> list[models.Switch]:
    """Where a person's identity went from one track to another."""
    pairs = evaluation.pairs
    switches = []
    for i in np.flatnonzero(pairs.switch).tolist():
        earlier = np.flatnonzero(pairs.people[:i] == pairs.people[i])
        switches.append(
            models.Switch(
                step=int(pairs.steps[i]),
                person=int(pairs.people[i]),
                before=int(pairs.tracks[earlier[-1]]),
                track=int(pairs.tracks[i]),
            )
        )
    return switches


def comparison_of(
    against: Reference, a: tuple[Scored, Evaluation], b: tuple[Scored, Evaluation]
) -> models.Comparison:
    """Every figure of A and of B, and the parameters in which they differ.

    The figures are compared once both runs are finished: those of a run under way are of the
    filter's tracks, which smoothing changes.
    """
    compared = compare(a[1], b[1])
    if not (a[0].final and b[0].final):
        compared = tuple(replace(row, difference=None, verdict="undefined") for row in compared)
    before, after = a[0].parameters, b[0].parameters
    return models.Comparison(
        against=against,
        steps=b[1].steps,
        a=_side(a[0]),
        b=_side(b[0]),
        parameters=[
            models.ParameterDifference(key=key, a=value_of(before, key), b=value)
            for key, value in changed_values(after, before).items()
        ],
        rows=[
            models.DifferenceInfo(
                name=row.definition.key,
                label=row.definition.name,
                digits=row.definition.digits,
                direction=row.definition.direction,
                headline=row.definition.headline,
                settings=row.measured_with,
                **_shared(row, models.DifferenceInfo),
            )
            for row in compared
        ],
    )


def _side(scored: Scored) -> models.ComparedRun:
    return models.ComparedRun(
        run=scored.key,
        steps=scored.steps,
        partial=not scored.final,
        changed=changed(scored),
    )


def changed(scored: Scored) -> dict[str, Any]:
    """The values of a run that are not the defaults of its sequence."""
    return changed_values(scored.parameters, pipeline.default_parameters(scored.sequence))
