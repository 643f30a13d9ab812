"""Everything that all pages share, but for the results themselves; and what can be chosen."""

from __future__ import annotations

from typing import Any, Literal

from app.models.base import Model, Vector
from app.models.correcting import CorrectionsState
from app.state.snapshot import RunPhase


class EntranceInfo(Model):
    """Where people appear: mean and standard deviation."""

    position: Vector
    sigma: Vector


class RoomInfo(Model):
    """The volume that people are tracked in."""

    min: Vector
    max: Vector
    entrances: list[EntranceInfo]


class TargetInfo(Model):
    """The upright box around a person."""

    half_extents: Vector


class CameraInfo(Model):
    """One camera of the sequence."""

    name: str
    width: int
    height: int
    has_pictures: bool
    has_detections: bool


class SequenceInfo(Model):
    """The sequence that is open."""

    key: str
    """Part of the pictures' addresses; another for every content."""
    name: str
    opened_as: str
    """The name or folder that opens it again."""
    description: str
    fps: float
    frames: int
    has_pictures: bool
    has_detections: bool
    has_truth: bool
    room: RoomInfo
    target: TargetInfo
    cameras: list[CameraInfo]
    templates: int
    """How many colour templates it has."""
    warnings: list[str]
    """What is odd about it, or was found out because it is not stated."""


class OpeningInfo(Model):
    """A sequence on its way."""

    name: str


class MethodsInfo(Model):
    """The chosen methods."""

    single_view: str
    fusion_method: str
    smoothing_method: str


class RunInfo(Model):
    """The run that the parameters ask for."""

    key: str
    """A step or timeline with this key is of these parameters; with another, of earlier ones."""
    state: RunPhase
    done: int
    total: int
    steps_per_second: float
    seconds_left: float | None
    message: str
    """The stage under way, and how long nothing was heard of it."""
    error: str | None
    kept: int | None
    """Its number in the library that it was taken from; what the cameras found is not there."""
    smoothed: bool
    """Whether the people are those of stage 3; else the filter's, as a live system would see."""
    stands_for: str
    """The key that a computation would have, where older code made what is shown; else empty."""
    warnings: list[str]
    """What its result lacks: pictures that were missing, files that changed."""


class PinnedInfo(Model):
    """The pinned run: the A of comparisons."""

    key: str
    parameters: dict[str, Any]
    """Methods and values."""
    changed: list[str]
    """Keys whose value is not the default."""
    differs: list[str]
    """Keys whose value is not the one that the parameters have now."""


class TeachingInfo(Model):
    """What the sequence was taught since its file was read."""

    key: str
    """Names room and templates as they are."""
    unsaved: int
    """Changes that its file does not have."""
    editing_room: bool
    """Whether the 3D view has handles on the room."""


class EditsInfo(Model):
    """What would be undone and redone, in words; null for nothing."""

    undo: str | None
    redo: str | None


class TaskInfo(Model):
    """Work in the background: an export, a check of identities, an import, parameters' effects."""

    of: str
    """The number of an export, the key of a run, that of an import, or that of a recording."""
    state: str
    done: int
    """What is done of :attr:`total`; of an import it is the version that can be read."""
    total: int
    """0 while it is not known."""
    words: str
    """What it makes: the name of a file."""
    error: str | None


class TrailInfo(Model):
    """How trails are drawn, in 3D and in pictures."""

    seconds: float
    """How far back they go."""
    fades: bool
    """Whether they are fainter the older they are."""


class ViserInfo(Model):
    """Where the 3D view is."""

    path: str = "/viser/"


class State(Model):
    """Everything that all pages share, but for the results themselves."""

    session: str
    """Another for every start of the server."""
    version: int
    """Grows with every change; of two states the larger is the newer."""
    sequence: SequenceInfo | None
    opening: OpeningInfo | None
    parameters: dict[str, Any]
    changed: list[str]
    """Keys whose value is not the default."""
    shown: list[str]
    """Keys that have an effect with what is chosen."""
    command: str
    """The command that computes the same in a terminal; empty while nothing is open."""
    methods: MethodsInfo
    unfit: dict[str, dict[str, str]]
    """Methods that cannot work on the sequence with the values chosen: by ``single_view``,
    ``fusion_method`` or ``smoothing_method``, the sentence why by the method's name."""
    presets: list[str]
    """Names of those that a person has saved."""
    preset: str | None
    """The one whose values the parameters have, built in or saved."""
    playhead: int
    selection: int | None
    layers: dict[str, bool]
    """Of the 3D view."""
    trail: TrailInfo
    view: int | Literal["top"] | None
    """What the 3D view looks through: a camera's index, from above, or freely."""
    theme: Literal["dark", "light"]
    """Of the 3D view."""
    run: RunInfo
    pinned: PinnedInfo | None
    teaching: TeachingInfo
    corrections: CorrectionsState
    edits: EditsInfo
    marks: int
    """Grows when kept runs are named, marked, deleted or restored."""
    tasks: dict[str, TaskInfo]
    """By ``export``, ``identity``, or ``import`` and its key. They come over the socket as they go
    on, and here as they are when something else is told."""
    viser: ViserInfo


class ParameterInfo(Model):
    """One parameter: what its row in the table of parameters needs."""

    key: str
    group: str
    name: str
    label: str
    help: str
    symbol: str
    unit: str
    stage: str
    """The first stage that a change re-runs."""
    topic: str
    """What it is about, such as "Birth"."""
    kind: Literal["float", "int", "bool", "choice"]
    default: Any
    minimum: float | None
    maximum: float | None
    step: float | None
    log: bool
    choices: list[str]
    advanced: bool
    essential: bool
    """Among the few that are shown first."""
    slider: tuple[float, float, float] | None
    """The ends of the sliders of an essential one, and the step of the one beside the 3D view; None
    for the others."""


class GroupInfo(Model):
    """A group of parameters."""

    name: str
    help: str


class Schema(Model):
    """Every parameter, method and preset."""

    groups: list[GroupInfo]
    topics: list[str]
    """What parameters are about, in the order of a filter's step."""
    parameters: list[ParameterInfo]
    methods: dict[str, list[str]]
    presets: dict[str, dict[str, Any]]


class SequenceEntryInfo(Model):
    """A sequence that can be opened."""

    name: str
    description: str
    kind: Literal["rendered", "folder"]
    cameras: int | None
    frames: int | None
    error: str | None = None
    """Why it cannot be opened."""


class SequenceList(Model):
    """What can be opened."""

    sequences: list[SequenceEntryInfo]
