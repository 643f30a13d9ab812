"""The reading of tracks in every form that the program writes and that has numbers: CSV, JSON,
Parquet, TRC, and MOTChallenge's file of the ground plane."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.export.json_file import TracksFile
from tracker.export.registry import FORMATS
from tracker.export.tracks_csv import BOX, COLUMNS, COVARIANCE, HEIGHT, TrackFile, read_tracks_csv
from tracker.export.trc import Y_UP
from tracker.files.validated import InvalidJson, parse_json
from tracker.io.read.detections.motchallenge import GROUND_PLANE, TRACKEVAL
from tracker.io.read.pieces import FormatError, TruthPiece
from tracker.io.read.registry import recognise
from tracker.io.read.source import SourceFile
from tracker.sequences.csv_columns import MOST_BYTES
from tracker.sequences.errors import SequenceError

_ROUNDING_SIGMA, _ROUNDING_COVARIANCE = 0.5e-4, 0.5e-6
"""Half of the last decimal that a CSV track file has of σ, metres, and of the covariance."""


def read_tracks(path: Path | str) -> TrackFile:
    """Read tracks, in the form that the name's ending states; any other ending is CSV.

    Of a folder as MOTChallenge's export writes it, the file of the ground plane is read. TRC and
    MOTChallenge have places alone: existences are 1, and standard deviations NaN.

    Raises:
        SequenceError: If the file does not have valid tracks, or covariances and heights that
            cannot be; the message names the file and what was expected and found.
    """
    path = _ground_plane(Path(path)) if Path(path).is_dir() else Path(path)
    suffix = path.suffix.lower()
    form = {".json": _json, ".parquet": _parquet, ".trc": _places, ".txt": _places}
    for one in FORMATS.values():
        if suffix in (one.suffix, f".{one.name}") and suffix not in (".csv", *form):
            raise SequenceError(
                f"{path.name}: expected tracks as CSV, JSON, Parquet, TRC or MOTChallenge's ground "
                f"plane, found {one.word}, which is written but not read; write the run in one of "
                "those, as `runs export` does"
            )
    tracks = form.get(suffix, read_tracks_csv)(path)
    _check(path.name, tracks)
    return tracks


def _ground_plane(folder: Path) -> Path:
    """Return the file of the ground plane in a folder as MOTChallenge's export writes it.

    Raises:
        SequenceError: If there is none, or more than one.
    """
    pattern = f"trackers/{TRACKEVAL}/*/*/data/*-{GROUND_PLANE}.txt"
    found = sorted(folder.glob(pattern))
    if len(found) != 1:
        names = ", ".join(str(file.relative_to(folder)) for file in found) or "none"
        raise SequenceError(
            f"{folder}: expected a file of tracks, or a folder with one file {pattern} as "
            f"`track --format motchallenge` writes it, found {names}; name the file"
        )
    return found[0]


def _check(where: str, tracks: TrackFile) -> None:
    """Check what no column can tell by itself.

    Raises:
        SequenceError: At the first row that cannot be, with its step and track.
    """

    def require(
        good: Bool[ndarray, " N"], field: str, expected: str, found: Float[ndarray, " N"]
    ) -> None:
        if not good.all():
            row = int(np.argmin(good))
            raise SequenceError(
                f"{where}, step {tracks.frames[row]}, track {tracks.ids[row]}, {field}: expected "
                f"{expected}, found {float(found[row]):.6g}"
            )

    for axis, sigmas in zip("xyz", tracks.sigmas.T, strict=True):
        require(~(sigmas < 0.0), f"sigma_{axis}", "a standard deviation of at least 0 m", sigmas)
    if tracks.covariances_xy is not None:
        sigmas = tracks.sigmas[:, :2]
        largest = np.prod(sigmas + _ROUNDING_SIGMA, axis=1) + _ROUNDING_COVARIANCE
        require(
            ~(np.abs(tracks.covariances_xy) > largest),
            COVARIANCE,
            "at most sigma_x · sigma_y in size (square metres)",
            tracks.covariances_xy,
        )
    for field, values in zip(HEIGHT, (tracks.heights, tracks.sigma_heights), strict=True):
        if values is not None:
            require(~(values < 0.0), field, "at least 0 m, or nothing", values)


def _in_order(
    where: str, frames: Int[ndarray, " N"], ids: Int[ndarray, " N"]
) -> Int[ndarray, " N"]:
    """Return the order of the rows by step and id.

    Raises:
        SequenceError: If a step or id is negative, or a track has two rows at a step.
    """
    for field, values in (("frame", frames), ("id", ids)):
        if (values < 0).any():
            raise SequenceError(
                f'{where}, "{field}": expected whole numbers from 0, found {values.min()}'
            )
    order = np.lexsort([ids, frames])
    same = (np.diff(frames[order]) == 0) & (np.diff(ids[order]) == 0)
    if same.any():
        row = order[np.argmax(same)]
        raise SequenceError(
            f"{where}: expected one row a track a step, found two of track {ids[row]} at step "
            f"{frames[row]}"
        )
    return order


def _limited(path: Path, what: str) -> bytes:
    """Return the bytes of a file within the limit.

    Raises:
        SequenceError: If it cannot be read, or is larger.
    """
    try:
        size = path.stat().st_size
        if size > MOST_BYTES:
            raise SequenceError(
                f"{path.name}: expected {what} of at most {MOST_BYTES / 2**20:.0f} MB, found "
                f"{size / 2**20:,.0f} MB; write the tracks as CSV"
            )
        return path.read_bytes()
    except OSError as error:
        raise SequenceError(f"{path}: cannot be read ({error.strerror})") from None


_FIELDS = {
    "positions": ("x", "y", "z"),
    "existences": ("existence",),
    "sigmas": ("sigma_x", "sigma_y", "sigma_z"),
}
"""The fields that each track has in JSON, and the columns that they are."""

_OPTIONAL = (COVARIANCE, *HEIGHT)


def _json(path: Path) -> TrackFile:
    """Read tracks as ``tracks.schema.json`` has them."""
    where = path.name
    data = _limited(path, "JSON")
    try:
        file = parse_json(TracksFile, data)
    except InvalidJson as error:
        raise SequenceError(
            f"{where}{f', field {error.field}' if error.field else ''}: expected tracks as "
            f"`track -o tracks.json` writes them, but here: {error.problem}"
        ) from None
    names = [camera.name for camera in file.sequence.cameras]
    for k, track in enumerate(file.tracks):
        rows: dict[str, Any] = {name: getattr(track, name) for name in _FIELDS}
        rows |= {f"boxes.{name}": track.boxes.get(name, []) for name in names}
        rows |= {name: own for name in _OPTIONAL if (own := getattr(track, name))}
        for name, values in rows.items():
            if len(values) != len(track.frames):
                raise SequenceError(
                    f"{where}, field tracks.{k}.{name}: expected {len(track.frames)} rows as "
                    f"tracks.{k}.frames has, found {len(values)}"
                )
    tracks = [one for one in file.tracks if one.frames]

    def column(name: str) -> ndarray:
        rows = [row for track in tracks for row in getattr(track, name)]
        return np.array(rows, dtype=np.float64)

    frames = np.array([step for one in tracks for step in one.frames], dtype=np.int64)
    ids = np.array([one.id for one in tracks for _ in one.frames], dtype=np.int64)
    order = _in_order(where, frames, ids)
    columns = {"frame": frames, "time": frames / file.sequence.fps, "id": ids}
    for name, parts in _FIELDS.items():
        values = _finite(where, name, column(name)).reshape(-1, len(parts))
        columns |= dict(zip(parts, values.T, strict=True))
    for name in _OPTIONAL:
        if all(getattr(one, name) for one in tracks):
            columns[name] = column(name)
    if COVARIANCE in columns:
        _finite(where, COVARIANCE, columns[COVARIANCE])
    missing = [np.nan] * len(BOX)
    for name in names:
        boxes = [box or missing for one in tracks for box in one.boxes[name]]
        sides = np.array(boxes, dtype=np.float64).reshape(-1, len(BOX)).T
        columns |= {f"{name}_{side}": own for side, own in zip(BOX, sides, strict=True)}
    settings = {"sequence": file.sequence.name, "seed": file.run.seed, **file.run.parameters}
    return TrackFile.of_columns(
        columns,
        names,
        order,
        settings={key: str(value) for key, value in settings.items()},
        done=file.run.steps if file.run.steps < file.sequence.frames else None,
        remarks=tuple(file.run.remarks),
    )


def _finite(where: str, name: str, values: ndarray) -> ndarray:
    """Return the values.

    Raises:
        SequenceError: If some are not finite.
    """
    if not np.isfinite(values).all():
        raise SequenceError(f'{where}, "{name}": expected finite numbers, found some that are not')
    return values


def _parquet(path: Path) -> TrackFile:
    """Read the columns of the track file from a Parquet table."""
    where = path.name
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError:
        raise SequenceError(
            f"{where}: Parquet needs pyarrow, which is not installed: "
            'pip install "multiview-phd[parquet]"'
        ) from None
    data = _limited(path, "a table")
    try:
        table = pq.read_table(pa.BufferReader(data))
    except (pa.ArrowException, OSError, ValueError) as error:
        found = " ".join(str(error).split())[:100]
        raise SequenceError(
            f"{where}: expected a Parquet table, found what cannot be read as one ({found})"
        ) from None
    missing = [name for name in COLUMNS if name not in table.column_names]
    if missing:
        raise SequenceError(
            f"{where}: expected the columns {','.join(COLUMNS)}, but {', '.join(missing)} "
            f"{'is' if len(missing) == 1 else 'are'} missing"
        )

    def column(name: str) -> Float[ndarray, " N"]:
        try:
            own = table.column(name).cast(pa.float64())
        except (pa.ArrowException, KeyError):
            raise SequenceError(
                f'{where}, column "{name}": expected one column of numbers, found '
                f"{table.schema.field(name).type if name in table.column_names else 'none'}"
            ) from None
        return np.asarray(own.to_numpy(zero_copy_only=False), dtype=np.float64)

    def whole(name: str) -> Int[ndarray, " N"]:
        values: Float[ndarray, " N"] = _finite(where, name, column(name))
        if (values != np.floor(values)).any() or (np.abs(values) > 2.0**53).any():
            raise SequenceError(f'{where}, column "{name}": expected whole numbers')
        return values.astype(np.int64)

    values = {name: _finite(where, name, column(name)) for name in COLUMNS}
    values |= {"frame": whole("frame"), "id": whole("id")}
    cameras = [name.removesuffix("_left") for name in table.column_names if name.endswith("_left")]
    values |= {f"{camera}_{side}": column(f"{camera}_{side}") for camera in cameras for side in BOX}
    values |= {name: column(name) for name in _OPTIONAL if name in table.column_names}
    return TrackFile.of_columns(
        values,
        cameras,
        _in_order(where, values["frame"], values["id"]),
        settings=_facts(table.schema.metadata or {}),
    )


def _facts(metadata: dict[bytes, bytes]) -> dict[str, str]:
    """Return what the table states of its run: sequence, seed and parameters."""
    try:
        run = json.loads(metadata.get(b"multiview-phd", b"{}"))
    except ValueError:
        return {}
    if not isinstance(run, dict):
        return {}
    parameters = run.get("parameters")
    facts = dict(parameters) if isinstance(parameters, dict) else {}
    facts |= {key: run[key] for key in ("sequence", "seed") if key in run}
    return {str(key): str(value) for key, value in facts.items()}


def _places(path: Path) -> TrackFile:
    """Read places alone, as truth is read."""
    where = path.name
    _limited(path, "text")
    file = SourceFile(path)
    try:
        form, _, complaint = recognise(file)
        pieces = [] if form is None else list(form.read(file))
    except FormatError as error:
        raise SequenceError(f"{where}: {error}") from None
    truths = [piece for piece in pieces if isinstance(piece, TruthPiece)]
    if len(truths) != 1:
        found = complaint or (f"{form.NAME} without places" if form else "none of both")
        raise SequenceError(
            f"{where}: expected places in metres as `track -o tracks.trc` or the ground plane of "
            f"MOTChallenge has them, found {found}"
        )
    truth = truths[0]
    if truth.unit not in (None, "m"):
        raise SequenceError(f"{where}: expected places in metres, found them in {truth.unit}")
    frames = truth.frames - int(truth.first_index or 0)
    order = _in_order(where, frames, truth.ids)
    places = truth.positions @ Y_UP if truth.up == "y" else truth.positions
    values = dict(zip("xyz", _finite(where, "places", places).T, strict=True))
    nothing = np.full(len(order), np.nan)
    values |= {
        "frame": frames,
        "time": nothing if truth.fps is None else frames / truth.fps,
        "id": truth.ids,
        "existence": np.ones(len(order)),
        **{f"sigma_{axis}": nothing for axis in "xyz"},
    }
    return TrackFile.of_columns(values, (), order, settings={})
