"""One step of a run as the message that the page draws."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy import ndarray
from pydantic import Field

from app.messages import Box, Model, Vector
from app.scene.geometry import FUTURE_SECONDS
from app.state.pairs import pairs_at
from app.web.overlays import key_of
from tracker.fusion.protocol import FusionResult
from tracker.fusion.trajectories import Trajectories
from tracker.geometry.boxes import Boxes
from tracker.parameters.groups.colour_phd import ColourPhdParams
from tracker.runs.detection_owners import detection_owners
from tracker.runs.pipeline import Run
from tracker.sequences.sequence import Sequence
from tracker.single_view.protocol import GATES, ViewResult, unpack_samples


class Measurement(Model):
    """A peak or detection that the camera's filter was given."""

    box: Box
    score: float
    track: int | None = None
    """Id of the track that it feeds; null where it is nobody's."""
    nearest: int | None = None
    """Of one that is nobody's: the track that it is nearest to."""
    sigmas: float | None = None
    """And how far that is, in standard deviations of where its box is expected."""
    gate: float | None = None
    """And within how many of them a box would have been taken for the track's."""


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


Reason = Literal["out of view", "behind camera", "near the edge"]


class Feeding(Model):
    """The box associated with a track, as the single-view stage gave it to the fusion."""

    box: Box
    weight: float
    """Its weight, existence or detector's score."""
    share: float
    """Association probability: that this track made the box, 0 … 1."""


class CameraTrack(Model):
    """One 3D target as one camera should see it, and what that camera said of it."""

    id: int
    box: Box | None
    """Reprojected; null where a part is behind the camera."""
    seen: bool
    """Whether one of the camera's boxes is associated with it at this step."""
    detection_probability: float
    source: int
    """Index of the associated box among those that the camera gave the fusion, -1 for none."""
    fed_by: Feeding | None
    hidden_by: int | None
    """Id of the target that occludes it; null for none."""
    visible: bool
    reason: Reason | None
    """Why it is not, or hardly, visible."""
    centre: tuple[float, float] | None
    trail: list[tuple[int, float, float]] = Field(default_factory=list)
    """Steps from this one, x and y of the feet; only where asked for."""


class CameraTruth(Model):
    """Where a person really is in this picture."""

    id: int
    box: Box
    valid: bool
    """False where the position is not certain."""


class Candidate(Model):
    """What a camera's method looked at and did not believe."""

    box: Box
    gate: str
    """At which it fell, in words."""


class CameraStep(Model):
    """One camera at one step."""

    name: str
    measurements: list[Measurement]
    estimates: list[Estimate]
    samples: list[tuple[float, float, float]] | None = None
    """x, y and relative weight; only where asked for."""
    dropped: list[Candidate] | None = None
    """With the samples."""
    events: list[CameraEvent] = Field(default_factory=list)
    gates: list[Gate] = Field(default_factory=list)
    """Where the method expects its targets, in pixels."""
    foreground: str | None = None
    """``?run=`` of the foreground's address; null where the method has none."""
    likelihood: str | None = None
    """``?run=`` of the likelihood map's address; null without pictures or templates."""
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
    height: tuple[float, float] | None = None
    """Height of the person while standing and its standard deviation, metres; null where it is not
    estimated."""


class Truth(Model):
    """Where a person really is."""

    id: int
    position: Vector
    valid: bool
    track: int | None = None
    """The track that is this person's at this step."""
    error: float | None = None
    """How far that is away, metres."""


class Step(Model):
    """One step of the shown run; the truth is there whether it is computed or not."""

    run: str
    """Key of the run that it is of; empty where none is shown."""
    revision: int
    """Of the run's people: a later one has others at steps that were there before."""
    step: int
    computed: bool
    cameras: list[CameraStep]
    tracks: list[Track]
    truth: list[Truth]
    components: int | None
    """The number of components of the filter; null where only the tracks of a run were stored."""
    cardinality: float | None
    """Expected number of people: the sum of the weights; null where only tracks were stored."""


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
) -> Step:
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
        CameraStep(
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
    message = Step(
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
    sequence: Sequence, run: Run | None, step: int, cameras: list[CameraStep]
) -> list[Truth]:
    truth = sequence.ground_truth
    if truth is None:
        return []
    rows = truth.at(step)
    ids, positions, valid = truth.ids[rows].tolist(), truth.positions[rows], truth.valid[rows]
    for view, message in zip(sequence.views, cameras, strict=True):
        boxes, visible = view.camera.project_boxes(positions, sequence.target_half_extents)
        message.truth = [
            CameraTruth(id=ids[i], box=_box(boxes[i]), valid=bool(valid[i]))
            for i in np.flatnonzero(visible)
        ]
    told = [
        Truth(id=ids[i], position=_vector(positions[i]), valid=bool(valid[i]))
        for i in range(len(ids))
    ]
    if run is not None and step < run.done:
        tracks = run.tracks
        pairs = pairs_at(truth, tracks, step)
        found = tracks.ids[tracks.at(step)][pairs.estimates]
        for person, track, error in zip(pairs.people, found, pairs.errors, strict=True):
            told[person].track, told[person].error = int(track), round(float(error), 4)
    return told


def _add_views(message: Step, run: Run, step: int, with_samples: bool) -> None:
    for camera, view in zip(message.cameras, run.views[step], strict=True):
        camera.measurements = [
            Measurement(box=box, score=score)
            for box, score in zip(
                _corner_boxes(view.measurements), view.measurement_scores.tolist(), strict=True
            )
        ]
        camera.estimates = [
            Estimate(box=box, weight=weight, label=label)
            for box, weight, label in zip(
                _corner_boxes(view.estimates),
                view.estimate_weights.tolist(),
                view.estimate_labels.tolist(),
                strict=True,
            )
        ]
        camera.information = view.information
        camera.events = [
            CameraEvent(kind=event.kind, labels=list(event.labels)) for event in view.events
        ]
        camera.gates = [(x, y, xx, xy, yy) for x, y, xx, xy, yy in view.gates.round(2).tolist()]
        if view.foreground is not None:
            camera.foreground = run.keys["single_view"]
        if with_samples:
            points = np.column_stack(unpack_samples(view.samples))
            camera.samples = [(x, y, w) for x, y, w in points.round(3).tolist()]
            camera.dropped = [
                Candidate(box=box, gate=GATES[gate])
                for box, gate in zip(
                    _corner_boxes(view.dropped.boxes.astype(float)),
                    view.dropped.gates.tolist(),
                    strict=True,
                )
            ]


def _add_owners(message: Step, run: Run, step: int) -> None:
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


def _add_tracks(message: Step, sequence: Sequence, run: Run, step: int) -> None:
    tracks = run.tracks
    rows = tracks.at(step)
    ids, positions = tracks.ids[rows].tolist(), tracks.positions[rows]
    components, seen = tracks.components[rows], tracks.seen[rows]
    # those in front are named by the label of their component, tracks by their id
    id_of_label = dict(zip(tracks.labels[rows].tolist(), ids, strict=True))
    message.tracks = [
        Track(
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
            reason: Reason | None = None
            if not visible[i]:
                reason = "out of view" if whole else "behind camera"
            elif fused is not None and hidden_by is None and probability < WORTH_A_REASON * nominal:
                reason = "near the edge"
            camera.tracks.append(
                CameraTrack(
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


def _feeding(view: ViewResult, fused: FusionResult, camera: int, component: int) -> Feeding | None:
    source = int(fused.sources[camera, component])
    if not 0 <= source < len(view.boxes):
        return None
    return Feeding(
        box=_corner_boxes(view.boxes[source : source + 1])[0],
        weight=float(f"{float(view.weights[source]):.4g}"),
        share=round(float(fused.source_weights[camera, component]), 4),
    )


def _add_trails(message: Step, sequence: Sequence, run: Run, step: int, seconds: float) -> None:
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


def _vector(values: ndarray) -> Vector:
    x, y, z = values.tolist()
    return x, y, z


def _box(values: ndarray) -> Box:
    left, top, width, height = values.round(2).tolist()
    return left, top, width, height


def _corner_boxes(boxes: ndarray) -> list[Box]:
    """Centre and half sizes as left, top, width, height."""
    rows: list[Box] = [
        (left, top, width, height)
        for left, top, width, height in Boxes(boxes).left_top.round(2).tolist()
    ]
    return rows
