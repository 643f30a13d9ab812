"""Recordings as some program would write them, with at most one defect, and what is true of them.

``make_folder`` draws a room, people who walk in it, cameras, the form of calibration and boxes, a
convention and a defect, writes the files and returns what an import should make of them.
:func:`judge` compares an import plan with that.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import cv2
import numpy as np
from numpy import ndarray
from numpy.random import Generator
from scipy.spatial.transform import Rotation

from tests.io.read.rig import FLIP
from tests.random_rooms import Walkers, looking_camera, random_walkers
from tracker.geometry.camera import Camera
from tracker.io.conventions.reading import upright
from tracker.io.importing.options import ImportOptions
from tracker.io.importing.settling import ImportPlan
from tracker.io.read.pieces import METRES, Unit, Up
from tracker.sequences.sequence import Room

ROOMS = ("random", "rolled", "crowded", "heads", "seated")
CALIBRATIONS = ("OpenCV", "JSON", "Anipose", "COLMAP")
BOXES = ("CSV by name", "JSON of four numbers", "MOTChallenge", "YOLO", "COCO")
NAMES = ("equal", "numbered", "another language", "shuffled")
DEFECTS = (
    "none", "late", "other rate", "exchanged", "mirrored", "boxes of another recording",
    "camera moved", "spoilt file", "frames lost", "every second frame", "boxes of all classes",
    "second calibration", "other pixels",
)  # fmt: skip
WORDS = ("north", "window", "stairs", "lobby", "bar", "yard", "gate", "office")
MOST_FRAMES = 1500
_TALL = {"random": 1.7, "rolled": 1.7, "crowded": 1.7, "heads": 0.25, "seated": 1.25}
_ROUND = np.array(
    [[x, y, z] for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if x or y or z], float
)
_ROUND /= np.linalg.norm(_ROUND, axis=1, keepdims=True)


@dataclass(frozen=True)
class Known:
    """What is true of a folder."""

    cameras: tuple[Camera, ...]
    """In metres, z up."""
    sources: dict[str, int]
    """The camera of each file or folder of boxes, by its stem."""
    boxes: tuple[dict[int, ndarray], ...]
    """Left, top, width, height by frame of each camera's file, counted from 0."""
    fps: float
    options: ImportOptions
    """What the user states."""
    arbitrary: bool
    """Whether the format's unit is arbitrary."""
    defect: str = "none"
    suspects: tuple[str, ...] = ()
    """Cameras, one of which a sentence about the defect names."""
    late: dict[int, float] = field(default_factory=dict)
    """Seconds by which cameras show what happened before."""
    form: str = ""


def make_folder(
    folder: Path, rng: Generator, defect: str | None = None, most_frames: int = MOST_FRAMES
) -> Known:
    """Write a recording and return what is true of it.

    Args:
        folder: An empty folder.
        rng: Generator that draws everything.
        defect: One of :data:`DEFECTS`; None for a random one.
        most_frames: Largest number of steps.
    """
    kind = str(rng.choice(ROOMS))
    if defect is None:
        defect = "none" if rng.random() < 0.33 else str(rng.choice(DEFECTS[1:]))
    tall = _TALL[kind]
    fps = float(rng.choice([4.0, 10.0, 12.5, 25.0, 30.0, 60.0]))
    seconds = float(np.exp(rng.uniform(np.log(4.0), np.log(200.0))))
    steps = int(np.clip(round(seconds * fps), 12, most_frames))
    cameras = _cameras(rng, kind)
    people = int(rng.integers(8, 16)) if kind == "crowded" else int(rng.integers(1, 7))
    sides = rng.uniform(4.0, 10.0, 2)
    room = Room(np.zeros(3), np.array([*sides, 2.2]))
    walkers = random_walkers(rng, room, people, steps / fps, tall)
    others = random_walkers(rng, room, people, steps / fps, tall)
    odd = int(rng.integers(len(cameras)))
    late = {odd: float(rng.uniform(0.4, 6.0))} if defect == "late" else {}
    lost = max(2, round(rng.uniform(0.6, 3.0) * fps))
    seen: list[dict[int, ndarray]] = []
    cars = rng.uniform([0.0, 0.0, 0.7], [*sides, 0.7], (2, 3))
    for number, camera in enumerate(_around(cameras, sides)):
        of = others if defect == "boxes of another recording" and number == odd else walkers
        times = np.arange(steps) / fps - late.get(number, 0.0)
        if defect == "other rate" and number == odd:
            times = np.arange(steps // 2) * 2.0 / fps
        if defect == "frames lost" and number == odd:
            times[steps // 2 :] += lost / fps
        boxes = _seen(rng, camera, of, times, tall, kind == "heads")
        if defect == "every second frame":
            boxes = {frame: own for frame, own in boxes.items() if frame % 2 == 0}
        if defect == "mirrored":
            boxes = {frame: _mirrored(own, camera) for frame, own in boxes.items()}
        seen.append(boxes)
    cameras = _around(cameras, sides)
    classes = None
    if defect == "boxes of all classes":
        classes = [_parked(camera, cars) for camera in cameras]
    return _write(folder, rng, defect, odd, cameras, seen, classes, steps, fps, late, kind)


def _cameras(rng: Generator, kind: str) -> list[Callable[[ndarray], Camera]]:
    count = int(rng.choice([2, 3, 4, 4, 5, 6, 8]))
    first = rng.uniform(0.0, 2.0 * np.pi)
    shape = ((640, 480), (1280, 720), (1920, 1080))[rng.integers(3)]
    found: list[Callable[[ndarray], Camera]] = []
    for number in range(count):
        angle = first + 2.0 * np.pi * (number + rng.uniform(-0.2, 0.2)) / max(count, 3)
        more, high, focal = rng.uniform(0.5, 2.5), rng.uniform(1.8, 3.6), rng.uniform(0.5, 0.7)
        aim = np.array([*rng.uniform(-0.5, 0.5, 2), rng.uniform(0.6, 1.2)])
        roll = 0.0
        if kind == "rolled":
            roll = float(rng.choice([np.pi / 2, -np.pi / 2])) if rng.random() < 0.5 else 0.25
            roll = roll * rng.choice([1.0, -1.0])

        def of(sides: ndarray, args: tuple[float, ...] = (angle, more, high, focal, roll),
               name: str = f"cam{number + 1}", aim: ndarray = aim) -> Camera:  # fmt: skip
            angle, more, high, focal, roll = args
            away = 0.5 * float(np.linalg.norm(sides)) + more
            middle = np.array([*(sides / 2.0), 0.0])
            centre = middle + away * np.array([np.cos(angle), np.sin(angle), high / away])
            camera = looking_camera(name, centre, middle + aim, focal * shape[0], shape)
            turn = Rotation.from_euler("z", roll).as_matrix() @ camera.rotation
            return replace(camera, rotation=turn, translation=-turn @ centre)

        found.append(of)
    return found


def _around(cameras: Sequence[Callable[[ndarray], Camera]], sides: ndarray) -> tuple[Camera, ...]:
    return tuple(of(sides) for of in cameras)


def _seen(
    rng: Generator, camera: Camera, walkers: Walkers, times: ndarray, tall: float, heads: bool
) -> dict[int, ndarray]:
    """Boxes around the outlines of ellipsoids, with noise, misses and clutter."""
    width, height = camera.image_size
    heights = walkers.heights
    middles = np.stack([walkers.at(time) for time in times])
    if heads:
        middles[..., 2] += 1.5
    axes = np.column_stack([0.18 * heights, 0.18 * heights, heights / 2.0])
    if heads:
        axes[:, :2] = 0.4 * heights[:, None]
    points = middles[:, :, None, :] + _ROUND * axes[None, :, None, :]
    pixels, valid = camera.project(points.reshape(-1, 3))
    pixels = pixels.reshape(*points.shape[:3], 2)
    whole = valid.reshape(points.shape[:3]).all(axis=2)
    low, high = pixels.min(axis=2), pixels.max(axis=2)
    size = (high - low)[..., 1:]
    low = low + 0.03 * size * rng.standard_normal(low.shape)
    high = high + 0.03 * size * rng.standard_normal(high.shape)
    edge = np.array([width - 0.5, height - 0.5])
    low, high = np.clip(low, -0.5, edge), np.clip(high, -0.5, edge)
    whole &= ((high - low) > 4.0).all(axis=2) & (rng.random(whole.shape) > 0.08)
    result = {}
    for frame in range(len(times)):
        rows = np.column_stack([low[frame], high[frame] - low[frame]])[whole[frame]]
        for _ in range(rng.poisson(0.2)):
            high_ = rng.uniform(0.1, 0.4) * height
            place = rng.uniform([0.0, 0.0], [width - 0.4 * high_, height - high_])
            rows = np.vstack([rows, [*place, 0.36 * high_, high_]])
        if len(rows):
            result[frame] = rows
    return result


def _mirrored(boxes: ndarray, camera: Camera) -> ndarray:
    other = boxes.copy()
    other[:, 0] = camera.image_size[0] - 1.0 - boxes[:, 0] - boxes[:, 2]
    return other


def _parked(camera: Camera, cars: ndarray) -> ndarray:
    points = cars[:, None, :] + _ROUND * [1.0, 1.0, 0.7]
    pixels, valid = camera.project(points.reshape(-1, 3))
    pixels, whole = pixels.reshape(len(cars), -1, 2), valid.reshape(len(cars), -1).all(axis=1)
    low, high = pixels.min(axis=1)[whole], pixels.max(axis=1)[whole]
    return np.column_stack([low, high - low])


def _write(
    folder: Path,
    rng: Generator,
    defect: str,
    odd: int,
    cameras: tuple[Camera, ...],
    seen: list[dict[int, ndarray]],
    cars: list[ndarray] | None,
    steps: int,
    fps: float,
    late: dict[int, float],
    kind: str,
) -> Known:
    calibration, form = str(rng.choice(CALIBRATIONS)), str(rng.choice(BOXES))
    if cars is not None:
        form = "MOTChallenge"
    naming = str(rng.choice(NAMES, p=[0.4, 0.2, 0.2, 0.2]))
    count = len(cameras)
    stems = {
        "equal": [camera.name for camera in cameras],
        "numbered": [str(number) for number in range(count)],
        "another language": [f"kamera{number + 1}" for number in range(count)],
        "shuffled": list(rng.permutation(WORDS)[:count]),
    }[naming]
    unit: Unit = ("m", "cm", "mm")[rng.integers(3)]
    up: Up = ("z", "y", "-y")[rng.integers(3)]
    stated = calibration in ("OpenCV", "Anipose", "COLMAP")
    inverse, flipped = (False, False) if stated else tuple(rng.random(2) < 0.5)
    scale = 1.0 / METRES[unit] if calibration != "COLMAP" else float(rng.uniform(0.2, 3.0))
    pixels = 0.5 if defect == "other pixels" else 1.0
    first = 1 if form == "MOTChallenge" else int(rng.integers(2))
    written = list(cameras)
    if defect == "exchanged":
        other = (odd + 1) % count
        written[odd], written[other] = (
            replace(written[other], name=cameras[odd].name),
            replace(written[odd], name=cameras[other].name),
        )
    if defect == "camera moved":
        written[odd] = _moved(rng, written[odd])
    to_file = upright(up).T
    _calibration(folder, calibration, written, to_file, scale, inverse, flipped, pixels)
    if defect == "second calibration":
        older = [_moved(rng, camera) for camera in cameras]
        beside = folder / "old"
        beside.mkdir()
        _calibration(beside, calibration, older, to_file, scale, inverse, flipped, 1.0)
    layout = ("ltwh", "xyxy", "cxcywh")[rng.integers(3)]
    last = steps - 1 + first
    for number, (stem, boxes) in enumerate(zip(stems, seen, strict=True)):
        size = cameras[number].image_size
        own = None if cars is None else cars[number]
        _boxes(folder, form, stem, boxes, own, layout, first, size, last)
    if defect == "spoilt file":
        _spoil(folder, form, stems[odd])
    options = ImportOptions(fps=fps if rng.random() < 0.8 else None)
    suspects = (cameras[odd].name,)
    if defect == "exchanged":
        suspects += (cameras[(odd + 1) % count].name,)
    return Known(
        cameras, {stem: number for number, stem in enumerate(stems)}, tuple(seen), fps, options,
        calibration == "COLMAP", defect, suspects, late,
        f"{kind}, {count} cameras, {steps} steps at {fps:g}, {calibration} in {unit}, {up} up, "
        f"{form} {layout} from {first}, names {naming}",
    )  # fmt: skip


def _moved(rng: Generator, camera: Camera) -> Camera:
    turn = Rotation.from_rotvec([0.0, np.radians(rng.uniform(10.0, 25.0)) * rng.choice([-1, 1]), 0])
    centre = camera.centre + np.array([*rng.uniform(-0.6, 0.6, 2), 0.0])
    rotation = turn.as_matrix() @ camera.rotation
    return replace(camera, rotation=rotation, translation=-rotation @ centre)


def _calibration(
    folder: Path, form: str, cameras: Sequence[Camera], to_file: ndarray, scale: float,
    inverse: bool, flipped: bool, pixels: float,
) -> None:  # fmt: skip
    rows = []
    for camera in cameras:
        rotation = camera.rotation @ to_file.T
        centre = scale * to_file @ camera.centre
        own = FLIP @ rotation if flipped else rotation
        where = -own @ centre
        if inverse:
            own, where = own.T, centre
        k = np.diag([pixels, pixels, 1.0]) @ camera.intrinsics
        size = [round(pixels * side) for side in camera.image_size]
        rows.append((camera.name, k, size, own, where))
    if form == "OpenCV":
        file = cv2.FileStorage(str(folder / "calibration.yml"), cv2.FILE_STORAGE_WRITE)
        for name, k, size, own, where in rows:
            file.write(f"size_{name}", np.array([size], dtype=np.int32))
            file.write(f"K_{name}", k)
            file.write(f"D_{name}", np.zeros((5, 1)))
            file.write(f"R_{name}", own)
            file.write(f"T_{name}", where[:, None])
        file.release()
    elif form == "JSON":
        tables = {
            name: {"K": k.tolist(), "dist": [0.0] * 5, "R": own.tolist(), "t": where.tolist(),
                   "size": size}
            for name, k, size, own, where in rows
        }  # fmt: skip
        (folder / "cameras.json").write_text(json.dumps(tables))
    elif form == "Anipose":
        text = "\n".join(
            f'[{name}]\nname = "{name}"\nsize = {size}\nmatrix = {k.tolist()}\n'
            f"distortions = [0.0, 0.0, 0.0, 0.0, 0.0]\n"
            f"rotation = {Rotation.from_matrix(own).as_rotvec().tolist()}\n"
            f"translation = {where.tolist()}\n"
            for name, k, size, own, where in rows
        )
        (folder / "calibration.toml").write_text(text)
    else:
        lenses, poses = [], []
        for number, (name, k, size, own, where) in enumerate(rows, 1):
            w, x, y, z = Rotation.from_matrix(own).as_quat()[[3, 0, 1, 2]]
            lenses.append(
                f"{number} PINHOLE {size[0]} {size[1]} {k[0, 0]} {k[1, 1]} {k[0, 2] + 0.5} "
                f"{k[1, 2] + 0.5}"
            )
            at = " ".join(map(str, where))
            poses.append(f"{number} {w} {x} {y} {z} {at} {number} {name}.jpg\n")
        (folder / "cameras.txt").write_text("\n".join(lenses) + "\n")
        (folder / "images.txt").write_text("\n".join(poses) + "\n")


def _boxes(
    folder: Path, form: str, stem: str, boxes: dict[int, ndarray], cars: ndarray | None,
    layout: str, first: int, size: tuple[int, int], last: int,
) -> None:  # fmt: skip
    ltwh = [(frame + first, *row) for frame, own in boxes.items() for row in own.tolist()]
    if form == "MOTChallenge":
        own = folder / stem / "gt" if cars is not None else folder
        own.mkdir(parents=True, exist_ok=True)
        kind = 2
        lines = [
            f"{f},-1,{x:.2f},{y:.2f},{w:.2f},{h:.2f},1,-1,-1,-1" if cars is None
            else f"{f},{n},{x:.2f},{y:.2f},{w:.2f},{h:.2f},1,{kind},1"
            for n, (f, x, y, w, h) in enumerate(ltwh, 10)
        ]  # fmt: skip
        if cars is not None:
            (own / "labels.txt").write_text("car\nperson\n")
            lines += [
                f"{f},{n},{x:.2f},{y:.2f},{w:.2f},{h:.2f},1,1,1"
                for f in range(first, last + 1)
                for n, (x, y, w, h) in enumerate(cars.tolist(), 1)
            ]
        (own / ("gt.txt" if cars is not None else f"{stem}.txt")).write_text("\n".join(lines))
    elif form == "YOLO":
        (folder / stem).mkdir()
        for frame in range(first, last + 1):
            rows = boxes.get(frame - first, np.zeros((0, 4)))
            middle = (rows[:, :2] + 0.5 + rows[:, 2:] / 2.0) / size
            lines = [
                "0 " + " ".join(f"{v:.6f}" for v in row)
                for row in np.column_stack([middle, rows[:, 2:] / size]).tolist()
            ]
            (folder / stem / f"{stem}_{frame:06d}.txt").write_text("\n".join(lines))
    elif form == "COCO":
        frames = range(first, last + 1)
        images = [{"id": f, "file_name": f"{f:06d}.jpg", "width": size[0], "height": size[1]}
                  for f in frames]  # fmt: skip
        notes = [{"id": n, "image_id": f, "category_id": 1, "bbox": [x, y, w, h]}
                 for n, (f, x, y, w, h) in enumerate(ltwh)]  # fmt: skip
        kinds = [{"id": 1, "name": "person"}]
        whole = {"images": images, "annotations": notes, "categories": kinds}
        (folder / f"{stem}.json").write_text(json.dumps(whole))
    else:
        four = np.array(ltwh)[:, 1:] if ltwh else np.zeros((0, 4))
        if layout == "xyxy":
            four = np.column_stack([four[:, :2], four[:, :2] + four[:, 2:]])
        elif layout == "cxcywh":
            four = np.column_stack([four[:, :2] + four[:, 2:] / 2.0, four[:, 2:]])
        named = {"ltwh": "left,top,width,height", "xyxy": "left,top,right,bottom",
                 "cxcywh": "center_x,center_y,width,height"}[layout]  # fmt: skip
        if form == "JSON of four numbers":
            frames = {str(frame): [] for frame in range(first, last + 1)}
            for row, numbers in zip(ltwh, four.round(3).tolist(), strict=True):
                frames[str(row[0])].append(numbers)
            (folder / f"{stem}.json").write_text(json.dumps(frames))
            return
        lines = [
            ",".join([str(row[0]), *(f"{v:.3f}" for v in numbers)])
            for row, numbers in zip(ltwh, four.tolist(), strict=True)
        ]
        (folder / f"{stem}.csv").write_text("\n".join([f"frame,{named}", *lines]))


def _spoil(folder: Path, form: str, stem: str) -> None:
    """Half of a file of numbers is noise."""
    paths = [folder / f"{stem}.{kind}" for kind in ("csv", "txt", "json")]
    paths += sorted((folder / stem).glob("*.txt"))[10:11]
    path = next(path for path in paths if path.exists())
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2] + b"\xff\x00,nan,{{" * 3)


# ── what is made of it


def judge(plan: ImportPlan, known: Known) -> str:
    """What is wrong with an import plan; empty where all is right, or the defect is reported."""
    reported = " ".join([*plan.told, *(f"{name} {value}" for name, value in plan.found)])
    suspects = {
        view.camera.name
        for view in plan.views
        if view.matched.detections is not None
        and known.cameras[_source(view.matched.detections.source, known)].name in known.suspects
    }
    named = any(re.search(rf"(?<!\w){name}(?![\w.])", " ".join(plan.told)) for name in suspects)
    if known.defect == "every second frame":
        return "" if "second frame" in reported else "frames between are said to be empty"
    if known.defect == "boxes of all classes":
        own = max(len(view.detections.frames) for view in plan.views if view.detections)
        people = max(sum(map(len, boxes.values())) for boxes in known.boxes)
        if own > 1.01 * people and "class" not in reported:
            return "cars are people"
    wrong = _wrong_cameras(plan, known) or _wrong_boxes(plan, known) or _wrong_times(plan, known)
    unmended = ("late", "mirrored", "camera moved", "boxes of another recording", "other rate",
                "frames lost")  # fmt: skip
    if known.defect in unmended:
        wrong = wrong or ("" if known.defect == "late" else known.defect)
        if known.defect == "mirrored" and "mirror" in reported:
            return ""
        return "" if named and known.defect != "mirrored" else wrong
    return wrong


def _source(path: Path, known: Known) -> int:
    for name in (path.stem, path.parent.name, path.parent.parent.name):
        if name in known.sources:
            return known.sources[name]
    raise ValueError(path)


def _wrong_cameras(plan: ImportPlan, known: Known) -> str:
    """Compare the cameras up to a turn about the vertical, a shift and, if arbitrary, a scale."""
    pairs = [
        (view.camera, known.cameras[_source(view.matched.detections.source, known)])
        for view in plan.views
        if view.matched.detections is not None
    ]
    turns = [found.rotation.T @ true.rotation for found, true in pairs]  # true world to found
    turn = Rotation.from_matrix(turns).mean().as_matrix()
    off = max(np.linalg.norm(Rotation.from_matrix(turn.T @ own).as_rotvec()) for own in turns)
    if off > 0.02:
        return f"cameras are turned by {np.degrees(off):.1f}° against each other"
    if np.degrees(np.arccos(np.clip(turn[2, 2], -1.0, 1.0))) > 6.0:
        return "the vertical is wrong"
    found = np.array([camera.centre for camera, _ in pairs])
    true = np.array([turn @ camera.centre for _, camera in pairs])
    found, true = found - found.mean(axis=0), true - true.mean(axis=0)
    size = float(np.linalg.norm(true, axis=1).max())
    if size == 0.0:
        return ""
    scale = float((found * true).sum() / (true * true).sum())
    if np.linalg.norm(found - scale * true, axis=1).max() > 0.01 * abs(scale) * size:
        return "cameras stand elsewhere"
    if scale <= 0.0 or (not known.arbitrary and abs(scale - 1.0) > 0.01):
        return f"the unit is wrong by {scale:.3g}"
    return ""


def _wrong_boxes(plan: ImportPlan, known: Known) -> str:
    worst, shifts = 0.0, []
    for view in plan.views:
        piece, own = view.matched.detections, view.detections
        if piece is None or own is None:
            continue
        true = known.boxes[_source(piece.source, known)]
        scale = view.camera.image_size[0] / known.cameras[0].image_size[0]
        best: dict[int, float] = {}
        for shift in (0, -1, 1):
            off = []
            for frame in sorted(true)[:: max(1, len(true) // 20)]:
                rows = own.boxes[own.frames == frame + shift]
                if not len(rows):
                    off.append(np.inf if known.defect != "spoilt file" else 0.0)
                    continue
                apart = np.abs(scale * true[frame][:, None] - rows[None]).max(axis=2)
                off.append(float(apart.min(axis=1).max()))
            best[shift] = float(np.median(off)) if off else 0.0
        shift = min(best, key=lambda one: best[one])
        shifts.append(shift)
        worst = max(worst, best[shift])
    if worst > 1.0:
        return f"boxes are off by {worst:.3g} px"
    return "" if len(set(shifts)) < 2 else "cameras count from different frames"


def _wrong_times(plan: ImportPlan, known: Known) -> str:
    if known.options.fps is not None and abs(plan.fps / known.fps - 1.0) > 0.01:
        return f"{plan.fps} steps a second"
    late = []
    for view in plan.views:
        piece = view.matched.detections
        if piece is not None:
            own = view.time.timing.time_offset * plan.fps / known.fps
            late.append(known.late.get(_source(piece.source, known), 0.0) + own)
    off = np.array(late) - np.median(late)
    allowed = max(0.1, 1.0 / known.fps)
    return "" if np.abs(off).max(initial=0.0) <= allowed else f"clocks are off by {off.max():.2f} s"
