"""The export format JSON, and its JSON Schema, which is made from the same models."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Literal

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from pydantic import BaseModel, ConfigDict, Field

from tracker import __version__
from tracker.export.exported_run import ExportedRun, Options

SCHEMA_PLACE = "tracks.schema.json"
"""The name of the published schema's file in the manual."""


class _Model(BaseModel):
    model_config = ConfigDict(extra="forbid", use_attribute_docstrings=True)


class CameraOfFile(_Model):
    """A camera."""

    name: str
    """The name of the camera, by which tracks refer to it."""
    width: int = Field(ge=1)
    """Width of the picture, pixels."""
    height: int = Field(ge=1)
    """Height of the picture, pixels."""


class SequenceOfFile(_Model):
    """The recording that was tracked."""

    name: str
    """The name of the recording."""
    fps: float = Field(gt=0)
    """The number of steps per second."""
    frames: int = Field(ge=1)
    """The number of steps of the recording."""
    half_extents: tuple[float, float, float] | None
    """Half width, depth and height of a target, metres; null if the recording was not there any
    more when its stored run was written, which then has no cameras either."""
    cameras: list[CameraOfFile]
    """The cameras, in the order of the recording."""


class RunOfFile(_Model):
    """The run that computed the tracks."""

    seed: int
    """The seed of the random numbers."""
    steps: int
    """The number of steps that were computed; fewer than those of the recording if the run was not
    finished."""
    parameters: dict[str, str | int | float | bool]
    """The chosen methods and the values of all parameters, by key."""
    remarks: list[str]
    """Sentences on the result, for instance that pictures of a camera were missing."""


class TrackOfFile(_Model):
    """A track: columns of equal length, with a row for each step at which the track exists."""

    id: int
    """The id of the track."""
    name: str | None = None
    """The name that the user gave to the person; left out if there is none."""
    frames: list[int]
    """The step of each row, counted from 0, ascending."""
    positions: list[tuple[float, float, float]]
    """The centre of the target in world coordinates x, y, z (z up), metres."""
    existences: list[float]
    """The probability that the target exists; the weight of its component in methods that
    estimate weights, which may exceed 1."""
    sigmas: list[tuple[float, float, float]]
    """The standard deviations of the position along x, y and z, metres."""
    covariance_xy: list[float] = []
    """The covariance of the position along x and y, square metres."""
    height: list[float | None] = []
    """The height of the track's person while standing, above the floor, metres; null where it is
    not estimated."""
    sigma_height: list[float | None] = []
    """The standard deviation of the height, metres; null where it is not estimated."""
    seen: dict[str, list[bool]]
    """For each camera by name: whether a box of the camera updated the track at this step."""
    correction: list[str] | None = None
    """For a corrected run, the id of the correction that each row depends on, or an empty string;
    left out for other runs."""
    boxes: dict[str, list[tuple[float, float, float, float] | None]]
    """For each camera by name: the reprojected box as left, top, width, height in pixels, with the
    origin at the centre of the top-left pixel; null if it does not lie in the picture."""


class TracksFile(_Model):
    """Tracks of several people in 3D, as multiview-phd writes them."""

    format: Literal[1] = 1
    """The version of this format."""
    program: str
    """The name and the version of the program."""
    sequence: SequenceOfFile
    """The recording that was tracked."""
    run: RunOfFile
    """The run that computed the tracks."""
    tracks: list[TrackOfFile]
    """The tracks, by ascending id."""


def schema() -> dict[str, Any]:
    """Return the JSON Schema of the file."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **TracksFile.model_json_schema(mode="serialization"),
    }


def write(path: Path, run: ExportedRun, options: Options) -> None:
    """Write a run as JSON, track by track."""
    sequence = run.sequence
    head = TracksFile(
        program=f"multiview-phd {__version__}",
        sequence=SequenceOfFile(
            name=sequence.name,
            fps=sequence.fps,
            frames=sequence.frames,
            half_extents=_triple(sequence.target_half_extents) if sequence.views else None,
            cameras=[
                CameraOfFile(name=c.name, width=c.image_size[0], height=c.image_size[1])
                for c in sequence.cameras
            ],
        ),
        run=RunOfFile(
            seed=run.seed,
            steps=run.steps,
            parameters=run.settings,
            remarks=list(run.remarks),
        ),
        tracks=[],
    )
    text = head.model_dump_json()
    beginning, end = text[: -len("]}")], "]}"
    ids = run.ids
    with path.open("w", encoding="utf-8") as file:
        file.write(beginning)
        for done, number in enumerate(ids):
            options.at(done, len(ids))
            file.write(
                ("," if done else "")
                + "\n"
                + _track(run, number).model_dump_json(exclude_none=True)
            )
        file.write(("\n" if ids else "") + end + "\n")
    options.at(len(ids), len(ids))


def _track(run: ExportedRun, number: int) -> TrackOfFile:
    """Return the track with an id."""
    tracks = run.tracks
    rows = np.flatnonzero(tracks.ids == number)
    cameras = run.sequence.cameras
    return TrackOfFile(
        id=number,
        name=run.names.get(number),
        frames=tracks.frames[rows].tolist(),
        positions=tracks.positions[rows].tolist(),
        existences=tracks.existences[rows].tolist(),
        sigmas=tracks.sigmas[rows].tolist(),
        covariance_xy=tracks.covariances_xy[rows].tolist(),
        height=_or_null(tracks.heights[rows]),
        sigma_height=_or_null(tracks.sigma_heights[rows]),
        seen={c.name: tracks.seen[rows, k].tolist() for k, c in enumerate(cameras)},
        correction=[run.row_corrections[k] for k in rows.tolist()] if run.row_corrections else None,
        boxes={
            camera.name: [
                box if there else None
                for box, there in zip(
                    run.boxes[k][0][rows].round(3).tolist(),
                    run.boxes[k][1][rows].tolist(),
                    strict=True,
                )
            ]
            for k, camera in enumerate(cameras)
        },
    )


def _or_null(values: Float[ndarray, " N"]) -> list[float | None]:
    """Return numbers as JSON has them, None for NaN."""
    return [value if value == value else None for value in values.tolist()]


def _triple(values: Any) -> tuple[float, float, float]:
    """Return three numbers as a tuple of floats."""
    x, y, z = (float(value) for value in values)
    return x, y, z


def published() -> str:
    """Return the text of the schema as the manual publishes it."""
    return json.dumps(schema(), indent=2) + "\n"
