"""Colours that mean something, once: the 24 of the tracks and the greys of the 3D scene.

The page has the same colours as custom properties in its tokens; a test compares them.
Pictures and the 3D scene always use the dark set. A track's colour follows its id, never
its rank, so it stays the same whatever else comes and goes.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int, UInt8
from numpy import ndarray

Rgb = tuple[int, int, int]


def from_hex(text: str) -> Rgb:
    """``#rrggbb`` as red, green and blue, 0 … 255.

    Raises:
        ValueError: If the text is anything else.
    """
    digits = text.removeprefix("#")
    if len(digits) != 6:
        raise ValueError(f"a colour must be #rrggbb, got {text!r}")
    return int(digits[:2], 16), int(digits[2:4], 16), int(digits[4:], 16)


TRACK_HEX = (
    *("#e98f48", "#77b1fc", "#98c994", "#b3578b", "#f6dc4d", "#6b65e4", "#78ebf4", "#cb4645"),
    *("#ffbfca", "#c4878c", "#158eac", "#caa3cf", "#76cef8", "#0abba0", "#d780d6", "#d6e19c"),
    *("#909d68", "#fe87a7", "#82b762", "#61ddbe", "#6575bb", "#d86c38", "#d1c57d", "#5c8760"),
)
"""``--id-1`` … ``--id-24``: the first eight differ most, also with a colour deficiency."""

TRACK_COLOURS = np.array([from_hex(text) for text in TRACK_HEX], dtype=np.uint8)
"""The same as (24, 3) red, green, blue."""

LIGHT_INK_IDS = frozenset({8})
"""The tracks whose tag is written in white; all others carry black ink."""

CANVAS = from_hex("#141414")
"""viser's dark background: what a fading colour fades to."""
GRID_MINOR = from_hex("#262626")
GRID_MAJOR = from_hex("#383838")
SCENE_LINE = from_hex("#8b8b8b")
"""Volume, frusta, and components that belong to no track."""
VOLUME_LINE = from_hex("#5c5c5c")
ENTRANCE_LINE = from_hex("#4a4a4a")
TRUTH_LINE = from_hex("#ababab")
PICTURE_EMPTY = from_hex("#202020")
"""Where a camera has no picture."""


def track_index(track: int) -> int:
    """Which of the 24 colours, 0-based, an id (1, 2, …) has."""
    return (track - 1) % len(TRACK_HEX)


def track_colour(track: int) -> Rgb:
    """Red, green and blue of a track id."""
    return from_hex(TRACK_HEX[track_index(track)])


def track_colours(tracks: Int[ndarray, " N"]) -> UInt8[ndarray, "N 3"]:
    """Red, green and blue of each track id."""
    places = (np.asarray(tracks, dtype=np.int64) - 1) % len(TRACK_HEX)
    return np.asarray(TRACK_COLOURS[places], dtype=np.uint8)


def track_ink(track: int) -> str:
    """The colour of text on a tag of the track's colour."""
    return "#fff" if track_index(track) + 1 in LIGHT_INK_IDS else "#000"


def fade(
    colours: UInt8[ndarray, "*N 3"], strength: Float[ndarray, "*N"] | float, towards: Rgb = CANVAS
) -> UInt8[ndarray, "*N 3"]:
    """Colours blended into a background: 1 leaves them, 0 makes them disappear."""
    share = np.clip(np.asarray(strength, dtype=float), 0.0, 1.0)[..., None]
    mixed = np.asarray(colours, dtype=float) * share + np.asarray(towards) * (1.0 - share)
    return np.asarray(np.rint(mixed), dtype=np.uint8)
