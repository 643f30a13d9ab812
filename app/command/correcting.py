"""``corrections``: what was put right by hand, in a terminal."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.command.arguments import (
    CheckCorrections,
    Corrections,
    DiffCorrections,
    ListCorrections,
    MergeCorrections,
    TruthOfCorrections,
)
from app.command.computing import compute
from app.command.terminal import CommandError, print_json, print_table, say
from tracker.corrections import Correction, CorrectionError
from tracker.corrections.log import FILE, place_of, read_log, remark_on, write_log
from tracker.corrections.merging import difference, merge
from tracker.corrections.truth import checked_ranges, write_truth
from tracker.files.atomic import replacing
from tracker.sequences import library
from tracker.sequences.sequence import Sequence

if TYPE_CHECKING:
    from tracker.runs.pipeline import Run

DIFFERENT = 1


def corrections(command: Corrections) -> int:
    """Run one of the commands; returns the exit status.

    Raises:
        CorrectionError: If a log is not as it must be.
    """
    match command.action:
        case ListCorrections() as action:
            _list(action)
        case CheckCorrections() as action:
            return _check(action)
        case DiffCorrections() as action:
            return _diff(action)
        case MergeCorrections() as action:
            merged = merge(read_log(_log(action.first)), read_log(_log(action.second)))
            write_log(action.output, merged)
            say(f"{len(merged)} corrections, written to {action.output}")
        case TruthOfCorrections() as action:
            _truth(action)
    return 0


def of_run(sequence: Sequence, file: Path | None, *, none: bool = False) -> tuple[Correction, ...]:
    """The corrections that a run of a sequence obeys.

    Args:
        sequence: Whose own log counts where no other is named.
        file: Another log.
        none: Whether none are wanted.

    Raises:
        CorrectionError: If the log that is named is not there, or cannot be used.
    """
    if none:
        if file is not None:
            raise CommandError("--corrections and --no-corrections: expected one of them")
        return ()
    if file is None:
        own = place_of(sequence.folder)
        if remark := remark_on(sequence.folder):
            say(remark)
        try:
            return read_log(own)
        except CorrectionError as error:
            raise CommandError(f"{error}; mend it, or track with --no-corrections") from None
    return read_log(_log(str(file)))


def _log(name: str) -> Path:
    """The log that a file or a sequence stands for, and that is there."""
    found = _named(name)
    if not found.is_file():
        raise CommandError(f"{name}: has no corrections yet; its log would be {found}")
    return found


def _named(name: str) -> Path:
    """The log that a file or a sequence stands for, whether it is there or not."""
    path = Path(name).expanduser()
    if path.is_file():
        return path
    if path.is_dir() and (path / FILE).is_file():
        return place_of(path)
    try:
        return place_of(library.open_sequence(name).folder)
    except ValueError as error:
        raise CommandError(f"{name}: expected a {FILE} or a sequence: {error}") from None


def _values(one: Correction) -> dict[str, Any]:
    return one.model_dump(mode="json", exclude_none=True)


def _list(action: ListCorrections) -> None:
    log = _named(action.log)
    found = read_log(log)
    if action.json:
        print_json([_values(one) for one in found])
        return
    if not log.is_file():
        say(f"{action.log} has no corrections yet; its log would be {log}")
        return
    print_table(("id", "time", "what", "where", "note"), [_row(one) for one in found])


def _row(one: Correction) -> tuple[str, ...]:
    where = ", ".join(f"({p.x:.2f}, {p.y:.2f})" for p in one.places[:4])
    return one.id, f"{one.time:%Y-%m-%d %H:%M}", one.words, where, one.note


def _tracked(name: str, file: Path | None) -> Run:
    """A sequence tracked with its corrections."""
    sequence = library.open_sequence(name)
    return compute(sequence, corrections=of_run(sequence, file))


def _truth(action: TruthOfCorrections) -> None:
    run = _tracked(action.sequence, action.corrections)
    with (
        replacing(action.output) as temporary,
        temporary.open("x", encoding="utf-8", newline="") as stream,
    ):
        write_truth(stream, run.tracks, run.corrections)
    ranges = ", ".join(f"{first} – {last}" for first, last in checked_ranges(run.corrections))
    say(f"steps {ranges}, written to {action.output}")


def _check(action: CheckCorrections) -> int:
    run = _tracked(action.sequence, action.corrections)
    told = run.corrections
    became = {outcome.id: outcome for outcome in run.outcomes}
    unmet = [one for one in run.outcomes if not one.met]
    if action.json:
        print_json([
            {**_values(one), "met": became[one.id].met, "why": became[one.id].why} for one in told
        ])  # fmt: skip
    else:
        print_table(
            ("id", "what", "met", "why not"),
            [
                (one.id, one.words, "yes" if became[one.id].met else "no", became[one.id].why)
                for one in told
            ],
        )
    say(f"{len(told) - len(unmet)} of {len(told)} corrections met")
    return DIFFERENT if unmet else 0


def _diff(action: DiffCorrections) -> int:
    found = difference(read_log(_log(action.first)), read_log(_log(action.second)))
    if action.json:
        print_json({
            "only_first": [_values(one) for one in found.only_first],
            "only_second": [_values(one) for one in found.only_second],
            "changed": [[_values(one), _values(other)] for one, other in found.changed],
        })  # fmt: skip
    else:
        rows = [("<", *_row(one)) for one in found.only_first]
        rows += [(">", *_row(one)) for one in found.only_second]
        for one, other in found.changed:
            rows += [("<", *_row(one)), (">", *_row(other))]
        print_table(("", "id", "time", "what", "where", "note"), rows)
    return 0 if found.empty else DIFFERENT
