"""The visible area is SciPy's convex hull, down to three points of the room in the picture."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy import ndarray
from scipy.spatial import ConvexHull

from tests.world import look_at, volume
from tracker.filters.models import visible_area
from tracker.geometry.camera import Camera

ROOM = volume(2.0, 2.5)


def seen(camera: Camera) -> ndarray:
    """The points of a grid of 12 × 12 × 12 over the room that are in the picture."""
    axes = np.linspace(ROOM.minimum, ROOM.maximum, 12).T
    pixels, _ = camera.project(np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 3))
    return np.asarray(pixels[camera.contains(pixels)])


@pytest.mark.parametrize("place", [(4.5, 1.0, 2.0), (1.0, 0.3, 1.2), (0.1, -1.7, 2.4)])
def test_the_area_is_the_hull_of_what_is_seen_of_the_room(place: tuple[float, ...]) -> None:
    camera = look_at("one", place, (-0.5, 0.2, 0.9), focal=400.0, image_size=(640, 480))
    assert visible_area(camera, ROOM) == pytest.approx(ConvexHull(seen(camera)).volume, rel=1e-4)


@pytest.mark.parametrize("count", [2, 3])
def test_three_points_span_an_area_and_two_do_not(count: int) -> None:
    camera = look_at("one", (4.5, 1.0, 2.0), (0.0, 0.0, 1.0), focal=3000.0, image_size=(90, 90))
    rng = np.random.default_rng(0)
    while True:  # another part of what a large picture would show
        shift = np.array([[0.0, 0.0, rng.uniform(-900, 900)], [0.0, 0.0, rng.uniform(-900, 900)]])
        part = replace(camera, intrinsics=camera.intrinsics + np.vstack([shift, np.zeros(3)]))
        points = seen(part)
        if len(points) == count:
            break
    least = 0.01 * 90 * 90
    area = ConvexHull(points).volume if count == 3 else 0.0
    assert visible_area(part, ROOM) == pytest.approx(max(area, least), rel=1e-4)
    assert (area > least) == (count == 3)
