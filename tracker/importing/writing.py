"""A settled recording as an ordinary sequence folder."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.formats.pieces import FormatError
from tracker.importing.settling import Settled, SettledView
from tracker.placing import replacing, write_whole
from tracker.sequences.sequence import Detections, GroundTruth

FILE = "sequence.toml"


def write(settled: Settled, folder: Path, name: str, *, copy: bool = False) -> list[str]:
    """Write ``sequence.toml``, boxes and truth; bring the pictures in.

    Pictures inside the folder stay where they are. Others are linked (a second name of the same
    file, which takes no room), or copied where the file system cannot.

    Args:
        settled: What to write.
        folder: It must not hold a sequence yet.
        name: Of the sequence.
        copy: Copy the pictures, also where they could be linked.

    Returns:
        What was copied or linked, a sentence each.

    Raises:
        FormatError: If there is a sequence in the folder already.
    """
    if (folder / FILE).exists():
        raise FormatError(f"{folder}: holds a {FILE} already; name another folder, or remove it")
    folder.mkdir(parents=True, exist_ok=True)
    names = _file_names([view.camera.name for view in settled.views])
    told: list[str] = []
    tables = []
    for view, own in zip(settled.views, names, strict=True):
        tables.append(_camera(view, own, folder, copy, told))
    truth = ""
    if settled.truth is not None:
        _write_truth(folder / "ground_truth.csv", settled.truth)
        truth = '\n[ground_truth]\nfile = "ground_truth.csv"\n'
    head = [
        "format = 1",
        f"name = {_text(name)}",
        f"fps = {_number(settled.fps)}",
        f"frames = {settled.frames}",
        "",
        "[room]",
        f"min = {_list(settled.room.minimum)}",
        f"max = {_list(settled.room.maximum)}",
        "",
        "[target]",
        f"half_extents = {_list(settled.room.half_extents)}",
        "",
    ]
    text = "\n".join(head) + "\n" + "\n".join(tables) + truth
    with replacing(folder / FILE) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return told


def _camera(view: SettledView, name: str, folder: Path, copy: bool, told: list[str]) -> str:
    camera = view.camera
    lines = ["[[camera]]", f"name = {_text(_plain_name(camera.name))}"]
    lines.append(f"image_size = [{camera.image_size[0]}, {camera.image_size[1]}]")
    matched = view.matched
    if matched.video is not None:
        place = _bring(matched.video.path, folder, name, copy, told)
        lines.append(f"video = {_text(place)}")
    elif matched.images is not None:
        lines.append(f"images = {_text(_bring_images(matched.images.files, folder, name, copy))}")
    timing = view.time.timing
    lines += [] if timing.fps is None else [f"fps = {_number(timing.fps)}"]
    lines += [f"time_offset = {_number(timing.time_offset)}"] if timing.time_offset else []
    if timing.stamps is not None:
        file = f"{name}_times.csv"
        rows = "\n".join(map(_number, timing.stamps))
        write_whole(folder / file, f"frame_time\n{rows}\n".encode())
        lines.append(f"timestamps = {_text(file)}")
    if view.detections is not None:
        file = f"{name}.csv"
        _write_boxes(folder / file, view.detections)
        lines.append(f"detections = {_text(file)}")
    lines += [
        f"K = {_rows(camera.intrinsics)}",
        f"distortion = {_list(camera.distortion)}",
        *(['lens = "fisheye"'] if camera.fisheye else []),
        f"R = {_rows(camera.rotation)}",
        f"t = {_list(camera.translation)}",
        "",
    ]
    return "\n".join(lines)


def _bring(path: Path, folder: Path, name: str, copy: bool, told: list[str]) -> str:
    """A file by its path inside the folder; linked or copied into it where it is outside."""
    real, home = path.resolve(), folder.resolve()
    if not copy and real.is_relative_to(home):
        return real.relative_to(home).as_posix()
    target = folder / f"{name}{path.suffix.lower()}"
    if target.exists():
        target.unlink()
    if not copy:
        try:
            os.link(real, target)
            return target.name
        except OSError:  # another file system, or one without links
            told.append(f"{path.name}: copied, since it cannot be linked from there")
    shutil.copyfile(real, target)
    return target.name


def _bring_images(files: Sequence[Path], folder: Path, name: str, copy: bool) -> str:
    """Pictures under numbers that sort as they follow each other."""
    own = folder / name
    own.mkdir(exist_ok=True)
    width = len(str(len(files)))
    for number, path in enumerate(files):
        if not path.exists():  # missing in the row of their numbers: the hole stays
            continue
        _bring_as(path, own / f"{number:0{width}}{path.suffix.lower()}", copy)
    return f"{name}/*{files[0].suffix.lower()}"


def _bring_as(path: Path, target: Path, copy: bool) -> None:
    if target.exists():
        return
    if not copy:
        try:
            os.link(path.resolve(), target)
            return
        except OSError:
            pass
    shutil.copyfile(path, target)


def _plain_name(name: str) -> str:
    """Without what heads no CSV column."""
    return re.sub(r'[,"#\s]+', "_", name).strip("_") or "camera"


def _file_names(names: Sequence[str]) -> list[str]:
    """Names of files, each its own, without slashes and other signs."""
    found: list[str] = []
    for name in names:
        plain = re.sub(r"[^\w\-]+", "_", name).strip("_.")[:60] or "camera"
        count = sum(other.lower() == plain.lower() for other in found)
        found.append(plain if not count else f"{plain}_{len(found)}")
    return found


def _write_boxes(path: Path, detections: Detections) -> None:
    rows = [
        f"{frame},{','.join(f'{value:.3f}' for value in box)},{score:.4f}"
        for frame, box, score in zip(
            detections.frames.tolist(), detections.boxes.tolist(), detections.scores.tolist(),
            strict=True,
        )
    ]  # fmt: skip
    text = "\n".join(["frame,left,top,width,height,score", *rows]) + "\n"
    write_whole(path, text.encode())


def _write_truth(path: Path, truth: GroundTruth) -> None:
    rows = [
        f"{frame},{who},{x:.5f},{y:.5f},{z:.5f},{int(valid)}"
        for frame, who, (x, y, z), valid in zip(
            truth.frames.tolist(), truth.ids.tolist(), truth.positions.tolist(),
            truth.valid.tolist(), strict=True,
        )
    ]  # fmt: skip
    write_whole(path, ("\n".join(["frame,id,x,y,z,valid", *rows]) + "\n").encode())


def _text(text: str) -> str:
    """A TOML string."""
    escaped = "".join(
        f"\\u{ord(c):04x}" if ord(c) < 32 or ord(c) == 127 else f"\\{c}" if c in '"\\' else c
        for c in text
    )
    return f'"{escaped}"'


def _number(value: float) -> str:
    return repr(float(value))


def _list(values: Float[ndarray, " n"]) -> str:
    return f"[{', '.join(_number(value) for value in np.asarray(values).tolist())}]"


def _rows(matrix: Float[ndarray, "n m"]) -> str:
    return f"[{', '.join(_list(row) for row in matrix)}]"
