"""Figure 3: the error of each person, two-stage scheme against a single-camera GM-PHD."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from tests.papers.claims.fig1 import QUICK_STEPS, ROOM
from tests.papers.laboratory import runs
from tests.papers.laboratory.experiment import Context, Experiment, Finding, Result, Verdict
from tests.papers.laboratory.noise import NoisyReader
from tests.rooms import read_visibility
from tracker.evaluation import EvaluationSettings, evaluate
from tracker.evaluation.figures import number
from tracker.fusion.trajectories import Trajectories
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.values import changed_values, with_values
from tracker.runs import pipeline
from tracker.runs.processes import WorkerControl
from tracker.sequences.reader import read_sequence
from tracker.sequences.sequence import Sequence

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SEEDS, QUICK_SEEDS = 20, 2

QUICK_RUN_STEPS = 340
"""Of the shortened room: all three people, and an occlusion in both cameras."""

NOISE = 4.0
"""Standard deviation of the noise added to the pictures, grey levels of 0 … 255."""

CLEAR, HALF = 0.9, 0.5
"""Visible shares: from the first on a camera sees a person, below the second hardly."""

LESS = 56.0
"""Per cent less error without occlusion, as claimed."""

TWICE = 1.8
"""From this ratio on the single camera's error is almost twice the scheme's."""

CLAIM = (
    "Without occlusion the two-stage scheme has about 56 % less error than the single-camera "
    "GM-PHD; with occlusion the single camera's error is almost twice the scheme's or more."
)


@dataclass(frozen=True, slots=True, eq=False)
class _Errors:
    """One seed: the error of each person at each step; NaN where there is no pair."""

    scheme: Float[ndarray, "P S"]
    single: Float[ndarray, "C P S"]
    """By each camera alone."""
    others: dict[str, Float[ndarray, "C P S"]]
    """By other ways, in words, for the reader of the table; of each single camera's positions."""


def run(context: Context) -> Result:
    """Track with every seed, by both cameras and by each alone, and set the errors side by side."""
    sequence = runs.room(context, ROOM, QUICK_STEPS if context.quick else None)
    steps = QUICK_RUN_STEPS if context.quick else sequence.frames
    seeds = list(range(context.seeds_of(SEEDS, QUICK_SEEDS)))
    parameters = parameters_of(sequence)
    work = partial(_one_seed, folder=sequence.folder, parameters=parameters, steps=steps)
    answers = context.spread(work, seeds, words=f"{len(seeds)} seeds", steps=steps * len(seeds))
    scheme = np.stack([answer.scheme for answer in answers])
    single = np.stack([answer.single for answer in answers])
    others = {name: np.stack([answer.others[name] for answer in answers])
              for name in answers[0].others}  # fmt: skip
    visible = read_visibility(sequence.folder)[:steps].transpose(2, 1, 0)
    groups = {
        "without occlusion": where_clear(visible),
        "with occlusion": where_occluded(visible, CLEAR),
        "more than half hidden": where_occluded(visible, HALF),
    }
    rows, measured = [], {}
    for name, where in groups.items():
        figures = compare(scheme, single, where)
        measured[name] = figures
        figures["others"] = {
            words: {"error": _mean(errors[:, where]), "found": _share(errors[:, where])}
            for words, errors in others.items()
        }
        rows.append(
            (
                name,
                f"{figures['positions']}",
                number(figures["scheme"], 3),
                number(figures["single"], 3),
                f"{number(figures['less'], 0)} %",
                number(figures["ratio"], 2),
                f"{number(figures['scheme_found'], 3)} / {number(figures['single_found'], 3)}",
                f"{number(figures['scheme_all'], 3)} / {number(figures['single_all'], 3)}",
            )
        )
    settings = EvaluationSettings()
    numbers = {
        "room": ROOM,
        "steps": steps,
        "seeds": len(seeds),
        "noise": NOISE,
        "settings": settings.model_dump(),
        "parameters": changed_values(parameters),
        "groups": measured,
        "people": over_time(scheme, single),
    }
    return Result(
        head=(
            "", ">positions", ">two cameras (m)", ">one camera (m)", ">less error", ">ratio",
            ">found, two / one", ">missed at the gate (m), two / one",
        ),
        rows=tuple(rows),
        numbers=numbers,
        findings=_findings(measured),
        figure=lambda: _draw(scheme, single, visible),
        notes=(
            f"{len(seeds)} seeds of the samples and of picture noise (σ {NOISE:g} of 255); the "
            "single camera is each of the two in turn, with the same boxes.",
            f"Errors of pairs: {settings.in_words(('distance', 'gate'))}; in the last column a "
            "missed person counts as an error of the gate.",
            *(_other(words, measured) for words in others),
            f"Without occlusion: both cameras see {100 * CLEAR:.0f} % of the person or more; with: "
            f"the single camera sees less; more than half hidden: less than {100 * HALF:.0f} %.",
        ),
    )  # fmt: skip


def parameters_of(sequence: Sequence) -> RunParameters:
    """The defaults, with the fusion of the claim; one camera alone cannot triangulate births."""
    changes = {"fusion_method": "sequential_phd"}
    defaults = pipeline.default_parameters(sequence)
    if defaults.fusion.birth == "measurements":
        changes["fusion.birth"] = "both"
    return with_values(defaults, changes)


def _one_seed(
    seed: int, control: WorkerControl, *, folder: Path, parameters: RunParameters, steps: int
) -> _Errors:
    sequence = read_sequence(folder)
    with NoisyReader(sequence, sigma=NOISE, seed=seed) as reader:
        tracked = runs.tracked(sequence, parameters, control, seed=seed, steps=steps, reader=reader)

    def alone(values: RunParameters) -> Float[ndarray, "C P S"]:
        each = [
            runs.fused_again(tracked, [camera], values) for camera in range(len(sequence.views))
        ]
        return np.stack([_errors(sequence, tracks, steps) for tracks in each])

    others = {
        f"one camera that measures {words}": alone(
            with_values(parameters, {"fusion.measurement": measurement})
        )
        for measurement, words in (("centre", "the boxes' centres"), ("box", "whole boxes"))
        if measurement != parameters.fusion.measurement
    }
    default = pipeline.default_parameters(sequence)
    if default.fusion_method != parameters.fusion_method:
        both = runs.fused_again(tracked, range(len(sequence.views)), default)
        errors = _errors(sequence, both, steps)
        others[f"two cameras by the default, {default.fusion_method}"] = np.stack(
            [errors] * len(sequence.views)
        )
    return _Errors(_errors(sequence, tracked.filtered, steps), alone(parameters), others)


def _errors(sequence: Sequence, tracks: Trajectories, steps: int) -> Float[ndarray, "P S"]:
    truth = sequence.ground_truth
    assert truth is not None
    errors = evaluate(truth, tracks, steps=steps).errors
    nobody = np.full(steps, np.nan)
    return np.stack([errors.get(person, nobody) for person in np.unique(truth.ids).tolist()])


def where_clear(visible: Float[ndarray, "C P S"]) -> Bool[ndarray, "C P S"]:
    """For every single camera: positions that no camera has trouble to see."""
    return np.broadcast_to((visible >= CLEAR).all(axis=0), visible.shape)


def where_occluded(visible: Float[ndarray, "C P S"], share: float) -> Bool[ndarray, "C P S"]:
    """For every single camera: positions of which it sees less than a share."""
    return np.asarray(visible < share)


def compare(
    scheme: Float[ndarray, "N P S"],
    single: Float[ndarray, "N C P S"],
    where: Bool[ndarray, "C P S"],
) -> dict[str, Any]:
    """Mean errors at the chosen positions, over seeds and single cameras."""
    gate = EvaluationSettings().gate
    both = np.broadcast_to(scheme[:, None], single.shape)[:, where]
    alone = single[:, where]
    two, one = _mean(both), _mean(alone)
    return {
        "positions": int(where.any(axis=0).sum()),
        "scheme": two,
        "single": one,
        "less": 100.0 * (1.0 - two / one) if two and one else None,
        "ratio": one / two if two and one else None,
        "scheme_found": _share(both),
        "single_found": _share(alone),
        "scheme_all": _mean(np.nan_to_num(both, nan=gate)),
        "single_all": _mean(np.nan_to_num(alone, nan=gate)),
    }


def _mean(values: ndarray) -> float | None:
    finite = values[np.isfinite(values)]
    return float(finite.mean()) if len(finite) else None


def _share(values: ndarray) -> float | None:
    return float(np.isfinite(values).mean()) if values.size else None


def _other(words: str, measured: dict[str, dict[str, Any]]) -> str:
    """A line for those who ask how another way does."""
    parts = []
    for name, figures in measured.items():
        other = figures["others"][words]
        parts.append(f"{name} {number(other['error'], 3)} m (found {_percent(other['found'])})")
    return f"{words[0].upper()}{words[1:]}: {', '.join(parts)}."


def _findings(measured: dict[str, dict[str, Any]]) -> tuple[Finding, ...]:
    clear, hidden, half = measured.values()
    less, ratio = clear["less"], hidden["ratio"]

    def verdict(holds: bool) -> Verdict:
        return "better" if holds else "worse"

    return (
        Finding(
            f"without occlusion about {LESS:.0f} % less error than a single camera",
            f"{number(less, 0)} % less ({number(clear['scheme'], 3)} m against "
            f"{number(clear['single'], 3)} m, found at {_percent(clear['scheme_found'])} against "
            f"{_percent(clear['single_found'])} of these positions)",
            verdict(less is not None and round(less) >= LESS),
        ),
        Finding(
            "with occlusion the single camera's error is almost twice the scheme's or more",
            f"{number(ratio, 2)} times ({number(hidden['single'], 3)} m against "
            f"{number(hidden['scheme'], 3)} m, found at {_percent(hidden['single_found'])} against "
            f"{_percent(hidden['scheme_found'])} of these positions); where more than half is "
            f"hidden {number(half['ratio'], 2)} times",
            verdict(ratio is not None and ratio >= TWICE),
        ),
    )


def _percent(share: float | None) -> str:
    return "–" if share is None else f"{100.0 * share:.0f} %"


def over_time(scheme: Float[ndarray, "N P S"], single: Float[ndarray, "N C P S"]) -> list[Any]:
    """For every person the mean error over the seeds at each step."""
    people = []
    for person in range(scheme.shape[1]):
        two, one = (
            _means(scheme[:, person]),
            _means(single[:, :, person].reshape(-1, len(scheme[0, 0]))),
        )
        people.append(
            {
                "person": person + 1,
                "scheme": [None if v != v else round(v, 4) for v in two.tolist()],
                "single": [None if v != v else round(v, 4) for v in one.tolist()],
            }
        )
    return people


def _means(values: Float[ndarray, "N S"]) -> Float[ndarray, " S"]:
    """Of each step, over what is there; NaN where nothing is."""
    there = np.isfinite(values)
    count = there.sum(axis=0)
    total = np.where(there, values, 0.0).sum(axis=0)
    return np.asarray(np.where(count > 0, total / np.maximum(count, 1), np.nan))


def _draw(
    scheme: Float[ndarray, "N P S"],
    single: Float[ndarray, "N C P S"],
    visible: Float[ndarray, "C P S"],
) -> Figure:
    from tests.papers.laboratory import drawing

    people, steps = scheme.shape[1:]
    figure = drawing.sheet(
        13.0, 2.05 * people + 0.9,
        f"Position error in {ROOM}: two cameras against one, {len(scheme)} seeds",
    )  # fmt: skip
    axes = drawing.panels(figure, [[f"{person}"] for person in range(people)])
    time = np.arange(steps)
    first = int(np.isfinite(visible).any(axis=(0, 1)).argmax())
    for person in range(people):
        plot = axes[f"{person}"]
        drawing.shade(plot, np.asarray((visible[:, person] < CLEAR).any(axis=0)))
        one = single[:, :, person].reshape(-1, steps)
        for values, tone, words, order in (
            (one, drawing.MUTED, "one camera alone (mean of the two)", 2),
            (scheme[:, person], drawing.colour(person + 1), "two-stage scheme, both cameras", 3),
        ):
            low, high = _band(values)
            plot.fill_between(time, low, high, color=tone, alpha=0.18, lw=0, zorder=order)
            plot.plot(time, _means(values), color=tone, zorder=order, label=words)
        plot.set_xlim(first, steps - 1)
        plot.set_ylim(0.0, 1.0)
        plot.set_ylabel("error (m)")
        plot.set_title(f"person {person + 1}")
        plot.legend(loc="lower right", ncols=2, bbox_to_anchor=(1.0, 0.97))
        if person < people - 1:
            plot.tick_params(labelbottom=False)
    axes[f"{people - 1}"].set_xlabel(
        f"step k · line: mean over the seeds, band: 10–90 % · shaded: a camera sees less than "
        f"{100 * CLEAR:.0f} % of the person"
    )
    return figure


def _band(values: Float[ndarray, "N S"]) -> tuple[ndarray, ndarray]:
    """10 and 90 % of what is there at each step."""
    low, high = np.full(values.shape[1], np.nan), np.full(values.shape[1], np.nan)
    there = np.isfinite(values).any(axis=0)
    low[there], high[there] = np.nanpercentile(values[:, there], [10.0, 90.0], axis=0)
    return low, high


EXPERIMENT = Experiment("fig3", CLAIM, run)
