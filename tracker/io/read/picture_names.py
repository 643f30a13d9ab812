"""What names of pictures say: which frame one is, and of which camera."""

from __future__ import annotations

import re
from pathlib import PurePosixPath


def number_in(text: str) -> int | None:
    """The last run of digits of a name: the frame of ``cam1/frame_0012.jpg``."""
    name = text.replace("\\", "/").rsplit("/", 1)[-1]
    stem = re.sub(r"\.[A-Za-z]\w{0,4}$", "", name)  # of "cam1.0012.json" the number stays
    runs = re.findall(r"\d+", stem)
    return int(runs[-1]) if runs and len(runs[-1]) <= 15 else None


def camera_of(name: str) -> str:
    """The folder of an image, or what is before the frame's number in its name."""
    path = PurePosixPath(name.replace("\\", "/"))
    if path.parent.name:
        return path.parent.as_posix()
    return re.sub(r"[\W_]*\d+\D*$", "", path.stem)


def is_camera_number(name: object) -> bool:
    """``cam1``, in which the number is no frame's."""
    return isinstance(name, str) and re.fullmatch(r"(cam|view)\D*\d+", name.lower()) is not None
