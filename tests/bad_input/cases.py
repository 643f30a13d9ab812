"""What a damaged folder must lead to: a sentence, or a run whose numbers are numbers."""

from __future__ import annotations

import csv
import io
import math
import shutil
import time
import warnings
from collections.abc import Sequence as Many
from pathlib import Path

from app.command.terminal import CommandError
from tests.app.folders import write_crossing
from tests.bad_input.drawing import Damage, damage
from tests.io.read.recorded import detections, toml
from tests.synthetic import write_sequence
from tracker.export import tracks_csv
from tracker.io.checks import check
from tracker.io.importing.gathering import gather
from tracker.io.importing.options import ImportOptions
from tracker.io.importing.settling import settle
from tracker.io.importing.writing import write
from tracker.io.read.pieces import FormatError
from tracker.parameters.values import with_values
from tracker.runs import gaps, pipeline
from tracker.sequences import library
from tracker.sequences.errors import SequenceError
from tracker.sequences.reader import FILE, read_sequence
from tracker.sequences.sequence import Sequence

STEPS = 12
LONGEST_SECONDS = 10.0
LONGEST_SENTENCE = 1500


class Fell(AssertionError):
    """What must not be."""


FOREIGN = "files of other programs"
"""The recording that is imported."""


def make_bases(folder: Path) -> dict[str, Path]:
    """Good folders of every kind."""
    bases = {
        "boxes": write_crossing(folder / "boxes", STEPS),
        "videos": write_sequence(folder / "videos", frames=STEPS, container="mp4"),
        "images": write_sequence(
            folder / "images", frames=STEPS, container="images", detections=True
        ),
        "bare": write_crossing(folder / "bare", STEPS),
        FOREIGN: folder / FOREIGN,
    }
    others = bases[FOREIGN]
    others.mkdir()
    toml(others)
    detections(others)
    file = bases["bare"] / FILE
    text = file.read_text(encoding="utf-8")
    begin, end = text.index("[room]"), text.index("[[camera]]")
    file.write_text(text[:begin] + text[end:], encoding="utf-8")
    return bases


def try_case(base: Path, damages: Many[Damage], work: Path, longest: float = math.inf) -> str:
    """Damage a copy of a folder, open, check and run it.

    Args:
        base: The good folder.
        damages: What is done to its copy.
        work: Where the copy goes.
        longest: Seconds of processor time that it may take, once the kernels are there.

    Returns:
        The sentence that it was refused with; empty where it ran.

    Raises:
        Fell: If it was anything else than that, in words.
    """
    place = work / "case"
    shutil.rmtree(place, ignore_errors=True)
    shutil.copytree(base, place)
    for one in damages:
        damage(place, one)
    begin = time.process_time()
    try:
        library.available(work)
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)  # what overflows is a fault
            if (base / FILE).exists():
                _run(read_sequence(place))
            else:
                _import(place, work / "case written")
        told = ""
    except FormatError as error:
        told = str(error)
        if not told.isprintable() or len(told) > LONGEST_SENTENCE:
            raise Fell(f"a poor sentence: {told[:400]!r}") from None
    except SequenceError as error:
        told = str(error)
        if "case" not in told or not told.isprintable() or len(told) > LONGEST_SENTENCE:
            raise Fell(f"a poor sentence: {told[:400]!r}") from None
    except CommandError as error:
        told = str(error)
    seconds = time.process_time() - begin
    if seconds > longest:
        raise Fell(f"it took {seconds:.1f} s")
    return told


def _import(place: Path, target: Path) -> None:
    """Import what is not refused; what is written opens, else nothing of it is there."""
    shutil.rmtree(target, ignore_errors=True)
    try:
        write(settle(gather([place]), ImportOptions(fps=10.0)), target, "case")
    except FormatError:
        if (target / FILE).exists():
            raise Fell("a refused import is written") from None
        raise
    _run(read_sequence(target))


def _run(sequence: Sequence) -> None:
    check(sequence, quick=True, pictures=False)
    try:
        wanted = pipeline.default_parameters(sequence)
    except ValueError as error:  # neither boxes nor pictures in every camera
        raise CommandError(str(error)) from None
    if sequence.has_detections:
        wanted = with_values(wanted, {"single_view": "none"})
    if any(view.camera.image_size[0] * view.camera.image_size[1] > 2e6 for view in sequence.views):
        return  # a picture of that size takes its time
    run = pipeline.compute(sequence, wanted, steps=min(sequence.frames, STEPS))
    gaps.sentences(run)
    stream = io.StringIO(newline="")
    tracks_csv.write_tracks_csv(stream, sequence, run.tracks, wanted, 0, done=run.done)
    rows = csv.reader(line for line in stream.getvalue().splitlines() if line[:1] != "#")
    for row in rows:
        for cell in row:
            if cell.lower() in ("nan", "inf", "-inf"):
                raise Fell(f"a cell of the CSV is {cell}")
