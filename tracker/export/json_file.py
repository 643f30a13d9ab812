"""The export format JSON, and its JSON Schema, which is made from the same models."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from tracker import __version__
from tracker.export.written import Options, Written

SCHEMA_PLACE = "tracks.schema.json"
"""The name of the published schema's file in the manual."""


class _Model(BaseModel):
    model_config = ConfigDict(extra="forbid", use_attribute_docstrings=True)


class CameraOfFile(_Model):
    """A camera that the boxes are of."""

    name: str
    width: int = Field(ge=1)
    """Pixels."""
    height: int = Field(ge=1)


class SequenceOfFile(_Model):
    """What was tracked."""

    name: str
    fps: float = Field(gt=0)
    """Steps a second."""
    frames: int = Field(ge=1)
    """The number of steps."""
    half_extents: tuple[float, float, float]
    """Half width, depth and height of a target, metres."""
    cameras: list[CameraOfFile]


class RunOfFile(_Model):
    """How it was tracked."""

    seed: int
    steps: int
    """Computed; fewer than the sequence has where the run was not finished."""
    parameters: dict[str, str | int | float | bool]
    """Methods and every value, by key."""
    remarks: list[str]
    """What must be said of it: a sentence for each camera of which pictures were missing."""


class TrackOfFile(_Model):
    """One track: columns of equal length, one row a step that it is there."""

    id: int
    name: str | None = None
    """What the person was called by hand."""
    frames: list[int]
    """Steps, from 0 on, ascending."""
    positions: list[tuple[float, float, float]]
    """World metres, z up."""
    existences: list[float]
    """Weight or probability of existence."""
    sigmas: list[tuple[float, float, float]]
    """Standard deviations of the position, metres."""
    seen: dict[str, list[bool]]
    """By camera: whether a box of it fed the track at this step."""
    correction: list[str] | None = None
    """Of a corrected run the id of the correction that each row rests on, empty for none."""
    boxes: dict[str, list[tuple[float, float, float, float] | None]]
    """By camera: left, top, width, height in pixels, origin at the centre of the top-left pixel;
    null where the picture has none."""


class TracksFile(_Model):
    """Tracks of several people in 3D, as multiview-phd writes them."""

    format: Literal[1] = 1
    program: str
    sequence: SequenceOfFile
    run: RunOfFile
    tracks: list[TrackOfFile]


def schema() -> dict[str, Any]:
    """Return the JSON Schema of the file."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **TracksFile.model_json_schema(mode="serialization"),
    }


def write(path: Path, written: Written, options: Options) -> None:
    """Write a run as JSON, track by track."""
    sequence = written.sequence
    head = TracksFile(
        program=f"multiview-phd {__version__}",
        sequence=SequenceOfFile(
            name=sequence.name,
            fps=sequence.fps,
            frames=sequence.frames,
            half_extents=_triple(sequence.target_half_extents),
            cameras=[
                CameraOfFile(name=c.name, width=c.image_size[0], height=c.image_size[1])
                for c in sequence.cameras
            ],
        ),
        run=RunOfFile(
            seed=written.seed,
            steps=written.steps,
            parameters=written.settings,
            remarks=list(written.remarks),
        ),
        tracks=[],
    )
    text = head.model_dump_json()
    beginning, end = text[: -len("]}")], "]}"
    ids = written.ids
    with path.open("w", encoding="utf-8") as file:
        file.write(beginning)
        for done, number in enumerate(ids):
            options.at(done, len(ids))
            file.write(
                ("," if done else "")
                + "\n"
                + _track(written, number).model_dump_json(exclude_none=True)
            )
        file.write(("\n" if ids else "") + end + "\n")
    options.at(len(ids), len(ids))


def _track(written: Written, number: int) -> TrackOfFile:
    tracks = written.tracks
    rows = np.flatnonzero(tracks.ids == number)
    cameras = written.sequence.cameras
    return TrackOfFile(
        id=number,
        name=written.names.get(number),
        frames=tracks.frames[rows].tolist(),
        positions=tracks.positions[rows].tolist(),
        existences=tracks.existences[rows].tolist(),
        sigmas=tracks.sigmas[rows].tolist(),
        seen={c.name: tracks.seen[rows, k].tolist() for k, c in enumerate(cameras)},
        correction=[written.row_corrections[k] for k in rows.tolist()]
        if written.row_corrections
        else None,
        boxes={
            camera.name: [
                box if there else None
                for box, there in zip(
                    written.boxes[k][0][rows].round(3).tolist(),
                    written.boxes[k][1][rows].tolist(),
                    strict=True,
                )
            ]
            for k, camera in enumerate(cameras)
        },
    )


def _triple(values: Any) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z


def published() -> str:
    """Return the text of the schema as the manual publishes it."""
    return json.dumps(schema(), indent=2) + "\n"
