"""A settled recording as a sequence in memory, for checks, and as an ordinary sequence folder.

Its pictures are brought into the folder: as they lie there, linked, or copied.
"""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable
from collections.abc import Sequence as Many
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from tracker.files.atomic import new_folder, replacing, write_whole
from tracker.io.conventions.questions import ACCEPT
from tracker.io.importing.settling import ImportPlan, PlannedView, at_steps_of, plain_name
from tracker.io.read.pieces import FormatError
from tracker.sequences.reader import FILE
from tracker.sequences.sequence import Room, Sequence, View
from tracker.sequences.tables import steps_without_boxes, write_boxes, write_truth

PIECE = 1 << 22
"""Bytes that are copied at once."""

Told = Callable[[int], None]
"""Called with how many more bytes are copied; what it raises ends the copying."""


def free_place(path: Path) -> Path:
    """A path at which there is nothing yet: this one, or with a number after its name. A folder
    that is imported into itself keeps its own files."""
    number, found = 2, path
    while found.exists() or found.is_symlink():
        number, found = number + 1, path.with_name(f"{path.stem}-{number}{path.suffix}")
    return found


def bring(path: Path, folder: Path, name: str, copy: bool, told: Told) -> tuple[str, bool]:
    """A file in the folder: where it lies if it is inside, else a link to it, or a copy.

    Args:
        path: The file.
        folder: Of the recording.
        name: What it is called there, without its suffix.
        copy: Copy it, also where it could be linked.
        told: Of what is copied.

    Returns:
        Its path inside the folder; and whether it had to be copied where a link was wanted:
        another file system, or one without links.
    """
    real, home = path.resolve(), folder.resolve()
    if real.is_relative_to(home):
        return real.relative_to(home).as_posix(), False
    target = free_place(folder / f"{name}{path.suffix.lower()}")
    linked = _place(real, target, copy, told)
    return target.name, not copy and not linked


def bring_images(
    files: Many[Path], folder: Path, name: str, copy: bool, told: Told
) -> tuple[str, bool]:
    """Pictures under numbers that sort as they follow each other; as :func:`bring`."""
    own = free_place(folder / name)
    own.mkdir()
    width = len(str(len(files)))
    linked = [
        _place(path.resolve(), own / f"{number:0{width}}{path.suffix.lower()}", copy, told)
        for number, path in enumerate(files)
        if path.exists()  # one missing in the row of their numbers stays missing
    ]
    return f"{own.name}/*{files[0].suffix.lower()}", not copy and not all(linked)


def _place(real: Path, target: Path, copy: bool, told: Told) -> bool:
    """Whether it is a link."""
    if not copy:
        try:
            os.link(real, target)
            return True
        except OSError:
            pass
    _copy(real, target, told)
    return False


def _copy(source: Path, target: Path, told: Told) -> None:
    """A copy with the times of the original, so that what is known of its content stays so."""
    with source.open("rb") as reading, target.open("wb") as writing:
        while piece := reading.read(PIECE):
            writing.write(piece)
            told(len(piece))
    shutil.copystat(source, target)


def links_in(folder: Path) -> dict[Path, int]:
    """The files of a folder that are second names of others, with their bytes."""
    found = {}
    for path in sorted(folder.rglob("*")):
        if path.is_file() and not path.is_symlink():
            known = path.stat()
            if known.st_nlink > 1:
                found[path] = known.st_size
    return found


def copy_links(folder: Path, told: Told) -> None:
    """Make a file of its own of every link in a folder; whoever reads one goes on undisturbed.

    Args:
        folder: Of a recording.
        told: Of what is copied; files that are not copied yet stay links where it raises.

    Raises:
        OSError: If one cannot be copied.
    """
    for path in links_in(folder):
        with replacing(path) as temporary:
            _copy(path, temporary, told)


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


def _file_names(names: Many[str]) -> list[str]:
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


def as_sequence(settled: ImportPlan, name: str) -> Sequence:
    """What the written folder will be read as; its folder is none.

    Args:
        settled: As it would be written.
        name: Of the sequence.
    """
    views = tuple(
        View(
            camera=view.camera,
            video=None if view.matched.video is None else view.matched.video.path,
            images=() if view.matched.images is None else view.matched.images.files,
            detections=None if view.detections is None else at_steps_of(view.detections, view.time),
            clock=view.time.clock,
            detector_ran=_ran(view, settled.frames),
        )
        for view in settled.views
    )
    room = settled.room
    return Sequence(
        name=name,
        folder=Path(),
        fps=settled.fps,
        frames=settled.frames,
        room=Room(np.asarray(room.minimum), np.asarray(room.maximum), settled.entrances),
        target_half_extents=np.asarray(room.half_extents),
        views=views,
        ground_truth=settled.truth,
    )


def _ran(view: PlannedView, steps: int) -> Bool[ndarray, " steps"] | None:
    """Whether the detector ran, by step; None where it ran at all."""
    if view.looked_at is None:
        return None
    ran = np.zeros(steps, dtype=bool)
    at = view.time.steps_of(view.looked_at)
    ran[at[(at >= 0) & (at < steps)]] = True
    return ran
