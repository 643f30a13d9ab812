"""A recording of boxes by an outside detector, in one camera or in several."""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import replace
from typing import Any

import numpy as np
from numpy import ndarray

from tests import world
from tracker import single_view
from tracker.geometry.camera import Camera
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.values import with_values
from tracker.sequences.sequence import Sequence
from tracker.single_view.protocol import ViewResult

CAMERA = world.ring(1)[0]

ANYWHERE = {"detection_boxes.room_tolerance": 100.0}
"""No box contradicts the room."""


def detected(
    steps: Many[Any], scores: Many[float] = (), *, camera: Camera = CAMERA, fps: float = 10.0
) -> Sequence:
    """One camera's boxes, centre and half sizes, step by step; their scores in the same order."""
    boxes = np.array([box for step in steps for box in step], dtype=float).reshape(-1, 4)
    frames = np.repeat(np.arange(len(steps)), [len(step) for step in steps])
    seen = world.Boxes(frames, boxes, np.ones_like(boxes), np.zeros_like(frames), len(steps))
    whole = world.sequence((camera,), np.full((len(steps), 0, 3), np.nan), [seen], fps=fps)
    if not len(scores):
        return whole
    found = replace(seen.detections(), scores=np.array(scores, dtype=float))
    return replace(whole, views=(replace(whole.views[0], detections=found),))


def run(name: str, whole: Sequence, **changes: Any) -> list[ViewResult]:
    """Every step of a method that looks at no pictures; changes of its own parameters, or of
    others by their whole keys."""
    values = {key if "." in key else f"{name}.{key}": value for key, value in changes.items()}
    if name == "jpda":
        values["jpda.measurements"] = "detections"
    parameters = with_values(RunParameters(), ANYWHERE | values)
    made = single_view.create(name, whole, 0, parameters, None)  # type: ignore[arg-type]
    state, results = made.start(), []
    for step in range(whole.frames):
        state, result = made.step(state, step, None, np.random.default_rng(step))
        results.append(result)
    return results


def normal(offset: ndarray, covariance: ndarray) -> float:
    """N(offset; 0, covariance)."""
    square = offset @ np.linalg.solve(covariance, offset)
    return float(np.exp(-0.5 * square) / np.sqrt(np.linalg.det(2.0 * np.pi * covariance)))
