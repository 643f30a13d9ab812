"""A snapshot and a step as the messages of :mod:`app.models`."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
from numpy import ndarray

from app import models
from app.snapshot import Snapshot
from tracker import parameters as table
from tracker.pipeline import Run
from tracker.sequences.sequence import Sequence


def state_of(snapshot: Snapshot) -> models.State:
    """The shared state as the page gets it."""
    parameters = snapshot.parameters
    return models.State(
        version=snapshot.version,
        sequence=_sequence_of(snapshot.sequence, snapshot.sequence_key),
        opening=None
        if snapshot.opening is None
        else models.OpeningInfo(**asdict(snapshot.opening)),
        parameters={key: table.value(parameters, key) for key in table.PARAMETERS},
        changed=list(table.changed(parameters, snapshot.defaults)),
        methods=models.MethodsInfo(
            single_view=parameters.single_view, fusion_method=parameters.fusion_method
        ),
        playhead=snapshot.playhead,
        selection=snapshot.selection,
        layers=dict(snapshot.layers),
        run=run_of(snapshot),
        pinned=_pinned_of(snapshot),
        viser=models.ViserInfo(),
    )


def run_of(snapshot: Snapshot) -> models.RunInfo:
    """How far the run is."""
    return models.RunInfo(**asdict(snapshot.run_state))


def _pinned_of(snapshot: Snapshot) -> models.PinnedInfo | None:
    pinned = snapshot.scores.pinned
    if pinned is None:
        return None
    values = pinned.parameters
    return models.PinnedInfo(
        key=pinned.key,
        parameters={key: table.value(values, key) for key in (*table.METHODS, *table.PARAMETERS)},
        changed=list(table.changed(values, snapshot.defaults)),
        differs=list(table.changed(values, snapshot.parameters)),
    )


def schema() -> models.Schema:
    """Every parameter, method and preset."""
    return models.Schema(
        groups=[models.GroupInfo(name=name, help=text) for name, text in table.GROUPS.items()],
        parameters=[
            models.ParameterInfo(
                **{name: getattr(p, name) for name in models.ParameterInfo.model_fields}
            )
            for p in table.PARAMETERS.values()
        ],
        methods={key: list(choices) for key, choices in table.METHODS.items()},
        presets=table.PRESETS,
    )


def _sequence_of(sequence: Sequence | None, key: str) -> models.SequenceInfo | None:
    if sequence is None:
        return None
    room = sequence.room
    return models.SequenceInfo(
        key=key,
        name=sequence.name,
        description=sequence.description,
        fps=sequence.fps,
        frames=sequence.frames,
        has_pictures=any(view.has_pictures for view in sequence.views),
        has_detections=any(view.detections is not None for view in sequence.views),
        has_truth=sequence.ground_truth is not None,
        room=models.RoomInfo(
            min=_vector(room.minimum),
            max=_vector(room.maximum),
            entrances=[
                models.EntranceInfo(position=_vector(e.position), sigma=_vector(e.sigma))
                for e in room.entrances
            ],
        ),
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
    )


def step_of(
    sequence: Sequence, run: Run | None, step: int, *, with_samples: bool = False
) -> models.Step:
    """One step of a run, with the truth; what is not computed yet stays empty."""
    computed = run is not None and step < run.done
    cameras = [
        models.CameraStep(
            name=camera.name, measurements=[], estimates=[], tracks=[], truth=[], information={}
        )
        for camera in sequence.cameras
    ]
    message = models.Step(
        run=run.key if run is not None else "",
        step=step,
        computed=computed,
        cameras=cameras,
        tracks=[],
        truth=_truth(sequence, step, cameras),
        components=0,
        cardinality=0.0,
    )
    if run is not None and computed:
        _add_views(message, run, step, with_samples)
        _add_tracks(message, sequence, run, step)
    return message


def _truth(sequence: Sequence, step: int, cameras: list[models.CameraStep]) -> list[models.Truth]:
    truth = sequence.ground_truth
    if truth is None:
        return []
    rows = truth.at(step)
    ids, positions, valid = truth.ids[rows].tolist(), truth.positions[rows], truth.valid[rows]
    for view, message in zip(sequence.views, cameras, strict=True):
        boxes, visible = view.camera.project_boxes(positions, sequence.target_half_extents)
        message.truth = [
            models.CameraTruth(id=ids[i], box=_box(boxes[i]), valid=bool(valid[i]))
            for i in np.flatnonzero(visible)
        ]
    return [
        models.Truth(id=ids[i], position=_vector(positions[i]), valid=bool(valid[i]))
        for i in range(len(ids))
    ]


def _add_views(message: models.Step, run: Run, step: int, with_samples: bool) -> None:
    for camera, view in zip(message.cameras, run.views[step], strict=True):
        camera.measurements = [
            models.Measurement(box=box, score=score)
            for box, score in zip(
                _corner_boxes(view.measurements), view.measurement_scores.tolist(), strict=True
            )
        ]
        camera.estimates = [
            models.Estimate(box=box, weight=weight, label=label)
            for box, weight, label in zip(
                _corner_boxes(view.estimates),
                view.estimate_weights.tolist(),
                view.estimate_labels.tolist(),
                strict=True,
            )
        ]
        camera.information = view.information
        camera.events = [
            models.CameraEvent(kind=event.kind, labels=list(event.labels)) for event in view.events
        ]
        camera.gates = [(x, y, xx, xy, yy) for x, y, xx, xy, yy in view.gates.round(2).tolist()]
        if view.foreground is not None:
            camera.foreground = run.keys["single_view"]
        if with_samples:
            points = np.column_stack([view.samples[:, :2], view.sample_weights])
            camera.samples = [(x, y, w) for x, y, w in points.round(3).tolist()]


def _add_tracks(message: models.Step, sequence: Sequence, run: Run, step: int) -> None:
    fused, tracks = run.fused[step], run.tracks
    message.components = fused.posterior.size
    message.cardinality = fused.posterior.cardinality
    rows = tracks.at(step)
    ids, positions = tracks.ids[rows].tolist(), tracks.positions[rows]
    components, seen = tracks.components[rows], tracks.seen[rows]
    # those in front are named by the label of their component, tracks by their id
    id_of_label = dict(zip(fused.posterior.labels[components].tolist(), ids, strict=True))
    message.tracks = [
        models.Track(
            id=ids[i],
            position=_vector(positions[i]),
            sigma=_vector(tracks.sigmas[rows][i]),
            existence=float(tracks.existences[rows][i]),
            seen=seen[i].tolist(),
        )
        for i in range(len(ids))
    ]
    for index, (view, camera) in enumerate(zip(sequence.views, message.cameras, strict=True)):
        boxes, visible = view.camera.project_boxes(positions, sequence.target_half_extents)
        centres, in_front = view.camera.project(positions)
        for i, component in enumerate(components.tolist()):
            whole = bool(np.isfinite(boxes[i]).all())
            reason = None if visible[i] else "out of view" if whole else "behind camera"
            camera.tracks.append(
                models.CameraTrack(
                    id=ids[i],
                    box=_box(boxes[i]) if whole else None,
                    seen=bool(seen[i, index]),
                    detection_probability=round(
                        float(fused.detection_probabilities[index, component]), 4
                    ),
                    source=int(fused.sources[index, component]),
                    hidden_by=id_of_label.get(int(fused.hidden_by[index, component])),
                    visible=bool(visible[i]),
                    reason=reason,  # type: ignore[arg-type]
                    centre=(float(centres[i, 0]), float(centres[i, 1])) if in_front[i] else None,
                )
            )


def _vector(values: ndarray) -> models.Vector:
    x, y, z = values.tolist()
    return x, y, z


def _box(values: ndarray) -> models.Box:
    left, top, width, height = values.round(2).tolist()
    return left, top, width, height


def _corner_boxes(boxes: ndarray) -> list[models.Box]:
    """Centre and half sizes as left, top, width, height."""
    corners = np.column_stack([boxes[:, :2] - boxes[:, 2:], 2.0 * boxes[:, 2:]])
    return [_box(row) for row in corners]
