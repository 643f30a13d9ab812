"""Calibrations whose shape is that of another camera's pictures."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from tests.io.read.rig import cameras as rig
from tests.io.read.rig import raw_cameras
from tracker.export.calibration import save_calibration
from tracker.io.importing.finding.matching import MatchedCamera
from tracker.io.importing.finding.pictures import exchange_by_shape, picture_sizes
from tracker.io.read.pieces import FormatError, VideoPiece


def matched(
    folder: Path, calibrated: list[tuple[int, int]], filmed: list[tuple[int, int]]
) -> list[MatchedCamera]:
    """Cameras by the sizes that they were calibrated for, and those of their videos."""
    save_calibration(folder / "cameras.toml", rig(), "pose2sim")
    raws = raw_cameras(folder / "cameras.toml")
    return [
        MatchedCamera(
            replace(raw, image_size=size),
            raw.name,
            VideoPiece(folder / f"{raw.name}.mp4", frames=10, fps=25.0, size=own),
        )
        for raw, size, own in zip(raws, calibrated, filmed, strict=False)
    ]


WIDE, TALL, SQUARE = (1280, 720), (640, 480), (500, 500)


@pytest.mark.parametrize(
    ("filmed", "owners"),
    [
        ((TALL, WIDE, WIDE), (1, 0, 2)),  # of three, two are each other's
        ((WIDE, TALL, WIDE), (0, 1, 2)),  # right
    ],
)
def test_calibrations_of_each_others_shape_are_exchanged_and_told(
    tmp_path: Path, filmed: tuple[tuple[int, int], ...], owners: tuple[int, ...]
) -> None:
    cameras = matched(tmp_path, [WIDE, TALL, WIDE], list(filmed))
    before = [camera.raw for camera in cameras]
    found: list[tuple[str, str]] = []
    exchange_by_shape(cameras, found)
    for camera, raw, owner in zip(cameras, before, owners, strict=True):
        assert camera.raw.name == raw.name, "names stay with the pictures"
        assert camera.raw.translation is before[owner].translation
    named = [name for name, _ in found]
    assert named == ([] if owners == (0, 1, 2) else ["cam1 exchanged", "cam2 exchanged"])
    assert picture_sizes(cameras, []) == list(filmed)


def test_three_shapes_in_a_circle_are_put_right(tmp_path: Path) -> None:
    cameras = matched(tmp_path, [WIDE, TALL, SQUARE], [TALL, SQUARE, WIDE])
    before = [camera.raw for camera in cameras]
    exchange_by_shape(cameras, [])
    assert [camera.raw.translation for camera in cameras] == [
        before[k].translation for k in (1, 2, 0)
    ]


def test_where_shapes_do_not_tell_whose_is_whose_it_is_refused_as_before(tmp_path: Path) -> None:
    cameras = matched(tmp_path, [WIDE, WIDE, TALL, TALL], [TALL, TALL, WIDE, WIDE])
    before = [camera.raw for camera in cameras]
    exchange_by_shape(cameras, [])
    assert [camera.raw for camera in cameras] == before
    with pytest.raises(FormatError, match="another shape"):
        picture_sizes(cameras, [])
