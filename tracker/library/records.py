"""The records of the library: recordings and runs as they are inserted, listed and read."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

from tracker.library.columns import KeptTracks
from tracker.parameters import RunParameters

Source = Literal["track", "page", "bundle", "batch"]
"""The origin of a run: a command, the page, or a bundle that was unpacked."""

HEADLINES = (
    "mota", "idf1", "hota", "ospa", "position_error", "misses", "false_positives", "id_switches",
)  # fmt: skip
"""The keys of the figures that have a column of their own, so that runs can be listed and sorted by
them."""

PROVISIONAL = "made before the run was finished; opening it computes them again"
"""The note on figures that an earlier version computed before the run was finished."""


class Recording(NamedTuple):
    """A recording that was opened, with or without stored runs."""

    id: int
    """The number of the recording in the library."""
    place: str
    """The name of a built-in recording, or the folder, by which it is opened again."""
    name: str
    """The name of the recording, for display."""
    kind: str
    """``rendered`` for a built-in recording, or ``folder``."""
    digest: str
    """The hash of the recording's content when it was last opened."""
    cameras: int
    """The number of cameras."""
    frames: int
    """The number of steps."""
    fps: float
    """The number of steps per second."""
    has_pictures: int
    """Whether every camera has pictures, 0 or 1."""
    has_detections: int
    """Whether every camera has boxes of an outside detector, 0 or 1."""
    people: int | None
    """The number of people in the ground truth; None without ground truth."""
    opened: float
    """The time when the recording was last opened, seconds since 1970."""
    runs: int
    """The number of stored runs of the recording."""


class KeptRun(NamedTuple):
    """A stored run without its tracks, so that thousands can be listed at once."""

    id: int
    """The number of the run in the library."""
    recording: int
    """The number of the recording, :attr:`Recording.id`."""
    recording_name: str
    """The name of the recording, for display."""
    began: float
    """The time when the computation began, seconds since 1970."""
    seconds: float
    """The duration of the computation, seconds."""
    steps: int
    """The number of steps that were tracked."""
    single_view: str
    """The key of the single-view method."""
    fusion_method: str
    """The key of the fusion method."""
    changes_json: str
    """The values of :attr:`changes`, as JSON."""
    seed: int
    """The seed of the random numbers."""
    version: str
    """The version of the program that computed the run."""
    code: str
    """The hash of the code that computes results, as in the keys of stages."""
    source: str
    """The origin of the run, a :data:`Source`."""
    targets: int
    """The number of tracks."""
    mota: float | None
    """This and the following seven figures (OSPA and position error in metres) are None if they are
    not defined or the recording has no ground truth."""
    idf1: float | None
    hota: float | None
    ospa: float | None
    position_error: float | None
    misses: int | None
    false_positives: int | None
    id_switches: int | None
    name: str
    """The name that the user gave the run, or an empty string."""
    star: int
    """Whether the user starred the run, 0 or 1."""
    note: str
    """The user's note, or an empty string."""
    tags_json: str
    """The values of :attr:`tags`, as JSON."""
    corrected: int = 0
    """The number of corrections of the run."""
    final: int = 0
    """Whether the figures are of the finished run's tracks, 0 or 1: of all steps, after smoothing
    and corrections. Earlier versions also stored figures of unfinished runs."""

    @property
    def provisional(self) -> bool:
        """Whether the run has figures of an unfinished run, which have to be computed again."""
        return not self.final and self.misses is not None

    @property
    def changes(self) -> dict[str, Any]:
        """The values of parameters that differ from the recording's defaults, by key."""
        return dict(json.loads(self.changes_json))

    @property
    def tags(self) -> list[str]:
        """The tags that the user gave the run."""
        return list(json.loads(self.tags_json))

    @property
    def steps_per_second(self) -> float:
        """The mean number of steps computed per second; 0 if nothing was computed."""
        return self.steps / self.seconds if self.seconds > 0.0 else 0.0

    @property
    def title(self) -> str:
        """The run's name and number, or the number alone."""
        return f"{self.name} ({self.id})" if self.name else f"run {self.id}"

    def to_json(self) -> dict[str, Any]:
        """Return all fields as plain values."""
        values = self._asdict()
        del values["changes_json"], values["tags_json"], values["final"]
        return {
            **values,
            "star": bool(self.star),
            "changes": self.changes,
            "tags": self.tags,
            "steps_per_second": self.steps_per_second,
            "provisional": self.provisional,
        }


@dataclass(frozen=True, slots=True, eq=False)
class Result:
    """A stored run with its tracks, for display, evaluation and export."""

    run: KeptRun
    """The run as it is listed."""
    place: str
    """The name or folder by which the recording is opened again."""
    key: str
    """The hash of recording, parameters, seed, corrections and code."""
    digest: str
    """The hash of the recording's content when it was tracked."""
    machine: str
    """The system, the processor and the name of the computer that tracked it."""
    parameters: RunParameters
    """The parameters as this version reads them."""
    unknown: tuple[str, ...]
    """The keys of stored parameters that this version does not accept; :attr:`parameters` has their
    defaults."""
    values: dict[str, Any]
    """All parameters as they were stored."""
    figures: dict[str, Any]
    """The figures of the evaluation by key; empty without ground truth."""
    kept: KeptTracks
    """The tracks."""
    ospa: tuple[float, ...] = ()
    """OSPA over time, as means over equally many steps each, metres; empty without ground truth."""
    corrections: tuple[dict[str, Any], ...] = ()
    """The corrections of the run, each in the form of a line of the log of corrections."""


@dataclass(frozen=True, slots=True, eq=False)
class NewRecording:
    """The record of a recording, to be inserted; its fields are those of :class:`Recording`."""

    place: str
    name: str
    kind: str
    digest: str
    cameras: int
    frames: int
    fps: float
    has_pictures: bool
    has_detections: bool
    people: int | None
    thumbnail: bytes | None = None


@dataclass(frozen=True, slots=True, eq=False)
class NewRun:
    """The record of a finished run, to be inserted; its fields are those of :class:`KeptRun` and
    :class:`Result`."""

    key: str
    digest: str
    began: float
    seconds: float
    steps: int
    single_view: str
    fusion_method: str
    changes: dict[str, Any]
    parameters: dict[str, Any]
    seed: int
    version: str
    code: str
    machine: str
    source: Source
    targets: int
    figures: dict[str, float | int | None]
    kept: KeptTracks
    ospa: tuple[float, ...] = ()
    corrections: tuple[dict[str, Any], ...] = ()
    name: str = ""
    note: str = ""
