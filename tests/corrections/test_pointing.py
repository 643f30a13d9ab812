"""Clicks as places: what a camera shows of a place leads back to it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests import world
from tracker.corrections import CorrectionError
from tracker.corrections.pointing import foot_on_floor, ground_under, stands, triangulate

CAMERAS = world.ring(3, distortion=world.BARREL)
_SPOTS = st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))


@given(_SPOTS, st.sampled_from(CAMERAS))
def test_a_click_on_the_feet_is_where_they_stand(spot: tuple[float, float], camera: object) -> None:
    feet = np.array([[*spot, 0.0]])
    pixels, _ = camera.project(feet)  # type: ignore[attr-defined]
    x, y = pixels[0].tolist()
    found = foot_on_floor(camera, (x, y), floor=0.0, half_height=0.9)  # type: ignore[arg-type]
    assert found == pytest.approx([*spot, 0.9], abs=1e-3)


@pytest.mark.parametrize(
    ("feet", "half_height", "ground"),
    [
        (None, 0.125, 0.2),  # of nobody nothing else is known
        (0.525, 0.125, 0.525),  # a head that goes at 0.65 m
        (0.36, 0.125, 0.36),
        (0.23, 0.125, 0.2),
        (0.45, 0.9, 0.2),  # a person stands, whatever the filter made of the height
        (1.2, 0.9, 1.2),
    ],
)
def test_a_click_goes_to_what_the_target_stands_on(
    feet: float | None, half_height: float, ground: float
) -> None:
    found = ground_under(feet, floor=0.2, half_height=half_height)
    assert found == ground
    assert stands(found + half_height, ground=found, half_height=half_height)
    assert not stands(found + 4.0 * half_height, ground=found, half_height=half_height)


@given(_SPOTS, st.floats(0.2, 1.8))
def test_two_clicks_on_one_point_are_that_point(spot: tuple[float, float], height: float) -> None:
    point = np.array([[*spot, height]])
    clicks = [(camera, tuple(camera.project(point)[0][0].tolist())) for camera in CAMERAS[:2]]
    assert triangulate(clicks) == pytest.approx(point[0], abs=1e-3)


def test_what_says_nothing_of_a_place_is_refused() -> None:
    camera = CAMERAS[0]
    high = camera.project(np.array([[3.0, 3.0, 9.0]]))[0][0]
    with pytest.raises(CorrectionError, match="does not show the floor"):
        foot_on_floor(camera, (float(high[0]), float(high[1])), floor=0.0, half_height=0.9)
    one = (camera, tuple(camera.project(np.array([[0.0, 0.0, 1.0]]))[0][0].tolist()))
    with pytest.raises(CorrectionError, match="in each of two"):
        triangulate([one])
    with pytest.raises(CorrectionError, match="same side"):
        triangulate([one, one])
    # the second shows the first camera itself, which cannot have a picture of that
    cameras = [world.look_at("a", (-4.0, 0.0, 1.0), (0.0, 0.0, 1.0)),
               world.look_at("b", (-4.0, -4.0, 1.0), (-4.0, 0.0, 1.0))]  # fmt: skip
    with pytest.raises(CorrectionError, match="two different points"):
        triangulate([(camera, (639.5, 399.5)) for camera in cameras])


@pytest.mark.parametrize(("angle", "refused"), [(0.03, True), (0.05, False), (0.2, False)])
def test_two_pictures_from_nearly_the_same_side_are_refused(angle: float, refused: bool) -> None:
    """The condition of two rays is 4 / θ²: below 0.04 rad they say nothing of how far away."""
    point = np.array([0.0, 0.0, 1.0])
    cameras = [
        world.look_at(name, (5.0 * np.sin(turn), -5.0 * np.cos(turn), 1.0), point.tolist())
        for name, turn in (("a", 0.0), ("b", angle))
    ]
    clicks = [(one, tuple(one.project(point[None])[0][0].tolist())) for one in cameras]
    if refused:
        with pytest.raises(CorrectionError, match="same side"):
            triangulate(clicks)
    else:
        assert triangulate(clicks) == pytest.approx(point, abs=1e-6)
