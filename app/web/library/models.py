"""What the routes of the library answer and are asked for, as types."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from app.models import Model, RoomInfo, TrackLife
from tracker.library.records import KeptRun


class RecordingInfo(Model):
    """A recording of which runs are kept, or that can be opened."""

    id: int | None
    """Null where it was never opened: it has no runs."""
    place: str
    """What opens it."""
    name: str
    kind: Literal["rendered", "folder"]
    cameras: int
    frames: int
    fps: float
    boxes_only: bool
    people: int | None
    """Of its truth; null without one."""
    opened: float | None
    """Seconds since 1970."""
    runs: int
    has_thumbnail: bool
    missing: str | None
    """Why it cannot be opened now."""


class LibraryInfo(Model):
    """The library."""

    file: str
    bytes: int
    error: str | None
    """Why nothing is kept and nothing listed but what can be opened."""
    read_only: bool
    recordings: list[RecordingInfo]


class ChangeInfo(Model):
    """A value that is not the recording's default."""

    key: str
    symbol: str
    default: str
    value: str


class KeptRunInfo(Model):
    """A run in the library."""

    id: int
    recording: int
    recording_name: str
    began: float
    """When the run was computed first, seconds since 1970."""
    latest: float
    """When the same run was computed last, seconds since 1970."""
    seconds: float
    steps: int
    steps_per_second: float
    single_view: str
    fusion_method: str
    changes: list[ChangeInfo]
    seed: int
    program: str
    """Its version."""
    older_code: bool
    """Whether another version of the program made it: computing it again may give other tracks."""
    source: str
    targets: int
    mota: float | None
    idf1: float | None
    hota: float | None
    ospa: float | None
    position_error: float | None
    misses: int | None
    false_positives: int | None
    id_switches: int | None
    name: str
    star: bool
    note: str
    tags: list[str]
    corrected: int
    """How many corrections of a person it obeys."""
    templates: list[str] | None
    """The colour templates of the run: name, camera and step of each; null where they are not
    known."""
    provisional: bool
    """Whether its figures were made before it was finished; opening it computes them again."""


class KeptRuns(Model):
    """The runs of one recording, the newest first."""

    runs: list[KeptRunInfo]


class Course(Model):
    """Where a track went, seen from above."""

    id: int
    points: list[tuple[float, float]]
    """x and y in metres, a few a second."""


class Preview(Model):
    """A run in small."""

    run: KeptRunInfo
    frames: int
    tracks: list[TrackLife]
    people: list[float]
    """Targets at each of equally many steps, their mean."""
    people_every: int
    """How many steps a value of :attr:`people` stands for."""
    courses: list[Course]
    ospa: list[float]
    """Its mean over equally many steps each, metres; empty without a truth, and where the figures
    are provisional."""
    ospa_every: int
    """How many steps a value of :attr:`ospa` stands for."""
    room: RoomInfo | None
    """The room of its recording, where that is open."""


class Place(Model):
    """Where a recording lies now."""

    place: str = Field(min_length=1, max_length=4096)


def run_info(run: KeptRun, changes: list[ChangeInfo], older_code: bool) -> KeptRunInfo:
    """A row of the library as the page gets it."""
    told: dict[str, Any] = {
        name: getattr(run, name)
        for name in KeptRunInfo.model_fields
        if name not in ("changes", "older_code", "program", "star", "tags", "steps_per_second")
    }
    return KeptRunInfo(
        **told,
        changes=changes,
        older_code=older_code,
        program=run.version,
        star=bool(run.star),
        tags=run.tags,
        steps_per_second=run.steps_per_second,
    )
