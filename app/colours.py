"""The colours that carry a meaning: the 24 of the tracks and the greys of the 3D scene.

The page has the same colours as custom properties in its tokens; a test compares them.
Pictures always use the dark set, the 3D scene that of the theme. A track's colour follows
its id, never its rank, so it stays the same whatever else comes and goes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

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

LIGHT_HEX = (
    *("#a05300", "#286ec2", "#558452", "#7d2259", "#a28d06", "#402cac", "#039ca6", "#8e0316"),
    *("#c4667b", "#864e53", "#00586d", "#87628c", "#2386ae", "#057664", "#954095", "#89924f"),
    *("#58632f", "#b44366", "#45771f", "#0a9278", "#374386", "#913a03", "#897e34", "#2c5531"),
)
"""The same of the light theme: as far apart, but dark enough for a white ground."""

LIGHT_INK_IDS = frozenset({8})
"""The tracks whose tag is written in white; all others carry black ink."""

PICTURE_EMPTY = from_hex("#202020")
"""Where a camera has no picture."""

Theme = Literal["dark", "light"]


@dataclass(frozen=True, slots=True, eq=False)
class Palette:
    """The colours of the 3D scene in one theme."""

    tracks: UInt8[ndarray, "24 3"]
    canvas: Rgb
    """viser's background, into which faded colours are blended; also behind its labels."""
    ink: Rgb
    """The colour of the words of labels."""
    grid_minor: Rgb
    grid_major: Rgb
    line: Rgb
    """Frusta, and components that belong to no track."""
    volume: Rgb
    ground: Rgb
    """The floor of the volume."""
    entrance: Rgb
    truth: Rgb
    pinned: Rgb
    """Whatever belongs to the run that this one is compared with."""
    errors: tuple[Rgb, Rgb]
    """Ends of the scale of position errors: none, and the largest that the scale tells apart."""

    def of(self, tracks: Int[ndarray, " N"]) -> UInt8[ndarray, "N 3"]:
        """Red, green and blue of each track id."""
        places = (np.asarray(tracks, dtype=np.int64) - 1) % len(self.tracks)
        return np.asarray(self.tracks[places], dtype=np.uint8)

    def fade(
        self, colours: UInt8[ndarray, "*N 3"], strength: Float[ndarray, "*N"] | float
    ) -> UInt8[ndarray, "*N 3"]:
        """Colours blended into the background: 1 leaves them, 0 makes them disappear."""
        return mix(np.asarray(self.canvas), colours, strength)

    def error(self, share: Float[ndarray, " N"]) -> UInt8[ndarray, "N 3"]:
        """The colour of an error by its share, 0 … 1, of the largest on :attr:`errors`."""
        none, most = (np.asarray(colour, dtype=np.uint8) for colour in self.errors)
        return mix(none, np.broadcast_to(most, (*np.shape(share), 3)), share)


def mix(
    ground: ndarray, colours: UInt8[ndarray, "*N 3"], share: Float[ndarray, "*N"] | float
) -> UInt8[ndarray, "*N 3"]:
    """Colours over a ground: at share 1 they alone, at 0 the ground alone."""
    share = np.clip(np.asarray(share, dtype=float), 0.0, 1.0)[..., None]
    mixed = np.asarray(colours, dtype=float) * share + ground * (1.0 - share)
    return np.asarray(np.rint(mixed), dtype=np.uint8)


def _tracks(texts: tuple[str, ...]) -> UInt8[ndarray, "24 3"]:
    return np.array([from_hex(text) for text in texts], dtype=np.uint8)


PALETTES: dict[Theme, Palette] = {
    "dark": Palette(
        tracks=_tracks(TRACK_HEX),
        canvas=from_hex("#141414"),
        ink=from_hex("#ededed"),
        grid_minor=from_hex("#262626"),
        grid_major=from_hex("#383838"),
        line=from_hex("#8b8b8b"),
        volume=from_hex("#6b6f75"),
        ground=from_hex("#121a23"),
        entrance=from_hex("#4a4a4a"),
        truth=from_hex("#ababab"),
        pinned=from_hex("#d9d9d9"),
        errors=(from_hex("#6cb2f5"), from_hex("#e6a24c")),
    ),
    "light": Palette(
        tracks=_tracks(LIGHT_HEX),
        canvas=from_hex("#ffffff"),
        ink=from_hex("#1b1b1b"),
        grid_minor=from_hex("#ececea"),
        grid_major=from_hex("#d9d9d6"),
        line=from_hex("#6e6e6e"),
        volume=from_hex("#9a9c9f"),
        ground=from_hex("#eaf0f6"),
        entrance=from_hex("#bdbdb9"),
        truth=from_hex("#5a5a5a"),
        pinned=from_hex("#333333"),
        errors=(from_hex("#1a66b0"), from_hex("#b06a0a")),
    ),
}


def track_index(track: int) -> int:
    """Which of the 24 colours, 0-based, an id (1, 2, …) has."""
    return (track - 1) % len(TRACK_HEX)


def track_colour(track: int) -> Rgb:
    """Red, green and blue of a track id."""
    return from_hex(TRACK_HEX[track_index(track)])


def track_ink(track: int) -> str:
    """The colour of text on a tag of the track's colour."""
    return "#fff" if track_index(track) + 1 in LIGHT_INK_IDS else "#000"
