"""``templates``: what models people's colours, in a terminal."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

from app.command.arguments import ListTemplates, OfferTemplates, RemoveTemplates, Templates
from app.command.computing import compute
from app.command.terminal import CommandError, print_json, print_table, say
from tracker.review import template_suggestions
from tracker.sequences import library
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.reader import FILE
from tracker.sequences.sequence import Sequence, Template
from tracker.sequences.writing import saving
from tracker.sequences.writing.teaching import Values, taught_values, template_values, with_taught


def templates(command: Templates) -> None:
    """Run one of the commands.

    Raises:
        CommandError: If a number is none of the list's.
        ValueError: If the sequence cannot be read, tracked or written.
    """
    match command.action:
        case ListTemplates() as action:
            _list(action)
        case OfferTemplates() as action:
            _offer(action)
        case RemoveTemplates() as action:
            _remove(action)


def _list(action: ListTemplates) -> None:
    sequence = library.open_sequence(action.sequence)
    if action.json:
        print_json([template_values(one) for one in sequence.templates])
    elif not sequence.templates:
        say(f"{action.sequence} has no templates; `templates offer` or Teach on the page adds some")
    else:
        rows = [_row(number, one) for number, one in enumerate(sequence.templates, 1)]
        print_table(_HEADS, rows)


_HEADS = ("number", "person", "camera", "step", "left, top, width, height (px)")


def _row(number: int, one: Template) -> tuple[str, ...]:
    box = ", ".join(f"{side:g}" for side in one.box)
    return str(number), one.name, one.camera, str(one.frame), box


def _offer(action: OfferTemplates) -> None:
    if action.add and action.add_all:
        raise CommandError("--add and --add-all: expected one of them")
    sequence = library.open_sequence(action.sequence)
    if not sequence.has_pictures:
        raise CommandError(f"{sequence.name}: no camera has pictures to cut templates from")
    if action.add or action.add_all:
        _check_place(sequence, "added")
    found = _found(sequence, action)
    if action.json:
        print_json([_values(one) for one in found])
    elif found:
        rows = [(*_row(number, one.template), one.reason) for number, one in enumerate(found, 1)]
        print_table((*_HEADS, "why"), rows)
    if not found:
        say("the tracks offer no further template")
    numbers = range(1, len(found) + 1)
    wanted = numbers if action.add_all else action.add
    _check(wanted, len(found), "--add")
    if wanted:
        new = [template_values(found[number - 1].template) for number in dict.fromkeys(wanted)]
        _write(sequence, lambda values: values["template"].extend(new))
        say(f"{len(new)} of {len(found)} added to {sequence.folder / FILE}")


def _found(
    sequence: Sequence, action: OfferTemplates
) -> tuple[template_suggestions.Suggestion, ...]:
    """What a run offers, its pictures written where they are wanted."""
    from app.command.correcting import of_run

    run = compute(sequence, seed=action.seed, corrections=of_run(sequence, None))
    with FrameReader(sequence) as reader:
        found = template_suggestions.suggest_templates(run, reader)
        if action.pictures is not None:
            _write_pictures(action.pictures, sequence, found, reader)
    return found


def _write_pictures(
    folder: Path,
    sequence: Sequence,
    found: tuple[template_suggestions.Suggestion, ...],
    reader: FrameReader,
) -> None:
    import cv2

    if folder.exists() and not folder.is_dir():
        raise CommandError(f"--pictures {folder}: expected a folder, found a file")
    folder.mkdir(parents=True, exist_ok=True)
    cameras = [camera.name for camera in sequence.cameras]
    for number, one in enumerate(found, 1):
        picture = reader.picture(cameras.index(one.template.camera), one.template.frame)
        assert picture is not None, "an offer was cut from it"
        left, top, width, height = (round(float(side)) for side in one.template.box)
        part = picture[max(0, top) : top + height, max(0, left) : left + width]
        done, data = cv2.imencode(".png", part)
        assert done, "a picture of three channels can be written as PNG"
        (folder / f"{number}.png").write_bytes(bytes(data))
    say(f"{len(found)} pictures written to {folder}")


def _values(one: template_suggestions.Suggestion) -> dict[str, Any]:
    return {
        **template_values(one.template),
        "track": one.track,
        "cameras": list(one.cameras),
        "deviation": round(one.deviation, 4),
        "difference": None if one.difference is None else round(one.difference, 4),
    }


def _remove(action: RemoveTemplates) -> None:
    sequence = library.open_sequence(action.sequence)
    if not action.numbers:
        raise CommandError("expected the number of a template; `templates list` has them")
    _check_place(sequence, "taken away")
    _check(action.numbers, len(sequence.templates), "NUMBER")

    def remove(values: Values) -> None:
        for number in sorted(set(action.numbers), reverse=True):
            del values["template"][number - 1]

    _write(sequence, remove)
    say(f"{len(set(action.numbers))} removed from {sequence.folder / FILE}")


def _check_place(sequence: Sequence, done: str) -> None:
    """Refuse to change a sequence that cannot be saved where it is."""
    reason = saving.why_not_in_place(sequence.folder)
    if reason is not None:
        raise CommandError(
            f"{sequence.name}: nothing can be {done}, since {reason}; copy its folder, and name "
            "the copy"
        )


def _check(numbers: Any, count: int, where: str) -> None:
    for number in numbers:
        if not 1 <= number <= count:
            expected = f"a number from 1 to {count}" if count else "none, since there is none"
            raise CommandError(f"{where}: expected {expected}, got {number}")


def _write(sequence: Sequence, edit: Any) -> None:
    """The sequence's own file with other templates; what it was stays beside it."""
    values = copy.deepcopy(taught_values(sequence))
    edit(values)
    saving.save(with_taught(sequence, values, f"{sequence.folder.name}/{FILE}"), sequence)
