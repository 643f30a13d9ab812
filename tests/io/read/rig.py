"""Four cameras around a room, people who walk in it, and the files that programs make of them."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy import ndarray

from tracker.geometry.camera import Camera
from tracker.io.conventions.reading import Reading, to_camera
from tracker.io.read.pieces import METRES, CalibrationPiece, DetectionPiece, Piece, RawCamera
from tracker.io.read.registry import recognise
from tracker.io.read.source import SourceFile

SIZE = (1280, 720)
HALF_EXTENTS = np.array([0.3, 0.3, 0.85])
FLIP = np.diag([1.0, -1.0, -1.0])


def cameras(distortion: bool = True) -> list[Camera]:
    """Looking at the middle of the room from its corners, 3 m up."""
    found = []
    for number, (x, y) in enumerate(((5.0, 5.0), (-5.0, 5.0), (-5.0, -5.0), (5.0, -4.0))):
        centre = np.array([x, y, 3.0 + 0.1 * number])
        ahead = np.array([0.0, 0.0, 1.0]) - centre
        ahead /= np.linalg.norm(ahead)
        right = np.cross(ahead, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right)
        rotation = np.stack([right, np.cross(ahead, right), ahead])
        k = np.array([[900.0 + number, 0.0, 640.5], [0.0, 905.0, 355.0], [0.0, 0.0, 1.0]])
        lens = np.array([-0.1, 0.02, 0.001, -0.002, 0.003]) * distortion
        found.append(Camera(f"cam{number + 1}", SIZE, k, rotation, -rotation @ centre, lens))
    return found


def walks(steps: int = 60, people: int = 4) -> ndarray:
    """Middles of people, (steps, people, 3) metres."""
    time = np.linspace(0.0, 4.0, steps)[:, None]
    phase = np.linspace(0.0, 5.0, people)[None]
    return np.stack(
        [
            2.0 * np.cos(time + phase),
            1.6 * np.sin(1.3 * time + 2.0 * phase),
            np.full((steps, people), HALF_EXTENTS[2]),
        ],
        axis=-1,
    )


def boxes(camera: Camera, places: ndarray) -> tuple[ndarray, ndarray]:
    """Frames and left, top, width, height of everybody whom the camera sees whole."""
    frames, rows = [], []
    for frame, people in enumerate(places):
        found, visible = camera.project_boxes(people, HALF_EXTENTS)
        low, high = found[:, :2], found[:, :2] + found[:, 2:]
        whole = visible & (low > 0.0).all(axis=1) & (high < np.array(SIZE)).all(axis=1)
        frames += [frame] * int(whole.sum())
        rows.append(found[whole])
    return np.array(frames), np.concatenate(rows)


def read(path: Path, *series: Path) -> tuple[str, list[Piece]]:
    """The format that a file is taken for, and its pieces."""
    file = SourceFile(path, series=series)
    found, _, complaint = recognise(file)
    assert found is not None, complaint
    return found.NAME, list(found.read(file))


def boxes_in(path: Path, *series: Path) -> list[DetectionPiece]:
    """The boxes of a file, a piece a camera."""
    return [piece for piece in read(path, *series)[1] if isinstance(piece, DetectionPiece)]


def boxes_of_one(path: Path, *series: Path) -> DetectionPiece:
    """The boxes of a file of one camera."""
    (piece,) = boxes_in(path, *series)
    return piece


def raw_cameras(path: Path) -> tuple[RawCamera, ...]:
    """The cameras of a file."""
    return tuple(c for p in read(path)[1] if isinstance(p, CalibrationPiece) for c in p.cameras)


def assert_same(raw: RawCamera, camera: Camera, tolerance: float = 1e-9) -> None:
    """A camera as it was read sees what the original sees, in the unit that its format states."""
    convention = raw.convention
    reading = Reading(
        convention.direction or "world-to-camera",
        convention.axes or "opencv",
        unit=convention.unit or "m",
        up=convention.up or "z",
    )
    assert METRES[reading.unit] > 0.0
    found = to_camera(raw, reading, raw.image_size or camera.image_size)
    for name in ("intrinsics", "rotation", "translation", "distortion"):
        np.testing.assert_allclose(
            getattr(found, name), getattr(camera, name), rtol=tolerance, atol=tolerance
        )


def assert_cameras(
    found: Iterable[RawCamera],
    expected: Iterable[Camera],
    tolerance: float = 1e-9,
    *,
    named: bool = True,
) -> None:
    """As many cameras as expected are the same, also by their names unless these are no matter."""
    for raw, camera in zip(found, expected, strict=True):
        assert raw.name == camera.name or not named
        assert_same(raw, camera, tolerance)
