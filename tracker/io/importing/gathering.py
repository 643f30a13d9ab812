"""Every file of what was named, and what each was taken for."""

from __future__ import annotations

import math
import os
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tracker.files.text import shown
from tracker.geometry.calibration import check_focal_lengths
from tracker.geometry.camera import Camera
from tracker.io.read.columns import decimal_points, delimiter_of
from tracker.io.read.pieces import (
    CalibrationPiece,
    DetectionPiece,
    FormatError,
    ImagesPiece,
    Piece,
    RawCamera,
    VideoPiece,
)
from tracker.io.read.protocol import Certainty, Format
from tracker.io.read.registry import recognise, unforeseen
from tracker.io.read.source import MOST_TREE_BYTES, FileOfLines, SourceFile
from tracker.sequences.fields import LARGEST_IN_MATRIX, LONGEST_NAME

MOST_FILES = 200_000
MOST_DEPTH = 8
"""Folders within each other."""

_MOST_REFUSED = 200
"""So many files alike, none of which anybody knows, speak for the rest."""

_LOOKED_AT = 50
"""Members of a series among which the one is sought that stands for all."""


_MOST_SPOILT = 0.05
"""Largest share of rows that are left out of a file that is recognised only without them."""


@dataclass(frozen=True, slots=True, eq=False)
class ParsedFiles:
    """A file, or a series of numbered files, and what it was taken for."""

    label: str
    """Path from the folder that was named; of a series that of the first, with the count."""
    format: str
    """What it was recognised as; empty where it is not used."""
    certainty: Certainty
    pieces: tuple[Piece, ...] = ()
    complaint: str = ""
    """Why it is not used, where it was recognised or begins as something known."""
    files: tuple[Path, ...] = ()
    mostly_spoilt: bool = False
    """Whether it is a table of text most rows of which cannot be read."""
    companions: tuple[Path, ...] = ()
    """Other files whose content was read with these."""
    read_with: str = ""
    """The label of the files that it was read with, where it has nothing of its own."""
    unopened: int = 0
    """The number of files that were not opened, which have no path here."""

    @property
    def count(self) -> int:
        """The number of files."""
        return len(self.files) + self.unopened


def gather(sources: Sequence[Path]) -> list[ParsedFiles]:
    """Recognise and read everything in some files and folders.

    Args:
        sources: Files, or folders that are searched with all in them.

    Returns:
        In the order of their paths. What cannot be read has its complaint and no pieces.

    Raises:
        FormatError: If a source is not there, or there are too many files.
    """
    taken: list[ParsedFiles] = []
    for source in sources:
        if not source.exists():
            raise FormatError(f"{source}: there is no such file or folder")
        root = source if source.is_dir() else source.parent
        files, strays = _walk(source, root)
        taken += strays
        crowds: dict[tuple[Path, str], _Crowd] = {}
        for series in _series(files):
            kind = (series[0].parent, series[0].suffix)
            crowd = crowds.setdefault(kind, _Crowd())
            if crowd.passes_over(series):
                continue
            found = list(_read(series, root))
            crowd.add(series, known=any(one.format for one in found))
            taken += found
        taken += [crowd.told(kind, root) for kind, crowd in crowds.items() if crowd.passed]
    readers = {path: one.label for one in taken if one.pieces for path in one.companions}
    return [replace(one, read_with=_read_with(one, readers)) for one in taken]


def _read_with(one: ParsedFiles, readers: Mapping[Path, str]) -> str:
    """The label of the files that others were read with; empty where it is not all of them."""
    labels = [readers.get(path, "") for path in one.files]
    return labels[0] if labels and all(labels) and not one.pieces and not one.complaint else ""


class _Crowd:
    """Files of one folder with one ending: once hundreds are nobody's, more of them are not opened.

    A file that is smaller or larger than all of those is something else, and is looked at.
    """

    def __init__(self) -> None:
        self.passed = 0
        """Files that were not opened."""
        self._refused = 0
        self._known = False
        self._smallest, self._largest = 0, 0

    def passes_over(self, series: tuple[Path, ...]) -> bool:
        """Whether a series need not be looked at."""
        if self._known or self._refused < _MOST_REFUSED:
            return False
        sizes = [_size(path) for path in series[:_LOOKED_AT]]
        if min(sizes) < self._smallest or max(sizes) > self._largest:
            return False
        self.passed += len(series)
        return True

    def add(self, series: tuple[Path, ...], *, known: bool) -> None:
        """Remember a series that was looked at."""
        if known:
            self._known |= self._refused < _MOST_REFUSED
            return
        sizes = [_size(path) for path in series[:_LOOKED_AT]]
        self._smallest = min([*sizes, self._smallest]) if self._refused else min(sizes)
        self._largest = max([*sizes, self._largest])
        # of a long series that nobody knows one was opened
        self._refused += len(series) if len(series) < _LOOKED_AT else 1

    def told(self, kind: tuple[Path, str], root: Path) -> ParsedFiles:
        """What is said of those that were not opened."""
        folder, suffix = kind
        where = SourceFile(folder / f"…{suffix}", root).where
        complaint = (
            f"{where}: {self._refused:,} of these files are of no format that is read, so "
            f"{self.passed:,} more of like size were not opened; name those that are wanted"
        )
        label = f"{where} ({self.passed:,})"
        return ParsedFiles(label, "", Certainty.NO, complaint=complaint, unopened=self.passed)


def walk(source: Path) -> Iterator[tuple[Path, list[str], list[str]]]:
    """Yield each folder in a folder, with the names of the files and of the folders in it.

    What is hidden, and what lies deeper than :data:`MOST_DEPTH`, is left out.
    """
    for folder, folders, names in os.walk(source):
        here = Path(folder)
        deep = len(here.relative_to(source).parts) >= MOST_DEPTH
        folders[:] = [] if deep else sorted(name for name in folders if not name.startswith("."))
        yield here, sorted(name for name in names if not name.startswith(".")), folders


def _walk(source: Path, root: Path) -> tuple[list[Path], list[ParsedFiles]]:
    """Ordinary files, and what leads out of the folder."""
    if source.is_file():
        return [source], []
    home = root.resolve()
    files: list[Path] = []
    strays: list[ParsedFiles] = []
    for here, names, folders in walk(source):
        for name in sorted([*names, *(f for f in folders if (here / f).is_symlink())]):
            path = here / name
            if path.is_symlink() and not _stays(path, home):
                strays.append(_stray(path, root, "a symbolic link leads out of the folder"))
            elif path.is_file():
                files.append(path)
            elif not path.is_dir():
                strays.append(_stray(path, root, "expected an ordinary file"))
        if len(files) > MOST_FILES:
            raise FormatError(
                f"{source}: has more than {MOST_FILES:,} files; name the folder of one recording"
            )
    return files, strays


def _stays(path: Path, home: Path) -> bool:
    try:
        return path.resolve(strict=True).is_relative_to(home)
    except (OSError, RuntimeError):  # a circle, or nothing there
        return False


def _stray(path: Path, root: Path, why: str) -> ParsedFiles:
    where = SourceFile(path, root).where
    return ParsedFiles(where, "", Certainty.NO, complaint=f"{where}: {why}", unopened=1)


def _series(files: Sequence[Path]) -> Iterator[tuple[Path, ...]]:
    """Files of a folder whose names differ in one number, the one that differs most."""
    groups: dict[tuple[object, ...], list[tuple[tuple[str, ...], Path]]] = {}
    for path in files:
        words = re.split(r"(\d+)", path.name)
        key = (path.parent, *words[::2])
        groups.setdefault(key, []).append((tuple(words[1::2]), path))
    for members in groups.values():
        numbers = [numbers for numbers, _ in members]
        kinds = [len(set(column)) for column in zip(*numbers, strict=True)]
        if not kinds:
            yield from ((path,) for _, path in members)
            continue
        # of numbers that differ as much, the last
        at = max(range(len(kinds)), key=lambda place: (kinds[place], place))
        by_rest: dict[tuple[str, ...], list[tuple[int, Path]]] = {}
        for own, path in members:
            by_rest.setdefault((*own[:at], *own[at + 1 :]), []).append((int(own[at]), path))
        for row in by_rest.values():
            yield tuple(path for _, path in sorted(row))


def _read(series: tuple[Path, ...], root: Path) -> Iterator[ParsedFiles]:
    largest = max(series[:_LOOKED_AT], key=_size)
    file = SourceFile(largest, root, series)
    found, certainty, complaint = _recognise(file)
    if found is not None and found.SERIES and len(series) > 1:
        yield from _series_pieces(found, certainty, file, root)
        return
    for path in series if found is not None or len(series) < _LOOKED_AT else ():
        own = SourceFile(path, root)
        if len(series) > 1:  # else it is the one that was just looked at
            found, certainty, complaint = _recognise(own)
        if found is not None:
            taken = _pieces(found, certainty, own, own.where)
        else:
            taken = ParsedFiles(own.where, "", Certainty.NO, complaint=complaint, files=(path,))
        yield taken if taken.pieces else _without_spoilt_rows(own, taken)
    if found is None and len(series) >= _LOOKED_AT:
        label = _label(series, root)
        yield ParsedFiles(label, "", Certainty.NO, complaint=complaint, files=series)


def _label(series: Sequence[Path], root: Path) -> str:
    """What a series is called: its first file, and how many there are."""
    return f"{SourceFile(series[0], root).where} … ({len(series)})"


def _without_spoilt_rows(file: SourceFile, taken: ParsedFiles) -> ParsedFiles:
    """The boxes of a table without its rows that cannot be read, which are summed up in a note.

    Args:
        file: The file.
        taken: What is used where it is no such table, or most of it cannot be read.
    """
    most = 0.5 if taken.format else _MOST_SPOILT
    try:
        rows = readable_rows(file, most)
        if rows is None:
            return replace(taken, mostly_spoilt=bool(taken.format) and is_table(file))
        own = FileOfLines(file, rows.lines)
        found, certainty, _ = _recognise(own)
    except FormatError:
        return taken
    if found is None or (taken.format and found.NAME != taken.format):
        return taken
    mended = _pieces(found, certainty, own, own.where)
    pieces = [
        replace(piece, left_out=" ".join(filter(None, (rows.left_out, piece.left_out))))
        for piece in mended.pieces
        if isinstance(piece, DetectionPiece)
    ]
    whole = len(pieces) == len(mended.pieces) > 0
    return replace(mended, pieces=tuple(pieces)) if whole else taken


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError:
        return 0


def _recognise(file: SourceFile) -> tuple[Format | None, Certainty, str]:
    try:
        with np.errstate(all="ignore"):
            found, certainty, complaint = recognise(file)
        return found, certainty, "" if complaint is None else str(complaint)
    except (FormatError, OSError) as error:
        return None, Certainty.NO, str(error)


def _series_pieces(
    found: Format, certainty: Certainty, file: SourceFile, root: Path
) -> Iterator[ParsedFiles]:
    """A series; without those of its files that cannot be read by themselves, also without some
    of their rows, each told.

    Where these are more than half of the files, the rest is not used either.
    """
    series = file.series
    label = _label(series, root)
    taken = _pieces(found, certainty, file, label)
    if not taken.complaint:
        yield taken
        return
    alone = [SourceFile(path, root) for path in series]
    each = [_pieces(found, certainty, one, one.where) for one in alone]
    whole = tuple(path for path, one in zip(series, each, strict=True) if not one.complaint)
    tried = [
        _without_spoilt_rows(one, own)
        for one, own in zip(alone, each, strict=True)
        if own.complaint
    ]
    mended = [one for one in tried if one.pieces]
    spoilt = [one for one in tried if not one.pieces]
    if mended and len(spoilt) <= len(whole) + len(mended):
        yield from (*mended, *spoilt)
    elif not whole or not 0 < len(spoilt) <= _LOOKED_AT:
        yield taken
        return
    elif len(spoilt) > len(whole):
        share = f"{len(spoilt)} of {len(series)} files cannot be read, so the others are not used"
        yield replace(taken, complaint=f"{label}: {share}; {spoilt[0].complaint}")
        return
    else:
        yield from spoilt
    if whole:
        file = SourceFile(whole[0], root, whole)
        yield _pieces(found, certainty, file, _label(whole, root))


def _pieces(found: Format, certainty: Certainty, file: SourceFile, label: str) -> ParsedFiles:
    try:
        with np.errstate(all="ignore"):  # what overflows is infinite, and refused by its reader
            pieces = tuple(found.read(file))
            for piece in pieces:
                if isinstance(piece, CalibrationPiece):
                    check_cameras(file, piece)
    except Exception as error:  # or a field of a kind that the reader does not foresee
        told = error if isinstance(error, FormatError) else unforeseen(file, found, error)
        return ParsedFiles(label, found.NAME, certainty, complaint=str(told), files=file.series)
    companions = tuple(dict.fromkeys(file.companions))
    return ParsedFiles(
        label, found.NAME, certainty, pieces, files=file.series, companions=companions
    )


def check_cameras(file: SourceFile, piece: CalibrationPiece) -> None:
    """Refuse cameras whose numbers are none of a lens or of a place.

    Raises:
        FormatError: Naming the camera and the field.
    """
    for place, camera in enumerate(piece.cameras):
        if len(camera.name) > LONGEST_NAME:
            raise file.error(
                f"expected a name of at most {LONGEST_NAME} characters, found "
                f"{len(camera.name):,}; shorten it",
                f"camera {place + 1}",
            )
        _check_lens(file, camera)
        _check_pose(file, camera)


def _check_lens(file: SourceFile, camera: RawCamera) -> None:
    try:
        if camera.intrinsics is not None:
            check_focal_lengths(camera.intrinsics)
    except ValueError as error:
        raise file.error(str(error), f"{camera.name} K".strip()) from None


def _check_pose(file: SourceFile, camera: RawCamera) -> None:
    for field, values in (
        ("rotation", camera.rotation),
        ("translation", camera.translation),
        ("projection", camera.projection),
    ):
        if values is not None and not np.abs(values).max() <= LARGEST_IN_MATRIX:
            raise file.error(
                f"expected numbers of at most {LARGEST_IN_MATRIX:g}, "
                f"found {shown(np.asarray(values).tolist())}",
                f"{camera.name} {field}".strip(),
            )
    if camera.projection is not None:
        try:
            Camera.from_projection(camera.name, (1, 1), camera.projection)
        except (ValueError, np.linalg.LinAlgError) as error:
            raise file.error(str(error), f"{camera.name} projection".strip()) from None


_FEWEST = 10
"""Fewest rows by which it is judged what a row is."""

_MOSTLY = 0.9
"""Share of a column's cells that are numbers where the column is one of numbers."""

_LARGEST = 2.0**53
"""Largest number, beyond which whole numbers are not exact."""


@dataclass(frozen=True, slots=True)
class ReadableRows:
    """A table without the rows that cannot be read."""

    lines: list[str]
    """The other lines, the header included."""
    left_out: str
    """A sentence about the rows that are left out."""


def readable_rows(file: SourceFile, most: float) -> ReadableRows | None:
    """Leave out the rows of a text table that are not like its others.

    These are rows with another count of cells than most, or without a number in a column that is
    one of numbers: 90 % of its cells are.

    Args:
        file: The file.
        most: Largest share of rows that may be left out.

    Returns:
        The rows; None if the file is no table, or none of its rows or too many are unlike.

    Raises:
        FormatError: If the file cannot be read as text.
    """
    if not is_table(file):
        return None
    lines = file.lines()
    rows = [k for k, line in enumerate(lines) if line.strip() and not line.startswith("#")]
    if not rows:
        return None
    cells = {k: _cells(lines[k]) for k in rows}
    if any(_number(cell) is None for cell in cells[rows[0]]):  # names of columns
        rows = rows[1:]
    if len(rows) < _FEWEST:
        return None
    width = Counter(len(cells[k]) for k in rows).most_common(1)[0][0]
    table = {k: [_number(cell) for cell in cells[k]] for k in rows if len(cells[k]) == width}
    numbers = np.array([[value is not None for value in row] for row in table.values()])
    finite = np.array(
        [[value is not None and math.isfinite(value) for value in row] for row in table.values()]
    )
    fits = np.where(finite.mean(axis=0) >= _MOSTLY, finite, numbers)
    fits = (fits | (numbers.mean(axis=0) < _MOSTLY)).all(axis=1)
    good = {k for k, own in zip(table, fits, strict=True) if own}
    spoilt = [k for k in rows if k not in good]
    if not 0 < len(spoilt) <= most * len(rows):
        return None
    count = f"{len(spoilt)} of {len(rows)} rows ({100.0 * len(spoilt) / len(rows):.2g} %)"
    first = spoilt[0]
    return ReadableRows(
        [line for k, line in enumerate(lines) if k not in set(spoilt)],
        f"{file.where}: {count} cannot be read and are left out, the first in line {first + 1}: "
        f"{shown(lines[first])}.",
    )


def is_table(file: SourceFile) -> bool:
    """Whether a file is text of rows rather than a tree, and not too large to look at each row."""
    return (
        file.is_text
        and file.size <= MOST_TREE_BYTES
        and file.head_text.lstrip()[:1] not in ("[", "{", "<")
    )


def _cells(line: str) -> list[str]:
    line = decimal_points(line)
    delimiter = delimiter_of(line)
    return [cell.strip() for cell in (line.split(delimiter) if delimiter in line else line.split())]


def _number(cell: str) -> float | None:
    """Return the number of a cell, infinite where it is too large; None for none."""
    try:
        value = float(cell.replace(",", ".").strip('"'))
    except ValueError:
        return None
    return value if abs(value) <= _LARGEST else math.inf


_UNKNOWN = "no format that is read"


@dataclass(frozen=True, slots=True, eq=False)
class FileUse:
    """A file, or a series of numbered ones, and how many of them are used."""

    files: ParsedFiles
    used: int
    """The number of files that are used, at most :attr:`ParsedFiles.count`."""
    why: str
    """Why not all are used; empty where all are, and where sentences on the cameras say it."""


def file_uses(taken: Sequence[ParsedFiles], sources: frozenset[Path] | None) -> list[FileUse]:
    """Judge all files.

    A file whose content was read with another one's is used where that one is.

    Args:
        taken: All files.
        sources: The files that the recording is made of; None while that is not known, when all
            that were read count.
    """
    used = {one.label: _used(one, sources) for one in taken}
    found = []
    for one in taken:
        count = one.count if one.read_with and used.get(one.read_with) else used[one.label]
        why = "" if count == one.count or one.pieces else one.complaint or _UNKNOWN
        found.append(FileUse(one, count, why))
    return found


def _used(one: ParsedFiles, sources: frozenset[Path] | None) -> int:
    if not one.pieces:
        return 0
    if sources is None:
        return one.count
    own: set[Path] = set()
    for piece in one.pieces:
        if isinstance(piece, ImagesPiece):
            own.update(piece.files)
        else:
            own.add(piece.path if isinstance(piece, VideoPiece) else piece.source)
    there = own & sources
    # of a series that is read as a whole the pieces name a file or two
    return len(there) if len(own) == one.count else one.count * bool(there)
