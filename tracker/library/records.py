"""What the library tells of a recording and of a run."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

from tracker.library.columns import KeptTracks
from tracker.parameters import RunParameters

Source = Literal["track", "page", "bundle", "batch"]

HEADLINES = (
    "mota", "idf1", "hota", "ospa", "position_error", "misses", "false_positives", "id_switches",
)  # fmt: skip
"""Figures that have a column of their own: runs are listed and sorted by them."""

PROVISIONAL = "made before the run was finished; opening it computes them again"
"""What is said of figures that an earlier version stored too early."""


class Recording(NamedTuple):
    """A recording of which runs are kept, or that was opened."""

    id: int
    place: str
    """A rendered room's name, or a folder: what opens it again."""
    name: str
    kind: str
    """``rendered`` or ``folder``."""
    digest: str
    """Of its content when it was opened last."""
    cameras: int
    frames: int
    fps: float
    has_pictures: int
    has_detections: int
    people: int | None
    """Of its truth; None without one."""
    opened: float
    """Seconds since 1970."""
    runs: int


class KeptRun(NamedTuple):
    """A run without its tracks; of 10,000 a list is made at once."""

    id: int
    recording: int
    recording_name: str
    began: float
    """Seconds since 1970."""
    seconds: float
    """How long its computation took."""
    steps: int
    single_view: str
    fusion_method: str
    changes_json: str
    seed: int
    version: str
    """Of the program."""
    code: str
    """Hash of the code that computes, as in the keys of stages."""
    source: str
    """Who computed it: ``track``, ``batch``, ``page``, or ``bundle`` where it was taken from a
    file."""
    targets: int
    """How many tracks."""
    mota: float | None
    """As the following figures (OSPA and position error in metres), None where it is not defined
    or the recording has no truth."""
    idf1: float | None
    hota: float | None
    ospa: float | None
    position_error: float | None
    misses: int | None
    false_positives: int | None
    id_switches: int | None
    name: str
    star: int
    note: str
    tags_json: str
    corrected: int = 0
    """How many corrections of a person it obeys."""
    final: int = 0
    """Whether the figures were made of the tracks of a finished run: of all steps, smoothed and
    corrected. Earlier versions stored others, too."""

    @property
    def provisional(self) -> bool:
        """Whether the run has figures that are to be computed again."""
        return not self.final and self.misses is not None

    @property
    def changes(self) -> dict[str, Any]:
        """The values that were not at the recording's defaults, by key."""
        return dict(json.loads(self.changes_json))

    @property
    def tags(self) -> list[str]:
        """Words that somebody put to it."""
        return list(json.loads(self.tags_json))

    @property
    def steps_per_second(self) -> float:
        """Mean speed of the computation; 0 where nothing was computed."""
        return self.steps / self.seconds if self.seconds > 0.0 else 0.0

    @property
    def title(self) -> str:
        """Its name with its number, or the number alone."""
        return f"{self.name} ({self.id})" if self.name else f"run {self.id}"

    def to_json(self) -> dict[str, Any]:
        """Everything as plain values."""
        told = self._asdict()
        del told["changes_json"], told["tags_json"], told["final"]
        return {
            **told,
            "star": bool(self.star),
            "changes": self.changes,
            "tags": self.tags,
            "steps_per_second": self.steps_per_second,
            "provisional": self.provisional,
        }


@dataclass(frozen=True, slots=True, eq=False)
class Result:
    """A run as it is read back: what is needed to show it, score it and write it out."""

    run: KeptRun
    place: str
    """What opens its recording again."""
    key: str
    """Of recording, parameters, seed and code."""
    digest: str
    """Of the recording as it was tracked."""
    machine: str
    parameters: RunParameters
    unknown: tuple[str, ...]
    """Keys of those that this version does not know or take: they are at their defaults."""
    values: dict[str, Any]
    """All of them as they were written."""
    figures: dict[str, Any]
    kept: KeptTracks
    ospa: tuple[float, ...] = ()
    """Its mean over equally many steps each, metres; empty without a truth."""
    corrections: tuple[dict[str, Any], ...] = ()
    """What a person said that it obeys, as a log of corrections has it."""


@dataclass(frozen=True, slots=True, eq=False)
class NewRecording:
    """A recording that is opened."""

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
    """A run that came to its end."""

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
    """Its mean over equally many steps each, metres; empty without a truth."""
    corrections: tuple[dict[str, Any], ...] = ()
    """What a person said that it obeys, as a log of corrections has it."""
    name: str = ""
    note: str = ""
