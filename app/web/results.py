"""The state that all pages share, as a message, and what can be chosen."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, Literal, get_args
from urllib.parse import urlencode

from numpy import ndarray

from app.messages import Model, Vector, filled
from app.state.snapshot import RunPhase, Snapshot, Task, Trail
from app.web import corrections as corrections
from app.web.corrections import CorrectionsState
from tracker.parameters import Topic
from tracker.parameters.catalogue import GROUPS, METHODS, PARAMETERS, PRESETS, RunParameters
from tracker.parameters.values import changed_values, shown_keys, value_of
from tracker.runs.track_command import track_command
from tracker.sequences.built_in import place_of
from tracker.sequences.sequence import Room
from tracker.sequences.writing.teaching import changes, taught_values


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
    folder: str
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
    trail: Trail
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
    tasks: dict[str, Task]
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
    folder: str
    """The folder that it lies in, whose name need not be that of the recording."""
    cameras: int | None
    frames: int | None
    error: str | None = None
    """Why it cannot be opened."""


class SequenceList(Model):
    """What can be opened."""

    sequences: list[SequenceEntryInfo]


def command_line(snapshot: Snapshot) -> str:
    """The command, quoted for a POSIX shell; empty while no sequence is open.

    Both methods are named, since what fits a sequence may be another one later; of the
    values, those that are not at their defaults.
    """
    sequence, parameters = snapshot.sequence, snapshot.parameters
    if sequence is None:
        return ""
    methods = {"single_view": parameters.single_view, "fusion_method": parameters.fusion_method}
    changes = {**methods, **changed_values(parameters, snapshot.defaults)}
    detector = sequence.detector
    own = detector is not None and detector.named and parameters.single_view == "onnx_detector"
    network = ["--detector", str(detector.path.absolute())] if detector is not None and own else []
    seed = 0 if snapshot.run is None else snapshot.run.seed
    return track_command(place_of(sequence.folder), "tracks.csv", changes, seed, *network)


def address_of(base: str, opens: str, parameters: RunParameters, defaults: RunParameters) -> str:
    """The address at which a run can be looked into again.

    Args:
        base: Of the page, with its last slash.
        opens: The name or folder that opens the recording.
        parameters: Of the run.
        defaults: Of the recording; what differs from them is in the address.
    """
    changes = {
        f"p.{key}": str(value).lower() if isinstance(value, bool) else value
        for key, value in changed_values(parameters, defaults).items()
    }
    return f"{base}?{urlencode({'seq': opens, **changes})}"


def state_of(snapshot: Snapshot) -> State:
    """The shared state as the page gets it."""
    parameters = snapshot.parameters
    return State(
        session=snapshot.session,
        version=snapshot.version,
        sequence=_sequence_of(snapshot),
        opening=None if snapshot.opening is None else filled(OpeningInfo, snapshot.opening),
        parameters={key: value_of(parameters, key) for key in PARAMETERS},
        changed=list(changed_values(parameters, snapshot.defaults)),
        shown=shown_keys(parameters),
        command=command_line(snapshot),
        methods=filled(MethodsInfo, parameters),
        unfit={str(key): names for key, names in snapshot.unfit.items()},
        presets=list(snapshot.presets),
        preset=snapshot.preset,
        playhead=snapshot.playhead,
        selection=snapshot.selection,
        layers=dict(snapshot.layers),
        trail=snapshot.trail,
        view=snapshot.view,
        theme=snapshot.theme,
        run=run_of(snapshot),
        pinned=_pinned_of(snapshot),
        teaching=_teaching_of(snapshot),
        corrections=corrections.state_of(snapshot),
        edits=EditsInfo(undo=snapshot.undo_words, redo=snapshot.redo_words),
        marks=snapshot.marks,
        tasks=dict(snapshot.tasks),
        viser=ViserInfo(),
    )


def run_of(snapshot: Snapshot) -> RunInfo:
    """How far the run is."""
    state, run = snapshot.run_state, snapshot.run
    smoothed = run is not None and run.key == state.key and run.tracks is not run.filtered
    if run is not None and state.kept is not None:  # only its people are kept, not the filter's
        smoothed = run.parameters.smoothing_method != "none"
    values = {**asdict(state), "warnings": list(state.warnings)}
    return RunInfo(**values, smoothed=smoothed)


def _teaching_of(snapshot: Snapshot) -> TeachingInfo:
    sequence, saved = snapshot.sequence, snapshot.saved
    unsaved = 0
    if sequence is not None and saved is not None and sequence is not saved:
        unsaved = len(changes(taught_values(saved), taught_values(sequence)))
    return TeachingInfo(
        key=sequence.digest if sequence is not None else "",
        unsaved=unsaved,
        editing_room=snapshot.editing_room,
    )


def _pinned_of(snapshot: Snapshot) -> PinnedInfo | None:
    pinned = snapshot.scores.pinned
    if pinned is None:
        return None
    values = pinned.parameters
    return PinnedInfo(
        key=pinned.key,
        parameters={key: value_of(values, key) for key in (*METHODS, *PARAMETERS)},
        changed=list(changed_values(values, snapshot.defaults)),
        differs=list(changed_values(values, snapshot.parameters)),
    )


def schema() -> Schema:
    """Every parameter, method and preset."""
    return Schema(
        groups=[GroupInfo(name=name, help=text) for name, text in GROUPS.items()],
        topics=list(get_args(Topic)),
        parameters=[filled(ParameterInfo, parameter) for parameter in PARAMETERS.values()],
        methods={key: list(choices) for key, choices in METHODS.items()},
        presets=PRESETS,
    )


def _sequence_of(snapshot: Snapshot) -> SequenceInfo | None:
    sequence = snapshot.sequence
    if sequence is None:
        return None
    return filled(
        SequenceInfo,
        sequence,
        key=snapshot.sequence_key,
        opened_as=snapshot.opened_as,
        folder=str(sequence.folder.absolute()),
        has_pictures=any(view.has_pictures for view in sequence.views),
        has_detections=any(view.detections is not None for view in sequence.views),
        has_truth=sequence.ground_truth is not None,
        room=room_of(sequence.room),
        target=TargetInfo(half_extents=_vector(sequence.target_half_extents)),
        cameras=[
            CameraInfo(
                name=view.camera.name,
                width=view.camera.image_size[0],
                height=view.camera.image_size[1],
                has_pictures=view.has_pictures,
                has_detections=view.detections is not None,
            )
            for view in sequence.views
        ],
        templates=len(sequence.templates),
        warnings=list(sequence.warnings),
    )


def room_of(room: Room) -> RoomInfo:
    """The volume that people are tracked in, and where they appear."""
    return RoomInfo(
        min=_vector(room.minimum),
        max=_vector(room.maximum),
        entrances=[
            EntranceInfo(position=_vector(e.position), sigma=_vector(e.sigma))
            for e in room.entrances
        ],
    )


def _vector(values: ndarray) -> Vector:
    x, y, z = values.tolist()
    return x, y, z
