"""What a parameter would change, under its slider: a small curve and its ends in words."""

from __future__ import annotations

import urllib.parse
from collections.abc import Iterable
from typing import Any

from app.scene.panel.sliders import number_text
from app.state.workers.sensitivity import Curve

WIDTH, HEIGHT = 64, 14
"""Of the drawing, pixels."""
LINE = "#4c97e0"
"""On dark and on light ground."""


def words_of(curve: Curve) -> str:
    """``0.15 … 0.9: MOTA 0.91 … 0.98``, or that it makes no difference.

    The scores are the least and the greatest, in this order unless the curve ends lower than it
    begins: read after the values they say whether it falls.
    """
    known = [score for score in curve.scores if score is not None]
    if not known:
        return "no run with other values"
    digits = 2 if curve.measure == "MOTA" else 0
    bounds = sorted((min(known), max(known)), reverse=known[-1] < known[0])
    low, high = (f"{end:.{digits}f}" for end in bounds)
    ends = f"{_text(curve.values[0])} … {_text(curve.values[-1])}"
    more = "" if curve.whole else ", computing"
    if low == high:
        return f"{ends}: {curve.measure} {low} throughout{more}"
    return f"{ends}: {curve.measure} {low} … {high}{more}"


def drawing_of(curve: Curve, now: Any) -> str:
    """The curve as SVG: scores over the values in their order, a dot at the value now."""
    known = [(i, s) for i, s in enumerate(curve.scores) if s is not None]
    low, high = min(s for _, s in known), max(s for _, s in known)
    # a curve that hardly moves is not made to look as if it did
    span = max(high - low, 0.05 if curve.measure == "MOTA" else 1.0)
    across = max(1, len(curve.values) - 1)

    def place(index: int, score: float) -> tuple[float, float]:
        x = 3 + index * (WIDTH - 6) / across
        return round(x, 1), round(HEIGHT - 3 - (score - low) * (HEIGHT - 6) / span, 1)

    points = " ".join(f"{x},{y}" for x, y in (place(i, s) for i, s in known))
    dots = "".join(
        f'<circle cx="{x}" cy="{y}" r="2.2" fill="{LINE}"/>'
        for i, s in known
        if curve.values[i] == now
        for x, y in [place(i, s)]
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{HEIGHT}">'
        f'<polyline points="{points}" fill="none" stroke="{LINE}" stroke-width="1.5"/>{dots}</svg>'
    )


def style_of(curves: Iterable[tuple[Curve, Any, list[str]]]) -> str:
    """Style that writes each curve under its sliders.

    Args:
        curves: With the value that the parameter has now, and the ids of its inputs.
    """
    rules = []
    for curve, now, inputs in curves:
        # as wide as its row and no wider: words that come would widen the whole panel
        rows = ",".join(
            f'.mantine-Flex-root:has(> div > .mantine-Text-root > label[for="{uuid}"])::after'
            for uuid in inputs
        )
        picture = ""
        if any(score is not None for score in curve.scores):
            svg = urllib.parse.quote(drawing_of(curve, now))
            picture = f'background: url("data:image/svg+xml,{svg}") no-repeat left center;'
        rules.append(
            f'{rows} {{ content: "{words_of(curve)}"; width: 0; min-width: 100%; {picture} '
            f"padding-left: {WIDTH + 6}px; margin-top: 4px; min-height: 16px; "  # under the thumb
            "font-size: 10px; line-height: 14px; box-sizing: border-box; color: var(--mvp-ink-3); }"
        )
    return f"<style>{' '.join(rules)}</style>"


def _text(value: Any) -> str:
    return number_text(value) if isinstance(value, int | float) else str(value).replace("_", " ")
