"""The track file: one row for each target and step, with its reprojected box in every picture.

The comment lines at the top state the version of the program, the sequence, the seed, the methods
and the value of every parameter, in the form that ``multiview-phd track --set`` accepts.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Iterator, Mapping
from collections.abc import Sequence as Many
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, TextIO

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker import __version__
from tracker.export.exported_run import ExportedRun, Options
from tracker.files.atomic import replacing
from tracker.fusion.trajectories import Trajectories
from tracker.parameters.catalogue import METHODS, PARAMETERS, RunParameters
from tracker.parameters.values import value_of
from tracker.sequences.csv_columns import guarded, read_columns, unguarded
from tracker.sequences.errors import SequenceError
from tracker.sequences.sequence import Sequence

PROGRAM = "multiview-phd"
"""The name of the program in the first comment line."""

BOX = ("left", "top", "width", "height")
"""The parts of a box, which follow the camera's name in the name of a column."""

COLUMNS = ("frame", "time", "id", "x", "y", "z", "existence", "sigma_x", "sigma_y", "sigma_z")
"""The columns of every track file before those of boxes."""

COVARIANCE = "covariance_xy"
"""The name of the column of the covariance of the position along x and y. It and the next two
follow the boxes so that columns keep their places; files of earlier versions lack them."""

HEIGHT = ("height", "sigma_height")
"""The names of the last columns: the height of the track's person and its standard deviation."""

CORRECTION = "correction"
"""The name of the column of a corrected run: the id of the correction that a row depends on, or
empty."""

NAME = "name"
"""The name of the column of a run with named people: the name of the row's track, or empty."""

_AT_ONCE = 1024
"""Number of rows that are text in memory at a time."""


@dataclass(frozen=True, slots=True, eq=False)
class TrackFile:
    """The content of a track file: N rows, sorted by step and then id."""

    frames: Int[ndarray, " N"]
    """The step of each row, counted from 0."""
    times: Float[ndarray, " N"]
    """The time of each step since step 0, seconds."""
    ids: Int[ndarray, " N"]
    """The id of the track of each row."""
    positions: Float[ndarray, "N 3"]
    """The centre of the target, world metres."""
    existences: Float[ndarray, " N"]
    """The existence probability, or the weight of the target's component, which may exceed 1."""
    sigmas: Float[ndarray, "N 3"]
    """Standard deviation of the position along x, y and z, metres."""
    boxes: Mapping[str, Float[ndarray, "N 4"]]
    """For each camera by name: left, top, width, height of the reprojected box in pixels; NaN if it
    does not lie in the picture."""
    settings: Mapping[str, str]
    """The values of the comment lines ``# key = value`` (sequence, seed, methods, parameters), by
    key."""
    covariances_xy: Float[ndarray, " N"] | None = None
    """Covariance of the position along x and y, square metres; None where the file has none."""
    heights: Float[ndarray, " N"] | None = None
    """Height of the track's person while standing, metres; NaN where it was not estimated, None
    where the file has none."""
    sigma_heights: Float[ndarray, " N"] | None = None
    """Standard deviation of the height, metres, with the same exceptions."""
    done: int | None = None
    """The number of steps computed, if the file states that these are not all; else None."""
    remarks: tuple[str, ...] = ()
    """The sentences of the comment lines ``# incomplete: …``."""

    def __len__(self) -> int:
        return len(self.frames)

    @classmethod
    def of_columns(
        cls,
        columns: Mapping[str, ndarray],
        cameras: Many[str],
        order: Int[ndarray, " N"],
        *,
        settings: Mapping[str, str],
        done: int | None = None,
        remarks: tuple[str, ...] = (),
    ) -> TrackFile:
        """Return the content of a file in any form from its columns.

        Args:
            columns: The columns by the names that the CSV file has; :data:`COVARIANCE` and
                :data:`HEIGHT` may be missing.
            cameras: The names of the cameras that have columns.
            order: The order of the rows by step and then id.
            settings, done, remarks: As the attributes.
        """
        own = {name: column[order] for name, column in columns.items()}

        def stacked(*names: str) -> Float[ndarray, "N C"]:
            return np.column_stack([own[name] for name in names])

        return cls(
            frames=own["frame"].astype(np.int64),
            times=own["time"],
            ids=own["id"].astype(np.int64),
            positions=stacked("x", "y", "z"),
            existences=own["existence"],
            sigmas=stacked("sigma_x", "sigma_y", "sigma_z"),
            boxes={name: stacked(*(f"{name}_{side}" for side in BOX)) for name in cameras},
            settings=settings,
            covariances_xy=own.get(COVARIANCE),
            heights=own.get(HEIGHT[0]),
            sigma_heights=own.get(HEIGHT[1]),
            done=done,
            remarks=remarks,
        )


def write_tracks_csv(
    stream: TextIO,
    sequence: Sequence,
    tracks: Trajectories,
    parameters: RunParameters,
    seed: int,
    *,
    done: int | None = None,
    remarks: Iterable[str] = (),
    row_corrections: Many[str] = (),
    names: Mapping[int, str] = MappingProxyType({}),
) -> None:
    """Write the track file.

    Positions have 4 decimals (a tenth of a millimetre), heights too, boxes 2, times and covariances
    6. The cells of a height that is not estimated are empty.

    Args:
        stream: A text stream, opened with ``newline=""``; lines end with a single line feed.
        sequence: The sequence that was tracked.
        tracks: The result, sorted by step and then id.
        parameters: The parameters of the run.
        seed: The seed of the run.
        done: The number of steps computed; a comment states it if the sequence has more.
        remarks: Further sentences for the comments, for instance that pictures were missing.
        row_corrections: For a corrected run, the id of the correction that each row depends on, or
            an empty string, for the column :data:`CORRECTION`; if empty, there is no such column.
        names: The names that the user gave to people, by track id, for the column :data:`NAME`; if
            empty, there is no such column.
    """
    for line in _comments(sequence, parameters, seed, done, remarks):
        stream.write(f"# {line}\n")
    cameras = sequence.cameras
    boxes = [f"{camera.name}_{side}" for camera in cameras for side in BOX]
    head = [
        *COLUMNS,
        *([NAME] if names else []),
        *([CORRECTION] if row_corrections else []),
        *map(guarded, boxes),
        COVARIANCE,
        *HEIGHT,
    ]
    csv.writer(stream, lineterminator="\n").writerow(head)
    called = {track: _cell(name) for track, name in names.items()}
    for first in range(0, len(tracks), _AT_ONCE):
        some = slice(first, first + _AT_ONCE)
        frames, ids, positions = tracks.frames[some], tracks.ids[some], tracks.positions[some]
        columns = [
            [f"{frame}" for frame in frames],
            [f"{frame * sequence.step_time:.6f}" for frame in frames],
            [f"{number}" for number in ids],
            *_fixed(positions, 4),
            *_fixed(tracks.existences[some, None], 4),
            *_fixed(tracks.sigmas[some], 4),
            *([[called.get(track, "") for track in ids.tolist()]] if names else []),
            *([list(row_corrections[some])] if row_corrections else []),
        ]
        for camera in cameras:
            pixels, visible = camera.project_boxes(positions, sequence.target_half_extents)
            columns += _fixed(np.where(visible[:, None], pixels, np.nan), 2)
        columns += _fixed(tracks.covariances_xy[some, None], 6)
        columns += _fixed(tracks.heights[some, None], 4)
        columns += _fixed(tracks.sigma_heights[some, None], 4)
        stream.writelines(",".join(row) + "\n" for row in zip(*columns, strict=True))


def _cell(text: str) -> str:
    """Return a user's text as one cell, quoted if necessary, that no spreadsheet reads as a
    formula."""
    cell = io.StringIO()
    csv.writer(cell, lineterminator="").writerow([guarded(" ".join(text.split()))])
    return cell.getvalue()


def _fixed(values: Float[ndarray, "N C"], decimals: int) -> Iterator[list[str]]:
    """Yield the C columns as text with a fixed number of decimals; NaN gives an empty cell, and −0
    gives 0."""
    rounded = np.round(values, decimals) + 0.0  # turns −0.0 into 0.0
    for column in rounded.T:
        yield [f"{number:.{decimals}f}" if number == number else "" for number in column.tolist()]


def _comments(
    sequence: Sequence,
    parameters: RunParameters,
    seed: int,
    done: int | None,
    remarks: Iterable[str],
) -> Iterator[str]:
    """Yield the comment lines without the sign #."""
    yield f"{PROGRAM} {__version__}"
    yield from (f"incomplete: {guarded(' '.join(remark.split()))}" for remark in remarks)
    if done is not None and done < sequence.frames:
        yield f"partial: the first {done} of {sequence.frames} steps"
    yield f"sequence = {guarded(' '.join(sequence.name.split()))}"
    yield f"seed = {seed}"
    for key in (*METHODS, *PARAMETERS):
        yield f"{key} = {_as_text(value_of(parameters, key))}"


def _as_text(setting: Any) -> str:
    """Return a value of a parameter as text; Boolean values are in lower case, as in TOML."""
    return str(setting).lower() if isinstance(setting, bool) else str(setting)


def write(path: Path, run: ExportedRun, options: Options) -> None:
    """Write a run as a track file."""
    with path.open("w", encoding="utf-8", newline="") as stream:
        write_tracks_csv(
            stream,
            run.sequence,
            run.tracks,
            run.parameters,
            run.seed,
            done=run.done,
            remarks=run.remarks,
            row_corrections=run.row_corrections,
            names=run.names,
        )
    options.at(run.steps, run.steps)


def save_tracks_csv(
    path: Path | str,
    sequence: Sequence,
    tracks: Trajectories,
    parameters: RunParameters,
    seed: int,
    *,
    done: int | None = None,
    remarks: Iterable[str] = (),
) -> None:
    """Write the track file to disk, atomically.

    Args:
        path: The file to write, which is replaced if it exists. A pipe or device is written to
            directly.
        sequence, tracks, parameters, seed, done, remarks: The arguments of
            :func:`write_tracks_csv`.

    Raises:
        OSError: If the file cannot be written; the message says why.
    """
    with (
        replacing(Path(path)) as temporary,
        temporary.open("w", encoding="utf-8", newline="") as stream,
    ):
        write_tracks_csv(stream, sequence, tracks, parameters, seed, done=done, remarks=remarks)


def read_tracks_csv(path: Path | str) -> TrackFile:
    """Read a track file.

    Raises:
        SequenceError: If the file is not a valid track file; the message names the file, the line
            and the column, and states what was expected and found.
    """
    path = Path(path)
    comments, header = _head(path)
    cameras = [name.removesuffix("_left") for name in header if name.endswith("_left")]
    sides = tuple(f"{camera}_{side}" for camera in cameras for side in BOX)
    columns = read_columns(
        path,
        path.name,
        needed=(*COLUMNS, *(s for s in sides if s not in header)),
        # where they are absent, a column of a camera may be called much the same
        optional={COVARIANCE: 0.0, **{name: np.nan for name in HEIGHT if name in header}},
        blank=(*sides, *HEIGHT),
        called=unguarded,
    )
    frames = columns.whole("frame", 0, None, "the step")
    ids = columns.whole("id", 0, None, "the track")
    order = columns.one_row_each(frames, ids, "track")
    values = {name: own for name, own in columns.values.items() if name in header}
    return TrackFile.of_columns(
        values,
        cameras,
        order,
        settings=_settings(comments),
        done=_done(comments),
        remarks=_remarks(comments),
    )


def _head(path: Path) -> tuple[list[str], list[str]]:
    """Return the comment lines above the header without the sign #, and the columns' names."""
    comments: list[str] = []
    try:
        with path.open(encoding="utf-8-sig", errors="replace") as stream:
            for line in stream:
                if line.startswith("#"):
                    comments.append(line[1:].strip())
                elif line.strip():
                    return comments, [unguarded(cell.strip()) for cell in next(csv.reader([line]))]
    except OSError as error:
        raise SequenceError(f"{path}: cannot be read ({error.strerror})") from None
    return comments, []


def _settings(comments: Many[str]) -> dict[str, str]:
    """Return the values of the comments ``key = value``, by key."""
    pairs = (line.partition("=") for line in comments)
    return {key.strip(): unguarded(value.strip()) for key, equals, value in pairs if equals}


def _done(comments: Many[str]) -> int | None:
    """Return the number of steps that the comment ``partial: …`` states; None without it."""
    found = (re.match(r"partial: the first (\d+) of ", line) for line in comments)
    return next((int(one[1]) for one in found if one), None)


def _remarks(comments: Many[str]) -> tuple[str, ...]:
    """Return the sentences of the comments ``incomplete: …``."""
    found = (re.match(r"incomplete: (.*)", line) for line in comments)
    return tuple(unguarded(one[1].strip()) for one in found if one)
