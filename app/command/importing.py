"""``import``, ``check``, ``formats`` and ``export-calibration``."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.command.arguments import IMPORT_FLAGS, PAIRS, Check, ExportCalibration, Formats, Import
from app.command.terminal import ASKED, FAILURE, REFUSED, CommandError, print_json, print_table, say
from tracker.parameters.values import ParameterError

if TYPE_CHECKING:
    from tracker.io.conventions.questions import Question
    from tracker.io.importing.gathering import ParsedFiles
    from tracker.io.importing.options import ImportOptions

MOST_UNKNOWN = 30
"""Files that nobody knows, named one by one."""

LONGEST_LABEL = 80
"""Characters of a file's name in the table."""

SIGNS = {"good": "ok", "warning": "!", "absent": "–"}
"""Of a check's outcome, in the first column."""


def import_files(command: Import) -> int:
    if command.output is None and not command.dry_run:
        raise ParameterError("--output", "expected the folder to write (-o FOLDER), or --dry-run")
    if not command.sources:
        raise ParameterError("SOURCE", "expected files or a folder to import, got none")
    options = options_of(command)
    from tracker.io.conventions.questions import Undecided, Unexplained
    from tracker.io.importing.arriving import gather_whole
    from tracker.io.importing.gathering import file_uses
    from tracker.io.importing.remedies import for_import, unsaid
    from tracker.io.importing.settling import settle
    from tracker.io.importing.writing import write
    from tracker.sequences import library
    from tracker.sequences.reader import FILE

    if command.output is not None and (command.output / FILE).exists():
        raise CommandError(f"{command.output}: holds a {FILE} already; name another folder")
    for folder in command.sources:
        if (folder / FILE).is_file():
            raise CommandError(
                f"{folder}: has a {FILE}, so that every command takes it as it is; name its files, "
                "to have them read anew"
            )
    sources = [*command.sources]
    sources += _not_inside((path for _, path in options.cameras), command.sources)
    waited: list[str] = []

    def wait_for(sentence: str) -> None:
        file = sentence.split(" is ")[0]
        if file not in waited:
            say(f"{sentence}; Ctrl+C gives up")
            waited.append(file)

    taken, _ = gather_whole(sources, wait_for)
    print_table(("file", "taken for", "note"), list(_rows(taken)))
    try:
        settled = settle(taken, options)
    except Undecided as open_:
        _ask(open_.question)
        return ASKED
    except Unexplained as refusal:
        say(f"{refusal}; nothing was written")
        return REFUSED
    print()
    print_table(("inferred", "value"), settled.found)
    uses = file_uses(taken, settled.sources)
    facts = (
        f"{len(settled.views)} cameras, {settled.frames} steps at {settled.fps:g} a second, "
        f"{'with' if settled.truth is not None else 'without'} truth, "
        f"{sum(one.used for one in uses):,} of {sum(one.files.count for one in uses):,} files used"
    )
    if command.dry_run or command.output is None:
        _print_notes(settled.told)
        say(f"{facts}; nothing was written")
        return 0
    name = command.name or command.output.resolve().name
    for sentence in write(settled, command.output, name, copy=command.copy):
        say(sentence)
    sequence = library.open_sequence(str(command.output))
    checks = [for_import(one, settled.reading) for one in _checks(sequence)]
    _print_notes(unsaid(settled.told, checks))
    say(f"{facts}, written to {command.output}")
    print()
    _print_checks(sequence, checks)
    return 0


def _print_notes(notes: Sequence[str]) -> None:
    """What is not used, or odd, in a table of its own."""
    if notes:
        print()
        print_table(("note",), [(note,) for note in notes])


def _ask(question: Question) -> None:
    """Print both interpretations with the flags that decide."""
    rows = zip(question.interpretations, question.flags, strict=True)
    print()
    print_table(("it may be", "then"), list(rows))
    say(f"{question.difference}; nothing was written: import again with one of the flags")


def _rows(taken: Sequence[ParsedFiles]) -> Iterator[tuple[str, str, str]]:
    """What each file was taken for; of those that nobody knows the first are named."""
    unknown = 0
    for one in taken:
        # a name that is as long as names can be would push everything aside
        label = one.label
        if len(label) > LONGEST_LABEL:
            label = f"{label[: LONGEST_LABEL // 2]}…{label[-LONGEST_LABEL // 2 + 1 :]}"
        if one.pieces:
            yield label, one.format, one.complaint
        elif one.read_with:
            yield label, f"read with {one.read_with}", ""
        elif one.complaint:
            yield label, "–", one.complaint
        else:
            unknown += 1
            if unknown <= MOST_UNKNOWN:
                yield label, "–", "no format that is read; it is not used"
    if unknown > MOST_UNKNOWN:
        yield f"… {unknown - MOST_UNKNOWN:,} more", "–", "no format that is read; not used either"


def _not_inside(files: Any, sources: Sequence[Path]) -> list[Path]:
    """Files of ``--camera`` that no source holds."""
    homes = [source.resolve() for source in sources]
    return [
        path for path in files if not any(path.resolve().is_relative_to(home) for home in homes)
    ]


def options_of(command: Import) -> ImportOptions:
    """Return what the flags state.

    Raises:
        ParameterError: If a pair is none.
    """
    from tracker.io.importing.options import ImportOptions

    values = {option: getattr(command, flag) for option, flag in IMPORT_FLAGS.items()}
    for option, form in PAIRS.items():
        values[option] = tuple(_pairs(f"--{IMPORT_FLAGS[option]}", form, values[option]))
    layout, _, normalised = (values["boxes"] or "").partition("-")
    values |= {"boxes": layout or None, "normalised": True if normalised else None}
    return ImportOptions.model_validate(values)


def _pairs(flag: str, form: str, items: Sequence[str]) -> Iterator[tuple[str, str]]:
    for item in items:
        first, _, second = item.partition("=")
        if not first or not second:
            raise ParameterError(flag, f"expected {form}, got {item!r}")
        yield first, second


def check_sequence(command: Check) -> int:
    from tracker.sequences import library

    sequence = library.open_sequence(command.sequence)
    return _print_checks(sequence, _checks(sequence), as_json=command.json)


def _checks(sequence: Any) -> list[Any]:
    from tracker.io.checks import check
    from tracker.single_view.rectification.sequence import check_shake

    return [*check(sequence), *check_shake(sequence)]


def _print_checks(sequence: Any, checks: Sequence[Any], *, as_json: bool = False) -> int:
    """Every check in a row, or as JSON; status 1 where one of them warns."""
    from tracker.io.importing.remedies import unsaid
    from tracker.sequences.finding import warning

    checks = [*checks, *(warning("opening", own) for own in unsaid(sequence.warnings, checks))]
    if as_json:
        facts = [(one, {k: float(v) for k, v in one.numbers.items()}) for one in checks]
        print_json(
            [
                {
                    "check": one.name, "status": one.status, "found": str(one),
                    "cameras": one.cameras,
                    "numbers": {k: v if math.isfinite(v) else None for k, v in numbers.items()},
                }
                for one, numbers in facts
            ]
        )  # fmt: skip
    else:
        rows = [(SIGNS[one.status], one.name, str(one)) for one in checks]
        print_table(("", "check", "found"), rows)
    return FAILURE if any(one.status == "warning" for one in checks) else 0


def formats(command: Formats) -> None:
    from tracker.export.calibration import WRITTEN
    from tracker.io.read.registry import all_formats

    rows = [
        (one.KIND, one.NAME, "a file a frame, too" if one.SERIES else "") for one in all_formats()
    ]
    print_table(("read", "format", ""), [*rows, *(("written", name, "") for name in WRITTEN)])


def export_calibration(command: ExportCalibration) -> None:
    from tracker.export.calibration import save_calibration
    from tracker.sequences import library

    if command.output.exists():
        raise CommandError(f"{command.output} exists; name a file that does not")
    sequence = library.open_sequence(command.sequence)
    save_calibration(command.output, sequence.cameras, command.form)
    say(f"{len(sequence.cameras)} cameras, written to {command.output}")
