"""The tables of a sequence folder: boxes of an outside detector, their appearance vectors, and the
ground truth; as they are read, and as they are written."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Float16, Int
from numpy import ndarray

from tracker.files.atomic import write_whole
from tracker.files.text import shown
from tracker.geometry.consistency.odds import DECISIVE
from tracker.sequences.clock import Clock
from tracker.sequences.csv_columns import Columns, read_columns
from tracker.sequences.errors import SequenceError
from tracker.sequences.fields import SMALLEST, Fields
from tracker.sequences.pictures.media import locate
from tracker.sequences.sequence import Detections, GroundTruth

BOX = ("left", "top", "width", "height")

MOST_BOXES = 1000
"""Most boxes of a camera at a step; detectors find fewer, and the number of pairs of boxes of two
cameras is the product."""

KNOWN_STEPS = "steps"
"""The key of the comment that states which steps a truth covers: ``# steps = 0-99 150-300``."""

LONGEST = 4096
"""Largest length of an appearance vector; re-identification networks give 128 to 2048 numbers."""

_AT_ONCE = 4096
"""The number of rows that are held in memory in full precision."""


@dataclass(slots=True)
class OpenedFiles:
    """The files that were opened while a sequence is read, and the warnings on them."""

    folder: Path
    """The folder of the sequence."""
    files: list[Path] = field(default_factory=list)
    """Every file that sequence.toml names, in its order."""
    warnings: list[str] = field(default_factory=list)
    """Sentences on problems that do not prevent tracking."""

    def columns(
        self,
        path: Path,
        *,
        needed: tuple[str, ...],
        optional: Mapping[str, float],
        blank: tuple[str, ...] = (),
    ) -> Columns:
        """Read a table, and add it to the files."""
        self.files.append(path)
        where = f"{self.folder.name}/{path.relative_to(self.folder).as_posix()}"
        return read_columns(path, where, needed=needed, optional=optional, blank=blank)


@dataclass(frozen=True, slots=True, eq=False)
class BoxTable:
    """A file of boxes, before the step of each frame is known."""

    columns: Columns
    """The columns of the file."""
    first: int
    """The number in the column ``frame`` of the first picture."""
    listed: bool
    """Whether the file lists the frames on which the detector was run; if not, it was run on
    all."""
    file_starts: int
    """The frame of the camera's video or image list that is the first picture."""
    embeddings: Float16[ndarray, "N A"]
    """The appearance vector of each row's box; of shape (0, 0) if there is no such file."""

    @property
    def steps(self) -> int:
        """The least number of steps, if each frame is a step."""
        frames = self.columns.values["frame"]
        return int(frames.max()) - self.first + 1 if len(frames) else 0

    @property
    def is_box(self) -> Bool[ndarray, " N"]:
        """Whether each row has a box; a row without one states that the detector was run."""
        return np.asarray(~np.isnan(self.columns.stacked(*BOX)).all(axis=1))

    def detections(
        self, steps: int, clock: Clock | None
    ) -> tuple[Detections, Bool[ndarray, " F"] | None]:
        """Return the boxes by step, and whether the detector was run at each step.

        The second value is None if the detector was run at every step.

        Args:
            steps: The number of steps.
            clock: The camera's clock; None if each frame is a step.

        Raises:
            SequenceError: If a row is outside the recording, or has no valid box.
        """
        columns = self.columns
        if clock is None:
            self._check_counting(steps)
            last = self.first + steps - 1
            meaning = "the step" if self.first == 0 else "detections_first_frame + the step"
            of_row = columns.whole("frame", self.first, last, meaning) - self.first
        else:
            counted = columns.whole("frame", self.first, None, "the frame of the file")
            of_row = clock.steps_of(counted - self.first + self.file_starts)
        is_box = self.is_box
        for name in (*BOX, "score"):
            empty = is_box & np.isnan(columns.values[name])
            if empty.any():
                line = int(columns.lines[np.argmax(empty)])
                raise columns.error(line, name, "expected a number, found an empty cell")
        for name in ("width", "height"):
            columns.require(name, ~is_box | (columns.values[name] > 0.0), "a size above 0 pixels")
            columns.require(
                name,
                ~is_box | (columns.values[name] >= SMALLEST),
                f"a size of at least {SMALLEST:g} pixels",
            )
        scores = columns.values["score"]
        within = (scores >= 0.0) & (scores <= 1.0)
        columns.require("score", ~is_box | within, "a score from 0 to 1")
        detector_ran = self._detector_ran(steps, clock, of_row)
        kept = np.flatnonzero(is_box & (of_row >= 0))
        kept = kept[np.argsort(of_row[kept], kind="stable")]
        counts = np.bincount(of_row[kept], minlength=1)
        if counts.max() > MOST_BOXES:
            step = int(np.argmax(counts))
            last = kept[np.searchsorted(of_row[kept], step) + MOST_BOXES]
            raise columns.error(
                int(columns.lines[last]),
                "frame",
                f"expected at most {MOST_BOXES:,} boxes at a step, found {int(counts[step]):,} at "
                f"step {step}; leave out those with low scores",
            )
        boxes: Float[ndarray, "D 4"] = columns.stacked(*BOX)[kept]
        embeddings = self.embeddings[kept] if self.embeddings.shape[1] else self.embeddings
        return Detections(of_row[kept], boxes, scores[kept], embeddings), detector_ran

    def _detector_ran(
        self, steps: int, clock: Clock | None, of_row: Int[ndarray, " N"]
    ) -> Bool[ndarray, " F"] | None:
        """Whether the detector was run at each step; None if at every step.

        Args:
            steps: The number of steps.
            clock: The camera's clock; None if each frame is a step.
            of_row: The step of each row, -1 for a frame without a step.
        """
        if not self.listed:
            return None if clock is None else np.asarray(clock.frame_of_step >= 0)
        detector_ran = np.zeros(steps, dtype=bool)
        detector_ran[of_row[of_row >= 0]] = True
        return detector_ran

    def _check_counting(self, steps: int) -> None:
        """Raise an error with the remedy if the file counts its frames from 1 instead of 0."""
        frames = self.columns.values["frame"]
        if self.first == 0 and len(frames) and frames.min() == 1 and frames.max() == steps:
            row = int(np.argmax(frames))
            raise self.columns.error(
                int(self.columns.lines[row]),
                "frame",
                f"expected a step from 0 to {steps - 1}, found 1 to {steps}: its frames are "
                "counted from 1; write detections_first_frame = 1 for this camera (when importing: "
                "--first-index 1)",
            )


def read_box_table(fields: Fields, reading: OpenedFiles, file_starts: int) -> BoxTable | None:
    """Read the file of boxes that ``detections`` names; None if there is none.

    Args:
        fields: The table of the camera.
        reading: The files and warnings so far.
        file_starts: The frame of the camera's video or image list that is the first picture.

    Raises:
        SequenceError: If the file cannot be read.
    """
    if "detections" not in fields:
        for name in ("detections_first_frame", "detected_steps", "appearance"):
            if name in fields:
                raise fields.error(name, "has no meaning without detections; remove it")
        return None
    path = locate(reading.folder, fields, "detections")
    columns = reading.columns(
        path,
        needed=("frame", *BOX),
        optional={"score": 1.0},
        blank=(*BOX, "score"),
    )
    steps = fields.text("detected_steps", "all")
    if steps not in ("all", "listed"):
        raise fields.error("detected_steps", f'expected "all" or "listed", found "{steps}"')
    first = fields.integer("detections_first_frame", 0)
    embeddings = np.zeros((0, 0), dtype=np.float16)
    if "appearance" in fields:
        file = locate(reading.folder, fields, "appearance")
        reading.files.append(file)
        embeddings = read_embeddings(file, fields, path.name, len(columns))
    return BoxTable(columns, first, steps == "listed", file_starts, embeddings)


def read_embeddings(path: Path, fields: Fields, boxes: str, rows: int) -> Float16[ndarray, "N A"]:
    """Read the appearance vectors of a table's boxes, a NumPy file beside the table.

    Args:
        path: The ``.npy`` file.
        fields: The fields of the camera whose ``appearance`` names the file.
        boxes: The table's name, for messages.
        rows: The number of the table's rows.

    Returns:
        A unit vector for each row; a zero vector, which means that nothing is known, stays zero.

    Raises:
        SequenceError: If the file is not such an array, or contains values that are not finite.
    """

    def wrong(problem: str) -> SequenceError:
        return fields.error("appearance", f'"{path.name}": {problem}')

    try:
        values = np.lib.format.open_memmap(path, mode="r")
    except (OSError, ValueError, EOFError, TypeError, SyntaxError, MemoryError, OverflowError):
        raise wrong(
            "expected an array of numbers in NumPy's format .npy, found none; write it with "
            "numpy.save"
        ) from None
    if values.ndim != 2 or values.dtype.kind != "f" or values.dtype.itemsize > 8:
        size = " × ".join(map(str, values.shape)) or "one number"
        raise wrong(
            "expected a table of floating-point numbers, rows × length of a vector, found "
            f"{size} of {shown(str(values.dtype))}; convert it"
        )
    if len(values) != rows:
        raise wrong(
            f'expected a row for each of the {rows:,} rows of "{boxes}", found {len(values):,}; '
            "write both in one order"
        )
    if not 1 <= values.shape[1] <= LONGEST:
        raise wrong(
            f"expected vectors of 1 to {LONGEST:,} numbers, found {values.shape[1]:,}; shorten them"
        )
    units = np.zeros(values.shape, dtype=np.float16)
    for first in range(0, rows, _AT_ONCE):
        some = np.array(values[first : first + _AT_ONCE], dtype=np.float64)
        bad = ~np.isfinite(some).all(axis=1)
        if bad.any():
            raise wrong(
                f"expected numbers, found one that is none in row {first + int(np.argmax(bad))} "
                "(counted from 0); write zeros where nothing is known of a box"
            )
        largest = np.abs(some).max(axis=1, keepdims=True)
        some /= np.where(largest > 0.0, largest, 1.0)  # else the squares may overflow
        lengths = np.linalg.norm(some, axis=1, keepdims=True)
        units[first : first + _AT_ONCE] = some / np.where(lengths > 0.0, lengths, 1.0)
    return units


def read_ground_truth(fields: Fields, reading: OpenedFiles, frames: int) -> GroundTruth | None:
    """Read the file that ``[ground_truth]`` names; None if there is none.

    Raises:
        SequenceError: If the file cannot be read.
    """
    table = fields.table("ground_truth", ("file",), needed=False)
    if table is None:
        return None
    path = locate(reading.folder, table, "file")
    reading.files.append(path)
    return truth_of(
        path, f"{reading.folder.name}/{path.relative_to(reading.folder).as_posix()}", frames
    )


def truth_of(path: Path, where: str, frames: int, notes: list[str] | None = None) -> GroundTruth:
    """Read a file of ground truth.

    Args:
        path: A table with the columns ``frame, id, x, y, z`` and optionally ``valid``. A comment
            before the header may state which steps it covers; see :data:`KNOWN_STEPS`. Else it
            covers all, or every second, third … one where it has rows of these alone.
        where: The file's name, for messages.
        frames: The number of steps of the sequence.
        notes: Receives a sentence on rows of later steps, which are left out; without it such a row
            is an error.

    Raises:
        SequenceError: If the file cannot be read, or all of its rows are of later steps.
    """
    columns = read_columns(
        path, where, needed=("frame", "id", "x", "y", "z"), optional={"valid": 1.0}
    )
    steps = columns.whole("frame", 0, frames - 1 if notes is None else None, "the step")
    ids = columns.whole("id", 0, None, "the person")
    valid = columns.whole("valid", 0, 1, "1 certain, 0 not")
    order = columns.one_row_each(steps, ids, "person")
    positions = columns.stacked("x", "y", "z")
    known = _known_steps(path, where, frames)
    if known is None:
        known = covered_steps(steps, frames)
    order = order[steps[order] < frames]
    if notes is not None and len(order) < len(steps):
        if not len(order):
            raise columns.error(
                int(columns.lines[0]),
                "frame",
                f"expected steps 0 … {frames - 1} as the sequence has them, found none below "
                f"{int(steps.min())}; name the truth of this recording",
            )
        notes.append(
            f"{where}: {len(steps) - len(order):,} of {len(steps):,} rows are left out: of steps "
            f"after {frames - 1}, the sequence's last."
        )
    return GroundTruth(steps[order], ids[order], positions[order], valid[order] == 1, known)


def regular_gap(frames: Int[ndarray, " G"], *others: Int[ndarray, " H"]) -> int:
    """The gap between the frames of rows, if these are every second, third … frame, else 1.

    A frame without a row may be one in which nobody was; frames between which there never is a row
    are those that nobody looked at. Of n frames at random the first two make any gap g, and the
    others are as far apart by chance with the probability g⁻⁽ⁿ⁻²⁾: a gap is decided at 1000 : 1.

    Args:
        frames: With rows, in any order.
        others: Frames with rows of other files, which count where their gap is the same.
    """
    gap, odds = _gap(frames)
    if gap == 1:
        return 1
    odds += sum(more for other, more in map(_gap, others) if other == gap)
    return gap if odds >= DECISIVE else 1


def _gap(frames: Int[ndarray, " G"]) -> tuple[int, float]:
    """The greatest common divisor of the differences of frames, and its log odds."""
    distinct = np.unique(frames)
    if len(distinct) < 3:
        return 1, 0.0
    gap = int(np.gcd.reduce(np.diff(distinct)))
    return gap, (len(distinct) - 2) * math.log(gap)


def covered_steps(frames: Int[ndarray, " G"], steps: int) -> Bool[ndarray, " F"] | None:
    """The steps that the rows of a truth cover by their regular gap; None if these are all."""
    gap = regular_gap(frames)
    if gap == 1:
        return None
    covered = np.zeros(steps, dtype=bool)
    covered[int(frames.min()) % gap :: gap] = True
    return covered


def _known_steps(path: Path, where: str, frames: int) -> Bool[ndarray, " F"] | None:
    """Return the steps at which the detector ran, as the comment lines of a file list them; None
    if they do not."""
    with path.open(encoding="utf-8-sig", errors="replace") as stream:
        for number, line in enumerate(stream, 1):
            if line.strip() and not line.startswith("#"):
                return None
            name, equals, ranges = line.lstrip("# ").partition("=")
            if not equals or name.strip() != KNOWN_STEPS:
                continue
            known = np.zeros(frames, dtype=bool)
            for part in ranges.split():
                first, _, last = part.partition("-")
                if not (first.isdecimal() and (last or first).isdecimal() and len(part) < 20):
                    raise SequenceError(
                        f"{where}, line {number}: {KNOWN_STEPS}: expected ranges like "
                        f"0-99 150-300, found {shown(part)}"
                    )
                known[int(first) : int(last or first) + 1] = True
            return known
    return None


def write_boxes(
    path: Path, boxes: Detections, empty: Int[ndarray, " E"], *, decimals: tuple[str, str]
) -> None:
    """Write the boxes of a camera, and a row without a box for each step without any.

    Args:
        path: The file to write.
        boxes: The boxes.
        empty: The steps at which the detector ran and found no box, if these are listed.
        decimals: The formats of the box's numbers and of its score.
    """
    side, score = decimals
    columns = (boxes.frames.tolist(), boxes.boxes.tolist(), boxes.scores.tolist())
    rows = [
        ",".join([str(frame), *(f"{value:{side}}" for value in box), f"{own:{score}}"])
        for frame, box, own in zip(*columns, strict=True)
    ]
    rows += [f"{step},,,,," for step in empty.tolist()]
    _write(path, "frame,left,top,width,height,score", rows)


def write_truth(path: Path, truth: GroundTruth, *, decimals: str) -> None:
    """Write the ground truth.

    Args:
        path: The file to write.
        truth: The positions of people.
        decimals: The format of the coordinates.
    """
    columns = (truth.frames, truth.ids, truth.positions, truth.valid.astype(int))
    rows = (
        ",".join([str(frame), str(who), *(f"{value:{decimals}}" for value in place), str(valid)])
        for frame, who, place, valid in zip(*(one.tolist() for one in columns), strict=True)
    )
    _write(path, "frame,id,x,y,z,valid", rows)


def steps_without_boxes(boxes: Detections, steps: Int[ndarray, " K"]) -> Int[ndarray, " E"]:
    """Return those of the steps at which the detector ran that have no box."""
    return np.setdiff1d(steps, boxes.frames).astype(np.int64)


def _write(path: Path, head: str, rows: Iterable[str]) -> None:
    write_whole(path, "".join(f"{row}\n" for row in (head, *rows)).encode())
