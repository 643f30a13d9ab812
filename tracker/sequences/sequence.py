"""The data of a sequence: cameras, room, target, templates, boxes and ground truth."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import numpy as np
from jaxtyping import Bool, Float, Float16, Int
from numpy import ndarray

from tracker.geometry.camera import Camera
from tracker.sequences.clock import Clock

PRESETS: dict[str, tuple[float, float, float]] = {
    "Person": (0.3, 0.3, 0.875),
    "Seated": (0.3, 0.3, 0.65),
    "Head": (0.12, 0.12, 0.15),
}
"""Half width, depth and height of common targets, metres."""


@dataclass(frozen=True, slots=True, eq=False)
class Entrance:
    """A place where targets appear, as a Gaussian in world coordinates."""

    position: Float[ndarray, " 3"]
    """Mean, world metres."""
    sigma: Float[ndarray, " 3"]
    """Standard deviation along x, y and z, metres."""


@dataclass(frozen=True, slots=True, eq=False)
class Room:
    """The axis-aligned volume in which people are tracked, z up."""

    minimum: Float[ndarray, " 3"]
    """The corner of least x, y and z, world metres; z is that of the floor."""
    maximum: Float[ndarray, " 3"]
    """The corner of largest x, y and z, world metres."""
    entrances: tuple[Entrance, ...] = ()
    """The places where targets appear; none if they may appear anywhere."""

    def contains(
        self, points: Float[ndarray, "N 3"], margin: float = 0.0, below: float = 0.0
    ) -> Bool[ndarray, " N"]:
        """Whether each point lies in the volume enlarged by a margin.

        Args:
            points: Points in world coordinates, metres.
            margin: The margin on all sides, metres.
            below: A further margin below the floor, metres.
        """
        inside = (points >= self.minimum - [margin, margin, margin + below]) & (
            points <= self.maximum + margin
        )
        return np.asarray(inside.all(axis=1))


@dataclass(frozen=True, slots=True, eq=False)
class Template:
    """A box around a person, whose colour histogram models that person's appearance."""

    name: str
    """The name of the person."""
    camera: str
    """The name of the camera."""
    frame: int
    """The step of the picture, from 0."""
    box: Float[ndarray, " 4"]
    """Left, top, width, height, pixels."""


@dataclass(frozen=True, slots=True, eq=False)
class Detections:
    """D boxes of an outside detector in one camera, sorted by step."""

    frames: Int[ndarray, " D"]
    """The step of each box."""
    boxes: Float[ndarray, "D 4"]
    """Left, top, width, height, pixels."""
    scores: Float[ndarray, " D"]
    """The score of each box, 0 … 1; 1 if the file has none."""
    embeddings: Float16[ndarray, "D A"] = field(
        default_factory=lambda: np.zeros((0, 0), np.float16)
    )
    """A unit vector of each box's appearance from an outside network, zero for a box without one;
    of shape (0, 0) if there is no such file."""

    def at(self, frame: int) -> slice:
        """Return the slice of the rows of one step."""
        first, last = np.searchsorted(self.frames, [frame, frame + 1])
        return slice(int(first), int(last))


class LabelledPositions(Protocol):
    """Positions with a track or person each, by columns: a run's tracks, a file's, or the truth."""

    @property
    def frames(self) -> Int[ndarray, " N"]:
        """Step of each row, an index from 0."""

    @property
    def ids(self) -> Int[ndarray, " N"]:
        """Track or person of each row."""

    @property
    def positions(self) -> Float[ndarray, "N 3"]:
        """Position of each row, world metres."""


@dataclass(frozen=True, slots=True, eq=False)
class GroundTruth:
    """The true positions of people: a row for each person and step, sorted by step and then id."""

    frames: Int[ndarray, " G"]
    """The step of each row."""
    ids: Int[ndarray, " G"]
    """The person of each row."""
    positions: Float[ndarray, "G 3"]
    """The position of the person's centre, world metres."""
    valid: Bool[ndarray, " G"]
    """False where the person is present but the position is uncertain."""
    known: Bool[ndarray, " F"] | None = None
    """Whether the truth covers each step; None if it covers all. Other steps are not evaluated."""

    def at(self, frame: int) -> slice:
        """Return the slice of the rows of one step."""
        first, last = np.searchsorted(self.frames, [frame, frame + 1])
        return slice(int(first), int(last))


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """One camera of a sequence, with its pictures and boxes."""

    camera: Camera
    """The calibrated camera."""
    video: Path | None = None
    """The video file; None if there is none."""
    images: tuple[Path, ...] = ()
    """The files of the image list; empty if there is none."""
    first_frame: int = 0
    """The frame of the video or image list at step 0, if the camera has no clock of its own."""
    detections: Detections | None = None
    """The boxes of an outside detector; None if there are none."""
    clock: Clock | None = None
    """The frame that each step shows; None if it is ``first_frame`` + k at step k."""
    detector_ran: Bool[ndarray, " F"] | None = None
    """Whether the outside detector was run at each step; None if at every step."""
    pictures_exist: Bool[ndarray, " N"] | None = None
    """Whether each frame of the video or image list existed when the sequence was opened; None if
    that was not checked."""
    background: Path | range | None = None
    """The file of a picture of the empty scene, or the steps without people; None if the background
    has to be learnt from the recording."""

    @property
    def has_pictures(self) -> bool:
        """Whether there is a video or a list of images."""
        return self.video is not None or bool(self.images)

    def boxes_above(self, score: float, every: int = 1) -> Detections:
        """Return the boxes with at least a score at every n-th step; none without detections."""
        if self.detections is None:
            return Detections(np.zeros(0, dtype=np.int64), np.zeros((0, 4)), np.zeros(0))
        own = self.detections
        rows = np.flatnonzero((own.scores >= score) & (own.frames % every == 0))
        return Detections(own.frames[rows], own.boxes[rows], own.scores[rows])

    def need_pictures(self, sequence: str, instead: str = "") -> None:
        """Check that there are pictures.

        Args:
            sequence: The name of the sequence, for the message.
            instead: What else can be done, as the end of the message.

        Raises:
            ValueError: If there are no pictures.
        """
        if not self.has_pictures:
            raise ValueError(
                f'camera "{self.camera.name}" of {sequence} has no pictures; give it a video '
                f"or images in sequence.toml{instead}"
            )

    def frame_at(self, step: int) -> int:
        """Return the frame of the video or image list that a step shows; −1 for none."""
        if self.clock is None:
            return self.first_frame + step
        return int(self.clock.frame_of_step[step])

    def frames_due(self, steps: int) -> Bool[ndarray, " F"]:
        """Whether the camera's clock has a frame at each of the first steps; False without
        pictures."""
        if self.clock is None or not self.has_pictures:
            return np.full(steps, self.has_pictures)
        return np.asarray(self.clock.frame_of_step[:steps] >= 0)

    def pictures_expected(self, steps: int) -> Bool[ndarray, " F"]:
        """Whether there was a picture for each of the first steps when the sequence was opened."""
        due = self.frames_due(steps)
        if self.pictures_exist is None or not self.has_pictures:
            return due
        frames = np.arange(steps) + self.first_frame
        if self.clock is not None:
            frames = self.clock.frame_of_step[:steps]
        expected = np.zeros(steps, dtype=bool)
        known = due & (frames < len(self.pictures_exist))
        expected[known] = self.pictures_exist[frames[known]]
        return expected

    def detector_ran_at(self, step: int) -> bool:
        """Whether the outside detector was run at this step, so that a missing box is a miss."""
        return self.detector_ran is None or bool(self.detector_ran[step])


@dataclass(slots=True)  # not frozen: all versions of a sequence share it, see `renew`
class FileState:
    """The state of a file when the sequence was opened, or was last saved by the program."""

    path: Path
    """The path of the file."""
    size: int
    """Size, bytes."""
    changed: int
    """Time of its last change, nanoseconds since 1970."""

    @staticmethod
    def of(path: Path) -> FileState:
        """Return the present state of a file.

        Raises:
            OSError: If the file does not exist.
        """
        status = path.stat()
        return FileState(path, status.st_size, status.st_mtime_ns)

    @property
    def is_same(self) -> bool:
        """Whether the file has not changed."""
        try:
            return FileState.of(self.path) == self
        except OSError:
            return False

    def renew(self) -> None:
        """Take the present state of the file, which the program itself has just written.

        Raises:
            OSError: If the file does not exist.
        """
        now = FileState.of(self.path)
        self.size, self.changed = now.size, now.changed


@dataclass(frozen=True, slots=True)
class DetectorFile:
    """A detection network: one that the user named, or one that the program fetched."""

    path: Path
    """The ONNX file."""
    digest: str
    """The hash of its content, for cache keys."""
    name: str = ""
    """The name of a fetched one."""
    named: bool = True
    """Whether the user named it for this recording; False for one that is at hand for all."""


@dataclass(frozen=True, slots=True, eq=False)
class Sequence:
    """A recorded multi-view sequence, validated and ready to be tracked."""

    name: str
    """The name that is displayed."""
    folder: Path
    """The folder of the sequence."""
    fps: float
    """The rate of the steps, 1/s."""
    frames: int
    """The number F of steps."""
    room: Room
    """The tracked volume."""
    target_half_extents: Float[ndarray, " 3"]
    """Half width, depth and height of an upright target, metres."""
    views: tuple[View, ...]
    """The cameras with their files."""
    description: str = ""
    """The description, in words."""
    templates: tuple[Template, ...] = ()
    """The templates of people for the colour methods."""
    ground_truth: GroundTruth | None = None
    """The true positions of people; None if they are not known."""
    digest: str = field(default="")
    """A hash of sequence.toml and of size and time of every file that it names, for cache keys."""
    stored_digest: str = field(default="")
    """The digest of the files alone, without what was taught and is not saved, by which a moved
    folder is recognised."""
    detector: DetectorFile | None = None
    """The network that may be run on the pictures; it is not part of :attr:`digest`."""
    warnings: tuple[str, ...] = ()
    """Sentences on problems that do not prevent tracking."""
    files: tuple[FileState, ...] = ()
    """Every file that sequence.toml names, in its state on opening."""
    own_file: FileState | None = None
    """The state of sequence.toml itself; None if the sequence was not read from a folder."""

    @property
    def cameras(self) -> tuple[Camera, ...]:
        """The cameras, in the order of the file."""
        return tuple(view.camera for view in self.views)

    @property
    def has_pictures(self) -> bool:
        """Whether every camera has pictures."""
        return all(view.has_pictures for view in self.views)

    @property
    def has_detections(self) -> bool:
        """Whether every camera has boxes of an outside detector."""
        return all(view.detections is not None for view in self.views)

    def changed_files(self) -> tuple[Path, ...]:
        """Return the files that changed or vanished since the sequence was opened."""
        own = () if self.own_file is None else (self.own_file,)
        return tuple(file.path for file in (*own, *self.files) if not file.is_same)

    @property
    def step_time(self) -> float:
        """Time between two steps, seconds."""
        return 1.0 / self.fps
