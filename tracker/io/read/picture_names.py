"""The frame number and the camera in the names of pictures."""

from __future__ import annotations

import re
from pathlib import PurePosixPath


def number_in(text: str) -> int | None:
    """Return the last number in a name, which is the frame of ``cam1/frame_0012.jpg``; None if
    there is none."""
    name = text.replace("\\", "/").rsplit("/", 1)[-1]
    stem = re.sub(r"\.[A-Za-z]\w{0,4}$", "", name)  # of "cam1.0012.json" the number stays
    runs = re.findall(r"\d+", stem)
    return int(runs[-1]) if runs and len(runs[-1]) <= 15 else None


def camera_of(name: str) -> str:
    """Return the folder of an image, or else the part of its name before the frame number."""
    path = PurePosixPath(name.replace("\\", "/"))
    if path.parent.name:
        return path.parent.as_posix()
    return re.sub(r"[\W_]*\d+\D*$", "", path.stem)


def is_camera_number(name: object) -> bool:
    """Whether a name is like ``cam1``, so that its number is the camera's and not the frame's."""
    return isinstance(name, str) and re.fullmatch(r"(cam|view)\D*\d+", name.lower()) is not None
