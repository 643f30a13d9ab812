"""Digests of every array of every stage, bit for bit: for changes that must change nothing."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import tempfile
from collections.abc import Iterator, Mapping
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from tests.golden.combinations import alternatives, combinations, runs
from tests.golden.pieces import PIECES
from tests.rooms import ROOMS, render
from tracker.evaluation import evaluate_sequence
from tracker.runs.pipeline import Run
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence

Digests = dict[str, str | list[str]]
"""By name, ``recording / combination / stage / field``: of the whole, or one a step."""

WITH_ALTERNATIVES = ("room24-2p", "cmc2")
"""Recordings on which every value of every choice is run: one with pictures, one with boxes."""


def digests(data: Path, only: str = "") -> Iterator[tuple[str, Digests]]:
    """What every recording gives, one after the other.

    Args:
        data: The folder of the real recordings; those that are not there are left out.
        only: What the name, ``recording / combination``, must contain.
    """
    for room in ROOMS:
        if only in f"rendering {room}":
            yield f"rendering {room}", _rendered(room)
    for piece in PIECES:
        if piece.real and not (data / piece.name).is_dir():
            continue
        sequence = piece.open(data)
        chosen = combinations(sequence)
        if piece.name in WITH_ALTERNATIVES:
            chosen += alternatives(sequence)
        if only in piece.name:
            yield piece.name, _of_recording(sequence, piece.steps)
        chosen = [one for one in chosen if only in f"{piece.name} / {one.name}"]
        for combination, run in runs(sequence, piece.steps, chosen):
            yield f"{piece.name} / {combination.name}", of_run(run)


def _rendered(room: str) -> Digests:
    """A few steps drawn afresh, whatever the cache has."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / room
        render(room, folder, cameras=3, frames=12)
        return {
            path.name: hashlib.sha256(path.read_bytes()).hexdigest()
            for path in sorted(folder.iterdir())
        }


def _of_recording(sequence: Sequence, steps: int) -> Digests:
    found: Digests = {
        "truth": digest(sequence.ground_truth),
        "room": digest(sequence.room),
        "templates": digest(sequence.templates),
    }
    with FrameReader(sequence) as reader:
        for index, view in enumerate(sequence.views):
            name = view.camera.name
            found[f"{name} / boxes"] = digest(view.detections)
            if view.has_pictures:
                found[f"{name} / pictures"] = [
                    short(picture) for picture in islice(reader.iterate(index), steps)
                ]
    return found


def of_run(run: Run) -> Digests:
    found: Digests = {}
    for index, camera in enumerate(run.sequence.cameras):
        steps = [views[index] for views in run.views]
        for field, values in _columns(steps).items():
            found[f"single_view / {camera.name} / {field}"] = values
    for field, values in _columns(run.fused).items():
        found[f"fusion / {field}"] = values
    for field in _names(run.tracks):
        found[f"tracks / {field}"] = digest(getattr(run.tracks, field))
    evaluation = evaluate_sequence(run.sequence, run.tracks, steps=run.done)
    found["evaluation"] = hashlib.sha256(
        json.dumps(evaluation.to_json(), sort_keys=True).encode()
    ).hexdigest()
    return found


def _columns(steps: list[Any]) -> dict[str, str | list[str]]:
    return {
        field: [short(getattr(step, field)) for step in steps]
        for field in (_names(steps[0]) if steps else ())
    }


def _names(value: Any) -> list[str]:
    return [field.name for field in dataclasses.fields(value)]


def short(value: Any) -> str:
    """A digest for one of many steps."""
    return digest(value)[:16]


def digest(value: Any) -> str:
    """Of a value and all that it holds: kind, shape and every bit of its arrays."""
    hashed = hashlib.sha256()
    for part in _parts(value):
        hashed.update(part)
    return hashed.hexdigest()


def _parts(value: Any) -> Iterator[bytes]:
    if isinstance(value, np.ndarray):
        yield f"{value.dtype.str}{value.shape}".encode()
        yield np.ascontiguousarray(value).tobytes()
    elif dataclasses.is_dataclass(value):
        for name in _names(value):
            yield name.encode()
            yield from _parts(getattr(value, name))
    elif isinstance(value, Mapping):
        for key in sorted(value):
            yield repr(key).encode()
            yield from _parts(value[key])
    elif isinstance(value, list | tuple):
        yield f"{len(value)}[".encode()
        for one in value:
            yield from _parts(one)
    elif isinstance(value, float | np.floating):
        yield float(value).hex().encode()
    elif value is None or isinstance(value, str | bool | int | np.integer | np.bool_):
        yield repr(value).encode()
    else:
        raise TypeError(f"no digest of a {type(value).__name__}: expected arrays, numbers, text")
