"""A bundle: one run with its recording, tracks, parameters and report in one portable ZIP file.

``run.json`` describes the run; ``tracks.bin`` has the tracks as the library stores them, and
``tracks.csv`` has them for other programs; ``sequence/`` is an ordinary sequence folder. Its
videos, if they are included, have the picture of step k as frame k, in full size and at a low bit
rate.
"""

from __future__ import annotations

import json
import shutil
import stat
import tempfile
import zipfile
import zlib
from fractions import Fraction
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from tracker import __version__
from tracker.export import tracks_csv
from tracker.files.atomic import replacing, zip_folder
from tracker.library import columns
from tracker.library.errors import LibraryError
from tracker.library.keeping import remarks_of, rescored
from tracker.library.records import KeptRun, Result
from tracker.library.store import parameters_of
from tracker.sequences.clock import FIELDS as CLOCK
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence

FORMAT = 1
"""The version of the format of a bundle."""

MANIFEST, TRACKS, FOLDER = "run.json", "tracks.bin", "sequence"
"""The names of the description, the tracks and the sequence folder in a bundle."""

MOST_FILES = 10_000
"""Largest number of files of a bundle."""

MOST_BYTES = 8 << 30
"""Largest size of an unpacked archive, bytes, since the contents of a small archive may be larger
than any disk."""

_UNREADABLE = (
    OSError, ValueError, KeyError, TypeError, AttributeError, EOFError, NotImplementedError,
    RuntimeError, zipfile.BadZipFile, zlib.error,
)  # fmt: skip
"""The exceptions that reading raises for a file that is no archive, or is damaged or encrypted."""

_EXPECTED = "expected a bundle as `multiview-phd bundle` writes it"
_QUALITY = {"preset": "veryfast", "crf": "32"}
"""The options of the encoder libx264."""
_REPLACED = ("video", "images", "first_frame", "background", "detections",
         "detections_first_frame", "detected_steps", "appearance", *CLOCK)  # fmt: skip
"""The fields of a camera that are written anew, since the files of a bundle are indexed by step;
all others, such as the calibration, are copied."""


def write_bundle(path: Path, result: Result, sequence: Sequence, *, videos: bool = False) -> None:
    """Write a bundle atomically.

    Args:
        path: The ``.zip`` file to write; an existing one is replaced.
        result: The run.
        sequence: The run's recording.
        videos: Whether the videos are included.

    Raises:
        OSError: If the file cannot be written; the message says why.
    """
    with replacing(path) as temporary, tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _fill(folder, result, sequence, videos)
        zip_folder(folder, temporary)


def _fill(folder: Path, result: Result, sequence: Sequence, videos: bool) -> None:
    """Write the files of a bundle into a folder."""
    evaluation = None
    if sequence.ground_truth is not None:
        from tracker.evaluation import evaluate_sequence

        evaluation = evaluate_sequence(sequence, result.kept.tracks, steps=result.run.steps)
        if result.run.provisional and evaluation.steps == sequence.frames:
            result = rescored(result, evaluation)
    run = result.run
    listed = run._asdict()
    manifest = {
        "format": FORMAT,
        "program": f"multiview-phd {__version__}",
        "final": bool(listed.pop("final")),  # older programs do not know this field of a run
        "run": listed,
        "key": result.key,
        "digest": result.digest,
        "machine": result.machine,
        "parameters": result.values,
        "figures": result.figures,
        "corrections": result.corrections,
    }
    text = json.dumps(manifest, indent=1, ensure_ascii=False)
    (folder / MANIFEST).write_text(text, encoding="utf-8")
    (folder / TRACKS).write_bytes(columns.pack(result.kept))
    tracks = result.kept.tracks
    with (folder / "tracks.csv").open("w", encoding="utf-8", newline="") as stream:
        tracks_csv.write_tracks_csv(
            stream, sequence, tracks, result.parameters, run.seed, remarks=remarks_of(result)
        )
    if evaluation is not None:
        from tracker.evaluation.report.page import report_html  # imports plotly

        report = report_html(sequence, tracks, result.parameters, evaluation, seed=run.seed)
        (folder / "report.html").write_text(report, encoding="utf-8")
    _write_sequence(folder / FOLDER, sequence, videos)


def _write_sequence(folder: Path, sequence: Sequence, videos: bool) -> None:
    """Write the recording as a sequence folder in which all files are indexed by step."""
    import tomlkit

    folder.mkdir()
    text = (sequence.folder / "sequence.toml").read_text(encoding="utf-8-sig")
    document = tomlkit.parse(text).unwrap()
    document |= {"name": sequence.name, "fps": sequence.fps, "frames": sequence.frames}
    room = sequence.room
    document["room"] = {
        "min": room.minimum.tolist(),
        "max": room.maximum.tolist(),
        "entrances": [
            {"position": e.position.tolist(), "sigma": e.sigma.tolist()} for e in room.entrances
        ],
    }
    document["target"] = {"half_extents": sequence.target_half_extents.tolist()}
    cameras: list[dict[str, Any]] = []
    for index, (view, original) in enumerate(zip(sequence.views, document["camera"], strict=True)):
        camera = {name: value for name, value in original.items() if name not in _REPLACED}
        camera["image_size"] = list(view.camera.image_size)
        if view.detections is not None:
            camera["detections"] = f"camera{index + 1}.csv"
            boxes = view.detections
            rows = np.column_stack([boxes.frames, boxes.boxes, boxes.scores]).tolist()
            vectors = boxes.embeddings
            lines = [f"{int(row[0])}," + ",".join(f"{v:.9g}" for v in row[1:]) for row in rows]
            # steps at which the detector ran and found no box are listed too
            if view.detector_ran is not None:
                camera["detected_steps"] = "listed"
                empty = np.setdiff1d(np.flatnonzero(view.detector_ran), boxes.frames)
                lines += [f"{step},,,,," for step in empty.tolist()]
                vectors = np.pad(vectors, ((0, len(empty) if vectors.shape[1] else 0), (0, 0)))
            if vectors.shape[1]:
                camera["appearance"] = f"camera{index + 1}.npy"
                np.save(folder / camera["appearance"], vectors)
            _write_csv(folder / camera["detections"], "frame,left,top,width,height,score", lines)
        if videos and view.has_pictures:
            camera["video"] = f"camera{index + 1}.mp4"
            _write_video(folder / camera["video"], sequence, index)
            if isinstance(view.background, range):
                camera["background"] = [view.background[0], view.background[-1]]
            elif view.background is not None:
                camera["background"] = f"camera{index + 1}-empty{view.background.suffix}"
                shutil.copyfile(view.background, folder / camera["background"])
        cameras.append(camera)
    document["camera"] = cameras
    if not videos:
        document.pop("template", None)
    document.pop("ground_truth", None)
    truth = sequence.ground_truth
    if truth is not None:
        document["ground_truth"] = {"file": "truth.csv"}
        rows = zip(
            truth.frames.tolist(), truth.ids.tolist(), truth.positions.tolist(),
            truth.valid.astype(int).tolist(), strict=True,
        )  # fmt: skip
        _write_csv(
            folder / "truth.csv", "frame,id,x,y,z,valid",
            (f"{f},{n}," + ",".join(f"{v:.9g}" for v in p) + f",{ok}" for f, n, p, ok in rows),
        )  # fmt: skip
    (folder / "sequence.toml").write_text(tomlkit.dumps(document), encoding="utf-8")


def _write_csv(path: Path, head: str, rows: Any) -> None:
    """Write a table from its first line and all others."""
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write(head + "\n")
        file.writelines(row + "\n" for row in rows)


def _write_video(path: Path, sequence: Sequence, camera: int) -> None:
    """Write the pictures of the camera with an index as a video, black where a picture is
    missing."""
    import av

    width, height = sequence.views[camera].camera.image_size
    even = (width + width % 2, height + height % 2)
    with FrameReader(sequence) as reader, av.open(str(path), "w", format="mp4") as file:
        rate = Fraction(sequence.fps).limit_denominator(1000)
        stream = file.add_stream("libx264", rate=rate, options=_QUALITY)
        stream.width, stream.height = width, height
        # chroma at half resolution (4:2:0), which players expect, needs even sizes
        stream.pix_fmt = "yuv420p" if even == (width, height) else "yuv444p"
        nothing = np.zeros((height, width, 3), dtype=np.uint8)
        for picture in reader.iterate(camera):
            shown = nothing if picture is None else np.ascontiguousarray(picture)
            file.mux(stream.encode(av.VideoFrame.from_ndarray(shown, format="bgr24")))
        file.mux(stream.encode())


def unpack_bundle(path: Path, folder: Path) -> Result:
    """Unpack a bundle into an empty folder, and read its run.

    No file is written outside the folder, whatever names the archive contains.

    Args:
        path: A bundle, as :func:`write_bundle` writes it.
        folder: The folder to unpack to.

    Raises:
        LibraryError: If the file is no bundle, is damaged or of a newer version, or contains names
            that lead out of the folder.
    """
    try:
        if path.exists() and not path.is_file():  # reading a pipe would block
            raise LibraryError(f"{path}: {_EXPECTED}, found a folder, pipe or device")
        with zipfile.ZipFile(path) as archive:
            _check_names(path, archive)
            if MANIFEST not in archive.namelist():
                raise LibraryError(f"{path}: {_EXPECTED}, found an archive without {MANIFEST}")
            archive.extractall(folder)
        manifest = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
        if manifest["format"] != FORMAT:
            raise LibraryError(
                f"{path}: expected a bundle of format {FORMAT}, found {manifest['format']!r}; "
                "update the program"
            )
        run = KeptRun(**manifest["run"], final=int(manifest.get("final", False)))
        parameters, unknown = parameters_of(manifest["parameters"])
        return Result(
            run=run,
            place=str(folder / FOLDER),
            key=str(manifest["key"]),
            digest=str(manifest["digest"]),
            machine=str(manifest["machine"]),
            parameters=parameters,
            unknown=unknown,
            values=manifest["parameters"],
            figures=manifest["figures"],
            kept=columns.unpack((folder / TRACKS).read_bytes()),
            corrections=tuple(manifest.get("corrections", ())),
        )
    except LibraryError:
        raise
    except _UNREADABLE as error:
        shutil.rmtree(folder, ignore_errors=True)
        why = error.strerror if isinstance(error, OSError) else error
        raise LibraryError(f"{path}: {_EXPECTED}, found none ({why})") from None


def _check_names(path: Path, archive: zipfile.ZipFile) -> None:
    """Check the number, the size and the names of an archive's files.

    Raises:
        LibraryError: If they are too many or too large, or a name leads out of the folder.
    """
    entries = archive.infolist()
    if len(entries) > MOST_FILES or sum(entry.file_size for entry in entries) > MOST_BYTES:
        raise LibraryError(
            f"{path}: expected at most {MOST_FILES} files of {MOST_BYTES >> 30} GiB together, "
            f"found {len(entries)} of {sum(entry.file_size for entry in entries) / 2**30:.1f} GiB"
        )
    for entry in entries:
        name = entry.filename.replace("\\", "/")
        place = PurePosixPath(name)
        is_link = stat.S_ISLNK(entry.external_attr >> 16)
        if place.is_absolute() or ".." in place.parts or ":" in name or is_link:
            raise LibraryError(
                f"{path}: {entry.filename!r} leads out of its folder; nothing was unpacked"
            )
