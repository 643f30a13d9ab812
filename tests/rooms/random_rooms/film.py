"""A random room rendered into a sequence folder, with truth, true boxes and labels."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tests.rooms.avi import AviWriter, compress
from tests.rooms.random_rooms.behaviour import direct
from tests.rooms.random_rooms.boxes import (
    FILE,
    certain,
    mark,
    seen_by,
    write_boxes,
    write_detections,
)
from tests.rooms.random_rooms.choices import Choices, choose, generator
from tests.rooms.random_rooms.figures import HALF_EXTENTS, act, tracked_part
from tests.rooms.random_rooms.furnishing import furnish_randomly
from tests.rooms.random_rooms.rig import drawn_by, mount
from tests.rooms.random_rooms.sensors import CameraFilm, record
from tests.rooms.random_rooms.shell import Furnished, build_shell, shade_lamps
from tests.rooms.random_rooms.things import things
from tests.rooms.random_rooms.wardrobe import dress
from tests.rooms.scene import Scene
from tests.rooms.studio import CELL, Drawn, Stage, Studio, in_order, muted_room
from tests.rooms.walls.background import Background, Tracer, render_background
from tests.rooms.writing import Description, RenderCancelled, describe, whole_folder
from tracker.geometry.camera import Camera

VERSION = 2
"""Grows when the same seed would give another room."""
LABELS_FILE = "labels.json"

_HEADROOM = 0.25
"""Metres that the tracking volume reaches above the tallest."""


@dataclass(frozen=True, slots=True, eq=False)
class Set:
    """A room ready to be filmed."""

    choices: Choices
    room: Furnished
    cameras: tuple[Camera, ...]
    enlarged: int
    """How many times larger the pictures are than they are drawn."""
    studio: Studio
    films: list[CameraFilm]


def render_random(
    seed: int,
    folder: Path,
    *,
    detections: bool = False,
    frames: int | None = None,
    progress: Callable[[int, int], None] | None = None,
    cancelled: Callable[[], bool] | None = None,
) -> Choices:
    """Render the room of a seed into a new sequence folder; the seed alone decides on it.

    Beside what every sequence has, the folder holds the true box of each person in each
    picture (``boxes.csv``) and what is in the room (``labels.json``). A position is certain
    where the boxes of two cameras lie in their pictures by half and one camera sees a
    quarter of the person.

    Args:
        seed: 0 or more.
        folder: Where to write; an existing sequence folder there is replaced.
        detections: Write the boxes that a detector would find, too.
        frames: Number of steps from the beginning, all by default.
        progress: Called with the steps done and the number of steps.
        cancelled: Asked now and then; rendering stops when it says so.

    Returns:
        What is in the room.

    Raises:
        ValueError: If the seed is negative, or the room has not so many steps.
        FileExistsError: If ``folder`` exists and is not a sequence folder.
        RenderCancelled: If ``cancelled`` said so.
    """
    choices = choose(seed)
    render_chosen(
        choices, folder,
        detections=detections, frames=frames, progress=progress, cancelled=cancelled,
    )  # fmt: skip
    return choices


def render_chosen(
    choices: Choices,
    folder: Path,
    *,
    detections: bool = False,
    frames: int | None = None,
    progress: Callable[[int, int], None] | None = None,
    cancelled: Callable[[], bool] | None = None,
) -> None:
    """Render a room of which somebody chose some, else as :func:`render_random` does.

    Args:
        choices: What is in it; what is not chosen follows from its seed.
        folder: As there, and so the rest.
        detections: Write detections.
        frames: Number of steps.
        progress: Called with steps.
        cancelled: Asked.

    Raises:
        ValueError: If the room has not so many steps.
        FileExistsError: If ``folder`` exists and is not a sequence folder.
        RenderCancelled: If ``cancelled`` said so.
    """
    count = choices.steps if frames is None else frames
    if not 1 <= count <= choices.steps:
        raise ValueError(
            f"frames must be 1 … {choices.steps} in random room {choices.seed}, got {frames}"
        )
    asked = cancelled or (lambda: False)
    with whole_folder(folder) as work:
        if progress is not None:
            progress(0, count)
        if asked():
            raise RenderCancelled(f"random room {choices.seed}")
        filmed = prepare(choices)
        corners, visible = _shoot(filmed, work, count, progress, asked)
        _write(filmed, work, corners, visible, detections)


def prepare(choices: Choices) -> Set:
    """Furnish, light and cast a room, and trace it empty for each camera."""
    cameras = mount(choices)
    looks = dress(choices)
    room = build_shell(choices, cameras, looks[0].shirt)
    furnish_randomly(room, choices, cameras)
    if choices.clothes == "of the wall":
        looks[0] = replace(looks[0], shirt=room.accent, pattern="plain")
    figures = act(choices, direct(choices, room), looks, room.half)
    half = np.array(room.half)
    stage = Stage(
        Scene(choices.steps, figures, things(choices, room, figures)),
        room.interior,
        shade_lamps(room.interior),
        -half - 0.2,
        (int(2.0 * (half[1] + 0.2) / CELL) + 2, int(2.0 * (half[0] + 0.2) / CELL) + 2),
        None,
        tuple(tracked_part(choices, f.body, look) for f, look in zip(figures, looks, strict=True)),
    )
    drawn, enlarged = zip(*(drawn_by(camera) for camera in cameras), strict=True)
    tracer = Tracer(room.interior)
    with ThreadPoolExecutor(max_workers=2) as pool:
        backgrounds = list(pool.map(partial(_empty, tracer), drawn))
    films = record(choices, drawn, backgrounds)
    studio = Studio(
        stage, drawn, backgrounds, choices.seed,
        grains=[film.grain for film in films], gains=[film.gains for film in films],
    )  # fmt: skip
    return Set(choices, room, cameras, enlarged[0], studio, films)


def _empty(tracer: Tracer, camera: Camera) -> Background:
    return muted_room(render_background(tracer, camera, rounds=3, stride=4))


def _shoot(
    filmed: Set, work: Path, steps: int, progress: Callable[[int, int], None] | None,
    cancelled: Callable[[], bool],
) -> tuple[Float[ndarray, "F P C 4"], Float[ndarray, "F P C"]]:  # fmt: skip
    """Draw and write the videos; the people's uncut corners and visible shares."""
    choices = filmed.choices
    corners = np.full((steps, choices.people, choices.cameras, 4), np.nan)
    visible = np.zeros((steps, choices.people, choices.cameras))
    with ExitStack() as stack:
        writers = [
            stack.enter_context(
                AviWriter(work / f"{camera.name}.avi", camera.image_size, choices.fps)
            )
            for camera in filmed.cameras
        ]
        for videos, drawn in in_order(partial(_develop, filmed), steps):
            if cancelled():
                raise RenderCancelled(f"random room {choices.seed}")
            for writer, video in zip(writers, videos, strict=True):
                for picture in video:
                    writer.write(picture)
            last = drawn.first + len(drawn.visible)
            visible[drawn.first : last] = drawn.visible
            corners[drawn.first : last] = (drawn.boxes + 0.5) * filmed.enlarged - 0.5
            if progress is not None:
                progress(last, steps)
    return corners, visible


def _develop(filmed: Set, first: int, last: int) -> tuple[list[list[bytes]], Drawn]:
    """Some steps of all cameras, drawn, shaken, enlarged and compressed."""
    drawn = filmed.studio.draw(first, last)
    videos = []
    for film, camera, pictures in zip(filmed.films, filmed.cameras, drawn.pictures, strict=True):
        video = []
        for number, picture in enumerate(pictures):
            shown = film.finished(first + number, picture)
            if filmed.enlarged > 1:
                shown = cv2.resize(shown, camera.image_size, interpolation=cv2.INTER_CUBIC)
            video.append(compress(shown, film.quality))
        videos.append(video)
    return videos, replace(drawn, pictures=())


def _write(filmed: Set, work: Path, corners: ndarray, visible: ndarray, detections: bool) -> None:
    choices, room, cameras = filmed.choices, filmed.room, filmed.cameras
    names = [camera.name for camera in cameras]
    figures = filmed.studio.scene.figures
    seen = seen_by(cameras, corners, visible)
    steps = len(visible)
    inside = np.stack([figure.inside[:steps] for figure in figures], axis=1)
    valid = certain(seen)
    # a calibration has its origin anywhere
    rng = generator(choices.seed, 7)
    origin = np.array([*np.round(rng.uniform(-1.0, 1.0, 2) * room.half, 2), 0.0])
    origin *= float(rng.random() < 0.6)
    with (work / "ground_truth.csv").open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(["frame", "id", "x", "y", "z", "valid"])
        for step, person in np.argwhere(inside):
            x, y, z = figures[person].centres[step] + origin
            known = int(valid[step, person])
            rows.writerow([step, person + 1, f"{x:.5f}", f"{y:.5f}", f"{z:.5f}", known])
    write_boxes(work / FILE, names, seen)
    if detections:
        for number, camera in enumerate(cameras):
            write_detections(work / f"{camera.name}.csv", choices, number, camera, seen)
    marked = mark(choices, names, inside, seen)
    tallest = max(float(figure.poses.top.max()) for figure in figures)
    half, height = np.array(room.half), HALF_EXTENTS[choices.target][2]
    sigma = np.array([0.35, 0.35, 0.12])
    entrances = [
        (np.array([*np.round(door.at(-0.3), 3), 0.86 if height > 0.5 else 1.35]) + origin, sigma,
         "doorway")
        for door in room.doorways
    ]  # fmt: skip
    told = Description(
        name=f"random-{choices.seed}",
        description=_sentence(choices),
        fps=choices.fps,
        frames=steps,
        minimum=np.array([-half[0], -half[1], 0.0]) + origin,
        maximum=np.array([half[0], half[1], round(max(2.0, tallest + _HEADROOM), 2)]) + origin,
        entrances=entrances if choices.entrances else (),
        half_extents=HALF_EXTENTS[choices.target],
        tracked=choices.target,
        cameras=[
            replace(c, translation=np.round(c.translation - c.rotation @ origin, 10))
            for c in cameras
        ],
        templates=marked,
        detections=detections,
    )
    (work / "sequence.toml").write_text(describe(told), encoding="utf-8")
    labels = {
        "version": VERSION,
        **choices.to_json(),
        "causes": choices.causes(),
        "people_with_template": sorted({m.person for m in marked}),
        "certain_share": round(float(valid[inside].mean()) if inside.any() else 0.0, 3),
        "empty_steps": int((~inside.any(axis=1)).sum()),
    }
    text = json.dumps(labels, indent=1, ensure_ascii=False)
    (work / LABELS_FILE).write_text(text + "\n", encoding="utf-8")


def _sentence(choices: Choices) -> str:
    said = [f"{choices.cameras} cameras", f"{choices.people} people"]
    said += [f"{name} {value}" for name, value in (
        ("lens", choices.lens), ("cameras", choices.turned), ("light", choices.light),
        ("shadows", choices.shadows), ("shake", choices.shake)) if value not in (
        "pinhole", "upright", "steady", "soft", "none")]  # fmt: skip
    return f"random room {choices.seed}: {', '.join(said)}"
