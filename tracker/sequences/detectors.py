"""The detection networks that are at hand: those that the program fetched for this user.

Each has a folder in :func:`~tracker.files.folders.detectors_folder` with the network, its licence
and a record of both. A network whose content is not the recorded one is not used.
"""

from __future__ import annotations

import errno
import hashlib
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

from tracker.files.atomic import size_of
from tracker.files.folders import detectors_folder
from tracker.files.validated import read_as, write_json
from tracker.sequences.sequence import DetectorFile

MODEL, LICENCE, RECORD = "model.onnx", "licence.txt", "detector.json"
"""Names of the files of a network."""

MOST_BYTES = 2**31
"""Largest size of a Protocol Buffers message, and so of an ONNX file, bytes."""


@dataclass(frozen=True, slots=True)
class DetectorRecord:
    """What is recorded of a fetched network."""

    name: str
    """The network's name."""
    licence: str
    """SPDX identifier of its licence."""
    source: str
    """The package that it was fetched from, with the version."""
    sha256: str
    """SHA-256 of its ONNX file."""


@dataclass(frozen=True, slots=True)
class FetchedDetector:
    """A network in the user's data folder."""

    folder: Path
    """The folder of the network."""
    record: DetectorRecord | None
    """Its record; None if that cannot be read."""
    size: int
    """Size of the ONNX file, bytes; 0 if there is none."""
    damage: str
    """Why the network cannot be used, as part of a sentence; empty if it can."""

    @property
    def path(self) -> Path:
        """The ONNX file."""
        return self.folder / MODEL

    @property
    def name(self) -> str:
        """The name by which it is listed."""
        return self.folder.name if self.record is None else self.record.name

    @property
    def file(self) -> DetectorFile:
        """The network for a sequence.

        Raises:
            ValueError: If it is damaged.
        """
        if self.record is None or self.damage:
            raise ValueError(f"the detector {self.name} {self.damage}")
        return DetectorFile(self.path, self.record.sha256[:16], self.name, named=False)


def write_record(folder: Path, name: str, licence: str, source: str) -> None:
    """Record the network that lies in a folder.

    Raises:
        OSError: If the network cannot be read or the record cannot be written.
    """
    record = DetectorRecord(name, licence, source, sha256_of(folder / MODEL))
    write_json(folder / RECORD, asdict(record))


def fetched_detector(folder: Path) -> FetchedDetector:
    """Read the network in a folder, and compare it with its record."""
    record, size = None, 0
    try:
        record = read_as(folder / RECORD, DetectorRecord)
        size = size_of(folder / MODEL)
        same = sha256_of(folder / MODEL) == record.sha256
        damage = "" if same else f"is damaged: {MODEL} has another SHA-256 than was recorded"
    except (OSError, ValueError) as error:
        words = (error.strerror if isinstance(error, OSError) else None) or str(error)
        damage = f"is damaged: its files cannot be read ({words})"
    return FetchedDetector(folder, record, size, damage)


def fetched_detectors() -> Iterator[FetchedDetector]:
    """Yield the networks in the user's data folder, damaged ones too, by name."""
    try:
        folders = sorted(p for p in detectors_folder().iterdir() if not p.name.startswith("."))
    except OSError:
        return
    yield from (fetched_detector(folder) for folder in folders if folder.is_dir())


def usable_detector() -> tuple[DetectorFile | None, str]:
    """Return the first network in the user's data folder that is not damaged, or None, and where
    there are damaged ones alone a sentence about the first."""
    damaged = ""
    for found in fetched_detectors():
        if not found.damage:
            return found.file, ""
        damaged = damaged or (
            f"{found.folder}: the detection network {found.name} {found.damage}; no network is "
            "used: fetch it again by `multiview-phd detector get`"
        )
    return None, damaged


def check_model_size(path: Path) -> None:
    """Raise unless a network can be read: a regular file of at most the size that ONNX allows.

    Raises:
        OSError: If it cannot; reading a pipe would block, and reading a large file takes long.
    """
    size = size_of(path)
    if size > MOST_BYTES:
        raise OSError(errno.EFBIG, f"it has {size >> 20:,} MB, expected at most 2,048")


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file's content, in hexadecimal digits.

    Raises:
        OSError: If it cannot be read.
    """
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
