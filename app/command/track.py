"""`track`: the pipeline without a browser."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from app.command.computing import compute
from app.command.flags import Track
from app.command.terminal import FAILURE, Bar, CommandError, rate, say
from tracker.files.folders import library_file
from tracker.parameters import Stage
from tracker.parameters.catalogue import METHODS, RunParameters
from tracker.parameters.values import with_values

if TYPE_CHECKING:
    from tracker.runs.pipeline import Run


def track(command: Track) -> int:
    changes = command.changes()
    with_values(RunParameters(), changes)  # wrong usage shows before any work
    output = command.output
    from tracker.export.exported_run import ExportedRun, Options
    from tracker.export.registry import format_of, save

    form = format_of(output, command.format)
    if output.is_dir() and not form.folder:
        raise CommandError(f"--output {output}: expected a file to write, found a folder")
    if not output.parent.is_dir():
        raise CommandError(f"--output {output}: there is no folder {output.parent}; make it first")

    from app.command.correcting import of_run
    from tracker.io.checks import check
    from tracker.runs import gaps, pipeline
    from tracker.runs.camera_notes import camera_notes
    from tracker.runs.fitting import advice
    from tracker.runs.gates import notices
    from tracker.runs.outcome import why_no_tracks
    from tracker.runs.run import given_names, row_corrections
    from tracker.sequences import library

    sequence = library.open_sequence(command.sequence)
    sequence = library.with_detector(sequence, command.detector)
    if command.detector is not None:
        from tracker.single_view.onnx.network import Network

        Network.tried(command.detector)  # before anything is computed, and without pictures too
        if not sequence.has_pictures:
            say(f"{sequence.name} has no pictures: the detector finds nobody in it")
    form.check(sequence)
    for sentence in sequence.warnings:
        say(sentence)
    for found in check(sequence, quick=True):
        if found.status == "warning" and str(found) not in sequence.warnings:
            say(str(found))
    parameters = with_values(pipeline.default_parameters(sequence), changes)
    if (words := advice(sequence, parameters)) is not None:
        say(words)
    told_by_hand = of_run(sequence, command.corrections, none=command.no_corrections)
    begin, began = time.perf_counter(), time.time()
    stages: set[Stage] = set()
    run = compute(
        sequence, parameters, seed=command.seed, corrections=told_by_hand, cached=command.cache,
        stages=stages,
    )  # fmt: skip
    seconds = time.perf_counter() - begin
    with Bar("writing", "step") as writing:
        missing = gaps.sentences(run)
        written = ExportedRun(
            sequence,
            run.tracks,
            parameters,
            command.seed,
            remarks=tuple(missing),
            row_corrections=row_corrections(run),
            names=given_names(run),
        )
        save(output, form, written, Options(progress=writing.at))
    targets = len(set(run.tracks.ids.tolist()))
    kept = "" if "single_view" in stages else "; stage 1 was kept from an earlier run"
    if (reason := why_no_tracks(run)) is not None:
        say(reason)
    for sentence in (*notices(run), *camera_notes(run)):
        say(sentence)
    if told_by_hand:
        unmet = {one.id: one.why for one in run.outcomes if not one.met}
        say(f"{len(told_by_hand) - len(unmet)} of {len(told_by_hand)} corrections met")
        for one in told_by_hand:
            if one.id in unmet:
                say(f"unmet: {one.words}: {unmet[one.id]}")
    if command.keep and not any(gap.unexpected for gap in gaps.gaps(run)):
        _store_run(command, run, began, seconds)
    incomplete = "".join(f"; {one}" for one in missing)
    methods = [name for key in METHODS if (name := str(written.settings[key])) != "none"]
    speed = sequence.frames / seconds
    say(
        f"{sequence.frames} steps, {targets} track{'' if targets == 1 else 's'} by "
        f"{', '.join(methods)}, {rate(speed)} steps/s "
        f"({rate(speed / sequence.fps)} × real time{kept}), written to {output}"
        f"{incomplete}"
    )
    return FAILURE if command.strict and missing else 0


def _store_run(command: Track, run: Run, began: float, seconds: float) -> None:
    """Put a finished run into the library; where that cannot be used, say so and go on."""
    from tracker.evaluation import evaluate_sequence
    from tracker.library.errors import LibraryError
    from tracker.library.keeping import record_of_recording, record_of_run, thumbnail_of
    from tracker.library.store import open_library

    sequence = run.sequence
    try:
        with open_library(command.library or library_file()) as library:
            evaluation = None
            if sequence.ground_truth is not None:
                evaluation = evaluate_sequence(sequence, run.tracks)
            new = record_of_run(
                run, source="track", began=began, seconds=seconds, evaluation=evaluation
            )
            recording = record_of_recording(sequence, command.sequence, thumbnail_of(sequence))
            library.keep(recording, new, command.keep)
    except LibraryError as error:
        say(f"the run was not kept: {error}")
