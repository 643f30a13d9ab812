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
from dataclasses import asdict
from pathlib import Path, PurePosixPath

from tracker import __version__
from tracker.export import tracks_csv
from tracker.files.atomic import replacing, zip_folder
from tracker.library import columns
from tracker.library.errors import LibraryError
from tracker.library.keeping import remarks_of, rescored
from tracker.library.records import KeptRun, Result
from tracker.library.store import parameters_of
from tracker.sequences.sequence import Sequence
from tracker.sequences.writing.by_step import write_by_step

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

_APART = ("key", "digest", "machine", "final", "latest")
"""The fields of a run that stand beside the others in the description, where older programs look
for them or look over them."""

_EXPECTED = "expected a bundle as `multiview-phd bundle` writes it"


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
    listed = asdict(run)
    apart = {name: listed.pop(name) for name in _APART}
    manifest = {
        "format": FORMAT,
        "program": f"multiview-phd {__version__}",
        **apart,
        "run": listed,
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
    write_by_step(folder / FOLDER, sequence, videos=videos)


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
        listed = manifest["run"] | {one: manifest[one] for one in _APART if one in manifest}
        parameters, unknown = parameters_of(manifest["parameters"])
        return Result(
            run=KeptRun(**listed),
            place=str(folder / FOLDER),
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
