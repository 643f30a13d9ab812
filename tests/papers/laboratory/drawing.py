"""How the experiments' figures look: calm, labelled, in the colours of the report.

Only a figure that is asked for imports this, and with it the drawing library.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import Any

import matplotlib
import numpy as np
from jaxtyping import Bool, Float, Int
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy import ndarray

from tracker.evaluation.figures import number
from tracker.evaluation.report.figures import (
    DARK_IDS,
    GRID,
    INK,
    LIGHT_IDS,
    LINE,
    MUTED,
    NEAR,
    SURFACE,
    broken,
    colour,
)

__all__ = ["INK", "LIGHT_IDS", "LINE", "MUTED", "NEAR", "broken", "colour"]

SHADE = "#ececea"
"""Behind steps that are set apart."""

DOTS_PER_INCH = 150

LIGHT_TAGS = frozenset({8})
"""The colours of the dark set on which white letters are read, not black ones."""

STYLE: Any = {
    "figure.facecolor": SURFACE,
    "axes.facecolor": SURFACE,
    "savefig.facecolor": SURFACE,
    "font.size": 9,
    "text.color": INK,
    "axes.labelcolor": MUTED,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.edgecolor": GRID,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": GRID,
    "grid.linewidth": 0.8,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.major.size": 0,
    "ytick.major.size": 0,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "lines.linewidth": 1.3,
    "lines.solid_capstyle": "round",
}


def sheet(width: float, height: float, title: str) -> Figure:
    """An empty figure with its title; inches."""
    figure = Figure(figsize=(width, height), layout="constrained", dpi=DOTS_PER_INCH)
    figure.suptitle(title, x=0.012, ha="left", fontsize=11.5, fontweight="bold")
    return figure


def png(draw: Callable[[], Figure]) -> bytes:
    """Draw a figure in the project's style."""
    picture = io.BytesIO()
    with matplotlib.rc_context(STYLE):
        draw().savefig(picture, format="png", bbox_inches="tight", pad_inches=0.12)
    return picture.getvalue()


def panels(figure: Figure, layout: list[list[str]], **more: Any) -> dict[str, Axes]:
    """Axes by their names."""
    names: Any = layout
    axes: dict[str, Axes] = figure.subplot_mosaic(names, **more)
    return axes


def shade(axes: Axes, steps: Bool[ndarray, " S"]) -> None:
    """Set steps apart by the ground behind them."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], steps, [False]]).astype(int)))
    for first, after in edges.reshape(-1, 2).tolist():
        axes.axvspan(first - 0.5, after - 0.5, color=SHADE, linewidth=0, zorder=0)


def circles(
    axes: Axes, frames: Int[ndarray, " N"], values: Float[ndarray, " N"], every: int = 25
) -> None:
    """The truth as circles, one every so many steps."""
    kept = frames % every == 0
    axes.plot(
        frames[kept], values[kept], "o", ms=4.2, mfc="none", mec=MUTED, mew=0.8, ls="none",
        zorder=2,
    )  # fmt: skip


def bars(
    axes: Axes, names: list[str], values: list[float | None], tones: list[str], *, named: bool
) -> None:
    """Values side by side, the first at the top, each with its number."""
    places = np.arange(len(names))[::-1]
    lengths = [0.0 if value is None else value for value in values]
    axes.barh(places, lengths, color=tones, height=0.62)
    for place, value, length in zip(places.tolist(), values, lengths, strict=True):
        axes.annotate(
            number(value, 3), (max(length, 0.0), place), xytext=(4, 0), fontsize=8,
            textcoords="offset points", va="center", color=INK,
        )  # fmt: skip
    axes.set_xlim(min(0.0, *lengths), 1.36 * max(1e-6, *lengths))
    axes.grid(visible=False, axis="y")
    axes.set_yticks(places, names if named else [""] * len(names))


def box(
    axes: Axes, place: tuple[float, float, float, float], tone: str, *, dashed: bool = False
) -> None:
    """A box in a picture: left, top, width, height in pixels."""
    left, top, width, height = place
    style: Any = {"linewidth": 0.9, "linestyle": (0, (2, 2))} if dashed else {"linewidth": 1.7}
    axes.add_patch(Rectangle((left, top), width, height, fill=False, edgecolor=tone, **style))


def tag(axes: Axes, x: float, y: float, name: int) -> None:
    """An id at the corner of its box."""
    index = (name - 1) % len(DARK_IDS)
    axes.text(
        x, y, str(name), fontsize=7.5, fontweight="bold", va="bottom", ha="left",
        color="#ffffff" if index + 1 in LIGHT_TAGS else "#000000",
        bbox={"boxstyle": "square,pad=0.18", "facecolor": DARK_IDS[index], "edgecolor": "none"},
        clip_on=True,
    )  # fmt: skip


def picture_colour(name: int) -> str:
    """Of an id on a picture."""
    return DARK_IDS[(name - 1) % len(DARK_IDS)]
