"""A kept run in small and runs side by side, as parts of the page."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from app.colours import track_index
from app.models import TrackLife
from app.web.library.models import ChangeInfo, Course, KeptRunInfo
from app.web.library.preview import BUCKETS
from app.web.tables.markup import (
    Cell,
    Markup,
    escaped,
    id_tag,
    joined,
    number,
    quiet,
    symbol,
    table,
)
from tracker.evaluation import BY_KEY
from tracker.library.keeping import CURVE, stride
from tracker.library.records import HEADLINES, PROVISIONAL
from tracker.sequences.sequence import Room

MOST_LANES = 6

_FIGURES = (
    *(
        (", ".join(filter(None, (one.name, one.unit.replace("{d}", "m")))), key, one.digits,
         1 if one.direction == "higher" else -1)
        for key, one in ((key, BY_KEY[key]) for key in HEADLINES)
    ),
    ("Tracks", "targets", 0, 0),
)  # fmt: skip
"""Word, field, digits, and which end is the better: 0 for neither."""


def preview(
    run: KeptRunInfo,
    frames: int,
    tracks: Sequence[TrackLife],
    people: Sequence[float],
    courses: Sequence[Course],
    ospa: Sequence[float],
    room: Room | None = None,
) -> str:
    """Lanes, people, OSPA, ways from above, and what differs.

    The room is drawn where it is known: that of the open recording.
    """
    curves = _curve("People", "", people, frames, stride(frames, BUCKETS))
    curves += _curve("OSPA", " m", ospa, frames, stride(frames, CURVE)) if ospa else ""
    return (
        f'<div class="pv-lanes">{_lanes(run, frames, tracks)}{curves}</div>'
        f'<div class="pv-top">{_ways(courses, room)}</div>'
        f'<dl class="pv-facts">{_facts(run)}</dl>'
    )


def comparison(runs: Sequence[KeptRunInfo]) -> str:
    """A table of what differs between runs, and of their figures, the best of each bold."""
    rows: list[tuple[Cell, ...]] = []
    for word, values in (
        ("Single view", [run.single_view for run in runs]),
        ("Fusion", [run.fusion_method for run in runs]),
        ("Seed", [str(run.seed) for run in runs]),
        ("Corrections", [str(run.corrected) for run in runs]),
        ("Program", [_program(run) for run in runs]),
    ):
        if len(set(values)) > 1:
            rows.append((word, *values))
    known = {change.key: change for run in runs for change in run.changes}
    for key, change in known.items():
        own = [next((c.value for c in run.changes if c.key == key), change.default) for run in runs]
        rows.append((_named(change), *own))
    rows += [_side_by_side(runs, *figure) for figure in _FIGURES]
    if any(run.provisional for run in runs):
        rows.append(("Figures", *(PROVISIONAL if run.provisional else "" for run in runs)))
    return table("Runs side by side", ("What", *(f"#{title_of(run)}" for run in runs)), rows)


def _side_by_side(
    runs: Sequence[KeptRunInfo], word: str, name: str, digits: int, sign: int
) -> tuple[Cell, ...]:
    """A figure of several runs, the best bold: provisional ones are shown, not compared."""
    scores = name != "targets"
    values = [(getattr(run, name), sign != 0 and not (scores and run.provisional)) for run in runs]
    there = [sign * value for value, compared in values if compared and value is not None]
    best = max(there) if len(there) > 1 else None
    alone = best is not None and there.count(best) == 1
    cells: list[Cell] = []
    for run, (value, compared) in zip(runs, values, strict=True):
        text = number(value, digits)
        if alone and compared and value is not None and sign * value == best:
            cells.append(Markup(f'<b class="top1">{text}</b>'))
        else:
            cells.append(quiet(f"({text})") if scores and run.provisional else text)
    return (word, *cells)


def title_of(run: KeptRunInfo) -> str:
    """Its name, else its number."""
    return run.name or f"Run {run.id}"


def _program(run: KeptRunInfo) -> str:
    return f"{run.program}, older code" if run.older_code else run.program


def _named(change: ChangeInfo) -> Markup:
    return Markup(f'<span title="{escaped(change.key)}">{symbol(change.symbol).html}</span>')


def _facts(run: KeptRunInfo) -> str:
    note = Markup(
        f'<input class="addnote" aria-label="Note" placeholder="add a note" '
        f'value="{escaped(run.note)}">'
    )
    error = "–" if run.position_error is None else f"{number(run.position_error, 3)} m"
    marked = quiet if run.provisional else str
    facts: list[tuple[Cell, Cell]] = [
        ("Note", note),
        *((_named(c), joined(quiet(f"{c.default} → "), c.value)) for c in run.changes),
        *([("Corrections of a person", run.corrected)] if run.corrected else []),
        *([("Figures", f"provisional: {PROVISIONAL}")] if run.provisional else []),
        ("Missed", marked(number(run.misses, 0))),
        ("False", marked(number(run.false_positives, 0))),
        ("Identity switches", marked(number(run.id_switches, 0))),
        ("Position error", marked(error)),
        ("Seed", run.seed),
        ("Program", _program(run)),
    ]
    return "".join(
        f"<dt>{joined(word).html}</dt><dd>{joined(value).html}</dd>" for word, value in facts
    )


def _lanes(run: KeptRunInfo, frames: int, tracks: Sequence[TrackLife]) -> str:
    longest = sorted(tracks, key=lambda t: t.first - t.last)[:MOST_LANES]
    lanes = []
    for track in sorted(longest, key=lambda t: t.first):
        parts = "".join(
            f'<i class="{kind.replace(" ", "-")}" style="left:{100 * first / frames:.2f}%;'
            f'width:{100 * (last + 1 - first) / frames:.2f}%"></i>'
            for first, last, kind in track.spans
        )
        colour = f"--c:var(--id-{track_index(track.id) + 1})"
        lanes.append(f'{id_tag(track.id).html}<div style="{colour}">{parts}</div>')
    more = len(tracks) - len(longest)
    under = f'<span></span><span class="q">and {more} more</span>' if more else ""
    words = f"Lanes of run {run.id}: {len(tracks)} tracks over {frames} steps"
    ends = f"<span></span><span class='ends'>{_ticks(frames)}</span>"
    return (
        f'<div class="lines" role="img" aria-label="{escaped(words)}">{ends}{"".join(lanes)}'
        f"{under}</div>"
    )


def _ticks(frames: int) -> str:
    """Round steps, four to ten of them, where they are on the lanes."""
    power = 10.0 ** np.floor(np.log10(max(10, frames) / 4.0))
    apart = next(int(k * power) for k in (5, 2, 1) if k * power <= max(10, frames) / 4.0)
    return "".join(
        f'<span style="left:{100 * step / max(1, frames):.2f}%">{step}</span>'
        for step in range(0, frames, max(1, apart))
    )


def _curve(word: str, unit: str, values: Sequence[float], frames: int, each: int) -> str:
    """A staircase over the steps; people are whole, everything else ends where it is largest.

    A value stands for ``each`` steps, so that a curve of fewer steps than the run has ends early.
    """
    most = max([0.1 if unit else 1.0, *values])
    top = f"{most:.2f}" if unit else f"{most:.0f}"
    points = " ".join(
        f"{min(at * each, frames)},{most - value:g}"
        for k, value in enumerate(values)
        for at in (k, k + 1)
    )
    return (
        f'<div class="crowd"><span>{word}{unit}<br><span class="q">0–{top}</span></span>'
        f'<svg viewBox="0 0 {max(1, frames)} {most:g}" preserveAspectRatio="none" role="img" '
        f'aria-label="{word} over time, at most {top}{unit}"><polyline points="{points}"/></svg>'
        "</div>"
    )


def _ways(courses: Sequence[Course], room: Room | None) -> str:
    points = np.array([p for course in courses for p in course.points]).reshape(-1, 2)
    if not len(points):
        return ""
    # a stray point far away does not make all others small
    (left, low), (right, high) = np.percentile(points, [0.5, 99.5], axis=0)
    if room is not None:
        left, low = np.minimum((left, low), room.minimum[:2])
        right, high = np.maximum((right, high), room.maximum[:2])
    side = max(right - left, high - low, 1.0)
    pad = 0.06 * side
    lines = [] if room is None else [_room(room)]
    for course in courses:
        n = track_index(course.id) + 1
        way = " ".join(f"{x:g},{-y:g}" for x, y in course.points)
        x, y = course.points[-1]
        lines.append(
            f'<g style="--c:var(--id-{n})"><polyline points="{way}"/>'
            f'<circle cx="{x:g}" cy="{-y:g}" r="{side / 60:.3f}"/></g>'
        )
    box = f"{left - pad:.2f} {-high - pad:.2f} {right - left + 2 * pad:.2f} "
    box += f"{high - low + 2 * pad:.2f}"
    return f'<svg viewBox="{box}" role="img" aria-label="Ways from above">{"".join(lines)}</svg>'


def _room(room: Room) -> str:
    """The volume and the entrances from above."""
    (x, y), (right, top) = room.minimum[:2], room.maximum[:2]
    doors = "".join(
        f'<ellipse cx="{e.position[0]:g}" cy="{-e.position[1]:g}" rx="{2 * e.sigma[0]:g}" '
        f'ry="{2 * e.sigma[1]:g}"/>'
        for e in room.entrances
    )
    return f'<rect x="{x:g}" y="{-top:g}" width="{right - x:g}" height="{top - y:g}"/>{doors}'
