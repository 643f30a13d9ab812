"""A camera that shakes is measured and held still; one that does not is left alone."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from tests.golden.pieces import cut
from tests.single_view.shaken import MIDDLE, SIZE, scene, shaken, taken
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.values import with_values
from tracker.runs import pipeline
from tracker.runs.gates import notices
from tracker.sequences.library import open_sequence
from tracker.sequences.pictures.frames import FrameReader, Picture
from tracker.single_view.rectification.sequence import RectifiedSequence, check_shake
from tracker.single_view.rectification.stabilisation import StaticScene, _normalise, consensus_shift


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
