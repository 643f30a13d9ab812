"""How a rendered sequence is written: whole or not at all, and its ``sequence.toml``."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.files.atomic import beside, sweep, sync_file, sync_folder
from tracker.geometry.camera import Camera

SUMS = "SHA256SUMS"
"""The SHA-256 of every file of a rendered folder, in the form of ``sha256sum``."""

FILE = "sequence.toml"


class RenderCancelled(Exception):
    """Rendering was stopped on request; nothing was written."""


@dataclass(frozen=True, slots=True, eq=False)
class Marked:
    """A template: whose, where, and its box (left, top, width, height) in pixels."""

    person: str
    camera: str
    step: int
    box: Float[ndarray, " 4"]


@dataclass(frozen=True, slots=True, eq=False)
class Description:
    """What a ``sequence.toml`` says."""

    name: str
    description: str
    fps: float
    frames: int
    minimum: Float[ndarray, " 3"]
    maximum: Float[ndarray, " 3"]
    entrances: Sequence[tuple[Float[ndarray, " 3"], Float[ndarray, " 3"], str]]
    """Mean and standard deviation of where people come in, metres, and what is there."""
    half_extents: Float[ndarray, " 3"]
    tracked: str
    """What the target is, in words."""
    cameras: Sequence[Camera]
    templates: Sequence[Marked]
    detections: bool = False
    """Whether each camera has a file of boxes by its name."""


@contextmanager
def whole_folder(folder: Path) -> Iterator[Path]:
    """A new folder to write in, which takes its name when all has gone well.

    Until then the files are in a hidden folder beside it, which is removed on any failure.

    Raises:
        FileExistsError: If ``folder`` exists and is not a sequence folder.
    """
    folder = Path(folder)
    _check_replaceable(folder)
    folder.parent.mkdir(parents=True, exist_ok=True)
    sweep(folder.parent, folder.name)
    work = beside(folder)
    try:
        work.mkdir()
        yield work
        seal(work)
        _check_replaceable(folder)
        if folder.exists():
            old = beside(folder)
            folder.rename(old)
            work.rename(folder)
            shutil.rmtree(old, ignore_errors=True)
        else:
            work.rename(folder)
        sync_folder(folder.parent)
    except BaseException:
        shutil.rmtree(work, ignore_errors=True)
        raise


def seal(folder: Path) -> None:
    """Write down what every file holds, and have the disk hold all of it."""
    lines = []
    for file in sorted(path for path in folder.rglob("*") if path.is_file()):
        lines.append(f"{_sum(file)}  {file.relative_to(folder).as_posix()}\n")
        sync_file(file)
    (folder / SUMS).write_text("".join(lines), encoding="utf-8")
    sync_file(folder / SUMS)
    sync_folder(folder)


def is_whole(folder: Path) -> bool:
    """Whether a rendered folder holds what was written: not cut off, not changed."""
    try:
        lines = (folder / SUMS).read_text(encoding="utf-8").splitlines()
        wanted = [line.partition("  ") for line in lines]
        names = {FILE, *(name for _, _, name in wanted)}
        return len(names) == len(wanted) and all(
            _sum(folder / name) == told for told, _, name in wanted
        )
    except (OSError, ValueError):
        return False


def _sum(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _check_replaceable(folder: Path) -> None:
    if not folder.exists():
        return
    if not folder.is_dir() or (any(folder.iterdir()) and not (folder / "sequence.toml").exists()):
        raise FileExistsError(
            f"{folder} exists and is not a sequence folder; choose another name or remove it"
        )


def _numbers(values: ndarray) -> str:
    return "[" + ", ".join(f"{float(v) + 0.0:.12g}" for v in values) + "]"


def describe(told: Description) -> str:
    """The text of the ``sequence.toml``."""
    lines = [
        "format = 1",
        f'name = "{told.name}"',
        f'description = "{told.description}"',
        f"fps = {told.fps}",
        f"frames = {told.frames}",
        "",
        "[room]                       # the volume people are tracked in: metres, z up",
        f"min = {_numbers(told.minimum)}",
        f"max = {_numbers(told.maximum)}",
    ]
    if told.entrances:
        lines.append(
            "entrances = [                # where people come in (mean, standard deviation), metres"
        )
        for mean, sigma, words in told.entrances:
            lines.append(
                f"  {{ position = {_numbers(mean)}, sigma = {_numbers(sigma)} }},   # {words}"
            )
        lines.append("]")
    lines += [
        "",
        f"[target]                     # what is tracked: {told.tracked}, as an upright box",
        f"half_extents = {_numbers(told.half_extents)}",
    ]
    for camera in told.cameras:
        lines += [
            "",
            "[[camera]]",
            f'name = "{camera.name}"',
            f"image_size = [{camera.image_size[0]}, {camera.image_size[1]}]",
            f'video = "{camera.name}.avi"',
        ]
        if told.detections:
            lines.append(f'detections = "{camera.name}.csv"')
        if camera.fisheye:
            lines.append('lens = "fisheye"')
        lines += [
            f"K = [{', '.join(_numbers(row) for row in camera.intrinsics)}]",
            f"distortion = {_numbers(camera.distortion)}",
            f"R = [{', '.join(_numbers(row) for row in camera.rotation)}]",
            f"t = {_numbers(camera.translation)}",
        ]
    for marked in told.templates:
        box = _numbers(np.round(marked.box, 2))
        lines += [
            "",
            "[[template]]                 # a box whose colours are a model of the person",
            f'name = "{marked.person}"',
            f'camera = "{marked.camera}"',
            f"frame = {marked.step}",
            f"box = {box}     # left, top, width, height in pixels",
        ]
    lines += [
        "",
        "[ground_truth]               # exact, from the people's poses",
        'file = "ground_truth.csv"',
        "",
    ]
    return "\n".join(lines)
