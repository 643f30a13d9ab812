"""``multiview-phd evaluate``: a track file against the truth, or an estimate without one."""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import TYPE_CHECKING

from app.command.computing import compute
from app.command.flags import Evaluate
from app.command.terminal import Bar, CommandError, print_json, print_table, say
from tracker import __version__
from tracker.evaluation import Evaluation, EvaluationSettings, evaluate_sequence
from tracker.evaluation.figures import number
from tracker.export.reading import read_tracks
from tracker.export.tracks_csv import TrackFile
from tracker.sequences import library
from tracker.sequences.sequence import Sequence
from tracker.sequences.tables import truth_of

if TYPE_CHECKING:
    from tracker.review.self_consistency import Estimate


def evaluate(command: Evaluate) -> None:
    """Print the figures, as tables or as JSON, and write the report where one is asked for.

    Without a track file the sequence is tracked in several ways, and how far they agree is said.

    Raises:
        CommandError: If the tracks are not of the sequence, or it has no truth.
        ValueError: If a file cannot be read.
        OSError: If the report cannot be written.
    """
    if command.tracks is None:
        estimate_without_truth(command)
        return
    settings = _settings_of(command)
    if command.html is not None:
        if command.html.is_dir():
            raise CommandError(f"--html {command.html}: expected a file to write, found a folder")
        if not command.html.parent.is_dir():
            raise CommandError(
                f"--html {command.html}: there is no folder {command.html.parent}; make it first"
            )
    sequence = library.open_sequence(command.sequence)
    beyond: list[str] = []
    if command.truth is not None:
        truth = truth_of(command.truth, str(command.truth), sequence.frames, beyond)
        sequence = replace(sequence, ground_truth=truth)
    tracks = read_tracks(command.tracks)
    check_fit(sequence, tracks, str(command.tracks))
    for sentence in (*sequence.warnings, *tracks.remarks):
        say(sentence)
    evaluation = evaluate_sequence(sequence, tracks, settings, steps=tracks.done)
    evaluation = replace(evaluation, notes=(*evaluation.notes, *beyond))
    for note in evaluation.notes:  # they say what the figures are worth
        say(note)
    if command.html is not None:
        from tracker.evaluation.report.page import write_report  # brings plotly

        seed = tracks.settings.get("seed", "")
        write_report(
            command.html,
            sequence,
            tracks,
            tracks.settings or None,
            evaluation,
            seed=int(seed) if seed.isdecimal() else None,
        )
    if command.json:
        head = {"version": __version__, "sequence": sequence.name, "file": str(command.tracks)}
        print_json({**head, **evaluation.to_json()})
    else:
        print_evaluation(evaluation)
    done = "" if tracks.done is None else f" of {sequence.frames} (the file is partial)"
    say(f"{evaluation.steps} steps{done}")
    if command.html is not None:
        say(f"the report is in {command.html}")


def _settings_of(command: Evaluate) -> EvaluationSettings:
    settings: EvaluationSettings = vars(command)["settings"]  # its flags come with the engine
    return settings


def estimate_without_truth(command: Evaluate) -> None:
    """Track a sequence with its default parameters, in several ways, and say how far they agree.

    Raises:
        CommandError: If something is asked for that needs a track file.
    """
    given = [name for name in ("html", "truth") if getattr(command, name) is not None]
    given += _settings_of(command).model_dump(exclude_defaults=True)
    if given:
        flags = ", ".join(f"--{name.replace('_', '-')}" for name in given)
        raise CommandError(f"{flags}: expected a track file as well; name it after the sequence")

    from tracker.review.self_consistency import estimate
    from tracker.review.self_consistency.estimate import WARNING
    from tracker.runs import gaps
    from tracker.runs.processes import available_cores

    sequence = library.open_sequence(command.sequence)
    for sentence in sequence.warnings:
        say(sentence)
    run = compute(sequence)
    for sentence in gaps.sentences(run):
        say(sentence)
    with Bar("looking in other ways", "step") as looking:
        found = estimate(run, processes=available_cores(), on_progress=looking.at)
    names = [camera.name for camera in sequence.cameras]
    if command.json:
        low, high = found.interval
        document = {
            "version": __version__,
            "sequence": sequence.name,
            "estimate": found.score,
            "low": low,
            "high": high,
            "backwards": found.backwards,
            "without": dict(zip(names, found.without, strict=False)),
            "overlap": dict(zip(names, found.overlaps, strict=False)),
            "doubts": [
                {"step": one.step, "ids": one.ids, "looks": one.variants, "why": one.why}
                for one in found.disagreements
            ],
        }
        print_json(document)
    else:
        _print_estimate(found, names)
    say(WARNING)


_SHOWN_DOUBTS = 10


def _print_estimate(found: Estimate, names: list[str]) -> None:
    low, high = found.interval
    rows = [
        ("IDF1, estimated", number(found.score, 3), f"90 %: {low:.3f} … {high:.3f}"),
        ("backwards in time", number(found.backwards, 3), "IDF1 by the run as it is"),
    ]
    for name, agreed, overlap in zip(names, found.without, found.overlaps, strict=False):
        words = f"its boxes overlap the others' people by {number(overlap, 2)}"
        rows.append((f"without {name}", number(agreed, 3), words))
    print_table(("figure", ">value", "measured with"), rows)
    if found.disagreements:
        sys.stdout.write("\n")
        print_table(
            (">step", "doubtful"),
            [(str(doubt.step), doubt.why) for doubt in found.disagreements[:_SHOWN_DOUBTS]],
        )


def check_fit(sequence: Sequence, tracks: TrackFile, name: str) -> None:
    """Whether tracks can be scored against a sequence.

    Raises:
        CommandError: If there is no truth, or the file is of another sequence.
    """
    if sequence.ground_truth is None:
        raise CommandError(
            f"{sequence.folder / 'sequence.toml'}: there is no truth to evaluate against; name "
            "its file in [ground_truth]"
        )
    own = " ".join(sequence.name.split())
    other = tracks.settings.get("sequence", own)
    if other != own:
        raise CommandError(
            f'{name}: expected tracks of the sequence "{own}", found those of "{other}"; name '
            "the sequence that they are of"
        )
    if len(tracks) and int(tracks.frames[-1]) >= sequence.frames:
        raise CommandError(
            f"{name}: expected steps 0 … {sequence.frames - 1} as {own} has them, found step "
            f"{int(tracks.frames[-1])}; the tracks are of another or longer sequence"
        )


def print_evaluation(evaluation: Evaluation) -> None:
    """The figures with what each was measured with, then the people."""
    print_table(
        ("figure", ">value", "unit", "measured with"),
        [(f.definition.name, f.text, f.unit, f.measured_with) for f in evaluation.figures],
    )
    if not evaluation.people:
        return
    sys.stdout.write("\n")
    print_table(
        ("person", ">steps", ">tracked", ">error (m)", ">95 % (m)", ">switches", "status"),
        [
            (
                str(row.id),
                str(row.steps),
                str(row.tracked),
                number(row.error, 3),
                number(row.error_95, 3),
                str(row.switches),
                row.status,
            )
            for row in evaluation.people
        ],
    )
