"""A rendered room written as an ordinary sequence folder, whole or not at all."""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tests.rooms.avi import AviWriter, compress
from tests.rooms.cast.paths import FRAMES_PER_SECOND
from tests.rooms.rooms import (
    CAMERAS,
    ROOMS,
    TARGET_HALF_EXTENTS,
    VOLUME_MAXIMUM,
    VOLUME_MINIMUM,
    RoomSpec,
)
from tests.rooms.scene import Scene
from tests.rooms.studio import Studio, in_order, studio_of
from tests.rooms.writing import Description, Marked, RenderCancelled, describe, whole_folder
from tracker.geometry.camera import Camera

VISIBILITY_FILE = "visibility.csv"
_QUALITY = 82
_TEMPLATES_PER_VIEW = 3


def render(
    name: str,
    folder: Path,
    *,
    cameras: int = 2,
    seed: int = 0,
    frames: int | None = None,
    progress: Callable[[int, int], None] | None = None,
    cancelled: Callable[[], bool] | None = None,
) -> None:
    """Render a built-in room into a new sequence folder.

    The folder appears under its name only when it is complete: until then the
    files are in a hidden folder beside it, which is removed on any failure.

    Args:
        name: One of :data:`ROOMS`.
        folder: Where to write; an existing sequence folder there is replaced.
        cameras: 2 or 3.
        seed: Of the sensor's noise. The people walk the same way with every seed,
            and the same seed gives the same pictures.
        frames: Number of steps from the beginning, all by default.
        progress: Called with the steps done and the number of steps.
        cancelled: Asked now and then; rendering stops when it says so.

    Raises:
        ValueError: If there is no such room, or a number is out of range.
        FileExistsError: If ``folder`` exists and is not a sequence folder.
        RenderCancelled: If ``cancelled`` said so.
    """
    if name not in ROOMS:
        raise ValueError(f'there is no built-in room "{name}"; choose one of {", ".join(ROOMS)}')
    spec = ROOMS[name]
    if not 2 <= cameras <= len(CAMERAS):
        raise ValueError(f"cameras must be 2 … {len(CAMERAS)}, got {cameras}")
    count = spec.frames if frames is None else frames
    if not 1 <= count <= spec.frames:
        raise ValueError(f"frames must be 1 … {spec.frames} in {name}, got {frames}")
    with whole_folder(folder) as work:
        _write(spec, work, cameras, seed, count, progress, cancelled or (lambda: False))


def read_visibility(folder: Path) -> Float[ndarray, "F P C"]:
    """How much of each person each camera sees at every step of a rendered sequence.

    Args:
        folder: A folder written by :func:`render`.

    Returns:
        The visible share (0 … 1) of the silhouette within the target box, by step,
        person (id minus 1) and camera; NaN where the person is not in the truth.

    Raises:
        FileNotFoundError: If the folder has no ``visibility.csv``.
    """
    rows = (Path(folder) / VISIBILITY_FILE).read_text(encoding="utf-8").splitlines()[1:]
    if not rows:
        return np.full((0, 0, 0), np.nan)
    table = np.array([row.split(",") for row in rows], dtype=float)
    index = table[:, :3].astype(int) - [0, 1, 0]
    shares = np.full(tuple(index.max(axis=0) + 1), np.nan)
    shares[tuple(index.T)] = table[:, 3]
    return shares


def _write(
    spec: RoomSpec,
    work: Path,
    cameras: int,
    seed: int,
    frames: int,
    progress: Callable[[int, int], None] | None,
    cancelled: Callable[[], bool],
) -> None:
    if progress is not None:
        progress(0, frames)
    if cancelled():
        raise RenderCancelled(spec.name)
    studio = studio_of(spec, CAMERAS[:cameras], seed)
    visible = np.zeros((frames, len(spec.people), cameras))
    with ExitStack() as stack:
        writers = [
            stack.enter_context(
                AviWriter(work / f"{camera.name}.avi", camera.image_size, FRAMES_PER_SECOND)
            )
            for camera in studio.cameras
        ]
        for films, seen, first in in_order(partial(_film, studio), frames):
            if cancelled():
                raise RenderCancelled(spec.name)
            for writer, film in zip(writers, films, strict=True):
                for picture in film:
                    writer.write(picture)
            visible[first : first + len(seen)] = seen
            if progress is not None:
                progress(first + len(seen), frames)
    write_truth(work / "ground_truth.csv", studio.scene, frames)
    _write_visibility(work / VISIBILITY_FILE, studio.scene, visible)
    templates = choose_templates(studio.scene, studio.cameras, visible)
    (work / "sequence.toml").write_text(
        describe_room(spec, studio.cameras, frames, studio.scene, templates), encoding="utf-8"
    )


def _film(studio: Studio, first: int, last: int) -> tuple[list[list[bytes]], ndarray, int]:
    """Some steps of all cameras, drawn and compressed; the visible shares; the first step."""
    drawn = studio.draw(first, last)
    films = [[compress(picture, _QUALITY) for picture in shown] for shown in drawn.pictures]
    return films, drawn.visible, first


def write_truth(path: Path, scene: Scene, frames: int) -> None:
    """Write where everybody is who is in the tracked volume, in the first steps."""
    with path.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(["frame", "id", "x", "y", "z"])
        for step in range(frames):
            for number, figure in enumerate(scene.figures):
                if figure.inside[step]:
                    x, y, z = figure.centres[step]
                    rows.writerow([step, number + 1, f"{x:.5f}", f"{y:.5f}", f"{z:.5f}"])


def _write_visibility(path: Path, scene: Scene, visible: ndarray) -> None:
    frames, people, cameras = visible.shape
    with path.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(["frame", "id", "camera", "visible"])
        for step in range(frames):
            for number in range(people):
                if scene.figures[number].inside[step]:
                    for camera in range(cameras):
                        share = visible[step, number, camera]
                        rows.writerow([step, number + 1, camera, f"{share:.4f}"])


def choose_templates(
    scene: Scene, cameras: Sequence[Camera], visible: ndarray
) -> list[tuple[int, int, int, ndarray]]:
    """Boxes that show each person whole, of good size, and from different sides.

    Returns:
        Person, camera, step, and the box (left, top, width, height) in pixels.
    """
    chosen = []
    frames = len(visible)
    for person, figure in enumerate(scene.figures):
        for number, camera in enumerate(cameras):
            boxes, whole = camera.project_boxes(figure.centres[:frames], TARGET_HALF_EXTENTS)
            good = whole & figure.inside[:frames] & (visible[:, person, number] > 0.985)
            good &= figure.inside[:frames]
            if not good.any():
                continue
            heights = boxes[:, 3]
            good &= heights >= np.median(heights[good])
            toward = camera.centre[:2] - figure.centres[:frames, :2]
            view = np.arctan2(toward[:, 1], toward[:, 0]) - figure.path.heading[:frames]
            for wanted in np.linspace(0.0, np.pi, _TEMPLATES_PER_VIEW):
                # 0 shows the front, pi the back
                turned = np.abs(np.abs((view + np.pi) % (2.0 * np.pi) - np.pi) - wanted)
                step = int(np.argmin(np.where(good, turned, np.inf)))
                if good[step]:
                    chosen.append((person, number, step, boxes[step]))
                    good[max(0, step - 15) : step + 15] = False
    return chosen


def describe_room(
    spec: RoomSpec,
    cameras: Sequence[Camera],
    frames: int,
    scene: Scene,
    templates: Sequence[tuple[int, int, int, ndarray]],
) -> str:
    """The text of a built-in room's ``sequence.toml``, as rendered."""
    height = float(np.mean([f.centres[f.inside, 2].mean() for f in scene.figures]))
    sigma = np.array([0.25, 0.25, 0.08])
    return describe(
        Description(
            name=spec.name,
            description=spec.description,
            fps=FRAMES_PER_SECOND,
            frames=frames,
            minimum=VOLUME_MINIMUM,
            maximum=VOLUME_MAXIMUM,
            entrances=[
                (np.array([x, y, round(height, 2)]), sigma, f"{door} door")
                for x, y, door in ((spec.back_door, 1.4, "back"), (1.4, spec.front_door, "front"))
            ],
            half_extents=TARGET_HALF_EXTENTS,
            tracked="head and torso",
            cameras=cameras,
            templates=[
                Marked(f"person{person + 1}", cameras[number].name, step, box)
                for person, number, step, box in templates
            ],
        )
    )
