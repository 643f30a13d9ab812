"""What the fusion methods share: the gate, the clutter, the births, who is one person."""

from __future__ import annotations

from collections.abc import Sequence as Many

import numpy as np
import pytest

from tests.fusion.rooms import HALF_EXTENTS, empty_room
from tracker.filters import models
from tracker.fusion.model import FusionModel
from tracker.fusion.target_model import SIZES, MeasurementKind
from tracker.parameters.groups.fusion import FusionParams

KINDS: Many[MeasurementKind] = ("centre", "box", "box_and_width")
every_kind = pytest.mark.parametrize("kind", KINDS)


def model(fps: float = 10.0, **changes: object) -> FusionModel:
    """Of the room with a door and four cameras."""
    return FusionModel(empty_room(fps), FusionParams().model_copy(update=changes))


@every_kind
def test_the_gate_holds_the_share_of_true_boxes_that_it_promises(
    kind: MeasurementKind,
) -> None:
    made, probability = model(measurement=kind), FusionParams.gate_probability
    innovations = np.random.default_rng(0).standard_normal((200_000, SIZES[kind]))
    share = float(((innovations**2).sum(axis=1) <= made.gate).mean())
    assert share == pytest.approx(probability, abs=4.0 * np.sqrt((1.0 - probability) / 200_000))


@every_kind
def test_clutter_is_spread_over_the_whole_measurement_space(kind: MeasurementKind) -> None:
    room = empty_room(10.0)
    found = model(measurement=kind, clutter_rate=3.0).clutter
    for camera, clutter in zip(room.cameras, found, strict=True):
        volume = models.visible_area(camera, room.room)
        width, height = camera.image_size
        volume *= {2: 1.0, 3: height / 2.0, 4: height / 2.0 * width / 2.0}[SIZES[kind]]
        assert clutter * volume == pytest.approx(3.0), "as many false boxes a picture as are said"


@pytest.mark.parametrize("fps", [5.0, 25.0])
def test_newcomers_are_expected_by_the_second(fps: float) -> None:
    made = model(fps, birth_rate=0.05)
    assert made.births.cardinality * fps == pytest.approx(0.05 * len(made.room.entrances))


def test_two_within_a_share_of_a_persons_width_are_one_unless_each_has_a_box() -> None:
    made = model(duplicate_distance=0.5)
    width = 2.0 * float(HALF_EXTENTS[:2].mean())
    nobodys, their_own = np.full((4, 2), -1), np.array([[-1, -1], [3, 4], [0, -1], [2, 2]])
    height = 2.0 * float(HALF_EXTENTS[2])
    for apart, above, sources, duplicate in (
        (0.49 * width, 0.0, nobodys, True),
        (0.51 * width, 0.0, nobodys, False),
        (0.49 * width, 0.0, their_own, False),  # the second camera gave each a box
        (0.24 * width, 0.0, their_own, True),  # but two people cannot stand in one place
        (0.24 * width, 0.9 * height, their_own, True),  # with one box drawn higher, too
        (0.24 * width, 1.1 * height, their_own, False),  # unless one is above the other
        (0.26 * width, 0.2 * height, their_own, False),
    ):
        means = np.array([[0.0, 0.0, 0.85], [apart, 0.0, 0.85 + above]])
        found = made.duplicates(means, np.array([0.9, 0.9]), np.array([1, 2]), sources)
        assert found.tolist() == [False, duplicate]


def test_the_middle_of_who_lies_is_the_lowest_and_who_stands_on_the_floor_is_free() -> None:
    low = model(posture_share=0.1).heights
    assert low is not None
    assert low.low == pytest.approx(FusionParams().posture_height * HALF_EXTENTS[2])
    assert low.high == pytest.approx(2.2 - low.low)
    assert model(posture_share=0.0).heights is None
