"""What a sequence is: cameras, room, target, templates, boxes and truth, as values."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

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
"""Usual targets: half width, depth and height, metres."""


@dataclass(frozen=True, slots=True, eq=False)
class Entrance:
    """Where targets appear: a Gaussian in world metres."""

    position: Float[ndarray, " 3"]
    sigma: Float[ndarray, " 3"]
    """Standard deviations, metres."""


@dataclass(frozen=True, slots=True, eq=False)
class Room:
    """The axis-aligned volume that people are tracked in, world metres."""

    minimum: Float[ndarray, " 3"]
    maximum: Float[ndarray, " 3"]
    entrances: tuple[Entrance, ...] = ()

    def contains(
        self, points: Float[ndarray, "N 3"], margin: float = 0.0, below: float = 0.0
    ) -> Bool[ndarray, " N"]:
        """Whether each point lies inside, or at most ``margin`` metres outside.

        ``below`` adds to the margin under the floor.
        """
        inside = (points >= self.minimum - [margin, margin, margin + below]) & (
            points <= self.maximum + margin
        )
        return np.asarray(inside.all(axis=1))


@dataclass(frozen=True, slots=True, eq=False)
class Template:
    """A box whose colour histogram models a target."""

    name: str
    camera: str
    frame: int
    box: Float[ndarray, " 4"]
    """left, top, width, height, pixels."""


@dataclass(frozen=True, slots=True, eq=False)
class Detections:
    """Boxes of an outside detector in one camera, sorted by step."""

    frames: Int[ndarray, " D"]
    boxes: Float[ndarray, "D 4"]
    """left, top, width, height, pixels."""
    scores: Float[ndarray, " D"]
    """0 … 1; 1 where the file has none."""
    embeddings: Float16[ndarray, "D A"] = field(
        default_factory=lambda: np.zeros((0, 0), np.float16)
    )
    """Unit vectors of each box's appearance from an outside network, or zeros for a box without
    one; of shape (0, 0) if there is no such file."""

    def at(self, frame: int) -> slice:
        """The rows of one step."""
        first, last = np.searchsorted(self.frames, [frame, frame + 1])
        return slice(int(first), int(last))


@dataclass(frozen=True, slots=True, eq=False)
class GroundTruth:
    """Where people really were: one row a person a step, sorted by step and then id."""

    frames: Int[ndarray, " G"]
    ids: Int[ndarray, " G"]
    positions: Float[ndarray, "G 3"]
    """World metres."""
    valid: Bool[ndarray, " G"]
    """False where the person is there but the position is not certain."""
    known: Bool[ndarray, " F"] | None = None
    """Of which steps anything is known; None for all. Of others nothing counts."""

    def at(self, frame: int) -> slice:
        """The rows of one step."""
        first, last = np.searchsorted(self.frames, [frame, frame + 1])
        return slice(int(first), int(last))


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """One camera of a sequence and where its pictures and boxes are."""

    camera: Camera
    video: Path | None = None
    images: tuple[Path, ...] = ()
    first_frame: int = 0
    """The frame of the video or image list that is step 0, where it has no clock of its own."""
    detections: Detections | None = None
    clock: Clock | None = None
    """Which frame each step shows; None where it is ``first_frame`` + k at step k."""
    looked_at: Bool[ndarray, " F"] | None = None
    """At which steps the detector had a picture; None where it had one at every step."""
    there: Bool[ndarray, " N"] | None = None
    """Which frames of the video or image list were there on opening; None where nobody looked."""
    background: Path | range | None = None
    """A picture of the empty scene, or the steps at which nobody is there; None where the
    background has to be learnt from whatever the clip shows."""

    @property
    def has_pictures(self) -> bool:
        """Whether there is a video or a list of images."""
        return self.video is not None or bool(self.images)

    def need_pictures(self, sequence: str, instead: str = "") -> None:
        """Make sure that there are pictures.

        Args:
            sequence: The name of the sequence, for the sentence.
            instead: What else can be done, as the sentence's end.

        Raises:
            ValueError: If there are none.
        """
        if not self.has_pictures:
            raise ValueError(
                f'camera "{self.camera.name}" of {sequence} has no pictures; give it a video '
                f"or images in sequence.toml{instead}"
            )

    def frame_at(self, step: int) -> int:
        """The frame of the video or image list that a step shows, -1 for none."""
        if self.clock is None:
            return self.first_frame + step
        return int(self.clock.frame_of_step[step])

    def asked_for(self, steps: int) -> Bool[ndarray, " F"]:
        """At which of the first steps the camera's clock has a frame: where a picture belongs."""
        if self.clock is None or not self.has_pictures:
            return np.full(steps, self.has_pictures)
        return np.asarray(self.clock.frame_of_step[:steps] >= 0)

    def expected(self, steps: int) -> Bool[ndarray, " F"]:
        """At which of the first steps there was a picture when the sequence was opened."""
        asked = self.asked_for(steps)
        if self.there is None or not self.has_pictures:
            return asked
        frames = np.arange(steps) + self.first_frame
        if self.clock is not None:
            frames = self.clock.frame_of_step[:steps]
        found = np.zeros(steps, dtype=bool)
        known = asked & (frames < len(self.there))
        found[known] = self.there[frames[known]]
        return found

    def was_looked_at(self, step: int) -> bool:
        """Whether the outside detector had a picture of this step: else it says nothing there."""
        return self.looked_at is None or bool(self.looked_at[step])


@dataclass(frozen=True, slots=True)
class FileState:
    """A file of a sequence as it was when the sequence was opened."""

    path: Path
    size: int
    """Bytes."""
    changed: int
    """Time of its last change, nanoseconds since 1970."""

    @staticmethod
    def of(path: Path) -> FileState:
        """As it is now.

        Raises:
            OSError: If it is not there.
        """
        status = path.stat()
        return FileState(path, status.st_size, status.st_mtime_ns)

    @property
    def is_same(self) -> bool:
        """Whether it is still so."""
        try:
            return FileState.of(self.path) == self
        except OSError:
            return False


@dataclass(frozen=True, slots=True)
class DetectorFile:
    """A detection network that somebody brings."""

    path: Path
    """An ONNX file."""
    digest: str
    """Hash of its content, for cache keys."""


@dataclass(frozen=True, slots=True, eq=False)
class Sequence:
    """A recorded multi-view sequence, checked and ready to run."""

    name: str
    folder: Path
    fps: float
    frames: int
    """The number of steps."""
    room: Room
    target_half_extents: Float[ndarray, " 3"]
    """Half width, depth and height of an upright target, metres."""
    views: tuple[View, ...]
    description: str = ""
    templates: tuple[Template, ...] = ()
    ground_truth: GroundTruth | None = None
    digest: str = field(default="")
    """Hash of sequence.toml and of the size and time of every file it names, for cache keys."""
    detector: DetectorFile | None = None
    """The network that may be run on its pictures; no part of :attr:`digest`."""
    warnings: tuple[str, ...] = ()
    """What is odd about it but does not keep it from running, one sentence each."""
    files: tuple[FileState, ...] = ()
    """Every file that its sequence.toml names, as it was on opening."""

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
        """The files that are gone, or others, since it was opened."""
        return tuple(file.path for file in self.files if not file.is_same)

    @property
    def step_time(self) -> float:
        """Seconds between two steps."""
        return 1.0 / self.fps
