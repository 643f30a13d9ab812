"""``detector``: the detection networks that are at hand, and the fetching of one."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from app.command.arguments import Detector, GetDetector, ListDetectors
from app.command.computing import compute
from app.command.flags import Detect, set_values
from app.command.terminal import Bar, CommandError, print_json, print_table, say
from tracker.sequences.detectors import FetchedDetector, fetched_detectors


def detector(command: Detector) -> None:
    """Run one of the commands.

    Raises:
        ValueError: If the network cannot be fetched.
        OSError: If it cannot be written.
    """
    match command.action:
        case GetDetector():
            _get()
        case ListDetectors(json):
            _list(json)


def _get() -> None:
    from tracker.single_view.onnx.fetching import NANODET, fetch

    with Bar("fetching", "B") as bar:
        found = fetch(NANODET, bar.at)
    say(
        f"{found.name} ({NANODET.licence}, {found.size / 1e6:.1f} MB) is in {found.folder}: "
        "single_view onnx_detector runs it on pictures"
    )


def _list(json: bool) -> None:
    found = list(fetched_detectors())
    if json:
        print_json([_values(one) for one in found])
        return
    if not found:
        say("no detector was fetched; `multiview-phd detector get` fetches one")
        return
    rows = [
        (
            one.name,
            "" if one.record is None else one.record.licence,
            f"{one.size / 1e6:.1f}",
            "" if one.record is None else one.record.source,
            str(one.path) + (f" ({one.damage})" if one.damage else ""),
        )
        for one in found
    ]
    print_table(("name", "licence", ">MB", "from", "path"), rows)


def _values(one: FetchedDetector) -> dict[str, object]:
    record = one.record
    return {
        "name": one.name,
        "licence": None if record is None else record.licence,
        "source": None if record is None else record.source,
        "sha256": None if record is None else record.sha256,
        "size": one.size,
        "path": str(one.path),
        "damage": one.damage or None,
    }


def detect(command: Detect) -> None:
    """Run a network on all pictures of a sequence and write what it finds.

    What it finds is kept as that of ``track`` is, so tracking with the same model and values
    begins where this ends.

    Raises:
        ParameterError: If a value is not as it must be.
        CommandError: If the folder cannot be written to.
        ValueError: If the sequence or the model cannot be used.
    """
    from tracker.files.atomic import file_names, replacing
    from tracker.geometry.boxes import Boxes
    from tracker.parameters.catalogue import RunParameters
    from tracker.parameters.values import with_values
    from tracker.sequences import library

    changes = set_values(command.set)
    if command.output.exists() and not command.output.is_dir():
        raise CommandError(f"--output {command.output}: expected a folder, found a file")
    sequence = library.open_sequence(command.sequence)
    sequence = library.with_detector(sequence, command.model)
    if not sequence.has_pictures:
        raise CommandError(f"{sequence.name}: a detector needs pictures of every camera")
    if sequence.detector is None:
        raise CommandError(
            "no detector is at hand: `multiview-phd detector get` fetches one, or name an ONNX "
            "file by --model"
        )
    parameters = with_values(RunParameters(), {**changes, "single_view": "onnx_detector"})
    run = compute(sequence, parameters, words="detecting")
    command.output.mkdir(parents=True, exist_ok=True)
    counts = []
    files = file_names([camera.name for camera in sequence.cameras])
    for number, (camera, file) in enumerate(zip(sequence.cameras, files, strict=True)):
        found = run.views.column("measurements", number)
        boxes, frames = Boxes(found.values).left_top, found.steps
        scores = run.views.column("measurement_scores", number).values
        with replacing(command.output / f"{file}.csv") as begun:
            _write(begun, frames, boxes, scores)
        counts.append(f"{camera.name} {len(boxes)}")
    say(f"boxes in {sequence.frames} steps: {', '.join(counts)}; written to {command.output}")


def _write(path: Path, frames: np.ndarray, boxes: np.ndarray, scores: np.ndarray) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(["frame", "left", "top", "width", "height", "score"])
        for frame, box, score in zip(frames, boxes, scores, strict=True):
            table.writerow([frame, *(f"{value:.2f}" for value in box), f"{score:.4f}"])
