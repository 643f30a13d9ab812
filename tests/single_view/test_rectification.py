"""Stage 1 looks at reduced, upright and steady pictures; all others see the camera's own pixels."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray

from tests import world
from tests.golden.pieces import cut
from tests.single_view.scenery import MIDDLE, SIZE, scene, shaken, taken
from tests.world import PERSON as HALF_EXTENTS
from tests.world import SMALL_CAMERAS, SMALL_ROOM
from tracker.geometry.camera import Camera
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.groups.foreground import PictureParams
from tracker.parameters.values import with_values
from tracker.runs import pipeline
from tracker.runs.gates import notices
from tracker.sequences.library import open_sequence
from tracker.sequences.pictures.frames import FrameReader, Picture
from tracker.sequences.sequence import Sequence, Template, View
from tracker.single_view.box_sizes import upright_boxes
from tracker.single_view.pictures.background import pack, unpack
from tracker.single_view.protocol import Dropped, ViewResult, pack_samples, unpack_samples
from tracker.single_view.rectification.sequence import RectifiedSequence, check_shake
from tracker.single_view.rectification.stabilisation import StaticScene, _normalise, consensus_shift
from tracker.single_view.rectification.view import RectifiedView, rectified_view

CAMERAS = tuple(
    world.surveillance(f"cam{k}", (4.6 * x, 4.6 * y, 2.6), (0.0, 0.0, 0.8), focal=620.0,
                       image_size=(1280, 800))
    for k, (x, y) in enumerate(((1.0, 0.1), (0.1, 1.0), (-1.0, -0.1)), 1)
)  # fmt: skip
ROOM = world.volume(2.2, 2.2, [(-1.9, -1.9, 0.85)])
LENS = np.array([-0.05, 0.01, 0.002, -0.001, 0.0])


def rolled(camera: Camera, angle: float, **changes: object) -> Camera:
    """The camera turned about its own axis, so that what stands leans to the right."""
    cos, sin = math.cos(angle), math.sin(angle)
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    turned = replace(camera, rotation=turn @ camera.rotation, translation=turn @ camera.translation)
    return replace(turned, **changes)  # type: ignore[arg-type]


def numbers_of(**numbers: float) -> PictureParams:
    """Parameters with other numbers, and constants too."""
    return PictureParams().model_copy(update=numbers)


def seen(camera: Camera, **numbers: float) -> RectifiedView:
    view = rectified_view(camera, ROOM, HALF_EXTENTS, numbers_of(**numbers))
    assert view is not None
    return view


def places(count: int = 40) -> ndarray:
    return np.random.default_rng(0).uniform([-1.5, -1.5, 0.3], [1.5, 1.5, 1.5], (count, 3))


def test_a_small_level_camera_is_left_alone() -> None:
    assert all(
        rectified_view(c, SMALL_ROOM, world.HEAD, PictureParams()) is None for c in SMALL_CAMERAS
    )


@given(
    angle=st.floats(-math.pi, math.pi),
    focal_ratio=st.floats(0.8, 1.25),
    fisheye=st.booleans(),
)
def test_the_working_calibration_sees_what_the_working_picture_shows(
    angle: float, focal_ratio: float, fisheye: bool
) -> None:
    camera = CAMERAS[1]
    intrinsics = camera.intrinsics * np.array([[1.0], [focal_ratio], [1.0]])
    intrinsics[0, 2] += 31.0
    lens = LENS[[0, 1, 4, 4]] if fisheye else LENS
    camera = rolled(camera, angle, intrinsics=intrinsics, distortion=lens, fisheye=fisheye)
    view = seen(camera)
    full, valid = camera.project(places())
    rectified, also = view.camera.project(places())
    assert valid.all()
    assert also.all()
    # the rectified picture's sides are whole pixels: a part of one is left
    np.testing.assert_allclose(rectified, view.points(full), atol=0.6)
    np.testing.assert_allclose(view.points_back(view.points(full)), full, atol=1e-9)


@given(angle=st.floats(-math.pi, math.pi))
def test_people_stand_in_the_working_picture(angle: float) -> None:
    view = seen(rolled(CAMERAS[0], angle))
    middle = view.camera.centre + 4.0 * view.camera.rotation[2]
    (foot, head), _ = view.camera.project(middle + np.array([[0, 0, -0.1], [0, 0, 0.1]]))
    up = head - foot
    assert up[1] < 0.0
    assert abs(math.atan2(up[0], -up[1])) <= PictureParams().level_from + 1e-3


def test_what_is_in_the_picture_is_where_the_working_calibration_says() -> None:
    camera = rolled(CAMERAS[2], 0.6, distortion=LENS)
    view = seen(camera)
    for place in places(5):
        picture = np.zeros((camera.image_size[1], camera.image_size[0], 3), dtype=np.uint8)
        centre = camera.project(place[None])[0][0]
        cv2.circle(picture, (round(centre[0]), round(centre[1])), 6, (255, 255, 255), -1)
        small = view.picture(picture)
        assert small.shape[1::-1] == view.camera.image_size
        rows, columns = np.nonzero(small[:, :, 0] > 100)
        expected = view.camera.project(place[None])[0][0]
        np.testing.assert_allclose([columns.mean(), rows.mean()], expected, atol=1.0)
        back = view.mask((small[:, :, 0] > 100).astype(np.uint8))
        rows, columns = np.nonzero(back)
        found = (np.array([columns.mean(), rows.mean()]) + 0.5) / view.factors - 0.5
        np.testing.assert_allclose(found, centre, atol=3.0)


@pytest.mark.parametrize(("lines", "shorter"), [(480, 480), (240, 240), (2000, 800)])
def test_a_picture_is_reduced_to_so_many_lines(lines: int, shorter: int) -> None:
    camera = replace(CAMERAS[0])
    numbers = {"lines": lines, "target_height": 2000}
    view = rectified_view(camera, ROOM, HALF_EXTENTS, numbers_of(**numbers))
    assert (camera if view is None else view.camera).image_size[1] == shorter


def test_far_targets_keep_their_pixels() -> None:
    few = seen(CAMERAS[0], lines=120, least_height=8)
    many = seen(CAMERAS[0], lines=120, least_height=100)
    assert few.camera.image_size[1] == 120
    boxes, there = upright_boxes(many.camera, places(400), HALF_EXTENTS)
    assert 80.0 < 2.0 * np.median(boxes[there, 3]) < 125.0


def test_an_upright_box_comes_back_around_the_same_person() -> None:
    for angle in (0.0, 0.4, -0.4, math.pi / 2.0):
        view = seen(rolled(CAMERAS[0], angle))
        boxes, there = upright_boxes(view.camera, places(), HALF_EXTENTS)
        boxes = boxes[there]
        back = view.boxes_back(boxes)
        np.testing.assert_allclose(view.points(back[:, :2]), boxes[:, :2], atol=1e-6)
        aside = abs(math.sin(angle)) > 0.9
        long, short = back[:, 2 if aside else 3], back[:, 3 if aside else 2]
        assert (long > short).all()
        np.testing.assert_allclose(long * view.scale / boxes[:, 3], 1.0, atol=0.1)


@pytest.mark.full
@given(angle=st.floats(-math.pi, math.pi).filter(lambda a: abs(abs(math.tan(a)) - 1.0) > 0.05))
def test_a_drawn_box_gives_the_upright_one(angle: float) -> None:
    view = seen(rolled(CAMERAS[0], angle))
    half = np.array([HALF_EXTENTS[0], HALF_EXTENTS[2]]) * 90.0
    cos, sin = math.cos(view.roll), math.sin(view.roll)
    bounds = [math.hypot(half[0] * cos, half[1] * sin), math.hypot(half[0] * sin, half[1] * cos)]
    drawn = np.array([600.0, 400.0, *(np.array(bounds) / view.factors)])
    np.testing.assert_allclose(view.drawn_box(drawn, HALF_EXTENTS)[2:], half, rtol=1e-6)


def test_ellipses_come_back_turned() -> None:
    view = seen(rolled(CAMERAS[0], 0.5))
    gate = np.array([[50.0, 60.0, 100.0, 20.0, 400.0]])
    back = view.gates_back(gate)[0]
    matrix = np.array([[100.0, 20.0], [20.0, 400.0]])
    border = np.linalg.cholesky(matrix) @ [0.6, 0.8] + gate[0, :2]
    apart = view.points_back(border[None])[0] - back[:2]
    full = np.array([[back[2], back[3]], [back[3], back[4]]])
    assert apart @ np.linalg.solve(full, apart) == pytest.approx(1.0)


@given(angle=st.floats(-math.pi, math.pi))
def test_deviations_come_back_turned(angle: float) -> None:
    view = seen(rolled(CAMERAS[0], angle), lines=400)
    sigmas = np.array([[2.0, 3.0, 4.0, 9.0]])
    back = view.sigmas_back(sigmas)[0]
    matrix = view.gates_back(np.array([[50.0, 60.0, 4.0, 0.0, 9.0]]))[0]
    # of independent errors along both axes, in the picture's own
    np.testing.assert_allclose(back[:2] ** 2, matrix[[2, 4]], rtol=1e-9)
    reach = view.boxes_back(np.array([[50.0, 60.0, 4.0, 9.0]]))[0, 2:]
    np.testing.assert_allclose(back[2:], reach)
    cos, sin = abs(math.cos(view.roll)), abs(math.sin(view.roll))
    expected = [max(4.0 * cos, 9.0 * sin), max(9.0 * cos, 4.0 * sin)] / view.factors
    np.testing.assert_allclose(reach, expected)
    assert view.scale == pytest.approx(math.sqrt(view.factors[0] * view.factors[1]))
    assert view.key[:2] == view.camera.image_size


def test_a_picture_is_left_alone_from_a_twentieth_less_on() -> None:
    numbers = {"target_height": 2000, "least_height": 8}
    for lines, alone in ((800, True), (761, True), (760, False), (759, False)):
        view = rectified_view(CAMERAS[0], ROOM, HALF_EXTENTS, numbers_of(lines=lines, **numbers))
        assert (view is None) == alone
    view = rectified_view(
        rolled(CAMERAS[0], 0.6), ROOM, HALF_EXTENTS, numbers_of(lines=761, **numbers)
    )
    assert view is not None  # turned, and as large as it was
    assert view.factors[0] == 1.0


def test_targets_are_made_so_high_and_pictures_at_most_half_as_large_for_it() -> None:
    boxes, there = upright_boxes(CAMERAS[0], places(3000), HALF_EXTENTS)
    high = 2.0 * float(np.median(boxes[there, 3]))

    def scale(**numbers: float) -> float:
        return seen(CAMERAS[0], lines=400, **numbers).scale

    assert scale(target_height=2000, least_height=8) == pytest.approx(0.5)
    wanted = round(0.4 * high)
    assert scale(target_height=wanted, least_height=8) == pytest.approx(0.4, rel=0.06)
    assert scale(target_height=16, least_height=8) == pytest.approx(0.25, rel=0.01)
    wanted = round(0.7 * high)
    assert scale(target_height=16, least_height=wanted) == pytest.approx(0.7, rel=0.06)


def test_what_is_seen_from_above_or_skewed_is_not_turned() -> None:
    def turned(camera: Camera, **numbers: float) -> bool:
        view = rectified_view(camera, ROOM, HALF_EXTENTS, numbers_of(**numbers))
        return view is not None and view.turn is not None

    for slope, expected in ((0.19, False), (0.21, True)):  # of the sine of its tilt
        tilt = math.asin(slope)
        above = world.look_at("a", (0.0, -math.tan(tilt) * 4.0, 4.0), (0.0, 0.0, 0.0))
        assert turned(rolled(above, 1.0)) == expected
    skewed = CAMERAS[0].intrinsics.copy()
    skewed[0, 1] = 2e-6 * skewed[0, 0]
    assert turned(rolled(CAMERAS[0], 1.0))
    assert not turned(rolled(CAMERAS[0], 1.0, intrinsics=skewed))
    assert not turned(rolled(CAMERAS[0], 0.1), level_from=0.11)
    assert turned(rolled(CAMERAS[0], 0.12), level_from=0.11)
    assert turned(rolled(CAMERAS[0], -0.12), level_from=0.11)


def recording(folder: Path, camera: Camera) -> Sequence:
    picture = np.full((camera.image_size[1], camera.image_size[0], 3), 90, dtype=np.uint8)
    cv2.imwrite(str(folder / "0.png"), picture)
    template = Template("somebody", camera.name, 0, np.array([300.0, 200.0, 80.0, 200.0]))
    return Sequence(
        name="one",
        folder=folder,
        fps=25.0,
        frames=1,
        room=ROOM,
        target_half_extents=HALF_EXTENTS,
        views=(View(camera, images=(folder / "0.png",)),),
        templates=(template,),
    )


def test_methods_get_the_reduced_recording_and_their_results_come_back(tmp_path: Path) -> None:
    sequence = recording(tmp_path, rolled(CAMERAS[0], 0.4))
    with FrameReader(sequence) as reader:
        rectified = RectifiedSequence.of(sequence, RunParameters(), reader)
        picture = rectified.reader.picture(0, 0)
        assert picture is not None
        assert picture.shape[1::-1] == rectified.sequence.cameras[0].image_size
        assert rectified.sequence.views[0].has_pictures
        mask = np.ones(picture.shape[:2], dtype=np.uint8)
        boxes = np.array([[100.0, 120.0, 10.0, 30.0]])
        result = ViewResult.of_boxes(boxes, np.ones(1), np.ones((1, 4)))
        fell = Dropped.of(boxes, {"colour": np.array([True])})
        back = rectified.back(0, replace(result, foreground=pack(mask), dropped=fell))
        view = rectified.views[0]
        assert view is not None
        np.testing.assert_allclose(view.points(back.boxes[:, :2]), boxes[:, :2])
        np.testing.assert_allclose(back.dropped.boxes, back.boxes, rtol=1e-6)
        assert back.foreground is not None
        reduced = np.rint(view.factors * [1280, 800])
        assert unpack(back.foreground).shape == (reduced[1], reduced[0])


def test_everything_that_a_result_draws_comes_back(tmp_path: Path) -> None:
    sequence = recording(tmp_path, rolled(CAMERAS[0], 0.4))
    rng = np.random.default_rng(2)
    boxes, estimates, measurements = (
        np.column_stack([rng.uniform(50.0, 200.0, (n, 2)), rng.uniform(5.0, 30.0, (n, 2))])
        for n in (2, 3, 4)
    )
    with FrameReader(sequence) as reader:
        rectified = RectifiedSequence.of(sequence, RunParameters(), reader)
    view = rectified.views[0]
    assert view is not None
    sigmas, gates = rng.uniform(1.0, 5.0, (2, 4)), np.array([[50.0, 60.0, 90.0, 20.0, 400.0]])
    result = replace(
        ViewResult.of_boxes(boxes, np.ones(2), sigmas), estimates=estimates, gates=gates,
        measurements=measurements, samples=pack_samples(boxes, np.array([0.5, 1.0])),
    )  # fmt: skip
    back = rectified.back(0, result)
    np.testing.assert_allclose(back.boxes, view.boxes_back(boxes))
    np.testing.assert_allclose(back.estimates, view.boxes_back(estimates))
    np.testing.assert_allclose(back.measurements, view.boxes_back(measurements))
    np.testing.assert_allclose(back.sigmas, view.sigmas_back(sigmas))
    np.testing.assert_allclose(back.gates, view.gates_back(gates))
    centres, weights = unpack_samples(back.samples)
    np.testing.assert_allclose(centres, view.points_back(boxes[:, :2]), atol=0.4)
    np.testing.assert_allclose(weights, [0.5, 1.0])
    assert back.foreground is None
    plain = replace(rectified, views=(None,))
    assert plain.back(0, result) is result
    # the template's bounds, upright again
    (template,) = rectified.sequence.templates
    drawn = np.array([340.0, 300.0, 40.0, 100.0])
    own = view.drawn_box(drawn, HALF_EXTENTS)
    np.testing.assert_allclose(
        template.box, [own[0] - own[2], own[1] - own[3], 2.0 * own[2], 2.0 * own[3]], atol=1.0
    )


def test_methods_that_look_at_no_pictures_get_the_recording_as_it_is(tmp_path: Path) -> None:
    sequence = recording(tmp_path, rolled(CAMERAS[0], 0.4))
    with FrameReader(sequence) as reader:
        parameters = with_values(RunParameters(), {"single_view": "none"})
        rectified = RectifiedSequence.of(sequence, parameters, reader)
        assert rectified.sequence is sequence
        assert rectified.reader is reader


@pytest.mark.full
@pytest.mark.parametrize("factor", [1.3, 2.0, 2.25, 2.9, 3.4, 4.5])
def test_a_reduced_picture_averages_and_stays_in_its_place(factor: float) -> None:
    camera = replace(CAMERAS[1], image_size=(round(640 * factor), round(480 * factor)))
    intrinsics = camera.intrinsics * np.array([[factor], [factor], [1.0]])
    view = seen(replace(camera, intrinsics=intrinsics), lines=480, target_height=2000)
    width, height = camera.image_size
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    ramp = np.stack([20 + 200 * x / width, 20 + 200 * y / height, 0 * x], axis=2)
    small = view.picture(np.rint(ramp).astype(np.uint8))
    middle = view.points_back(np.array([[0.0, 0.0], [311.0, 207.0], [639.0, 479.0]]))
    for place, at in zip([(0, 0), (207, 311), (479, 639)], middle, strict=True):
        expected = 20.0 + 200.0 * at / [width, height]
        np.testing.assert_allclose(small[place][:2], expected, atol=1.0)
    noise = np.random.default_rng(0).normal(128.0, 30.0, (height, width, 3))
    calm = view.picture(np.clip(noise, 0, 255).astype(np.uint8))
    assert calm.astype(float).std() < 1.1 * noise.std() / factor  # as of independent pixels


def test_a_shake_is_the_deviation_of_what_moved_and_is_undone() -> None:
    rng = np.random.default_rng(3)
    room = scene(rng)
    moved = np.array([
        [2.5, 0, 0], [-2.5, 0, 0], [0, 2.5, 0.002], [0, -2.5, -0.002], [1.5, 1.5, 0],
        [-1.5, -1.5, 0], [1, -1.5, 0.001], [-1, 1.5, -0.001], [0, 0, 0],
    ])  # fmt: skip
    pictures = [taken(room, one, rng) for one in moved]
    found = StaticScene.learn(pictures, None, 0.2)
    assert found is not None
    square = np.median((moved[:, :2] ** 2).sum(axis=1))
    assert found.shake == pytest.approx(np.sqrt(square / np.log(4.0)), rel=0.25)
    # what is left of it, measured in the same way on the pictures that are held still
    left = StaticScene.learn([found.align(picture) for picture in pictures], None, 0.0)
    assert left is not None
    assert left.shake < 0.15 * found.shake
    # a picture of three times the size shakes by three times as many pixels
    larger = [cv2.resize(one, None, fx=3.0, fy=3.0) for one in pictures]
    wider = StaticScene.learn(larger, None, 0.2)
    assert wider is not None
    assert wider.reduction == pytest.approx(320.0 / 720.0)
    assert wider.shake == pytest.approx(3.0 * found.shake, rel=0.2)


def test_a_camera_that_turns_about_the_middle_of_its_picture_is_not_shifted() -> None:
    room = scene(np.random.default_rng(8))

    def turned(angle: float) -> np.ndarray:
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        matrix = np.column_stack([turn, MIDDLE - turn @ (MIDDLE + 30.0)])
        return np.asarray(cv2.warpAffine(room, matrix, SIZE, flags=cv2.INTER_CUBIC))

    found = StaticScene.learn([turned(0.0)] * 3, None, 0.2)
    assert found is not None
    angle = 0.06
    forth, back = (found._shift_of(_normalise(turned(one), 1.0)) for one in (angle, -angle))
    assert forth is not None
    assert back is not None
    assert forth[2] == pytest.approx(angle, rel=0.02)
    # about another point p the shifts would be θ J p
    assert np.abs((forth - back)[:2] / (2.0 * angle)).max() < 0.2


def test_a_picture_on_its_side_is_evened_alike() -> None:
    picture = scene(np.random.default_rng(5))
    sideways = np.ascontiguousarray(picture.transpose(1, 0, 2))
    evened = _normalise(picture, 1.0)
    assert evened.std() > 20.0  # there is something to be evened
    assert np.abs(_normalise(sideways, 1.0).T.astype(int) - evened).max() <= 1


def test_people_light_and_noise_are_no_shake() -> None:
    found = StaticScene.learn(shaken(np.random.default_rng(4), 0.0), None, 0.2)
    assert found is not None
    assert found.shake < 0.06


def test_who_moves_does_not_move_the_scene() -> None:
    rng = np.random.default_rng(5)
    places = rng.uniform(-100.0, 100.0, (60, 2))
    truth = np.array([1.5, -0.7, 0.004])
    shifts = truth[:2] + truth[2] * np.stack([-places[:, 1], places[:, 0]], axis=1)
    shifts += rng.normal(0.0, 0.05, shifts.shape)
    shifts[:20] += [6.0, 2.0]  # somebody who walks
    found = consensus_shift(places, shifts, 240.0)
    assert found is not None
    assert (np.abs(found - truth) < [0.05, 0.05, 0.001]).all()


def test_what_nobody_agrees_on_or_lies_too_far_is_no_shake() -> None:
    rng = np.random.default_rng(6)
    places = rng.uniform(-100.0, 100.0, (60, 2))
    assert consensus_shift(places, rng.uniform(-20.0, 20.0, (60, 2)), 240.0) is None
    assert consensus_shift(places, np.full((60, 2), 13.0), 240.0) is None
    assert consensus_shift(places, np.full((60, 2), 11.0), 240.0) is not None
    assert consensus_shift(places[:11], np.zeros((11, 2)), 240.0) is None
    assert consensus_shift(places[:0], np.zeros((0, 2)), 240.0) is None


def test_a_plain_wall_tells_nothing() -> None:
    walls = [np.full((240, 320, 3), 90, dtype=np.uint8) for _ in range(8)]
    found = StaticScene.learn(walls, None, 0.2)
    assert found is not None
    assert found.shake == 0.0
    assert found.align(walls[0]) is walls[0]
    assert StaticScene.learn([], None, 0.2) is None


class _Shaking(FrameReader):
    """The pictures of a recording, of which one camera shakes."""

    def picture(self, camera: int, step: int) -> Picture | None:
        return self._shaken(super().picture(camera, step), camera, step)

    def iterate(self, camera: int, first: int = 0):  # type: ignore[no-untyped-def]
        for step, picture in enumerate(super().iterate(camera, first), first):
            yield self._shaken(picture, camera, step)

    @staticmethod
    def _shaken(picture: Picture | None, camera: int, step: int) -> Picture | None:
        if picture is None or camera != 0:
            return picture
        moved = np.random.default_rng(step).normal(0.0, 1.5, 2)
        matrix = np.column_stack([np.eye(2), moved])
        size = picture.shape[1::-1]
        return np.asarray(
            cv2.warpAffine(picture, matrix, size, borderMode=cv2.BORDER_REPLICATE), dtype=np.uint8
        )


@pytest.mark.full
def test_a_run_holds_the_shaking_camera_still_and_says_so() -> None:
    sequence = cut(open_sequence("room24-2p"), 270, 32)
    parameters = with_values(RunParameters(), {"single_view": "association_matrix"})
    with FrameReader(sequence) as calm, _Shaking(sequence) as reader:
        rectified = RectifiedSequence.of(sequence, parameters, reader)
        undone = pipeline.compute(sequence, parameters, reader=reader, steps=3)
        off = with_values(parameters, {"pictures.steady_from": 100.0})
        left = pipeline.compute(sequence, off, reader=reader, steps=3)
        plain = RectifiedSequence.of(sequence, parameters, calm)
        assert rectified.shake(0) == pytest.approx(1.5, rel=0.4)
        for camera in range(1, len(sequence.views)):
            assert rectified.shake(camera) == 0.0
            picture = rectified.reader.picture(camera, 5)
            assert (picture == calm.picture(camera, 5)).all()
        first, second = rectified.reader.picture(0, 7), next(iter(rectified.reader.iterate(0, 7)))
        assert (first == second).all()
        assert (first != reader.picture(0, 7)).any()
        assert plain.shake(0) == 0.0
        assert (plain.reader.picture(0, 7) == calm.picture(0, 7)).all()
    name = sequence.views[0].camera.name
    assert any(f'"{name}" shakes by 1.' in one for one in notices(undone))
    assert not any("shakes" in one for one in notices(left))


@pytest.mark.full
def test_check_names_the_camera_that_shakes_and_no_other() -> None:
    sequence = cut(open_sequence("room24-2p"), 270, 32)
    with FrameReader(sequence) as calm, _Shaking(sequence) as reader:
        (shaking,) = check_shake(sequence, reader)
        (still,) = check_shake(sequence, calm)
    assert shaking.status == "warning"
    assert shaking.sentence.startswith(f'camera "{sequence.views[0].camera.name}" shakes by 1.')
    assert shaking.numbers["shake"] == pytest.approx(1.5, rel=0.4)
    assert still.status == "good"
    blind = replace(
        sequence, views=tuple(replace(v, video=None, images=()) for v in sequence.views)
    )
    assert [one.status for one in check_shake(blind)] == ["absent"]
