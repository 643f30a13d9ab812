"""The records of the library: recordings and runs as they are inserted, listed and read.

The fields of a record are the columns of its table, which :func:`selected` and :func:`inserted`
read off; a field that is computed from other columns has the expression of SQL beside it.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any, Literal, TypeVar

from tracker.library.columns import KeptTracks
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.values import removed_notes, with_current_keys
from tracker.sequences.reader import why_missing

Source = Literal["track", "page", "bundle", "batch"]
"""The origin of a run: a command, the page, or a bundle that was unpacked."""

HEADLINES = (
    "mota", "idf1", "hota", "ospa", "position_error", "misses", "false_positives", "id_switches",
)  # fmt: skip
"""The keys of the figures that have a column of their own, so that runs can be listed and sorted by
them."""

PROVISIONAL = "made before the run was finished; opening it computes them again"
"""The note on figures that an earlier version computed before the run was finished."""


def _of(expression: str) -> Any:
    """A field that is listed by an expression of SQL, and not inserted."""
    return field(metadata={"expression": expression})


@dataclass(frozen=True, slots=True)
class _Recording:
    """What is known of a recording when it is inserted, and listed later."""

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
    has_pictures: bool
    """Whether every camera has pictures."""
    has_detections: bool
    """Whether every camera has boxes of an outside detector."""
    people: int | None
    """The number of people in the ground truth; None without ground truth."""


@dataclass(frozen=True, slots=True)
class NewRecording(_Recording):
    """A recording, to be inserted."""

    thumbnail: bytes | None = None
    """The JPEG thumbnail; None for the one that is stored, if any."""


@dataclass(frozen=True, slots=True)
class Recording(_Recording):
    """A recording that was opened, with or without stored runs."""

    id: int
    """The number of the recording in the library."""
    opened: float
    """The time when the recording was last opened, seconds since 1970."""
    runs: int = _of(
        "(SELECT count(*) FROM runs WHERE runs.recording = recordings.id AND deleted IS NULL)"
    )
    """The number of stored runs of the recording."""

    @property
    def missing(self) -> str | None:
        """The reason why the folder of the recording cannot be opened; None if it is there."""
        return why_missing(Path(self.place)) if self.kind == "folder" else None


@dataclass(slots=True)  # a frozen one takes six times as long to make, and lists have thousands
class _Run:
    """What is known of a run when it is inserted, and listed later."""

    key: str
    """The hash of recording, parameters, seed, corrections and code."""
    digest: str
    """The hash of the recording's content when it was tracked."""
    began: float
    """The time when the computation began, the first one if there were several, seconds since
    1970."""
    seconds: float
    """The duration of the computation, seconds."""
    steps: int
    """The number of steps that were tracked."""
    single_view: str
    """The key of the single-view method."""
    fusion_method: str
    """The key of the fusion method."""
    seed: int
    """The seed of the random numbers."""
    version: str
    """The version of the program that computed the run."""
    code: str
    """The hash of the code that computes results, as in the keys of stages."""
    machine: str
    """The system, the processor and the name of the computer that tracked it."""
    source: Source
    """The origin of the run."""
    targets: int
    """The number of tracks."""


@dataclass(slots=True, eq=False)
class NewRun(_Run):
    """A finished run, to be inserted."""

    changes: dict[str, Any]
    """The values of parameters that differ from the recording's defaults, by key."""
    parameters: dict[str, Any]
    """All parameters."""
    figures: dict[str, float | int | None]
    """The figures of the evaluation by key; empty without ground truth."""
    kept: KeptTracks
    """The tracks."""
    ospa: tuple[float, ...] = ()
    """OSPA over time, in the form of :attr:`Result.ospa`."""
    corrections: tuple[dict[str, Any], ...] = ()
    """The corrections of the run, each in the form of a line of the log of corrections."""
    templates: tuple[str, ...] = ()
    """The colour templates of the run: the name, camera and step of each."""
    names: dict[int, str] = field(default_factory=dict)
    """The names of tracks, by id."""
    name: str = ""
    """The name of the run, or an empty string."""
    note: str = ""
    """The note on the run, or an empty string."""


@dataclass(slots=True)
class KeptRun(_Run):
    """A stored run without its tracks, so that thousands can be listed at once."""

    id: int
    """The number of the run in the library."""
    recording: int
    """The number of the recording, :attr:`Recording.id`."""
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
    recording_name: str = _of("recordings.name")
    """The name of the recording, for display."""
    changes_json: str = _of("runs.changes")
    """The values of :attr:`changes`, as JSON."""
    tags_json: str = _of("runs.tags")
    """The values of :attr:`tags`, as JSON."""
    corrected: int = 0
    """The number of corrections of the run."""
    final: int = 0
    """Whether the figures are of the finished run's tracks, 0 or 1: of all steps, after smoothing
    and corrections. Earlier versions also stored figures of unfinished runs."""
    latest: float = 0.0
    """The time when the last computation began, seconds since 1970."""
    taught_json: str = field(default="{}", metadata={"expression": "runs.taught"})
    """The values of :attr:`templates` and :attr:`names`, as JSON."""

    @property
    def templates(self) -> list[str] | None:
        """The colour templates of the run: the name, camera and step of each. None for a run of a
        version that did not store them."""
        stored: list[str] | None = json.loads(self.taught_json).get("templates")
        return stored

    @property
    def names(self) -> dict[int, str]:
        """The names of tracks, by id."""
        names = json.loads(self.taught_json).get("names", {})
        return {int(track): str(name) for track, name in names.items()}

    @property
    def provisional(self) -> bool:
        """Whether the run has figures of an unfinished run, which have to be computed again."""
        return not self.final and self.misses is not None

    @property
    def changes(self) -> dict[str, Any]:
        """The values of parameters that differ from the recording's defaults, by key."""
        return with_current_keys(json.loads(self.changes_json))

    @property
    def removed(self) -> tuple[str, ...]:
        """A sentence for each parameter that had another value than by default, and no longer
        exists."""
        return removed_notes(json.loads(self.changes_json))

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
        values = asdict(self)
        del values["changes_json"], values["tags_json"], values["taught_json"], values["final"]
        return {
            **values,
            "templates": self.templates,
            "names": self.names,
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


R = TypeVar("R", Recording, KeptRun)


def selected(record: type[R], table: str) -> str:
    """Return the columns of SQL of the fields of a record, in their order.

    Args:
        record: The type of the records.
        table: The table that they are the rows of.
    """
    return ", ".join(
        one.metadata.get("expression", f"{table}.{one.name}") for one in fields(record)
    )


def inserted(record: NewRecording | NewRun) -> dict[str, Any]:
    """Return the values of a record, by the columns of its table."""
    if isinstance(record, NewRecording):
        return asdict(record)
    names = [*(one.name for one in fields(_Run)), "name", "note"]
    taught = {"templates": record.templates, "names": record.names}
    return {name: getattr(record, name) for name in names} | {
        "changes": json.dumps(record.changes, ensure_ascii=False),
        "taught": json.dumps(taught, ensure_ascii=False),
    }
