"""The one synthetic world of the tests: cameras around a room, people who walk, what is seen.

Paths come first, everything else is derived from them: ``paths`` are ``(steps, people, 3)``
centres of upright targets in world metres, NaN where a person is not in the room. So one line
makes a scene, and every stage has its input from the same truth::

    cameras = ring(4)
    paths = together(walk([(-1, 0), (1, 0)], [0, 2], fps=10), walk([(1, 1), (-1, 1)], [1, 2], 10))
    seen = boxes(cameras, paths, sigma=1.5, rng=np.random.default_rng(0), misses=0.1, clutter=0.5)
    views(seen)           # stage 1, for the fusion: by step and camera
    tracks(paths)         # stage 2, for smoothing, corrections and export
    truth(paths)          # for the evaluation
    sequence(cameras, paths, seen)               # the whole as a value …
    folder(tmp_path, sequence(cameras, paths))   # … or in files, with painted or other pictures

Boxes are drawn by OpenCV's projection, not by the one that is tested.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from collections.abc import Sequence as Many
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import tomlkit
from numpy import ndarray

from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.fusion.trajectories import Trajectories
from tracker.geometry.camera import Camera
from tracker.sequences.sequence import (
    Detections,
    Entrance,
    GroundTruth,
    Room,
    Sequence,
    Template,
    View,
)
from tracker.single_view.protocol import ViewResult

PERSON = np.array([0.3, 0.3, 0.85])
"""Half width, depth and height of somebody upright, metres."""

HEAD = np.array([0.09, 0.09, 0.12])
"""Half extents of a target so small that the centre of its box is the projection of its centre."""

PINHOLE = np.zeros(5)
BARREL = np.array([-0.29, 0.01, 0.004, -0.004, 0.0])
"""The lens of a cheap surveillance camera: corners are drawn a good tenth too near."""

Hidden = Callable[[int, int, int], bool]
"""Whether a camera misses a person at a step: camera, person and step, by index."""

Picture = Callable[[int, int], ndarray]
"""The picture (height, width, 3), uint8, BGR, of a camera at a step: camera and step, by index."""

Colour = tuple[float, float, float]


# ── cameras and the room


def look_at(
    name: str,
    position: Many[float],
    target: Many[float] = (0.0, 0.0, 0.85),
    *,
    focal: float = 620.0,
    image_size: tuple[int, int] = (1280, 800),
    distortion: ndarray = PINHOLE,
    aspect: float = 1.0,
    shift: tuple[float, float] = (0.0, 0.0),
) -> Camera:
    """A camera at ``position``, metres, that looks at ``target``.

    Args:
        name: Of the camera.
        position: World metres.
        target: World metres.
        focal: Pixels across; down it is ``aspect`` times as much.
        image_size: Width and height, pixels.
        distortion: Of the lens.
        aspect: Width of a pixel in its heights.
        shift: Pixels from the middle of the picture to the optical axis.
    """
    ahead = np.subtract(target, position)
    ahead = ahead / np.linalg.norm(ahead)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(ahead, right), ahead])
    width, height = image_size
    x, y = (width - 1) / 2 + shift[0], (height - 1) / 2 + shift[1]
    intrinsics = np.array([[focal, 0, x], [0, aspect * focal, y], [0, 0, 1]])
    return Camera(name, image_size, intrinsics, rotation, -rotation @ position, distortion)


def surveillance(
    name: str, position: Many[float], target: Many[float] = (0.0, 0.0, 1.0), **changes: Any
) -> Camera:
    """A cheap camera: a bent lens, uneven pixels, an optical axis beside the picture's middle."""
    numbers: dict[str, Any] = {"focal": 390.0, "image_size": (360, 288), "distortion": BARREL,
                               "aspect": 1.08, "shift": (-1.3, 2.5)}  # fmt: skip
    return look_at(name, position, target, **(numbers | changes))


def ring(
    count: int,
    radius: float = 4.6,
    height: float = 2.6,
    *,
    focal: float = 620.0,
    image_size: tuple[int, int] = (1280, 800),
    distortion: ndarray = PINHOLE,
) -> tuple[Camera, ...]:
    """``count`` cameras, ``cam1`` on the x axis, evenly around the middle of the room."""
    # a little off the axes: the symmetry of a scene must not hide a swapped x and y
    angles = 0.1 + 2.0 * np.pi * np.arange(count) / count
    places = [(radius * np.cos(angle), radius * np.sin(angle), height) for angle in angles]
    return tuple(
        look_at(f"cam{k}", at, focal=focal, image_size=image_size, distortion=distortion)
        for k, at in enumerate(places, 1)
    )


def volume(
    half: float = 2.2,
    height: float = 2.2,
    entrances: Many[Many[float]] = (),
    sigma: Many[float] = (0.3, 0.3, 0.1),
) -> Room:
    """A square room around the origin, its floor at z = 0; entrances are points in metres."""
    doors = tuple(Entrance(np.array(place), np.array(sigma)) for place in entrances)
    return Room(np.array([-half, -half, 0.0]), np.array([half, half, height]), doors)


SMALL_CAMERAS = (
    surveillance("left", (-3.4, -3.2, 2.6)),
    surveillance("right", (3.3, -3.1, 2.4)),
    surveillance("back", (0.4, 4.4, 2.7)),
)
SMALL_ROOM = volume(1.5, 2.0, [(-1.2, 0.0, 1.0), (1.2, 0.0, 1.0)], (0.25, 0.25, 0.15))
"""What they see; people come in on both sides."""


# ── people


def walk(
    points: Many[Many[float]], times: Many[float], fps: float, *, height: float = PERSON[2]
) -> ndarray:
    """A path (steps, 3) through points at given seconds, NaN before the first of them.

    Args:
        points: x and y, or x, y and z, metres.
        times: Seconds from step 0, ascending; the path ends before the last of them.
        fps: Steps a second.
        height: z where the points have none.
    """
    places = np.array([[*point, height][:3] for point in points], dtype=float)
    seconds = np.arange(round(times[-1] * fps)) / fps
    path = np.stack([np.interp(seconds, times, places[:, axis]) for axis in range(3)], axis=1)
    path[seconds < times[0]] = np.nan
    return path


def stand(point: Many[float], steps: int, *, height: float = PERSON[2]) -> ndarray:
    """The path (steps, 3) of somebody who does not move."""
    return np.tile([*point, height][:3], (steps, 1)).astype(float)


def wander(
    rng: np.random.Generator, steps: int, *, size: float = 4.0, pace: float = 0.15
) -> ndarray:
    """A random walk (steps, 3) from anywhere in a square of ``size``, ``pace`` metres a step."""
    path = rng.uniform(-size / 2.0, size / 2.0, 3) + rng.normal(0.0, pace, (steps, 3)).cumsum(
        axis=0
    )
    path[:, 2] = PERSON[2] + 0.05 * rng.normal(size=steps)
    return path


def together(*walks: ndarray, steps: int | None = None) -> ndarray:
    """The paths of several people (steps, people, 3), NaN after the end of each."""
    steps = max((len(path) for path in walks), default=0) if steps is None else steps
    paths = np.full((steps, len(walks), 3), np.nan)
    for person, path in enumerate(walks):
        paths[: len(path), person] = path[:steps]
    return paths


def present(paths: ndarray) -> tuple[ndarray, ndarray, ndarray]:
    """Step, person and position of everybody in the room, by step and then person."""
    steps, people = np.nonzero(np.isfinite(paths).all(axis=2))
    return steps, people, paths[steps, people]


# ── what a detector makes of them


@dataclass(frozen=True)
class Boxes:
    """The boxes of one camera, sorted by step."""

    frames: ndarray
    boxes: ndarray
    """(D, 4) centre_x, centre_y, half_width, half_height, pixels."""
    sigmas: ndarray
    """(D, 4), the standard deviations of the noise in them."""
    people: ndarray
    """Whose box it is, by index; -1 for clutter."""
    steps: int

    def detections(self) -> Detections:
        """The same as a sequence holds them, each with the score 1."""
        corners = np.concatenate(
            [self.boxes[:, :2] - self.boxes[:, 2:], 2.0 * self.boxes[:, 2:]], axis=1
        )
        return Detections(self.frames, corners, np.ones(len(corners)))


def upright(camera: Camera, places: ndarray, half_extents: ndarray = PERSON) -> ndarray:
    """Boxes (N, 4), centre and half sizes, from head to foot of people; NaN if out of sight.

    The width is to the height as that of the target. A person is in sight where the centre of
    the box lies in the picture and head and foot are in front of the camera.
    """
    result = np.full((len(places), 4), np.nan)
    offset = np.array([0.0, 0.0, half_extents[2]])
    ahead = np.array(
        [(places + up) @ camera.rotation[2] + camera.translation[2] for up in (offset, -offset)]
    )
    rows = np.flatnonzero((ahead > 0.1).all(axis=0))
    if not len(rows):
        return result
    turn, _ = cv2.Rodrigues(camera.rotation)
    head, foot = (
        cv2.projectPoints(
            (places[rows] + up)[:, None], turn, camera.translation, camera.intrinsics,
            camera.distortion,
        )[0][:, 0]
        for up in (offset, -offset)
    )  # fmt: skip
    half = np.abs(foot[:, 1] - head[:, 1]) / 2.0
    share = float(np.mean(half_extents[:2])) / half_extents[2]
    result[rows] = np.stack([*((head + foot) / 2.0).T, half * share, half], axis=1)
    inside = (result[:, :2] >= -0.5) & (result[:, :2] < np.array(camera.image_size) - 0.5)
    result[~inside.all(axis=1)] = np.nan
    return result


def boxes(
    cameras: Many[Camera],
    paths: ndarray,
    sigma: float = 1.0,
    rng: np.random.Generator | None = None,
    misses: float = 0.0,
    clutter: float = 0.0,
    *,
    relative: float = 0.0,
    hidden: Hidden = lambda camera, person, step: False,
    half_extents: ndarray = PERSON,
) -> list[Boxes]:
    """The boxes of each camera.

    Args:
        cameras: In order.
        paths: (steps, people, 3).
        sigma: Standard deviation of the noise of a box's four numbers, pixels.
        rng: Of noise, misses and clutter; None for a generator of seed 0.
        misses: Probability that a person in sight is not detected.
        clutter: Expected number of false boxes a camera and step.
        relative: Noise besides ``sigma``, as a share of a box's half height.
        hidden: Who is not detected besides.
        half_extents: Of the people, metres.
    """
    rng = np.random.default_rng(0) if rng is None else rng
    result = []
    for number, camera in enumerate(cameras):
        rows = []
        for step, places in enumerate(paths):
            exact = upright(camera, places, half_extents)
            there = [
                person
                for person in np.flatnonzero(np.isfinite(exact[:, 0])).tolist()
                if rng.random() >= misses and not hidden(number, person, step)
            ]
            low, high = (0.0, 0.0, 15.0, 45.0), (*camera.image_size, 30.0, 90.0)
            false = rng.uniform(low, high, (rng.poisson(clutter), 4))
            of_step = np.concatenate([exact[there], false])
            people = np.array([*there, *[-1] * len(false)], dtype=np.int64)
            for row in rng.permutation(len(people)):
                noise = np.full(4, np.hypot(sigma, relative * of_step[row, 3]))
                noise *= people[row] >= 0
                rows.append((step, of_step[row] + noise * rng.normal(size=4), noise, people[row]))
        result.append(
            Boxes(
                np.array([row[0] for row in rows], dtype=np.int64),
                np.array([row[1] for row in rows]).reshape(-1, 4),
                np.array([row[2] for row in rows]).reshape(-1, 4),
                np.array([row[3] for row in rows], dtype=np.int64),
                len(paths),
            )
        )
    return result


def views(
    seen: Many[Boxes], trust: Callable[[ndarray], ndarray] | float | None = None
) -> list[tuple[ViewResult, ...]]:
    """Stage 1 of every step: one result a camera, boxes of weight 1.

    Args:
        seen: Of each camera.
        trust: The measurement noise that is stated: a function of the boxes, one number in
            pixels, or None for the noise they were made with (of clutter: that of the step's
            worst box, at least a pixel).
    """
    steps = []
    for step in range(seen[0].steps):
        results = []
        for one in seen:
            rows = slice(*np.searchsorted(one.frames, [step, step + 1]).tolist())
            found = one.boxes[rows]
            if trust is None:
                worst = max(one.sigmas[rows].max(initial=0.0), 1.0)
                sigmas = np.where(one.people[rows, None] >= 0, one.sigmas[rows], worst)
            else:
                sigmas = trust(found) if callable(trust) else np.full(found.shape, trust)
            results.append(ViewResult.of_boxes(found, np.ones(len(found)), sigmas))
        steps.append(tuple(results))
    return steps


# ── what a filter makes of them, and the truth


def gaussians(
    places: ndarray,
    *,
    weights: float | ndarray = 0.9,
    sigma: float = 0.1,
    speed_sigma: float | None = 0.5,
    first_label: int = 1,
) -> GaussianMixture:
    """One component a place (N, 3), at rest; without velocities where ``speed_sigma`` is None."""
    count = len(places)
    spread = [sigma] * 3 + ([] if speed_sigma is None else [speed_sigma] * 3)
    means = np.concatenate([places, np.zeros((count, len(spread) - 3))], axis=1)
    covariances = np.tile(np.diag(np.square(spread)), (count, 1, 1))
    labels = first_label + np.arange(count)
    return GaussianMixture(
        np.broadcast_to(weights, count).astype(float), means, covariances, labels
    )


def tracks(
    paths: ndarray,
    *,
    sigma: float = 0.0,
    rng: np.random.Generator | None = None,
    ids: Many[int] | None = None,
    cameras: int = 1,
    stated: float | None = None,
    existence: float = 1.0,
) -> Trajectories:
    """Tracks along the paths, every camera seeing everybody.

    Args:
        paths: (steps, people, 3).
        sigma: Standard deviation of the error of each coordinate, metres.
        rng: Of the error; None for a generator of seed 0.
        ids: Of each person; 1, 2, … where none are given.
        cameras: How many.
        stated: The standard deviation that the tracks claim; ``sigma`` where it is None.
        existence: Of every row.
    """
    rng = np.random.default_rng(0) if rng is None else rng
    steps, people, places = present(paths)
    names = np.arange(1, paths.shape[1] + 1) if ids is None else np.asarray(ids, dtype=np.int64)
    order = np.lexsort((names[people], steps))
    count = len(order)
    return Trajectories(
        frames=steps[order],
        ids=names[people][order],
        positions=places[order] + sigma * rng.normal(size=(count, 3)),
        existences=np.full(count, existence),
        sigmas=np.full((count, 3), sigma if stated is None else stated),
        seen=np.ones((count, cameras), dtype=bool),
        components=np.arange(count) - np.searchsorted(steps[order], steps[order]),
        labels=names[people][order],
        covariances_xy=np.zeros(count),
        heights=np.full(count, np.nan),
        sigma_heights=np.full(count, np.nan),
    )


def truth(paths: ndarray, ids: Many[int] | None = None) -> GroundTruth:
    """Where everybody was; ids are 1, 2, … where none are given."""
    exact = tracks(paths, ids=ids)
    certain = np.ones(len(exact), dtype=bool)
    return GroundTruth(exact.frames, exact.ids, exact.positions, certain)


# ── the whole, as a value and as files


def sequence(
    cameras: Many[Camera],
    paths: ndarray,
    seen: Many[Boxes] | None = None,
    *,
    fps: float = 10.0,
    room: Room | None = None,
    half_extents: ndarray = PERSON,
    templates: Many[Template] = (),
    name: str = "world",
) -> Sequence:
    """Cameras, boxes (where they are given) and truth as a sequence without pictures."""
    detections = [None] * len(cameras) if seen is None else [one.detections() for one in seen]
    content = [paths.tobytes(), *(one.boxes.tobytes() for one in seen or ())]
    return Sequence(
        name=name,
        folder=Path(),
        fps=fps,
        frames=len(paths),
        room=volume() if room is None else room,
        target_half_extents=half_extents,
        views=tuple(
            View(camera, detections=of_camera)
            for camera, of_camera in zip(cameras, detections, strict=True)
        ),
        templates=tuple(templates),
        ground_truth=truth(paths),
        digest=hashlib.sha256(b"".join(content)).hexdigest(),
    )


def painted(
    cameras: Many[Camera],
    paths: ndarray,
    colours: Many[tuple[Colour, Colour]],
    *,
    half_extents: ndarray = PERSON,
    noise: float = 2.0,
) -> Picture:
    """People as ellipses of two colours, upper and lower half, before a wall, nearer ones in front.

    Args:
        cameras: In order.
        paths: (steps, people, 3).
        colours: Upper and lower half of each person, BGR.
        half_extents: Of the people, metres.
        noise: Standard deviation of the sensor's noise, grey levels.
    """

    def picture(camera: int, step: int) -> ndarray:
        width, height = cameras[camera].image_size
        result = np.full((height, width, 3), (175.0, 190.0, 195.0))
        things = np.random.default_rng(camera)
        for _ in range(10):
            x, y = (things.integers(0, length * 8 // 9) for length in (width, height))
            result[y : y + height // 9, x : x + width // 9] = things.uniform(60, 220)
        found = upright(cameras[camera], paths[step], half_extents)
        distances = np.linalg.norm(paths[step] - cameras[camera].centre, axis=1)
        for person in np.argsort(-distances):
            if np.isfinite(found[person, 0]):
                x, y, *half = np.rint(found[person]).astype(int).tolist()
                axes = (max(1, half[0]), max(1, half[1]))
                upper, lower = colours[person]
                cv2.ellipse(result, (x, y), axes, 0, 0, 360, lower, -1)
                cv2.ellipse(result, (x, y), axes, 0, 180, 360, upper, -1)
        sensor = np.random.default_rng([camera, step]).normal(0.0, noise, result.shape)
        return np.clip(np.rint(result + sensor), 0, 255).astype(np.uint8)

    return picture


def folder(
    path: Path, whole: Sequence, picture: Picture | None = None, *, video: bool = False
) -> Path:
    """A sequence as a folder that the reader opens: cameras, boxes, truth, templates, pictures.

    Args:
        path: Made if it is not there.
        whole: As :func:`sequence` makes it.
        picture: Of every camera and step; None for a folder without pictures.
        video: Whether the pictures become one MPEG-4 video a camera, not PNG files.
    """
    path.mkdir(parents=True, exist_ok=True)
    toml: dict[str, Any] = {"format": 1, "name": whole.name, "fps": whole.fps}
    toml["frames"] = whole.frames
    toml["room"] = {
        "min": whole.room.minimum.tolist(),
        "max": whole.room.maximum.tolist(),
        "entrances": [
            {"position": door.position.tolist(), "sigma": door.sigma.tolist()}
            for door in whole.room.entrances
        ],
    }
    toml["target"] = {"half_extents": whole.target_half_extents.tolist()}
    toml["camera"] = []
    for number, view in enumerate(whole.views):
        camera, table = view.camera, {"name": view.camera.name}
        if picture is not None:
            pictures = [picture(number, step) for step in range(whole.frames)]
            table |= _write_pictures(path, camera, pictures, whole.fps, video=video)
        if view.detections is not None:
            table["detections"] = f"{camera.name}.csv"
            boxes, scores = view.detections.boxes, view.detections.scores
            columns = [view.detections.frames, *boxes.T, scores]
            write_csv(path / f"{camera.name}.csv", "frame,left,top,width,height,score", columns)
        numbers = (camera.intrinsics, camera.rotation, camera.translation, camera.distortion)
        table |= {"image_size": list(camera.image_size)}
        names = ("K", "R", "t", "distortion")
        table |= {key: value.tolist() for key, value in zip(names, numbers, strict=True)}
        toml["camera"].append(table)
    if whole.templates:
        toml["template"] = [
            {"name": one.name, "camera": one.camera, "frame": one.frame, "box": one.box.tolist()}
            for one in whole.templates
        ]
    if whole.ground_truth is not None:
        known = whole.ground_truth
        columns = [known.frames, known.ids, *known.positions.T, known.valid]
        write_csv(path / "ground_truth.csv", "frame,id,x,y,z,valid", columns)
        toml["ground_truth"] = {"file": "ground_truth.csv"}
    (path / "sequence.toml").write_text(tomlkit.dumps(toml), encoding="utf-8")
    return path


def write_csv(path: Path, header: str, columns: Many[ndarray]) -> None:
    """Columns of numbers under a line of names."""
    table = np.column_stack(columns)
    np.savetxt(path, table, "%.17g", delimiter=",", header=header, comments="")


def _write_pictures(
    path: Path, camera: Camera, pictures: Many[ndarray], fps: float, *, video: bool
) -> dict[str, str]:
    """Write them; what names them in ``sequence.toml``."""
    if not video:
        (path / camera.name).mkdir()
        for step, picture in enumerate(pictures):
            cv2.imwrite(str(path / camera.name / f"{step:05d}.png"), picture)
        return {"images": f"{camera.name}/*.png"}
    file = path / f"{camera.name}.mp4"
    codec = cv2.VideoWriter.fourcc(*"mp4v")
    writer = cv2.VideoWriter(str(file), cv2.CAP_FFMPEG, codec, fps, camera.image_size)
    assert writer.isOpened(), "this OpenCV cannot write MPEG-4"
    for picture in pictures:
        writer.write(picture)
    writer.release()
    return {"video": file.name}
