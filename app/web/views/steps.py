"""One step of a run as the message that the page draws."""

from __future__ import annotations

import numpy as np
from numpy import ndarray

from app import models
from app.scene.geometry import FUTURE_SECONDS
from app.state.pairs import pairs_at
from app.web.pictures.likelihood import key_of
from tracker.fusion.protocol import FusionResult
from tracker.fusion.trajectories import Trajectories
from tracker.geometry.boxes import Boxes
from tracker.parameters.groups.colour_phd import ColourPhdParams
from tracker.runs.detection_owners import detection_owners
from tracker.runs.pipeline import Run
from tracker.sequences.sequence import Sequence
from tracker.single_view.protocol import GATES, ViewResult, unpack_samples

WORTH_A_REASON = 0.9
"""Below this share of the chosen p_D, a camera's p_D for a track is explained."""

MOST_POINTS = 240
"""Of one trail in a picture."""

TRAIL_POINTS = 6
"""Points a second of the trails in the pictures."""


def step_of(
    sequence: Sequence,
    run: Run | None,
    step: int,
    *,
    with_samples: bool = False,
    trails: float = 0.0,
) -> models.Step:
    """One step of a run, with the truth; what is not computed yet stays empty.

    Args:
        sequence: That is open.
        run: That is shown.
        step: 0-based.
        with_samples: Whether to tell each camera's samples, which are many.
        trails: How many seconds back to tell where tracks come from in each picture, and where
            they go to; 0 for not at all.
    """
    run = run.snapshot() if run is not None else None
    computed = run is not None and step < run.done
    likelihood = None
    if run is not None and sequence.templates:
        likelihood = key_of(sequence, run.parameters.of(ColourPhdParams))
    cameras = [
        models.CameraStep(
            name=view.camera.name,
            measurements=[],
            estimates=[],
            likelihood=likelihood if view.has_pictures else None,
            tracks=[],
            truth=[],
            information={},
        )
        for view in sequence.views
    ]
    message = models.Step(
        run=run.key if run is not None else "",
        revision=run.revision if run is not None else 0,
        step=step,
        computed=computed,
        cameras=cameras,
        tracks=[],
        truth=_truth(sequence, run, step, cameras),
        components=None,
        cardinality=None,
    )
    if run is not None and computed:
        if not run.only_tracks:
            _add_views(message, run, step, with_samples)
        _add_tracks(message, sequence, run, step)
        if not run.only_tracks:
            _add_owners(message, run, step)
        if trails:
            _add_trails(message, sequence, run, step, trails)
    return message


def _truth(
    sequence: Sequence, run: Run | None, step: int, cameras: list[models.CameraStep]
) -> list[models.Truth]:
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
    told = [
        models.Truth(id=ids[i], position=_vector(positions[i]), valid=bool(valid[i]))
        for i in range(len(ids))
    ]
    if run is not None and step < run.done:
        tracks = run.tracks
        pairs = pairs_at(truth, tracks, step)
        found = tracks.ids[tracks.at(step)][pairs.estimates]
        for person, track, error in zip(pairs.people, found, pairs.errors, strict=True):
            told[person].track, told[person].error = int(track), round(float(error), 4)
    return told


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
            points = np.column_stack(unpack_samples(view.samples))
            camera.samples = [(x, y, w) for x, y, w in points.round(3).tolist()]
            camera.dropped = [
                models.Candidate(box=box, gate=GATES[gate])
                for box, gate in zip(
                    _corner_boxes(view.dropped.boxes.astype(float)),
                    view.dropped.gates.tolist(),
                    strict=True,
                )
            ]


def _add_owners(message: models.Step, run: Run, step: int) -> None:
    """Write beside each detection whose it is, and how far the nearest track is from others."""
    for camera, owners in zip(message.cameras, detection_owners(run, step), strict=True):
        for detection, track, nearest, distance in zip(
            camera.measurements,
            owners.tracks.tolist(),
            owners.nearest.tolist(),
            owners.distances.tolist(),
            strict=True,
        ):
            detection.track = track if track >= 0 else None
            if nearest >= 0:
                detection.nearest = nearest
                detection.sigmas, detection.gate = round(distance, 2), round(owners.gate, 2)


def _height(tracks: Trajectories, row: int) -> tuple[float, float] | None:
    """The height of a row's person and its standard deviation; None where it is not estimated."""
    height, sigma = float(tracks.heights[row]), float(tracks.sigma_heights[row])
    return (height, sigma) if np.isfinite(height) else None


def _add_tracks(message: models.Step, sequence: Sequence, run: Run, step: int) -> None:
    tracks = run.tracks
    rows = tracks.at(step)
    ids, positions = tracks.ids[rows].tolist(), tracks.positions[rows]
    components, seen = tracks.components[rows], tracks.seen[rows]
    # those in front are named by the label of their component, tracks by their id
    id_of_label = dict(zip(tracks.labels[rows].tolist(), ids, strict=True))
    message.tracks = [
        models.Track(
            id=ids[i],
            position=_vector(positions[i]),
            sigma=_vector(tracks.sigmas[rows][i]),
            existence=float(tracks.existences[rows][i]),
            seen=seen[i].tolist(),
            height=_height(tracks, rows.start + i),
        )
        for i in range(len(ids))
    ]
    fused = None if run.only_tracks else run.fused[step]
    if fused is not None:
        message.components = fused.posterior.size
        message.cardinality = fused.posterior.cardinality
    probabilities = run.detection_probabilities(np.arange(rows.start, rows.stop))
    nominal = run.parameters.fusion.detection_probability
    for index, (view, camera) in enumerate(zip(sequence.views, message.cameras, strict=True)):
        boxes, visible = view.camera.project_boxes(positions, sequence.target_half_extents)
        centres, in_front = view.camera.project(positions)
        for i, component in enumerate(components.tolist()):
            whole = bool(np.isfinite(boxes[i]).all())
            probability = float(probabilities[i, index])
            source, fed_by, hidden_by = -1, None, None
            # the filter knew nothing of whom the smoothing alone found
            if fused is not None and component >= 0:
                source = int(fused.sources[index, component])
                fed_by = _feeding(run.views[step][index], fused, index, component)
                hider = int(fused.hidden_by[index, component])
                hidden_by = id_of_label.get(hider) if hider >= 0 else None
            reason: models.Reason | None = None
            if not visible[i]:
                reason = "out of view" if whole else "behind camera"
            elif fused is not None and hidden_by is None and probability < WORTH_A_REASON * nominal:
                reason = "near the edge"
            camera.tracks.append(
                models.CameraTrack(
                    id=ids[i],
                    box=_box(boxes[i]) if whole else None,
                    seen=bool(seen[i, index]),
                    detection_probability=round(probability, 4) if probability >= 0.0 else 0.0,
                    source=source,
                    fed_by=fed_by,
                    hidden_by=hidden_by,
                    visible=bool(visible[i]),
                    reason=reason,
                    centre=(float(centres[i, 0]), float(centres[i, 1])) if in_front[i] else None,
                )
            )


def _feeding(
    view: ViewResult, fused: FusionResult, camera: int, component: int
) -> models.Feeding | None:
    source = int(fused.sources[camera, component])
    if not 0 <= source < len(view.boxes):
        return None
    return models.Feeding(
        box=_corner_boxes(view.boxes[source : source + 1])[0],
        weight=float(f"{float(view.weights[source]):.4g}"),
        share=round(float(fused.source_weights[camera, component]), 4),
    )


def _add_trails(
    message: models.Step, sequence: Sequence, run: Run, step: int, seconds: float
) -> None:
    """Where the feet of each track were and will be, a few points a second."""
    fps, tracks = sequence.fps, run.tracks
    # however long it is, a trail has a bounded number of points
    every = max(1, round(fps / TRAIL_POINTS), round(seconds * fps / MOST_POINTS))
    ids = [track.id for track in message.tracks]
    near = slice(
        tracks.at(step - round(seconds * fps)).start,
        tracks.at(min(run.done - 1, step + round(FUTURE_SECONDS * fps))).stop,
    )
    frames, owners = tracks.frames[near], tracks.ids[near]
    kept = ((frames - step) % every == 0) & np.isin(owners, ids)
    frames, owners = frames[kept], owners[kept]
    feet = tracks.positions[near][kept] - np.array([0.0, 0.0, sequence.target_half_extents[2]])
    for view, camera in zip(sequence.views, message.cameras, strict=True):
        pixels, in_front = view.camera.project(feet)
        size = np.array(view.camera.image_size)
        inside = in_front & (np.abs(pixels - size / 2.0) < 0.6 * size).all(axis=1)
        for track in camera.tracks:
            track.trail = [
                (
                    int(frames[i]) - step,
                    round(float(pixels[i, 0]), 1),
                    round(float(pixels[i, 1]), 1),
                )
                for i in np.flatnonzero(inside & (owners == track.id))
            ]


def _vector(values: ndarray) -> models.Vector:
    x, y, z = values.tolist()
    return x, y, z


def _box(values: ndarray) -> models.Box:
    left, top, width, height = values.round(2).tolist()
    return left, top, width, height


def _corner_boxes(boxes: ndarray) -> list[models.Box]:
    """Centre and half sizes as left, top, width, height."""
    rows: list[models.Box] = [
        (left, top, width, height)
        for left, top, width, height in Boxes(boxes).left_top.round(2).tolist()
    ]
    return rows
