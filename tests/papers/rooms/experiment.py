"""The experiment ``rooms``: every method in as many random rooms as asked for."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tests.papers.laboratory.experiment import Context, Experiment, Finding, Result, Unavailable
from tests.papers.rooms.cases import Case, Item, cases, key_of, measure, steps_of
from tests.papers.rooms.causes import causes_of, worst_of
from tests.papers.rooms.kept import read_rows
from tracker.evaluation import EvaluationSettings
from tracker.evaluation.figures import number
from tracker.parameters.catalogue import DEFAULT_CANDIDATES, METHODS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CLAIM = "People are found in rooms that nothing was tuned for, with templates and without."

ASKED = {True: (0.95, 0.70, 0.05, 0.3), False: (0.80, 0.45, 0.1, 0.5)}
"""With templates and without: found at least, in the median room and in nine tenths of the
rooms; and false tracks a step at most, likewise."""

QUICK_ROOMS, QUICK_STEPS = 1, 25
_SHOWN_CAUSES = 4


def run(context: Context) -> Result:
    """Measure what no earlier start has measured, and sum up."""
    chosen = _chosen(context)
    count = QUICK_ROOMS if context.quick else context.rooms.count
    steps = QUICK_STEPS if context.quick else None
    seeds = range(context.rooms.first, context.rooms.first + count)
    keys = {case: key_of(case, steps) for case in chosen}
    rows = read_rows(context.output)
    with tempfile.TemporaryDirectory(prefix="random-rooms-") as scratch:
        keep = context.rooms.keep and context.output is not None
        place = context.output / "rooms" if keep and context.output is not None else Path(scratch)
        items = []
        for seed in seeds:
            missing = tuple((c, key) for c, key in keys.items() if (seed, key) not in rows)
            if missing:
                items.append(Item(seed, missing, place / f"{seed}", keep, context.output, steps))
        total = sum(steps_of(item) for item in items)
        for some in context.spread(measure, items, words="random rooms", steps=total):
            rows |= {(row["seed"], row["key"]): row for row in some}
    return _summed_up({c: [rows[seed, key] for seed in seeds] for c, key in keys.items()}, seeds)


def _chosen(context: Context) -> tuple[Case, ...]:
    wanted = context.rooms.methods
    unknown = [name for name in wanted if name not in METHODS["single_view"]]
    if unknown:
        raise Unavailable(
            f"there is no single-view method {unknown[0]!r}; expected some of "
            f"{', '.join(METHODS['single_view'])}"
        )
    if context.rooms.first < 0 or context.rooms.count < 1:
        raise Unavailable(
            "expected a count of at least 1 and a first seed from 0, got "
            f"{context.rooms.count} and {context.rooms.first}"
        )
    return tuple(case for case in cases() if not wanted or case.method in wanted)


def _spread_of(rows: list[dict[str, Any]], key: str, worst: float) -> tuple[float, float]:
    """The median, and what one room in ten does not reach."""
    values = [row[key] for row in rows if row[key] is not None]
    if not values:
        return float("nan"), float("nan")
    return float(np.median(values)), float(np.quantile(values, worst))


def _summed_up(found: dict[Case, list[dict[str, Any]]], seeds: range) -> Result:
    table, notes, numbers = [], [], {}
    for case, rows in found.items():
        cells, figures = [], {}
        for key, worst in (
            ("found_share", 0.1), ("false_per_step", 0.9), ("position_error", 0.9), ("idf1", 0.1)
        ):  # fmt: skip
            median, tenth = _spread_of(rows, key, worst)
            cells += [_shown(median), _shown(tenth)]
            figures[key] = {"median": _plain(median), "worst_tenth": _plain(tenth)}
        timed = [row["steps"] / row["seconds"] for row in rows if row["seconds"]]
        speed = float(np.median(timed)) if timed else None
        table.append((case.method, "yes" if case.templates else "no", *cells, number(speed, 0)))
        causes = causes_of(rows)
        worst_rooms = worst_of(rows)
        notes.append(_worst_in_words(case, rows))
        numbers[case.name] = figures | {
            "steps_per_second": speed,
            "worst": [row["seed"] for row in worst_rooms],
            "causes": [
                {
                    "name": c.name, "value": c.value, "rooms": c.rooms, "of_the_worst": c.worst,
                    "found_median": c.found, "found_median_elsewhere": _plain(c.elsewhere),
                }
                for c in causes
            ],
            "rooms": [{k: v for k, v in row.items() if k not in ("causes", "key")}
                for row in rows
            ],
        }  # fmt: skip
    settings = EvaluationSettings()
    notes.append(
        f"Rooms {seeds.start} to {seeds.stop - 1}; a tenth: the value that one room in ten does "
        f"not reach; found and false {settings.in_words(('near',))}; IDF1 "
        f"{settings.in_words(('distance', 'gate'))}. Default parameters, seed 0. "
        f"`python -m tests.rooms random-SEED -o FOLDER` makes any of the rooms again."
    )
    return Result(
        head=(
            "single view", "templates", ">found", ">tenth", ">false/step", ">tenth", ">error (m)",
            ">tenth", ">IDF1", ">tenth", ">steps/s",
        ),
        rows=tuple(table),
        numbers={"first": seeds.start, "count": len(seeds), "cases": numbers},
        findings=_findings(found),
        figure=lambda: _draw(found),
        notes=tuple(notes),
    )  # fmt: skip


def _shown(value: float) -> str:
    return number(_plain(value), 3)


def _plain(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _worst_in_words(case: Case, rows: list[dict[str, Any]]) -> str:
    worst = worst_of(rows)
    seeds = ", ".join(f"{row['seed']} ({number(row['found_share'] or 0.0, 2)})" for row in worst)
    words = [
        f"{cause.name} {cause.value} {cause.worst} of {len(worst)} "
        f"({cause.rooms} of {len(rows)} in all)"
        for cause in causes_of(rows)[:_SHOWN_CAUSES]
        if cause.worst * len(rows) > cause.rooms * len(worst)
    ]
    more = f"; more often there: {', '.join(words)}" if words else ""
    return f"{case.name}, worst rooms by seed (found): {seeds}{more}."


def _findings(found: dict[Case, list[dict[str, Any]]]) -> tuple[Finding, ...]:
    """Of the method on pictures that a recording gets by itself, with templates and without; where
    it can do nothing without them, of the one that finds most."""
    findings = []
    for templates in (True, False):
        judged = [
            case
            for case, rows in found.items()
            if rows and case.templates == templates and case.on_pictures
        ]
        if not judged:
            continue
        usual = [case for name in DEFAULT_CANDIDATES for case in judged if case.method == name]
        best = max(judged, key=lambda case: _spread_of(found[case], "found_share", 0.1)[0])
        default = usual[0] if usual else best
        least, least_tenth, most, most_tenth = ASKED[templates]
        shares = _spread_of(found[default], "found_share", 0.1)
        false = _spread_of(found[default], "false_per_step", 0.9)
        good = shares[0] >= least and shares[1] >= least_tenth
        good = good and false[0] <= most and false[1] <= most_tenth
        findings.append(
            Finding(
                f"{default.name}: found ≥ {least:g} and in nine tenths of the rooms ≥ "
                f"{least_tenth:g}, false a step ≤ {most:g} and ≤ {most_tenth:g}",
                f"found {_shown(shares[0])} and {_shown(shares[1])}, false a step "
                f"{_shown(false[0])} and {_shown(false[1])}",
                "better" if good else "worse",
            )
        )
    return tuple(findings)


def _draw(found: dict[Case, list[dict[str, Any]]]) -> Figure:
    from tests.papers.laboratory import drawing

    figure = drawing.sheet(11.0, 4.6, "Random rooms, from the worst to the best")
    words = {"found_share": "found", "false_per_step": "false a step, lower is better",
             "idf1": "IDF1"}  # fmt: skip
    plots = drawing.panels(figure, [list(words)])
    methods = list(dict.fromkeys(case.method for case in found))
    for key, plot in plots.items():
        for case, rows in found.items():
            values = sorted(row[key] for row in rows if row[key] is not None)
            if key == "false_per_step":
                values = values[::-1]
            plot.plot(
                np.linspace(0.0, 100.0, len(values)) if len(values) > 1 else [50.0] * len(values),
                values,
                color=drawing.colour(methods.index(case.method)),
                linestyle="-" if case.templates else "--",
                label=case.name,
            )
        plot.set_title(words[key])
        plot.set_xlabel("rooms, %")
    plots["false_per_step"].set_ylim(0.0, 2.0)
    plots["idf1"].legend(fontsize=7)
    return figure


EXPERIMENT = Experiment("rooms", CLAIM, run)
