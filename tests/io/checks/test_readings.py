"""The boxes of random rooms tell how their calibration is meant."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, get_args

import numpy as np
import pytest

from tests import world
from tests.conftest import short
from tests.mistakes import MISTAKES, positions, transposed, y_up
from tests.random_rooms import random_room
from tracker.geometry.consistency.consensus import Consensus
from tracker.geometry.consistency.suggestion import consensus_of_cameras, suggest
from tracker.io.checks import check
from tracker.io.checks.boxes import judge_boxes, raw_cameras
from tracker.io.checks.timing import check_counting
from tracker.io.conventions.judge import Seen
from tracker.io.conventions.questions import stating_flags
from tracker.io.conventions.reading import FLIP, Reading, pose, read_boxes, to_camera, upright
from tracker.io.conventions.search import as_meant, find_reading
from tracker.io.conventions.sizes import likely_unit
from tracker.io.read.pieces import METRES, Layout, RawCamera
from tracker.sequences.sequence import Sequence

ROOMS = range(6)


def seen(sequence: Sequence) -> list[Seen | None]:
    """The boxes of all cameras."""
    return [
        None if v.detections is None else Seen(v.detections.frames, v.detections.boxes)
        for v in sequence.views
    ]


def warnings(sequence: Sequence) -> list[str]:
    """The remedies that are named."""
    found = [each for each in check(sequence) if each.status == "warning"]
    return [str(remedy) for each in found for remedy in each.remedies]


@pytest.mark.parametrize("seed", short(ROOMS, 2))
def test_nothing_is_odd_in_a_good_room(seed: int) -> None:
    found = check(random_room(seed))
    assert [str(each) for each in found if each.status == "warning"] == []


@pytest.mark.full
@pytest.mark.parametrize("name", MISTAKES)
def test_each_usual_mistake_is_named_with_its_remedy(name: str) -> None:
    make, remedy = MISTAKES[name]
    named = [warnings(make(random_room(seed, steps=150))) == [remedy] for seed in ROOMS]
    assert sum(named) >= len(ROOMS) - 1


@pytest.mark.parametrize(
    ("mistaken", "flag"),
    [(transposed, "--pose transposed"), (positions, "--pose position")],
)
@pytest.mark.parametrize("seed", short(ROOMS, 2))
def test_poses_that_are_half_inverted_are_named(
    seed: int, mistaken: Callable[[Sequence], Sequence], flag: str
) -> None:
    assert warnings(mistaken(random_room(seed, steps=150))) == [flag]


@pytest.mark.full
@pytest.mark.parametrize("height", [0.25, 1.25, 1.7])
@pytest.mark.parametrize("seed", [0, 1])
def test_heads_and_people_who_sit_raise_no_alarm(seed: int, height: float) -> None:
    found = check(random_room(seed, height=height, people=4))
    assert [str(each) for each in found if each.status == "warning"] == []


@pytest.mark.full
def test_a_crowd_raises_no_alarm_and_is_read_rightly() -> None:
    crowd = random_room(3, people=20, cameras=4, steps=100)
    assert warnings(crowd) == []
    assert warnings(MISTAKES["camera to world"][0](crowd)) == ["--pose camera-to-world"]


@pytest.mark.full
@pytest.mark.parametrize("seed", ROOMS)
def test_all_at_once_is_found_out(seed: int) -> None:
    """Inverted OpenGL poses in centimetres of a world with y up, and corners of boxes."""
    sequence = random_room(seed, steps=150)
    turned = [
        (FLIP @ raw.rotation @ upright("y"), 100.0 * FLIP @ raw.translation)
        for raw in raw_cameras(sequence)
    ]
    cameras = [
        replace(raw, rotation=rotation.T, translation=-rotation.T @ translation)
        for raw, (rotation, translation) in zip(raw_cameras(sequence), turned, strict=True)
    ]
    corners = [
        Seen(own.frames, np.concatenate([own.four[:, :2], own.four[:, :2] + own.four[:, 2:]], 1))
        for own in seen(sequence)
        if own is not None
    ]
    verdict = find_reading(cameras, corners, fps=sequence.fps)
    assert verdict is not None
    assert verdict.kind == "decided"
    judged, reading = as_meant(verdict, None)
    assert reading == Reading("camera-to-world", "opengl", "xyxy", False, "cm", "y")
    assert judged.consensus.height == pytest.approx(170.0, rel=0.12)
    again = to_camera(cameras[0], reading, sequence.cameras[0].image_size)
    np.testing.assert_allclose(again.centre, sequence.cameras[0].centre, atol=1e-9)
    np.testing.assert_allclose(again.rotation, sequence.cameras[0].rotation, atol=1e-9)


def test_boxes_of_nobody_prove_nothing() -> None:
    rng = np.random.default_rng(5)
    sequence = random_room(2, cameras=3)
    noise = [
        Seen(np.repeat(np.arange(200), 3), rng.uniform(10, 300, (600, 4))) for _ in sequence.views
    ]
    found = find_reading(raw_cameras(sequence), noise, fps=sequence.fps)
    assert found is not None
    assert found.kind == "none"


def test_boxes_of_which_hardly_any_meet_tell_no_axis() -> None:
    """Six steps of a world with y up are right, and all boxes after them anywhere."""
    sequence, rng = y_up(random_room(2, steps=300)), np.random.default_rng(2)
    views = []
    for view in sequence.views:
        own = view.detections
        assert own is not None
        wrong = own.frames >= 6
        boxes = own.boxes.copy()
        boxes[wrong, :2] = rng.uniform(0.0, view.camera.image_size, (int(wrong.sum()), 2))
        views.append(replace(view, detections=replace(own, boxes=boxes)))
    judged = judge_boxes(replace(sequence, views=tuple(views)))
    assert judged is not None
    assert judged.chosen.consensus.agreeing > 50
    assert not judged.mistaken


def test_too_few_boxes_are_no_reason_for_an_alarm() -> None:
    found = check(random_room(1, steps=4, people=1))
    assert [each for each in found if each.status == "warning"] == []


def test_a_convention_that_a_file_states_is_not_questioned() -> None:
    sequence = random_room(0, steps=150)
    stated = [
        replace(raw, convention=replace(raw.convention, direction="camera-to-world", unit="mm"))
        for raw in raw_cameras(sequence)
    ]
    found = find_reading(stated, seen(sequence), fps=sequence.fps)
    assert found is not None
    assert found.best.reading.direction == "camera-to-world"


def test_one_camera_alone_tells_nothing() -> None:
    sequence = random_room(0, cameras=2)
    assert find_reading(raw_cameras(sequence), [seen(sequence)[0], None], fps=10.0) is None
    alone = replace(sequence, views=sequence.views[:1])
    assert judge_boxes(alone) is None
    assert {each.status for each in check(alone)} <= {"good", "absent"}


@pytest.mark.parametrize("up", ["x", "y", "z", "-x", "-y", "-z"])
def test_up_becomes_z(up: str) -> None:
    axis = np.zeros(3)
    axis["xyz".index(up[-1])] = -1.0 if up.startswith("-") else 1.0
    turn = upright(up)  # type: ignore[arg-type]
    np.testing.assert_allclose(turn @ axis, [0.0, 0.0, 1.0], atol=1e-12)
    assert np.linalg.det(turn) == pytest.approx(1.0)


@pytest.mark.full
@pytest.mark.parametrize("height", [0.25, 0.9, 1.2, 1.7])
@pytest.mark.parametrize("unit", METRES)
def test_the_unit_follows_from_how_tall_and_far_people_are(unit: str, height: float) -> None:
    agreed = judge_boxes(random_room(0, steps=60))
    assert agreed is not None
    one = METRES[unit]  # type: ignore[index]
    scaled = replace(agreed.given.consensus, rise=np.array([0.0, 0.0, height / one]))
    assert likely_unit(5.0 / one, scaled) == unit


@pytest.mark.parametrize("layout", get_args(Layout))
def test_layouts_of_a_box(layout: Layout) -> None:
    box = np.array([[10.0, 20.0, 30.0, 60.0]])
    as_written = {
        "ltwh": box,
        "xyxy": np.array([[10.0, 20.0, 40.0, 80.0]]),
        "yxyx": np.array([[20.0, 10.0, 80.0, 40.0]]),
        "cxcywh": np.array([[25.0, 50.0, 30.0, 60.0]]),
    }[layout]
    np.testing.assert_allclose(read_boxes(as_written, layout), box)


def test_a_camera_without_a_pose_is_told() -> None:
    with pytest.raises(ValueError, match="has no pose"):
        pose(RawCamera("cam1"), Reading())


@pytest.mark.full
@pytest.mark.parametrize("seed", ROOMS)
def test_room_and_people_are_suggested(seed: int) -> None:
    from tracker.geometry.consistency.observed import rays_of

    sequence = random_room(seed, people=5)
    rays = [
        rays_of(v.detections.frames, v.detections.boxes, v.camera)
        for v in sequence.views
        if v.detections is not None
    ]
    found = suggest(sequence.cameras, consensus_of_cameras(sequence.cameras, rays))
    assert found is not None
    truth = sequence.ground_truth
    assert truth is not None
    assert abs(found.floor) < 0.12
    assert 2.0 * found.half_extents[2] == pytest.approx(1.7, rel=0.1)
    low, high = np.quantile(truth.positions, [0.03, 0.97], axis=0)
    assert (found.minimum <= low + 0.6).all()
    assert (found.maximum >= high - 0.6).all()
    assert (found.maximum[:2] - found.minimum[:2] <= high[:2] - low[:2] + 3.0).all()


@pytest.mark.parametrize("cameras", [1, 2, 3])
def test_without_boxes_the_room_is_where_views_overlap(cameras: int) -> None:
    sequence = random_room(4, cameras=3)
    found = suggest(sequence.cameras[:cameras], None)
    assert found is not None
    middle = (sequence.room.minimum + sequence.room.maximum)[:2] / 2.0
    assert (found.minimum[:2] < middle).all()
    assert (found.maximum[:2] > middle).all()
    assert found.people == 0


def test_without_boxes_no_room_is_behind_a_camera() -> None:
    camera = world.look_at("one", (0.0, 0.0, 3.0), (4.0, 0.0, 1.0))
    found = suggest([camera], None)
    assert found is not None
    assert found.minimum[0] > 0.0
    assert found.maximum[0] > 10.0


@pytest.mark.parametrize(("pairs", "people"), [(19, 0), (20, 20)])
def test_twenty_pairs_of_boxes_are_enough_for_a_room(pairs: int, people: int) -> None:
    found = suggest(random_room(4, cameras=3).cameras, agreed_on(1.7, 0.0, pairs))
    assert found is not None
    assert found.people == people


def test_boxes_a_step_before_the_truth_are_counted_from_0() -> None:
    sequence = random_room(2, steps=200)
    early = [
        replace(view, detections=replace(own, frames=np.maximum(own.frames - 1, 0)))
        for view in sequence.views
        if (own := view.detections) is not None
    ]
    found = check_counting(replace(sequence, views=tuple(early)))
    assert [str(remedy) for remedy in found.remedies] == ["--first-index 0"]
    assert check_counting(sequence).status == "good"


def test_cameras_that_differ_in_their_delay_do_not_count_otherwise() -> None:
    """By 1 step in the median, but no number of a first frame is different in each camera."""
    sequence = random_room(2, steps=200, cameras=3)
    views = []
    for view, late in zip(sequence.views, (1, 1, 2), strict=True):
        own = view.detections
        assert own is not None
        shifted = replace(own, frames=own.frames + late)
        views.append(replace(view, detections=shifted))
    found = check_counting(replace(sequence, views=tuple(views)))
    assert (found.status, found.remedies) == ("good", ())


def agreed_on(height: float, foot: float, count: int = 200) -> Consensus:
    """A consensus on boxes of a height, their feet at a height above z = 0, metres."""
    rng = np.random.default_rng(3)
    feet = np.column_stack([rng.uniform(-3.0, 3.0, (count, 2)), np.full(count, foot)])
    rises = np.tile([0.0, 0.0, height], (count, 1))
    none = np.zeros(count, dtype=int)
    return Consensus(
        np.array([0.0, 0.0, height]), 1.0, {(0, 1): 1.0}, count, count, none, feet, rises,
        np.zeros(count), np.ones(count), np.tile([0, 1], (count, 1)),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("height", "foot", "bottom", "top"),
    [
        (1.2, 0.4, -0.2, 2.2),  # a whole size below and above their middles at 1.0
        (1.0, 0.2, -0.3, 1.7),
        (1.0, 0.19, 0.0, 1.69),  # they sit on the floor that the calibration has
    ],
)
def test_a_room_of_seated_people_reaches_a_whole_size_above_and_below_them(
    height: float, foot: float, bottom: float, top: float
) -> None:
    found = suggest([], agreed_on(height, foot))
    assert found is not None
    assert found.half_extents[2] == pytest.approx(height / 2.0)
    assert found.floor == pytest.approx(bottom)
    assert (found.minimum[2], found.maximum[2]) == pytest.approx((bottom, top), abs=0.1001)


@pytest.mark.parametrize(
    ("height", "half_extents"),
    [
        (0.3, (0.105, 0.105, 0.15)),  # a head
        (0.5, (0.125, 0.125, 0.25)),  # with shoulders
        (0.7, (0.175, 0.175, 0.35)),
        (1.44, (0.36, 0.36, 0.72)),  # a seated person
        (1.45, (0.286765, 0.286765, 0.8125)),  # a standing one, partly as tall as most are
        (1.7, (0.3, 0.3, 0.85)),
        (2.3, (0.331765, 0.331765, 0.94)),
        (2.32, (0.58, 0.58, 1.16)),
    ],
)
def test_people_have_the_size_that_their_height_shows(
    height: float, half_extents: tuple[float, float, float]
) -> None:
    found = suggest([], agreed_on(height, 1.0))
    assert found is not None
    assert found.half_extents == pytest.approx(half_extents, abs=0.0006)


def test_flags_state_what_differs_and_the_form_of_boxes_once() -> None:
    given = Reading()

    def flags(**parts: Any) -> list[str]:
        return [str(one) for one in stating_flags(replace(given, **parts), given, ["a", "b"])]

    assert flags() == []
    assert flags(layout="xyxy") == ["--boxes xyxy"]
    assert flags(parts=1) == ["--boxes ltwh-normalised"]
    assert flags(layout="xyxy", parts=1) == ["--boxes xyxy-normalised"]
    assert flags(direction="camera-to-world", order=(1, 0)) == [
        "--pose camera-to-world",
        "--swap a=b",
    ]
    exchanged = replace(given, order=(1, 0))
    assert list(map(str, stating_flags(given, exchanged, ["a", "b"]))) == ["--as-named"]
    both = replace(given, layout="xyxy", parts=1)
    found = stating_flags(both, replace(both, layout="cxcywh"), ["a", "b"])
    assert list(map(str, found)) == ["--boxes xyxy"]
