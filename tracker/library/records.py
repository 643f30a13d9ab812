"""The records of the library: recordings and runs, as they are listed, read and inserted."""

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
"""Figures that have a column of their own, by which runs are listed and sorted."""

PROVISIONAL = "made before the run was finished; opening it computes them again"
"""The note on figures that an earlier version computed before the run was finished."""


class Recording(NamedTuple):
    """A recording that was opened, with or without stored runs."""

    id: int
    place: str
    """The name of a built-in recording, or the folder, by which it is opened again."""
    name: str
    kind: str
    """``rendered`` or ``folder``."""
    digest: str
    """The hash of its content when it was last opened."""
    cameras: int
    """The number of cameras."""
    frames: int
    """The number of steps."""
    fps: float
    has_pictures: int
    has_detections: int
    people: int | None
    """The number of people in the ground truth; None without one."""
    opened: float
    """The time when it was last opened, seconds since 1970."""
    runs: int
    """The number of its runs."""


class KeptRun(NamedTuple):
    """A stored run without its tracks, so that thousands can be listed at once."""

    id: int
    recording: int
    recording_name: str
    began: float
    """The time when its computation began, seconds since 1970."""
    seconds: float
    """The duration of its computation, seconds."""
    steps: int
    single_view: str
    fusion_method: str
    changes_json: str
    seed: int
    version: str
    """The version of the program."""
    code: str
    """The hash of the code that computes results, as in the keys of stages."""
    source: str
    """The origin of the run, a :data:`Source`."""
    targets: int
    """The number of tracks."""
    mota: float | None
    """This and the following figures (OSPA and position error in metres) are None where they are
    not defined or the recording has no truth."""
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
    """The number of corrections of the run."""
    final: int = 0
    """Whether the figures are those of a finished run's tracks: of all steps, smoothed and
    corrected. Earlier versions also stored figures of unfinished runs."""

    @property
    def provisional(self) -> bool:
        """Whether the run has figures that have to be computed again."""
        return not self.final and self.misses is not None

    @property
    def changes(self) -> dict[str, Any]:
        """The values that differ from the recording's defaults, by key."""
        return dict(json.loads(self.changes_json))

    @property
    def tags(self) -> list[str]:
        """The tags that users gave the run."""
        return list(json.loads(self.tags_json))

    @property
    def steps_per_second(self) -> float:
        """Mean speed of the computation; 0 where nothing was computed."""
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
    place: str
    """The name or folder by which the recording is opened again."""
    key: str
    """The hash of recording, parameters, seed and code."""
    digest: str
    """The hash of the recording's content when it was tracked."""
    machine: str
    parameters: RunParameters
    unknown: tuple[str, ...]
    """The keys of parameters that this version does not accept; they are at their defaults."""
    values: dict[str, Any]
    """All parameters as they were stored."""
    figures: dict[str, Any]
    kept: KeptTracks
    ospa: tuple[float, ...] = ()
    """OSPA over time, as means over equally many steps each, metres; empty without truth."""
    corrections: tuple[dict[str, Any], ...] = ()
    """The corrections of the run, in the form of a log of corrections."""


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
