"""The room from above: how many cameras see the floor where, and how they look at it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.geometry.camera import Camera
from tracker.geometry.consistency.consensus import Consensus
from tracker.io.importing.settling import ImportPlan

CELLS = 72
"""Of the longer side."""

MARGIN = 0.6
"""Metres around room and cameras."""

MOST_FEET = 300
_FARTHEST = 15.0  # metres from the room that a camera may be to be in the plan
_ABOVE = 0.05  # metres above the floor, so that it is not cut off by rounding


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """What is drawn of a room from above, metres. H by W cells."""

    origin: tuple[float, float]
    """Of the first cell's corner."""
    cell: float
    seen: Int[ndarray, "H W"]
    """How many cameras see the middle of each cell; rows go along y."""
    cameras: tuple[tuple[float, float, float, float], ...]
    """x, y, direction and half the angle across, radians."""
    feet: Float[ndarray, "N 2"]
    """Where boxes of two cameras show feet."""


def draw_plan(settled: ImportPlan, agreed: Consensus | None) -> Plan:
    """The plan of a settled recording.

    Args:
        settled: Whose cameras and room.
        agreed: What the boxes agree on, where there are any.
    """
    cameras = [view.camera for view in settled.views]
    corners = [
        settled.room.minimum, settled.room.maximum,
        settled.suggested.minimum, settled.suggested.maximum,
    ]  # fmt: skip
    low, high = np.min(corners, axis=0)[:2], np.max(corners, axis=0)[:2]
    near = [
        c.centre[:2]
        for c in cameras
        if (np.abs(np.clip(c.centre[:2], low, high) - c.centre[:2]) < _FARTHEST).all()
    ]
    low, high = np.min([low, *near], axis=0) - MARGIN, np.max([high, *near], axis=0) + MARGIN
    cell = float((high - low).max()) / CELLS
    width, height = (max(1, int(np.ceil(side / cell))) for side in high - low)
    x, y = np.meshgrid(
        low[0] + (np.arange(width) + 0.5) * cell, low[1] + (np.arange(height) + 0.5) * cell
    )
    floor = np.full(x.size, float(settled.room.minimum[2]) + _ABOVE)
    points = np.column_stack([x.ravel(), y.ravel(), floor])
    seen = np.sum([camera.sees(points) for camera in cameras], axis=0).reshape(height, width)
    feet = np.zeros((0, 2)) if agreed is None else agreed.feet[:, :2]
    if len(feet) > MOST_FEET:
        feet = feet[np.linspace(0, len(feet) - 1, MOST_FEET).astype(int)]
    return Plan(
        (float(low[0]), float(low[1])), cell, seen, tuple(_look(camera) for camera in cameras), feet
    )


def _look(camera: Camera) -> tuple[float, float, float, float]:
    width, height = camera.image_size
    middle = (height - 1) / 2.0
    ends = camera.back_project(np.array([[0.0, middle], [width - 1.0, middle]]))
    ahead = camera.rotation[2]
    flat = float(np.hypot(ahead[0], ahead[1]))
    # a camera that looks straight down looks nowhere from above: along its picture's upper edge
    way = ahead if flat > 0.05 else -camera.rotation[1]
    cosine = float(ends[0] @ ends[1] / np.linalg.norm(ends[0]) / np.linalg.norm(ends[1]))
    return (
        float(camera.centre[0]),
        float(camera.centre[1]),
        float(np.arctan2(way[1], way[0])),
        float(np.arccos(np.clip(cosine, -1.0, 1.0)) / 2.0),
    )
