"""A settled recording as an ordinary sequence folder."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.files.atomic import new_folder, replacing, write_whole
from tracker.io.conventions.questions import ACCEPT
from tracker.io.importing.bringing import Told, bring, bring_images, free_place
from tracker.io.importing.settling import ImportPlan, PlannedView, plain_name
from tracker.io.read.pieces import FormatError
from tracker.sequences.reader import FILE
from tracker.sequences.writing.csv_files import steps_without_boxes, write_boxes, write_truth


def write(
    settled: ImportPlan,
    folder: Path,
    name: str,
    *,
    copy: bool = False,
    copied: Told = lambda more: None,
) -> list[str]:
    """Write ``sequence.toml``, boxes and truth; bring the pictures in.

    Pictures inside the folder stay where they are. Others are linked (a second name of the same
    file, which takes no room), or copied where the file system cannot.

    Args:
        settled: What to write.
        folder: It must not hold a sequence yet.
        name: Of the sequence.
        copy: Copy the pictures, also where they could be linked.
        copied: Called with how many more bytes are copied; what it raises ends the writing.

    Returns:
        What was copied though a link was wanted, a sentence each.

    Raises:
        FormatError: If there is a sequence in the folder already.
        OSError: If it cannot be written; nothing of it is left then.
    """
    if (folder / FILE).exists():
        raise FormatError(f"{folder}: holds a {FILE} already; name another folder, or remove it")
    if not folder.is_dir() or not any(folder.iterdir()):
        folder.parent.mkdir(parents=True, exist_ok=True)
        with new_folder(folder) as place:
            return _write_into(place, settled, name, copy, copied)
    before = set(folder.rglob("*"))
    try:
        return _write_into(folder, settled, name, copy, copied)
    except BaseException:
        for path in sorted(set(folder.rglob("*")) - before, reverse=True):
            path.rmdir() if path.is_dir() and not path.is_symlink() else path.unlink()
        raise


def _write_into(
    folder: Path, settled: ImportPlan, name: str, copy: bool, copied: Told
) -> list[str]:
    names = _file_names([view.camera.name for view in settled.views])
    told: list[str] = []
    tables = []
    for view, own in zip(settled.views, names, strict=True):
        tables.append(_camera(view, own, folder, copy, copied, told))
    truth = ""
    if settled.truth is not None:
        file = free_place(folder / "ground_truth.csv")
        write_truth(file, settled.truth, decimals=".5f")
        truth = f"\n[ground_truth]\nfile = {_text(file.name)}\n"
    head = [
        *([] if settled.open is None else [f"# by {ACCEPT}: {settled.open}"]),
        "format = 1",
        f"name = {_text(name)}",
        f"fps = {_number(settled.fps)}",
        f"frames = {settled.frames}",
        "",
        "[room]",
        f"min = {_list(settled.room.minimum)}",
        f"max = {_list(settled.room.maximum)}",
        *_entrances(settled),
        "",
        "[target]",
        f"half_extents = {_list(settled.room.half_extents)}",
        "",
    ]
    text = "\n".join(head) + "\n" + "\n".join(tables) + truth
    with replacing(folder / FILE) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return told


def _entrances(settled: ImportPlan) -> list[str]:
    """The lines of the room's entrances."""
    if not settled.entrances:
        return []
    tables = [
        f"  {{ position = {_list(one.position)}, sigma = {_list(one.sigma)} }},"
        for one in settled.entrances
    ]
    return ["entrances = [", *tables, "]"]


def _camera(
    view: PlannedView, name: str, folder: Path, copy: bool, copied: Told, told: list[str]
) -> str:
    camera = view.camera
    lines = ["[[camera]]", f"name = {_text(plain_name(camera.name))}"]
    lines.append(f"image_size = [{camera.image_size[0]}, {camera.image_size[1]}]")
    matched = view.matched
    if matched.video is not None:
        path = matched.video.path
        place, instead = bring(path, folder, name, copy, copied)
        if instead:
            told.append(f"{path.name}: copied, since it cannot be linked from there")
        lines.append(f"video = {_text(place)}")
    elif matched.images is not None:
        place, instead = bring_images(matched.images.files, folder, name, copy, copied)
        if instead:
            told.append(f"{name}: pictures copied, since they cannot be linked from there")
        lines.append(f"images = {_text(place)}")
    timing = view.time.timing
    lines += [] if timing.fps is None else [f"fps = {_number(timing.fps)}"]
    lines += [f"time_offset = {_number(timing.time_offset)}"] if timing.time_offset else []
    if timing.stamps is not None:
        file = free_place(folder / f"{name}_times.csv")
        rows = "\n".join(map(_number, timing.stamps))
        write_whole(file, f"frame_time\n{rows}\n".encode())
        lines.append(f"timestamps = {_text(file.name)}")
    if view.detections is not None:
        file = free_place(folder / f"{name}.csv")
        looked_at = np.zeros(0, dtype=np.int64) if view.looked_at is None else view.looked_at
        empty = steps_without_boxes(view.detections, looked_at)
        write_boxes(file, view.detections, empty, decimals=(".3f", ".4f"))
        lines += ['detected_steps = "listed"'] if view.looked_at is not None else []
        lines.append(f"detections = {_text(file.name)}")
    lines += [
        f"K = {_rows(camera.intrinsics)}",
        f"distortion = {_list(camera.distortion)}",
        *(['lens = "fisheye"'] if camera.fisheye else []),
        f"R = {_rows(camera.rotation)}",
        f"t = {_list(camera.translation)}",
        "",
    ]
    return "\n".join(lines)


def _file_names(names: Sequence[str]) -> list[str]:
    """Names of files, each its own, without slashes and other signs."""
    found: list[str] = []
    for name in names:
        plain = re.sub(r"[^\w\-]+", "_", name).strip("_.")[:60] or "camera"
        count = sum(other.lower() == plain.lower() for other in found)
        found.append(plain if not count else f"{plain}_{len(found)}")
    return found


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
