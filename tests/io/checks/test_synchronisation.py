"""Offsets of cameras are found from boxes and from pictures, and only where there are any."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.conftest import short
from tests.random_rooms import looking_camera, random_room, random_walkers
from tracker.geometry.camera import Camera
from tracker.io.checks import check
from tracker.io.checks.offsets import solve
from tracker.io.checks.synchronisation import LEAST_GAIN, CameraOffset, synchronise
from tracker.sequences.sequence import Detections, Room, Sequence, View

STEPS = [-25.0, -7.0, -0.5, 0.0, 0.5, 3.0, 12.0, 40.0]


def against_the_first(found: tuple[CameraOffset, ...]) -> list[float]:
    """The offsets of all cameras less that of the first: which one is right nobody can know."""
    return [offset.steps - found[0].steps for offset in found]


@pytest.mark.parametrize("late", STEPS)
@pytest.mark.parametrize("seed", short(range(3)))
def test_a_late_camera_is_found_from_boxes(seed: int, late: float) -> None:
    sequence = random_room(seed, fps=12.0, steps=300, people=3, late=(0.0, late / 12.0))
    found = synchronise(sequence)
    expected = [late if camera == 1 else 0.0 for camera in range(len(found))]
    assert against_the_first(found) == pytest.approx(expected, abs=1.0)


@pytest.mark.full
def test_several_late_cameras_of_a_crowd_are_found_together() -> None:
    late = (0.0, 1.3, 0.0, -0.7, 0.0)
    sequence = random_room(11, cameras=5, fps=10.0, steps=300, people=12, late=late)
    found = synchronise(sequence)
    assert [offset.seconds for offset in found] == pytest.approx(late, abs=0.08)
    assert [offset.sure for offset in found] == [False, True, False, True, False]


@pytest.mark.full
def test_a_late_camera_is_told_with_its_remedy_and_nothing_is_applied() -> None:
    sequence = random_room(5, cameras=4, fps=25.0, steps=400, people=3, late=(0, 0, 12 / 25))
    told = [each for each in check(sequence) if each.status == "warning"]
    (late,) = told
    assert late.sentence.startswith("cam3 is 1")
    assert "frames late" in late.sentence
    (remedy,) = late.remedies
    assert remedy.flag == "camera.time_offset"
    assert float(remedy.value) == pytest.approx(-12 / 25, abs=0.04)
    assert sequence.views[2].clock is None


def with_frames(sequence: Sequence, camera: int, frames: np.ndarray, kept: np.ndarray) -> Sequence:
    """The sequence with other numbers of the frames of one camera, without some of its boxes."""
    view = sequence.views[camera]
    own = view.detections
    assert own is not None
    changed = Detections(frames[kept], own.boxes[kept], own.scores[kept])
    views = list(sequence.views)
    views[camera] = replace(view, detections=changed)
    return replace(sequence, views=tuple(views))


def frames_of(sequence: Sequence, camera: int) -> np.ndarray:
    own = sequence.views[camera].detections
    assert own is not None
    return own.frames


def sentences(sequence: Sequence) -> list[str]:
    """The warnings about cameras that do not show the same moments."""
    return [
        each.sentence
        for each in check(sequence, pictures=False)
        if each.name == "cameras show the same moments" and each.status == "warning"
    ]


@pytest.mark.parametrize(("cameras", "camera"), [(4, 0), (4, 2), (2, 0), (2, 1)])
def test_lost_frames_are_a_warning_with_their_number_and_frame(cameras: int, camera: int) -> None:
    """Of two cameras the one that lost frames is named, not the other, which has more."""
    sequence = random_room(5, cameras=cameras, fps=10.0, steps=300, people=3)
    frames = frames_of(sequence, camera)
    kept = (frames < 150) | (frames >= 162)
    (words,) = sentences(with_frames(sequence, camera, frames - 12 * (frames >= 162), kept))
    found = re.fullmatch(
        r"cam(\d): it lost about (\d+) frames \((\d\.\d\d) s\) before its frame (\d+) .*", words
    )
    assert found is not None, words
    assert int(found[1]) == camera + 1
    assert int(found[2]) == pytest.approx(12, abs=2)
    assert float(found[3]) == pytest.approx(int(found[2]) / 10.0)
    assert int(found[4]) == pytest.approx(150, abs=2)
    assert "drifts" not in words


@pytest.mark.parametrize(("cameras", "rate"), [(4, 1.05), (4, 0.95), (2, 1.05)])
def test_a_clock_that_drifts_is_one_of_another_rate(cameras: int, rate: float) -> None:
    """Of two cameras either may be meant."""
    sequence = random_room(6, cameras=cameras, fps=10.0, steps=300, people=3)
    frames = frames_of(sequence, 1)
    drifting = np.round(frames * rate).astype(int)
    (words,) = sentences(with_frames(sequence, 1, drifting, drifting < 300))
    found = re.search(
        r"(cam\d): its clock drifts: .*, as if it had ([\d.]+) frames a second", words
    )
    assert found is not None, words
    if cameras == 2 and found[1] == "cam1":
        rate = 1.0 / rate
    else:
        assert found[1] == "cam2"
    assert float(found[2]) == pytest.approx(10.0 * rate, rel=0.01)
    assert "lost" not in words


def test_the_curve_has_its_peak_at_the_offset() -> None:
    sequence = random_room(5, cameras=3, fps=12.0, steps=300, people=3, late=(0.0, 1.0))
    curve = synchronise(sequence)[1].curve
    assert curve.offsets[0] == -120
    assert curve.offsets[-1] == 120
    assert curve.offsets[int(np.nanargmax(curve.agreement))] == pytest.approx(12.0, abs=1.0)


@pytest.mark.full
@pytest.mark.parametrize("seed", range(4))
def test_boxes_of_other_people_give_no_sure_offset(seed: int) -> None:
    sequence, other = random_room(seed, cameras=3), random_room(seed + 50, cameras=3)
    stranger = replace(sequence.views[1], detections=other.views[1].detections)
    views = (sequence.views[0], stranger, *sequence.views[2:])
    assert not any(offset.sure for offset in synchronise(replace(sequence, views=views)))


def test_people_who_stand_still_give_no_sure_offset() -> None:
    sequence = random_room(7, cameras=3, people=3, steps=200)
    still = []
    for view in sequence.views:
        own = view.detections
        assert own is not None
        first = own.at(0)
        count = first.stop - first.start
        noise = np.random.default_rng(0).normal(0.0, 1.0, (200, count, 4))
        boxes = (own.boxes[first] + noise).reshape(-1, 4)
        frames = np.repeat(np.arange(200), count)
        still.append(
            replace(
                view,
                detections=replace(own, frames=frames, boxes=boxes, scores=np.ones(len(frames))),
            )
        )
    found = synchronise(replace(sequence, views=tuple(still)))
    assert not any(offset.sure for offset in found)


@dataclass(frozen=True)
class _Agreement:
    """Two cameras of which noise alone, or a shift by ``peak`` steps, agrees."""

    noise: np.random.Generator
    peak: float | None

    def scores(self, offsets: np.ndarray, *, fine: bool = False) -> tuple[np.ndarray, np.ndarray]:
        fits = self.noise.normal(0.0, 0.01, (len(offsets), 20))
        if self.peak is not None:
            fits += np.exp(-((offsets[:, None] - self.peak) ** 2) / 8.0)
        return fits, np.ones_like(fits)


@pytest.mark.parametrize("seed", range(5))
def test_two_cameras_that_agree_with_each_other_alone_tell_no_offset(seed: int) -> None:
    noise = np.random.default_rng(seed)
    apart, together = _Agreement(noise, None), _Agreement(noise, -20.0)
    found = solve({(0, 1): apart, (0, 2): apart, (1, 2): together}, 3, 100)
    steps = [offset.steps for offset in found if offset is not None]
    assert steps[2] - steps[1] == pytest.approx(-20.0, abs=1.0)
    assert [offset.gain < LEAST_GAIN for offset in found if offset is not None] == [True] * 3


def test_nothing_to_compare_gives_nothing() -> None:
    sequence = random_room(0, cameras=2)
    bare = [replace(view, detections=None) for view in sequence.views]
    assert synchronise(replace(sequence, views=tuple(bare))) == ()


def drawn(folder: Path, camera: Camera, rng: np.random.Generator, late: float) -> tuple[Path, ...]:
    """Pictures of people as bright columns before a noisy wall, shown ``late`` seconds too late."""
    width, height = camera.image_size
    wall = cv2.resize(rng.integers(60, 160, (12, 16), dtype=np.uint8), (width, height))
    room = Room(np.zeros(3), np.array([5.0, 5.0, 2.2]))
    walkers = random_walkers(np.random.default_rng(3), room, 2, 30.0)
    folder.mkdir()
    for step in range(240):
        picture = wall + rng.normal(0.0, 3.0, wall.shape)
        boxes, visible = camera.project_boxes(
            walkers.at(step / 12.0 - late), np.array([0.25, 0.25, 0.85])
        )
        for number in np.flatnonzero(visible):
            left, top, right, bottom = np.round(
                [*boxes[number, :2], *(boxes[number, :2] + boxes[number, 2:])]
            ).astype(int)
            picture[max(top, 0) : max(bottom, 0), max(left, 0) : max(right, 0)] = 30 + 190 * number
        colour = cv2.cvtColor(np.clip(picture, 0, 255).astype(np.uint8), cv2.COLOR_GRAY2BGR)
        cv2.imwrite(str(folder / f"{step:04d}.png"), colour)
    return tuple(sorted(folder.iterdir()))


@pytest.mark.parametrize(
    "late",
    [0.5, *(pytest.param(late, marks=pytest.mark.full) for late in (-25.0, 0.0, 17.0))],
)
def test_a_late_camera_is_found_from_the_motion_in_pictures(tmp_path: Path, late: float) -> None:
    rng = np.random.default_rng(8)
    middle = np.array([2.5, 2.5, 0.9])
    views = []
    for number, place in enumerate([(-1.0, -1.5, 2.5), (6.5, -0.5, 2.2), (2.0, 7.0, 2.7)]):
        camera = looking_camera(f"cam{number + 1}", np.array(place), middle, 170.0, (240, 180))
        delay = late / 12.0 if number == 1 else 0.0
        views.append(View(camera, images=drawn(tmp_path / camera.name, camera, rng, delay)))
    sequence = Sequence(
        name="columns",
        folder=tmp_path,
        fps=12.0,
        frames=240,
        room=Room(np.zeros(3), np.array([5.0, 5.0, 2.2])),
        target_half_extents=np.array([0.25, 0.25, 0.85]),
        views=tuple(views),
    )
    found = synchronise(sequence)
    assert against_the_first(found) == pytest.approx([0.0, late, 0.0], abs=1.0)
    if abs(late) < 1.0:
        assert not found[1].sure
    if late == 17.0:
        assert found[1].sure
