"""What the page and the server tell each other, as types: the OpenAPI page is made from them.

Pixels, metres and steps throughout; a step is 0-based. ``null`` stands for what
is not there.
"""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from app.workbench import RunPhase


class Model(BaseModel):
    """A message; attribute docstrings become the descriptions of the OpenAPI page."""

    model_config = ConfigDict(use_attribute_docstrings=True, extra="forbid")


Box = tuple[float, float, float, float]
"""left, top, width, height in pixels."""

Vector = tuple[float, float, float]
"""x, y, z in metres, world frame."""


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


class OpeningInfo(Model):
    """A sequence on its way."""

    name: str
    message: str
    done: int
    total: int
    """0 while it is not known."""


class MethodsInfo(Model):
    """The chosen methods."""

    single_view: str
    fusion_method: str


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
    """The stage that takes the time."""
    error: str | None


class PinnedInfo(Model):
    """The pinned run: the A of comparisons."""

    key: str
    parameters: dict[str, Any]
    """Methods and values."""
    changed: list[str]
    """Keys whose value is not the default."""
    differs: list[str]
    """Keys whose value is not the one that the parameters have now."""


class ViserInfo(Model):
    """Where the 3D view is."""

    path: str = "/viser/"


class State(Model):
    """Everything that all pages share, but for the results themselves."""

    version: int
    """Grows with every change; of two states the larger is the newer."""
    sequence: SequenceInfo | None
    opening: OpeningInfo | None
    parameters: dict[str, Any]
    changed: list[str]
    """Keys whose value is not the default."""
    methods: MethodsInfo
    playhead: int
    selection: int | None
    layers: dict[str, bool]
    """Of the 3D view."""
    run: RunInfo
    pinned: PinnedInfo | None
    viser: ViserInfo


class ParameterInfo(Model):
    """One parameter: what a slider needs."""

    key: str
    group: str
    name: str
    label: str
    help: str
    symbol: str
    unit: str
    stage: str
    """The first stage that a change re-runs."""
    kind: Literal["float", "int", "bool", "choice"]
    default: Any
    minimum: float | None
    maximum: float | None
    step: float | None
    log: bool
    choices: list[str]
    advanced: bool


class GroupInfo(Model):
    """A group of parameters."""

    name: str
    help: str


class Schema(Model):
    """Every parameter, method and preset."""

    groups: list[GroupInfo]
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
    ready: bool
    """Whether it opens without rendering."""
    error: str | None = None
    """Why it cannot be opened."""


class SequenceList(Model):
    """What can be opened."""

    sequences: list[SequenceEntryInfo]


class Measurement(Model):
    """A peak or detection that the camera's filter was given."""

    box: Box
    score: float


class Estimate(Model):
    """A camera's own 2D estimate."""

    box: Box
    weight: float
    label: int
    """-1 where the method has no labels."""


class CameraEvent(Model):
    """Something that happened to people in a camera's picture, as its method tells it."""

    kind: Literal["new", "vanished", "returned", "occluded", "merged", "split"]
    labels: list[int]
    """Labels of the camera's own 2D estimates."""


Gate = tuple[float, float, float, float, float]
"""An ellipse: centre x and y, and xx, xy, yy of the matrix C with (z − c)ᵀ C⁻¹ (z − c) = 1."""


class CameraTrack(Model):
    """One 3D target as one camera should see it, and what that camera said of it."""

    id: int
    box: Box | None
    """Reprojected; null where a part is behind the camera."""
    seen: bool
    """Whether one of the camera's boxes fed it at this step."""
    detection_probability: float
    source: int
    """Index of the box that fed it among what the camera gave the fusion, -1 for none."""
    hidden_by: int | None
    """Id of the target in front of it."""
    visible: bool
    reason: Literal["out of view", "behind camera"] | None
    """Why it is not visible."""
    centre: tuple[float, float] | None


class CameraTruth(Model):
    """Where a person really is in this picture."""

    id: int
    box: Box
    valid: bool
    """False where the position is not certain."""


class CameraStep(Model):
    """One camera at one step."""

    name: str
    measurements: list[Measurement]
    estimates: list[Estimate]
    samples: list[tuple[float, float, float]] | None = None
    """x, y and relative weight; only where asked for."""
    events: list[CameraEvent] = Field(default_factory=list)
    gates: list[Gate] = Field(default_factory=list)
    """Where the method expects its targets, in pixels."""
    foreground: str | None = None
    """``?run=`` of the foreground's address; null where the method has none."""
    tracks: list[CameraTrack]
    truth: list[CameraTruth]
    information: dict[str, float]
    """Numbers of the method worth showing, by name."""


class Track(Model):
    """One 3D target at one step."""

    id: int
    position: Vector
    sigma: Vector
    existence: float
    """Weight or probability of existence."""
    seen: list[bool]
    """By camera."""


class Truth(Model):
    """Where a person really is."""

    id: int
    position: Vector
    valid: bool


class Step(Model):
    """One step of the shown run; the truth is there whether it is computed or not."""

    run: str
    """Key of the run that it is of; empty where none is shown."""
    step: int
    computed: bool
    cameras: list[CameraStep]
    tracks: list[Track]
    truth: list[Truth]
    components: int
    cardinality: float
    """Expected number of people: the sum of the weights."""


Span = tuple[int, int, Literal["seen", "coasting"]]
"""First step, last step, and whether any camera saw the target."""


class TrackLife(Model):
    """A track's life."""

    id: int
    first: int
    last: int
    """Of its whole life."""
    seen: float
    """Share of its whole life in which a camera saw it."""
    spans: list[Span]
    """Within the steps asked for; ones shorter than ``stride`` are joined with their neighbours."""


class Counts(Model):
    """Whole numbers over time: of each bucket the lowest, the highest and the mean."""

    low: list[int]
    high: list[int]
    mean: list[float]


class Numbers(Model):
    """Numbers over time: of each bucket the lowest, the highest and the mean."""

    low: list[float]
    high: list[float]
    mean: list[float]


class Timeline(Model):
    """The shown run over time, as far as it is computed, summed up in buckets of steps."""

    run: str
    done: int
    frames: int
    first: int
    """The first step of the first bucket."""
    stride: int
    """Steps a bucket: 1 where each step has its own value."""
    cardinality: Numbers
    count: Counts
    """Targets reported."""
    truth: Counts | None
    """People really there, over all steps asked for."""
    tracks: list[TrackLife]
    """Those that live in the steps asked for, by id."""
    left_out: int
    """How many more live there: the shorter ones, where they are very many."""


class OpenRequest(Model):
    """Open another sequence."""

    name: str = Field(min_length=1, max_length=4096)
    """A built-in name, a name of the list, or a folder."""


class ParameterChanges(Model):
    """Values by key; all are taken or none."""

    changes: dict[str, Any]
    origin: str = ""


class ResetRequest(Model):
    """Back to the defaults."""

    keys: list[str] | None = None
    """All, the methods included, where none are named."""


class PresetRequest(Model):
    """A preset by name."""

    name: str


class LayerChanges(Model):
    """Layers of the 3D view, by name."""

    changes: dict[str, bool]


class ViewChange(Model):
    """Look through a camera in 3D."""

    camera: int | None
    """Its index; null for the free view."""


class SelectChange(Model):
    """Select a track."""

    id: int | None


class SeekChange(Model):
    """Move the playhead."""

    step: int
    origin: str = ""


class StreamSeek(SeekChange):
    """From the page over the socket."""

    type: Literal["seek"]


class StreamSelect(SelectChange):
    """From the page over the socket."""

    type: Literal["select"]


class StreamPing(Model):
    """From the page over the socket: is anybody there?"""

    type: Literal["ping"]
