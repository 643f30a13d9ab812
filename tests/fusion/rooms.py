"""The room of the fusion's tests: four cameras around it, one door, boxes of some steps."""

from __future__ import annotations

from collections.abc import Sequence as Many

import numpy as np
from numpy import ndarray

from tests import world
from tracker.fusion.measurement_births import BirthModel, Evidence, MeasurementBirths
from tracker.fusion.model import all_boxes
from tracker.fusion.multi_bernoulli import MultiBernoulli
from tracker.fusion.protocol import FusionResult
from tracker.fusion.sequential_phd import SequentialPhd
from tracker.fusion.target_model import MeasurementKind, TargetModel
from tracker.geometry.camera import Camera
from tracker.kernels.kalman import Measurements
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.groups.fusion import FusionParams
from tracker.sequences.sequence import Room, Sequence
from tracker.single_view.protocol import ViewResult

CAMERAS = world.ring(4)
HALF_EXTENTS = world.PERSON
ROOM = world.volume(entrances=[(-1.9, -1.9, 0.85)])
NOBODY = np.zeros((0, 1, 3))
NO_BOXES = ViewResult.of_boxes(np.zeros((0, 4)), np.zeros(0), np.zeros((0, 4)))
NO_FRAME = ViewResult.of_no_frame()

Method = type[MultiBernoulli] | type[SequentialPhd]
METHODS: tuple[Method, ...] = (MultiBernoulli, SequentialPhd)

Step = tuple[ViewResult, ...]


def empty_room(fps: float = 10.0, cameras: Many[Camera] = CAMERAS, room: Room = ROOM) -> Sequence:
    """The room as a sequence without boxes."""
    return world.sequence(cameras, NOBODY, fps=fps, room=room)


def filtered(
    method: Method,
    views: Many[Step],
    *,
    cameras: Many[Camera] = CAMERAS,
    fps: float = 10.0,
    room: Room = ROOM,
    **changes: object,
) -> list[FusionResult]:
    """The posterior of every step, with some parameters changed."""
    parameters = FusionParams().model_copy(update=changes)
    fusion = method(empty_room(fps, cameras, room), RunParameters(fusion=parameters))
    state, results = fusion.start(), []
    for step in views:
        state, result = fusion.step(state, step)
        results.append(result)
    return results


def reordered(view: ViewResult, order: ndarray) -> ViewResult:
    """The boxes of a camera in another order."""
    return ViewResult.of_boxes(view.boxes[order], view.weights[order], view.sigmas[order])


def of_boxes(boxes: ndarray, sigma: float = 2.0) -> ViewResult:
    """Boxes of one standard deviation, pixels; those out of sight are left out."""
    seen = boxes[np.isfinite(boxes[:, 0])]
    return ViewResult.of_boxes(seen, np.ones(len(seen)), np.full(seen.shape, sigma))


def exact(places: Many[Many[float]], cameras: Many[Camera] = CAMERAS, sigma: float = 2.0) -> Step:
    """What every camera shows of people at some places, without error, in their order."""
    where = np.array(places, dtype=float).reshape(-1, 3)
    return tuple(of_boxes(world.upright(camera, where), sigma) for camera in cameras)


def births(
    kind: MeasurementKind = "box", margin: float = 0.0, p_d: float = 0.95, gap: float = 1.0
) -> MeasurementBirths:
    """The values are those of the room with four cameras."""
    model = BirthModel(
        0.005, p_d, np.full(4, 1e-8 if kind != "centre" else 1e-6), 21.0, margin, gap
    )
    return MeasurementBirths(CAMERAS, ROOM, TargetModel(HALF_EXTENTS, kind), model)


def evidence(
    views: tuple[ViewResult, ...], kind: MeasurementKind = "box", unexplained: float = 1.0
) -> Evidence:
    """The boxes are equally unexplained."""
    seen, model = all_boxes(views), TargetModel(HALF_EXTENTS, kind)
    values, noises = model.measured(seen.boxes, seen.sigmas, 1.0)
    share = np.full(len(seen.boxes), unexplained)
    return Evidence(
        seen.boxes[:, :2], Measurements(values, noises), share, seen.starts, seen.clutter_factors
    )
