"""Figure 1: three people in ``room44-3p``, truth and tracks over 1,500 steps."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from tests.papers.laboratory import runs
from tests.papers.laboratory.experiment import Context, Experiment, Finding, Result
from tracker.evaluation import Evaluation, evaluate_sequence
from tracker.evaluation.figures import number
from tracker.evaluation.tables import TrackRow
from tracker.runs.pipeline import Run

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ROOM = "room44-3p"

QUICK_STEPS = 720
"""Enough for all three people, an occlusion, and the armchair."""

ARMCHAIR = (600, 700)
"""Steps around which somebody passes the armchair that has the colours of his clothes."""

FOLLOWED = 0.9
"""Share of the steps from which a person counts as followed."""

LISTED = 6
"""Tracks that the figure's legend names; the table of a report has them all."""

CLAIM = (
    "The tracks follow all three people over 1,500 steps, and the error stays small at steps "
    "600–700, where the background resembles a template."
)


def run(context: Context) -> Result:
    """Track the room once and score it as a whole and around the armchair."""
    sequence = runs.room(context, ROOM, QUICK_STEPS if context.quick else None)
    tracked = runs.computed(context, sequence).run
    whole = evaluate_sequence(sequence, tracked.filtered)
    near = whole.settings.near
    first, last = ARMCHAIR
    rows = []
    people: dict[str, Any] = {}
    for person in whole.people:
        errors = whole.errors[person.id]
        apart = errors[first : last + 1]
        apart = apart[np.isfinite(apart)]
        there = _steps_there(tracked, person.id)
        spent = int(((there >= first) & (there <= last)).sum())
        people[str(person.id)] = {
            "steps": person.steps,
            "found_share": person.found_share,
            "error": person.error,
            "error_95": person.error_95,
            "switches": person.switches,
            "armchair_steps": spent,
            "armchair_tracked_share": len(apart) / spent if spent else None,
            "armchair_error": float(apart.mean()) if len(apart) else None,
            "armchair_error_largest": float(apart.max()) if len(apart) else None,
        }
        figures = people[str(person.id)]
        rows.append(
            (
                f"person {person.id}",
                f"{person.steps}",
                number(person.found_share, 3),
                number(person.error, 3),
                number(person.error_95, 3),
                f"{person.switches}",
                number(figures["armchair_tracked_share"], 3),
                number(figures["armchair_error"], 3),
                number(figures["armchair_error_largest"], 3),
            )
        )
    numbers = {
        "room": ROOM,
        "steps": whole.steps,
        "settings": whole.settings.model_dump(),
        "mota": whole["mota"],
        "idf1": whole["idf1"],
        "people": people,
        "armchair_steps": list(ARMCHAIR),
    }
    return Result(
        head=(
            "", ">steps", f">found within {near:g} m", ">error (m)", ">95 % (m)", ">id switches",
            f">{first}–{last}: tracked", ">error (m)", ">largest (m)",
        ),
        rows=tuple(rows),
        numbers=numbers,
        findings=_findings(people, near),
        figure=lambda: _draw(tracked, whole),
        notes=(f"Errors of pairs: {whole.settings.in_words(('distance', 'gate'))}.",),
    )  # fmt: skip


def _findings(people: dict[str, Any], near: float) -> tuple[Finding, ...]:
    shares = [person["found_share"] for person in people.values()]
    lowest = min(shares, default=0.0)
    followed = len(shares) == 3 and lowest >= FOLLOWED
    apart = [p["armchair_error"] for p in people.values() if p["armchair_error"] is not None]
    kept = [p["armchair_tracked_share"] for p in people.values() if p["armchair_steps"]]
    small = bool(apart) and max(apart) <= near and min(kept) >= FOLLOWED
    return (
        Finding(
            "the tracks follow all three people",
            f"each found within {near:g} m at {100.0 * lowest:.1f} % of the steps or more "
            f"(followed: from {100.0 * FOLLOWED:.0f} %)",
            "better" if followed else "worse",
        ),
        Finding(
            "the error stays small at steps 600–700",
            f"mean error of each person at most {number(max(apart, default=None), 3)} m, tracked "
            f"at {100.0 * min(kept, default=0.0):.1f} % of these steps or more (small: up to "
            f"{near:g} m)",
            "better" if small else "worse",
        ),
    )


def _words(row: TrackRow) -> str:
    of = "nobody" if row.kind == "false" else f"person {row.person}"
    return f"track {row.id}: {of}, {row.steps} step{'' if row.steps == 1 else 's'}"


def _steps_there(run: Run, person: int) -> np.ndarray:
    truth = run.sequence.ground_truth
    assert truth is not None
    return np.asarray(truth.frames[(truth.ids == person) & truth.valid])


def _draw(run: Run, evaluation: Evaluation) -> Figure:
    from tests.papers.laboratory import drawing

    sequence, tracks, truth = run.sequence, run.filtered, run.sequence.ground_truth
    assert truth is not None
    figure = drawing.sheet(
        13.0, 6.6, f"Three people in {sequence.name}: truth (circles) and tracks (lines)"
    )
    axes = drawing.panels(
        figure, [["x", "top"], ["y", "top"], ["z", "top"]], width_ratios=[1.75, 1.0]
    )
    top = axes["top"]
    steps = np.arange(evaluation.steps)
    armchair = (steps >= ARMCHAIR[0]) & (steps <= ARMCHAIR[1])
    for index, name in enumerate("xyz"):
        plot = axes[name]
        drawing.shade(plot, armchair)
        plot.set_ylabel(f"{name} (m)")
        plot.set_xlim(0, evaluation.steps - 1)
        for person in np.unique(truth.ids).tolist():
            rows = truth.ids == person
            drawing.circles(plot, truth.frames[rows], truth.positions[rows, index])
        for track in np.unique(tracks.ids).tolist():
            rows = tracks.ids == track
            time, values = drawing.broken(tracks.frames[rows], tracks.positions[rows, index])
            plot.plot(time, values, color=drawing.colour(track), zorder=3)
        if name != "z":
            plot.tick_params(labelbottom=False)
    axes["x"].set_title(f"shaded: steps {ARMCHAIR[0]}–{ARMCHAIR[1]}, past the armchair")
    axes["z"].set_xlabel("step k")
    for person in np.unique(truth.ids).tolist():
        rows = (truth.ids == person) & (truth.frames % 10 == 0)
        top.plot(
            truth.positions[rows, 0], truth.positions[rows, 1], "o", ms=3.6, mfc="none",
            mec=drawing.MUTED, mew=0.7, ls="none", zorder=2,
        )  # fmt: skip
    longest = sorted(evaluation.tracks, key=lambda row: -row.steps)[:LISTED]
    for row in evaluation.tracks:
        rows = tracks.ids == row.id
        _, x, y = drawing.broken(tracks.frames[rows], *tracks.positions[rows, :2].T)
        top.plot(x, y, color=drawing.colour(row.id), lw=1.1, zorder=3,
                 label=_words(row) if row in longest else None)  # fmt: skip
    low, high = sequence.room.minimum, sequence.room.maximum
    top.set_xlim(low[0] - 0.1, high[0] + 0.1)
    top.set_ylim(low[1] - 0.1, high[1] + 0.1)
    top.set_aspect("equal")
    top.set_title("from above")
    top.set_xlabel("x (m)")
    top.set_ylabel("y (m)")
    others = len(evaluation.tracks) - len(longest)
    top.legend(
        loc="upper center", bbox_to_anchor=(0.5, -0.1), ncols=2,
        title=f"and {others} shorter tracks" if others else None, title_fontsize=8.5,
    )  # fmt: skip
    return figure


EXPERIMENT = Experiment("fig1", CLAIM, run)
