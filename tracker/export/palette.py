"""The colours of tracks, the same as on the page and in the report."""

from __future__ import annotations

from functools import cache

Rgb = tuple[int, int, int]


@cache
def rgb(number: int) -> Rgb:
    """Return the colour of the track with an id on a dark background: red, green, blue in 0 …
    255."""
    from tracker.evaluation.report.figures import DARK_IDS  # imports plotly

    text = DARK_IDS[(number - 1) % len(DARK_IDS)]
    return int(text[1:3], 16), int(text[3:5], 16), int(text[5:7], 16)
