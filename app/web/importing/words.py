"""What the import says, in the page's words: a flag of the command line is a field or a button."""

from __future__ import annotations

import re

FIELDS = {
    "--accept-best": "Import it as it is",
    "--as-named": "As named",
    "--axes": "Axes",
    "--boxes": "Boxes",
    "--euler": "Angles",
    "--first-index": "First frame",
    "--fps": "Rate",
    "--pose": "Poses",
    "--swap": "Apply",
    "--unit": "File's unit",
    "--up": "Up",
    "camera.time_offset": "Starts late by",
    "room.max": "Room",
    "room.min": "Room",
    "target.half_extents": "Target",
}
"""What the sheet of *Open* calls a flag of the import, or a field of ``sequence.toml``."""

_WHOLE = (
    (
        r"; --camera \S+=FILE(?=\)?$)",
        "; choose it in the row of its camera, or name it after its camera",
    ),
    (r"by --camera \S+=FILE", "by the name of its camera, with the others left out"),
    (r" \(`multiview-phd formats` lists them\)", ""),
    (r"timestamps in sequence\.toml", "in a file of time stamps"),
    (r"name (a video or images|a file of detections) in sequence\.toml", r"add \1"),
    (r"\[(room|target)\]", r"the \1"),
    (r" or by `[^`]*`, or start the program with --detector model\.onnx", ""),
)
"""What the page says in place of words that name more than a flag."""

_FLAG = re.compile(rf"(?<![\w-])({'|'.join(map(re.escape, FIELDS))})(?![\w-])( = |=)?")


def on_page(words: str) -> str:
    """A sentence of the import for whoever has the sheet before them, and no command line."""
    for pattern, instead in _WHOLE:
        words = re.sub(pattern, instead, words)
    words = re.sub(r"; (--[a-z-]+)$", r"; \1 changes it", words)
    return _FLAG.sub(lambda found: f"“{FIELDS[found[1]]}”{' ' if found[2] else ''}", words)
