"""A snapshot as the messages of :mod:`app.models`."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, get_args

from numpy import ndarray

from app import models
from app.state.snapshot import Snapshot
from app.web.command_line import command_line
from app.web.corrections import views as corrections
from tracker.parameters import Topic
from tracker.parameters.catalogue import GROUPS, METHODS, PARAMETERS, PRESETS
from tracker.parameters.values import changed_values, shown_keys, value_of
from tracker.sequences.sequence import Room
from tracker.sequences.writing.teaching import changes, taught_values


def state_of(snapshot: Snapshot) -> models.State:
    """The shared state as the page gets it."""
    parameters = snapshot.parameters
    return models.State(
        session=snapshot.session,
        version=snapshot.version,
        sequence=_sequence_of(snapshot),
        opening=None
        if snapshot.opening is None
        else models.OpeningInfo(**asdict(snapshot.opening)),
        parameters={key: value_of(parameters, key) for key in PARAMETERS},
        changed=list(changed_values(parameters, snapshot.defaults)),
        shown=shown_keys(parameters),
        command=command_line(snapshot),
        methods=models.MethodsInfo(
            single_view=parameters.single_view,
            fusion_method=parameters.fusion_method,
            smoothing_method=parameters.smoothing_method,
        ),
        unfit={str(key): names for key, names in snapshot.unfit.items()},
        presets=list(snapshot.presets),
        preset=snapshot.preset,
        playhead=snapshot.playhead,
        selection=snapshot.selection,
        layers=dict(snapshot.layers),
        trail=models.TrailInfo(**asdict(snapshot.trail)),
        view=snapshot.view,
        theme=snapshot.theme,
        run=run_of(snapshot),
        pinned=_pinned_of(snapshot),
        teaching=_teaching_of(snapshot),
        corrections=corrections.state_of(snapshot),
        edits=models.EditsInfo(undo=snapshot.undo_words, redo=snapshot.redo_words),
        marks=snapshot.marks,
        tasks={kind: models.TaskInfo(**one) for kind, one in tasks_of(snapshot).items()},
        viser=models.ViserInfo(),
    )


def tasks_of(snapshot: Snapshot) -> dict[str, dict[str, Any]]:
    """Work in the background, by its kind."""
    return {kind: asdict(task) for kind, task in snapshot.tasks.items()}


def run_of(snapshot: Snapshot) -> models.RunInfo:
    """How far the run is."""
    state, run = snapshot.run_state, snapshot.run
    smoothed = run is not None and run.key == state.key and run.tracks is not run.filtered
    if run is not None and state.kept is not None:  # only its people are kept, not the filter's
        smoothed = run.parameters.smoothing_method != "none"
    values = {**asdict(state), "warnings": list(state.warnings)}
    return models.RunInfo(**values, smoothed=smoothed)


def _teaching_of(snapshot: Snapshot) -> models.TeachingInfo:
    sequence, saved = snapshot.sequence, snapshot.saved
    unsaved = 0
    if sequence is not None and saved is not None and sequence is not saved:
        unsaved = len(changes(taught_values(saved), taught_values(sequence)))
    return models.TeachingInfo(
        key=sequence.digest if sequence is not None else "",
        unsaved=unsaved,
        editing_room=snapshot.editing_room,
    )


def _pinned_of(snapshot: Snapshot) -> models.PinnedInfo | None:
    pinned = snapshot.scores.pinned
    if pinned is None:
        return None
    values = pinned.parameters
    return models.PinnedInfo(
        key=pinned.key,
        parameters={key: value_of(values, key) for key in (*METHODS, *PARAMETERS)},
        changed=list(changed_values(values, snapshot.defaults)),
        differs=list(changed_values(values, snapshot.parameters)),
    )


def schema() -> models.Schema:
    """Every parameter, method and preset."""
    return models.Schema(
        groups=[models.GroupInfo(name=name, help=text) for name, text in GROUPS.items()],
        topics=list(get_args(Topic)),
        parameters=[
            models.ParameterInfo(
                **{name: getattr(p, name) for name in models.ParameterInfo.model_fields}
            )
            for p in PARAMETERS.values()
        ],
        methods={key: list(choices) for key, choices in METHODS.items()},
        presets=PRESETS,
    )


def _sequence_of(snapshot: Snapshot) -> models.SequenceInfo | None:
    sequence = snapshot.sequence
    if sequence is None:
        return None
    return models.SequenceInfo(
        key=snapshot.sequence_key,
        name=sequence.name,
        opened_as=snapshot.opened_as,
        description=sequence.description,
        fps=sequence.fps,
        frames=sequence.frames,
        has_pictures=any(view.has_pictures for view in sequence.views),
        has_detections=any(view.detections is not None for view in sequence.views),
        has_truth=sequence.ground_truth is not None,
        room=room_of(sequence.room),
        target=models.TargetInfo(half_extents=_vector(sequence.target_half_extents)),
        cameras=[
            models.CameraInfo(
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


def room_of(room: Room) -> models.RoomInfo:
    """The volume that people are tracked in, and where they appear."""
    return models.RoomInfo(
        min=_vector(room.minimum),
        max=_vector(room.maximum),
        entrances=[
            models.EntranceInfo(position=_vector(e.position), sigma=_vector(e.sigma))
            for e in room.entrances
        ],
    )


def _vector(values: ndarray) -> models.Vector:
    x, y, z = values.tolist()
    return x, y, z
