"""The conversion of recordings and finished runs to records of the library, and of a stored run to
a run for display.
"""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from tracker import __version__
from tracker.corrections.kinds import leeway, make
from tracker.corrections.outcomes import outcomes
from tracker.evaluation import Evaluation
from tracker.export.exported_run import ExportedRun
from tracker.library.columns import KeptTracks
from tracker.library.records import HEADLINES, NewRecording, NewRun, Recording, Result, Source
from tracker.parameters.values import changed_values
from tracker.runs.fitting import default_parameters
from tracker.runs.gaps import gaps
from tracker.runs.numbers_version import numbers_version
from tracker.runs.run import Run, given_names
from tracker.sequences.built_in import opens_by_name
from tracker.sequences.library import open_sequence
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Room, Sequence

THUMBNAIL = (144, 96)
"""Width and height of a recording's thumbnail, pixels: twice the size on the page."""

_QUALITY = 80
"""JPEG quality of a thumbnail, 0 … 100: 4 kB for one of room44-3p."""

MISSING = "missing_pictures"
"""The key of the figure that is the number of missing pictures of a run in all cameras."""


def code_version() -> str:
    """Return a short hash of all code that may change the tracks of a run."""
    return hashlib.sha256(numbers_version("tracks").encode()).hexdigest()[:12]


def record_of_recording(
    sequence: Sequence, opened_as: str, thumbnail: bytes | None = None
) -> NewRecording:
    """Return the record of a recording, to be inserted into a library.

    Args:
        sequence: The recording.
        opened_as: The name or the folder by which the recording was opened.
        thumbnail: The thumbnail from :func:`thumbnail_of`, if any.
    """
    rendered = opens_by_name(sequence.folder)
    truth = sequence.ground_truth
    return NewRecording(
        place=opened_as if rendered else str(sequence.folder.absolute()),
        name=sequence.name,
        kind="rendered" if rendered else "folder",
        digest=sequence.stored_digest or sequence.digest,
        cameras=len(sequence.views),
        frames=sequence.frames,
        fps=sequence.fps,
        has_pictures=sequence.has_pictures,
        has_detections=sequence.has_detections,
        people=None if truth is None else len(np.unique(truth.ids)),
        thumbnail=thumbnail,
    )


def thumbnail_of(sequence: Sequence, reader: FrameReader | None = None) -> bytes | None:
    """Return the JPEG thumbnail of a recording; None if no camera has a picture at the middle step.

    The thumbnail is made from this picture of the first camera that has one.

    Args:
        sequence: The recording.
        reader: The reader of the recording's pictures; if None, one is opened.
    """
    if reader is None:
        with FrameReader(sequence) as own:
            return thumbnail_of(sequence, own)
    for index, view in enumerate(sequence.views):
        picture = reader.picture(index, sequence.frames // 2) if view.has_pictures else None
        if picture is None:
            continue
        height, width = picture.shape[:2]
        scale = max(THUMBNAIL[0] / width, THUMBNAIL[1] / height)
        size = (max(1, round(width * scale)), max(1, round(height * scale)))
        small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
        left, top = ((a - b) // 2 for a, b in zip(size, THUMBNAIL, strict=True))
        cut = small[top : top + THUMBNAIL[1], left : left + THUMBNAIL[0]]
        done, data = cv2.imencode(".jpg", cut, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
        return data.tobytes() if done else None
    return None


CURVE = 300
"""Largest number of values of a stored curve, about as many as the page draws pixels."""


def stride(steps: int, values: int) -> int:
    """Return the number of steps that each value of a stored curve stands for.

    Args:
        steps: The number of steps.
        values: Largest number of values of the curve.
    """
    return max(1, -(-steps // values))


def stored_tracks(run: Run) -> KeptTracks:
    """Return the part of a run's result that the library stores."""
    probabilities = run.detection_probabilities(np.arange(len(run.tracks)))
    return KeptTracks(run.tracks, np.nan_to_num(probabilities))


def record_of_run(
    run: Run,
    *,
    source: Source,
    began: float,
    seconds: float,
    evaluation: Evaluation | None = None,
    names: Mapping[int, str] | None = None,
) -> NewRun:
    """Return the record of a finished run, to be inserted into a library.

    Args:
        run: The finished run.
        source: The command that computed it.
        began: The time when the computation began, seconds since 1970.
        seconds: The duration of the computation, seconds.
        evaluation: The evaluation of the run's tracks, if there is ground truth.
        names: The names of tracks, by id; None for those that people were given by hand.

    Raises:
        ValueError: If the run is not finished, or the evaluation does not cover all its steps.
    """
    if not run.finished or (evaluation is not None and evaluation.steps != run.done):
        scored = "" if evaluation is None else f" and {evaluation.steps} scored"
        raise ValueError(
            f"expected a finished run of {run.sequence.frames} steps, got {run.done} steps{scored}"
        )
    parameters = run.parameters
    figures = {} if evaluation is None else figures_of(evaluation)
    if missing := sum(gap.missing for gap in gaps(run)):
        figures[MISSING] = missing
    return NewRun(
        key=run.key,
        digest=run.sequence.digest,
        began=began,
        seconds=seconds,
        steps=run.done,
        single_view=parameters.single_view,
        fusion_method=parameters.fusion_method,
        changes=changed_values(parameters, default_parameters(run.sequence)),
        parameters=parameters.model_dump(mode="json"),
        seed=run.seed,
        version=__version__,
        code=code_version(),
        machine=f"{platform.system()} {platform.machine()}, {platform.node()}",
        source=source,
        targets=len(np.unique(run.tracks.ids)),
        figures=figures,
        kept=stored_tracks(run),
        ospa=() if evaluation is None else ospa_of(evaluation),
        corrections=tuple(
            one.model_dump(mode="json", exclude_none=True) for one in run.corrections
        ),
        templates=tuple(
            f"{one.name}, {one.camera}, step {one.frame}" for one in run.sequence.templates
        ),
        names=dict(given_names(run) if names is None else names),
    )


def figures_of(evaluation: Evaluation) -> dict[str, float | int | None]:
    """Return the figures of an evaluation by key; empty without ground truth."""
    if not evaluation.has_truth:
        return {}
    return {figure.definition.key: figure.value for figure in evaluation.figures}


def rescored(result: Result, evaluation: Evaluation) -> Result:
    """Return a stored run whose provisional figures are replaced by those of an evaluation."""
    figures = figures_of(evaluation)
    headlines: dict[str, Any] = {name: figures.get(name) for name in HEADLINES}
    return replace(
        result,
        run=replace(result.run, **headlines, final=1),
        figures={**result.figures, **figures},
        ospa=ospa_of(evaluation),
    )


def ospa_of(evaluation: Evaluation) -> tuple[float, ...]:
    """Return the curve of OSPA over time as it is stored: means over :func:`stride` steps,
    metres."""
    if not evaluation.has_truth:
        return ()
    values = evaluation.series.ospa
    starts = np.arange(0, len(values), stride(len(values), CURVE))
    sizes = np.diff(np.append(starts, len(values)))
    means = np.add.reduceat(values, starts) / sizes if len(values) else values
    return tuple(means.round(3).tolist())


def remarks_of(result: Result) -> tuple[str, ...]:
    """Return the sentences that accompany a stored run in every export."""
    missing, corrected = result.figures.get(MISSING), result.run.corrected
    pictures = (f"{missing} pictures were missing",) if missing else ()
    words = "1 correction" if corrected == 1 else f"{corrected} corrections"
    return pictures + ((f"{words} by a person applied",) if corrected else ())


def sequence_for_export(recording: Recording) -> Sequence:
    """Open the recording of stored runs that are exported.

    If its folder was moved or deleted, the sequence has only what the library stores of it: name,
    rate and number of steps, no camera, and NaN for the room and for the size of a target.

    Raises:
        SequenceError: If the recording is there and cannot be read.
    """
    if recording.missing is None:
        return open_sequence(recording.place)
    unknown = np.full(3, np.nan)
    return Sequence(
        recording.name,
        Path(recording.place),
        recording.fps,
        recording.frames,
        Room(unknown, unknown),
        unknown,
        views=(),
    )


def run_for_export(sequence: Sequence, result: Result, back: str = "") -> ExportedRun:
    """Return a stored run as the input of every export format.

    Args:
        sequence: The recording, of :func:`sequence_for_export`.
        result: The stored run.
        back: The URL of the page that shows the run; empty if there is none.
    """
    steps, tracks, seed = result.run.steps, result.kept.tracks, result.run.seed
    done = None if steps >= sequence.frames else steps
    words = remarks_of(result)
    if not sequence.views:
        words += (f"the recording was not in {sequence.folder} any more: boxes are left out",)
    return ExportedRun(sequence, tracks, result.parameters, seed, done, words, back=back)


def run_for_display(sequence: Sequence, result: Result) -> Run:
    """Return a run for display: the tracks of a stored run and the outcomes of its corrections, by
    which people have names, without results of the stages.

    Args:
        sequence: The recording as it is now, which may have changed since the run.
        result: The stored run.

    Raises:
        ValueError: If the recording has a different number of cameras now.
    """
    stored, kept = result.run, result.kept
    cameras = len(sequence.views)
    if kept.tracks.seen.shape[1] != cameras:
        raise ValueError(
            f"run {stored.id} is of {kept.tracks.seen.shape[1]} cameras, and {sequence.name} has "
            f"{cameras} now"
        )
    steps = min(stored.steps, sequence.frames)
    rows = np.arange(kept.tracks.at(steps).start)
    run = Run(
        sequence,
        result.parameters,
        stored.seed,
        {"tracks": stored.key},
        stored_probabilities=kept.detection_probabilities[rows],
    )
    run.tracks = kept.tracks.take(rows)
    run.done = steps
    run.finished = run.complete
    run.stored_names = stored.names
    run.corrections = tuple(make(**values) for values in result.corrections)
    run.corrected = True
    tracks = run.tracks
    run.outcomes = outcomes(
        tracks.frames,
        tracks.ids,
        tracks.positions,
        run.corrections,
        leeway=leeway(sequence.step_time),
    )
    return run
