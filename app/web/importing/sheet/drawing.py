"""What is drawn on the sheet: the room from above, and how well a camera agrees when shifted."""

from __future__ import annotations

import math
from itertools import groupby

from app.web.importing.models import ImportedOffset, ImportedPlan, ImportInfo
from app.web.importing.sheet.building import Markup, element

PLAN_SIZE = (330.0, 360.0)
"""About how many pixels the plan has; lengths of its signs are by these."""

CURVE_SIZE = (140.0, 42.0)
BASE = CURVE_SIZE[1] - 12.5
REACH = 30
"""Frames on either side that a curve shows at least."""

CAMERA = (0.7, 18.0)
"""How long a camera is in the plan: metres, and at least so many pixels."""


def plan_picture(info: ImportInfo, words: str) -> Markup:
    """The room from above in metres, y up; the page puts in the box and its grips."""
    plan = info.plan
    if plan is None:
        return element("svg", class_="plan", role="img", aria_label=words)
    wide, high = plan.width * plan.cell, plan.height * plan.cell
    pixel = max(wide / PLAN_SIZE[0], high / PLAN_SIZE[1])
    faces = [
        element("rect", class_="grip", data_face=f"{axis} {end}", x=-x * pixel, y=-y * pixel,
                width=2 * x * pixel, height=2 * y * pixel, rx=3 * pixel)
        for axis, end, x, y in ((0, 0, 4, 13), (0, 1, 4, 13), (1, 0, 13, 4), (1, 1, 13, 4))
    ]  # fmt: skip
    lengths = [element("text", class_="length", data_axis=axis) for axis in (0, 1)]
    metre = f"M{wide - 1 - 8 * pixel:.3f} {high - 10 * pixel:.3f}h1"
    return element(
        "svg",
        _tint(plan),
        element("path", class_="feet", d="".join(
            f"M{x - plan.x:.3f} {high - y + plan.y:.3f}h0" for x, y in plan.feet
        )),
        [_entrance(info, number, pixel) for number in range(len(plan.entrances))],
        [one for number in range(len(plan.cameras)) for one in _camera(info, plan, number, pixel)],
        element("rect", class_="box"),
        faces,
        lengths,
        element("path", class_="scale", d=metre),
        element("text", "1 m", x=wide - 0.5 - 8 * pixel, y=high - 14 * pixel),
        class_="plan",
        role="img",
        aria_label=words,
        tabindex=0,
        viewBox=f"0 0 {wide:.3f} {high:.3f}",
        style=f"--pixel:{pixel:.5f}px",
        data_plan=[plan.x, plan.y, high],
    )  # fmt: skip


def _tint(plan: ImportedPlan) -> list[Markup]:
    """The floor by how many cameras see it: cells of a row that are alike in one piece."""
    pieces: dict[int, list[str]] = {}
    for row in range(plan.height):
        cells = plan.seen[row * plan.width : (row + 1) * plan.width]
        column = 0
        top = (plan.height - 1 - row) * plan.cell
        for count, run in groupby(min(count, 4) for count in cells):
            length = len(list(run))
            if count:
                piece = f"M{column * plan.cell:.3f} {top:.3f}h{length * plan.cell:.3f}"
                piece += f"v{plan.cell:.3f}h{-length * plan.cell:.3f}z"
                pieces.setdefault(count, []).append(piece)
            column += length
    return [
        element("path", class_=f"floor seen-{count}", d="".join(pieces[count]))
        for count in sorted(pieces)
    ]


def _entrance(info: ImportInfo, number: int, pixel: float) -> Markup:
    """A disc where people come in; hollow while it is only suggested."""
    plan = info.plan
    assert plan is not None
    x, y, wide, deep = plan.entrances[number]
    high = plan.height * plan.cell
    return element(
        "ellipse",
        class_="entrance" if info.wish.entrances else "entrance suggested",
        cx=f"{x - plan.x:.3f}", cy=f"{high - (y - plan.y):.3f}",
        rx=f"{max(wide, 4 * pixel):.3f}", ry=f"{max(deep, 4 * pixel):.3f}",
    )  # fmt: skip


def _camera(info: ImportInfo, plan: ImportedPlan, number: int, pixel: float) -> list[Markup]:
    x, y, way, half = plan.cameras[number]
    wide, high = plan.width * plan.cell, plan.height * plan.cell
    u, v = x - plan.x, high - (y - plan.y)
    length = max(CAMERA[0], CAMERA[1] * pixel)
    ends = [
        f"L{u + length * math.cos(way + turn):.3f} {v - length * math.sin(way + turn):.3f}"
        for turn in (-half, half)
    ]
    name = info.cameras[number].name if number < len(info.cameras) else ""
    side = min(3.5 * len(name) * pixel, wide / 2.0)
    return [
        element("path", class_="camera", d=f"M{u:.3f} {v:.3f}{''.join(ends)}z"),
        element("text", name, x=f"{min(max(u, side), wide - side):.3f}",
                y=f"{min(max(v - 4 * pixel, 12 * pixel), high - 4 * pixel):.3f}"),
    ]  # fmt: skip


def curve_picture(found: ImportedOffset | None, late: float, words: str) -> Markup:
    """How well a camera agrees with the others when it is shifted.

    Args:
        found: Beyond what it is shifted by.
        late: Frames, that it is shifted by.
        words: What the picture says.
    """
    width, height = CURVE_SIZE
    line = element("path", class_="base", d=f"M0 {BASE}h{width}")
    if found is None:
        parts = [line, element("text", "nothing to compare", x=width / 2, y=BASE - 6)]
    else:
        parts = [line, *_curve(found, late)]
    return element("svg", parts, class_="curve", role="img", aria_label=words,
                   viewBox=f"0 0 {width:g} {height:g}")  # fmt: skip


def _curve(found: ImportedOffset, late: float) -> list[Markup]:
    width, height = CURVE_SIZE
    reach = max(REACH, math.ceil(abs(found.steps) + 5))

    def across(steps: float) -> float:
        return width / 2 + steps / reach * (width / 2 - 6)

    near = [
        (offset, value)
        for offset, value in zip(found.offsets, found.agreement, strict=True)
        if value is not None and abs(offset) <= reach
    ]
    low = min((value for _, value in near), default=0.0)
    span = max((value for _, value in near), default=1.0) - low or 1.0
    points = [(across(o), BASE - 2 - (value - low) / span * (BASE - 6)) for o, value in near]
    drawn = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)

    def label(steps: float, anchor: str = "middle") -> Markup:
        x = {"start": 0.0, "end": width}.get(anchor, across(steps))
        words = f"{late + steps:.0f}".replace("-", "−")
        return element("text", words, x=x, y=height - 2, text_anchor=anchor)

    parts = [
        element("polyline", points=drawn, class_="sure" if found.sure else None),
        element("path", class_="now", d=f"M{across(0)} 2V{BASE}"),
        label(-reach, "start"),
        label(0.0),
        label(reach, "end"),
    ]
    if found.sure:
        top = min((y for _, y in points), default=4.0)
        parts += [element("circle", cx=f"{across(found.steps):.1f}", cy=top, r=3)]
        parts += [label(found.steps)]
    return parts
