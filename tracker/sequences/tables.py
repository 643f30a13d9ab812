"""The tables of a sequence folder: boxes of an outside detector, and the ground truth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Float16, Int
from numpy import ndarray

from tracker.files.text import shown
from tracker.sequences.appearance import read_appearance
from tracker.sequences.clock import Clock
from tracker.sequences.csv_columns import Columns, read_columns
from tracker.sequences.errors import SequenceError
from tracker.sequences.fields import SMALLEST, Fields
from tracker.sequences.pictures.media import locate
from tracker.sequences.sequence import Detections, GroundTruth

BOX = ("left", "top", "width", "height")

MOST_BOXES = 1000
"""Of one camera at one step: a detector finds fewer, and the pairs of two cameras are their
product."""

KNOWN_STEPS = "steps"
"""The comment of a truth that says of which steps it knows: ``# steps = 0-99 150-300``."""


@dataclass(slots=True)
class Reading:
    """What is collected on the way through a sequence's file."""

    folder: Path
    files: list[Path] = field(default_factory=list)
    """Every file that sequence.toml names, in its order."""
    warnings: list[str] = field(default_factory=list)

    def columns(
        self,
        path: Path,
        *,
        needed: tuple[str, ...],
        optional: Mapping[str, float],
        blank: tuple[str, ...] = (),
    ) -> Columns:
        """A table, which counts among the files from now on."""
        self.files.append(path)
        where = f"{self.folder.name}/{path.relative_to(self.folder).as_posix()}"
        return read_columns(path, where, needed=needed, optional=optional, blank=blank)


@dataclass(frozen=True, slots=True, eq=False)
class BoxTable:
    """A file of boxes as it was read, before anybody knows which step each frame is."""

    columns: Columns
    first: int
    """The number in its column ``frame`` that is the first picture."""
    listed: bool
    """Whether only frames that have a row were looked at."""
    file_starts: int
    """Which frame of the camera's file the first picture is."""
    embeddings: Float16[ndarray, "N A"]
    """The appearance vector of each row's box; of shape (0, 0) if there is no such file."""

    @property
    def steps(self) -> int:
        """How many steps there are at least, where each frame is a step."""
        frames = self.columns.values["frame"]
        return int(frames.max()) - self.first + 1 if len(frames) else 0

    @property
    def is_box(self) -> Bool[ndarray, " N"]:
        """Which rows are boxes; a row without one says that a frame was looked at."""
        return np.asarray(~np.isnan(self.columns.stacked(*BOX)).all(axis=1))

    def detections(
        self, steps: int, clock: Clock | None
    ) -> tuple[Detections, Bool[ndarray, " F"] | None]:
        """The boxes by step, and at which steps the detector had a picture, None for at all.

        Raises:
            SequenceError: If a row lies outside the recording, or is no box.
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
        looked_at = self._looked_at(steps, clock, of_row)
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
        return Detections(of_row[kept], boxes, scores[kept], embeddings), looked_at

    def _looked_at(
        self, steps: int, clock: Clock | None, of_row: Int[ndarray, " N"]
    ) -> Bool[ndarray, " F"] | None:
        if not self.listed:
            return None if clock is None else np.asarray(clock.frame_of_step >= 0)
        looked_at = np.zeros(steps, dtype=bool)
        looked_at[of_row[of_row >= 0]] = True
        return looked_at

    def _check_counting(self, steps: int) -> None:
        """A file that counts its frames from 1 is told as such, not as a row too many."""
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


def read_box_table(fields: Fields, reading: Reading, file_starts: int) -> BoxTable | None:
    """The file that ``detections`` names; None where there is none.

    Raises:
        SequenceError: If it cannot be read.
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
        embeddings = read_appearance(file, fields, path.name, len(columns))
    return BoxTable(columns, first, steps == "listed", file_starts, embeddings)


def read_ground_truth(fields: Fields, reading: Reading, frames: int) -> GroundTruth | None:
    """The file that ``[ground_truth]`` names; None where there is none.

    Raises:
        SequenceError: If it cannot be read.
    """
    table = fields.table("ground_truth", ("file",), needed=False)
    if table is None:
        return None
    path = locate(reading.folder, table, "file")
    reading.files.append(path)
    return truth_of(
        path, f"{reading.folder.name}/{path.relative_to(reading.folder).as_posix()}", frames
    )


def truth_of(path: Path, where: str, frames: int) -> GroundTruth:
    """A file of truth.

    Args:
        path: A table ``frame, id, x, y, z`` with ``valid`` where there is one. A comment before
            its head may say of which steps it knows; see :data:`KNOWN_STEPS`.
        where: The file, as the messages begin.
        frames: Steps of the sequence.

    Raises:
        SequenceError: If it cannot be read.
    """
    columns = read_columns(
        path, where, needed=("frame", "id", "x", "y", "z"), optional={"valid": 1.0}
    )
    steps = columns.whole("frame", 0, frames - 1, "the step")
    ids = columns.whole("id", 0, None, "the person")
    valid = columns.whole("valid", 0, 1, "1 certain, 0 not")
    order = columns.one_row_each(steps, ids, "person")
    positions = columns.stacked("x", "y", "z")
    known = _known_steps(path, where, frames)
    return GroundTruth(steps[order], ids[order], positions[order], valid[order] == 1, known)


def _known_steps(path: Path, where: str, frames: int) -> Bool[ndarray, " F"] | None:
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
