"""Merging and splitting: how well objects are followed apart, and found again by their colours."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tests.papers.clips import clip as clips
from tests.papers.clips.association import CLIPS, together
from tests.papers.clips.clip import Clip
from tests.papers.clips.light import Light, light_rows, segment
from tests.papers.laboratory.experiment import Context, Experiment, Finding, Result
from tracker import single_view
from tracker.evaluation.figures import number
from tracker.evaluation.matching import assign
from tracker.geometry.boxes import Boxes
from tracker.parameters.catalogue import PRESETS, RunParameters
from tracker.parameters.values import changed_values, with_values
from tracker.runs.pipeline import Cancelled
from tracker.runs.processes import WorkerControl
from tracker.sequences.pictures.frames import FrameReader
from tracker.single_view.protocol import ViewResult

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SEEDS, QUICK_SEEDS = 10, 1

AROUND = 3
"""Steps before and after people are together at which their ids are compared."""

PUBLISHED, ONE_OBJECT, DEFAULTS = "published", "published, no mean shift", "defaults"

KEPT = 0.9
"""Share of ids that are right after a split from which a method is said to keep them."""

CLAIM = (
    "Two under mild occlusion are followed apart by mean shift, after a split colours find each "
    "person again, and the threshold that adapts holds over a change of light."
)


def methods() -> dict[str, RunParameters]:
    """The ways of tracking that are compared, by name."""
    base = RunParameters(single_view="association_matrix")
    published = with_values(base, PRESETS["published"])
    return {
        PUBLISHED: published,
        ONE_OBJECT: with_values(published, {"association_matrix.follow_mild": False}),
        DEFAULTS: base,
    }


@dataclass(frozen=True, slots=True, eq=False)
class Tracked:
    """What one method made of one clip."""

    errors: Float[ndarray, "T A"]
    """Pixels from each actor's centre to the estimate of his track; NaN where there is none."""
    present: Bool[ndarray, "T A"]
    merged: Bool[ndarray, "T A"]
    """Where he may be one piece of foreground with another."""
    partings: int
    """How often somebody was together with others and alone again."""
    right: int
    """How often his id was the same afterwards."""
    path: Float[ndarray, "E 3"]
    """Step, label and centre x of every estimate."""


def run(context: Context) -> Result:
    """Every method on every clip with every seed, and every threshold over the change of light."""
    seeds = list(range(context.seeds_of(SEEDS, QUICK_SEEDS)))
    items = [(clip, seed) for clip in CLIPS for seed in seeds]
    answers = context.spread(
        _track,
        items,
        words=f"{len(methods())} methods, {len(CLIPS)} clips, {len(seeds)} seeds",
        steps=sum(CLIPS[clip](0).steps for clip, _ in items) * len(methods()),
    )
    tracked: dict[str, dict[str, list[Tracked]]] = {
        clip: {name: [] for name in methods()} for clip in CLIPS
    }
    for (clip, _), answer in zip(items, answers, strict=True):
        for name, one in answer.items():
            tracked[clip][name].append(one)
    measured = {
        clip: {name: summed_up(runs) for name, runs in by_name.items()}
        for clip, by_name in tracked.items()
    }
    light = segment(context, seeds[: 1 if context.quick else 3])
    return Result(
        head=("clip", "method", ">error alone (px)", ">error merged (px)", ">found", ">ids right"),
        rows=(
            *(
                (
                    clip if index == 0 else "",
                    name,
                    *(number(f[key], 2) for key in ("alone", "merged", "found")),
                    f"{f['right']} of {f['partings']}",
                )
                for clip, by_name in measured.items()
                for index, (name, f) in enumerate(by_name.items())
            ),
            *light_rows(light),
        ),
        numbers={
            "seeds": len(seeds),
            "clips": measured,
            "light": light.numbers(),
            "parameters": {name: changed_values(p) for name, p in methods().items()},
        },
        findings=_findings(measured, light),
        figure=lambda: _draw(tracked, measured, light),
        notes=(
            f"Means of {len(seeds)} seeds: pixels from a person's centre to the estimate of his "
            "track, while he is a piece of foreground by himself and while he may be one with "
            "others; share of steps with an estimate; ids that are right again "
            f"{AROUND} steps after a parting.",
            "light: precision, recall and F of the foreground's pixels over a lamp's fading and "
            "return, and F in the worst second; each with the same selective background.",
        ),
    )


def _track(item: tuple[str, int], control: WorkerControl) -> dict[str, Tracked]:
    """Every method on one clip."""
    clip_name, seed = item
    clip, tracked = CLIPS[clip_name](seed), {}
    with tempfile.TemporaryDirectory(prefix="multiview-phd-") as folder:
        sequence = clips.write(clip, Path(folder))
        with FrameReader(sequence) as reader:
            for name, parameters in methods().items():
                method = single_view.create("association_matrix", sequence, 0, parameters, reader)
                state, results = method.start(), []
                for step in range(clip.steps):
                    if control.cancelled():
                        raise Cancelled
                    rng = np.random.default_rng((seed, step))
                    state, result = method.step(state, step, reader.picture(0, step), rng)
                    results.append(result)
                    control.advance(1)
                tracked[name] = compare(clip, results)
    return tracked


def compare(clip: Clip, results: list[ViewResult]) -> Tracked:
    """Set a method's tracks against the truth.

    Somebody who is alone is the track whose estimate is nearest; while he is together
    with others he is the track that he was before. An id is right after a parting if it
    is the one of before.
    """
    boxes = np.array([clip.boxes(step) for step in range(clip.steps)])
    merged = together(clip)
    present = np.isfinite(boxes[:, :, 0]) & _whole(clip, boxes)
    errors = np.full(present.shape, np.nan)
    labels = np.full(present.shape, -1, dtype=np.int64)
    last = np.full(present.shape[1], -1, dtype=np.int64)
    for step, result in enumerate(results):
        alone = np.flatnonzero(present[step] & ~merged[step])
        apart = boxes[step, alone, None, :2] - result.estimates[None, :, :2]
        radii = np.linalg.norm(apart / boxes[step, alone, None, 2:], axis=2)
        rows, columns = assign(radii, 1.0)
        last[alone] = -1
        last[alone[rows]] = result.estimate_labels[columns]
        labels[step] = last
        for actor in np.flatnonzero(present[step]):
            mine = np.flatnonzero(result.estimate_labels == last[actor])
            if last[actor] >= 0 and len(mine):
                off = result.estimates[mine[0], :2] - boxes[step, actor, :2]
                errors[step, actor] = np.hypot(*off)
    partings, right = _partings(labels, present, merged)
    path = [
        [step, label, box[0]]
        for step, result in enumerate(results)
        for label, box in zip(result.estimate_labels, result.estimates, strict=True)
    ]
    return Tracked(errors, present, merged, partings, right, np.array(path).reshape(-1, 3))


def _whole(clip: Clip, boxes: Float[ndarray, "T A 4"]) -> Bool[ndarray, "T A"]:
    """Whether an actor is wholly in the picture."""
    with np.errstate(invalid="ignore"):
        low, high = Boxes(boxes).low, Boxes(boxes).high
        return np.asarray(((low >= 0.0) & (high <= np.array(clip.size) - 1.0)).all(axis=2))


def _partings(
    labels: Int[ndarray, "T A"], present: Bool[ndarray, "T A"], merged: Bool[ndarray, "T A"]
) -> tuple[int, int]:
    """How often somebody was together with others between being alone, and how often his id
    was the same afterwards."""
    partings = right = 0
    steps = len(labels)
    for actor in range(labels.shape[1]):
        inside = np.concatenate([[False], merged[:, actor] & present[:, actor], [False]])
        for first, after in np.flatnonzero(np.diff(inside.astype(int))).reshape(-1, 2).tolist():
            before, later = first - AROUND, after + AROUND - 1
            if before < 0 or later >= steps:
                continue
            alone = present[:, actor] & ~merged[:, actor]
            if not (alone[before:first].all() and alone[after : later + 1].all()):
                continue
            partings += 1
            right += bool(labels[before, actor] >= 0
                          and labels[later, actor] == labels[before, actor])  # fmt: skip
    return partings, right


def summed_up(runs: list[Tracked]) -> dict[str, Any]:
    def mean(chosen: str) -> float | None:
        values = [
            one.errors[one.present & (one.merged if chosen == "merged" else ~one.merged)]
            for one in runs
        ]
        known = np.concatenate(values)
        known = known[np.isfinite(known)]
        return float(known.mean()) if len(known) else None

    present = sum(int(one.present.sum()) for one in runs)
    found = sum(int(np.isfinite(one.errors[one.present]).sum()) for one in runs)
    return {
        "alone": mean("alone"),
        "merged": mean("merged"),
        "found": found / present if present else None,
        "right": sum(one.right for one in runs),
        "partings": sum(one.partings for one in runs),
    }


def _findings(measured: dict[str, dict[str, dict[str, Any]]], light: Light) -> tuple[Finding, ...]:
    apart = {name: figures["merged"] for name, figures in measured["passing"].items()}
    with_it, without = apart[PUBLISHED], apart[ONE_OBJECT]
    better = with_it is not None and without is not None and with_it < without
    findings = [
        Finding(
            "two under mild occlusion are followed apart by mean shift",
            f"centre error while merged {number(with_it, 1)} px, {number(without, 1)} px as one "
            f"object; with the defaults {number(apart[DEFAULTS], 1)} px",
            "better" if better else "worse",
        )
    ]
    for clip, words in (("three", "three merge fully"), ("street", "people come and go")):
        figures, ours = measured[clip][PUBLISHED], measured[clip][DEFAULTS]
        share = figures["right"] / figures["partings"] if figures["partings"] else 0.0
        findings.append(
            Finding(
                f"{words}: after a split each gets his track again",
                f"{figures['right']} of {figures['partings']} ids right; with the defaults "
                f"{ours['right']} of {ours['partings']}",
                "better" if share >= KEPT else "worse",
            )
        )
    return (*findings, light.finding())


def _draw(
    tracked: dict[str, dict[str, list[Tracked]]],
    measured: dict[str, dict[str, dict[str, Any]]],
    light: Light,
) -> Figure:
    from tests.papers.laboratory import drawing

    figure = drawing.sheet(11.0, 6.4, "Merging and splitting: tracks, ids and thresholds")
    layout = [[PUBLISHED, ONE_OBJECT, "errors"], ["street", "street", "light"]]
    plots = drawing.panels(figure, layout, width_ratios=[1.1, 1.1, 1.0])
    for place, clip, name in (
        (PUBLISHED, "passing", PUBLISHED),
        (ONE_OBJECT, "passing", ONE_OBJECT),
        ("street", "street", PUBLISHED),
    ):
        plot, made = plots[place], CLIPS[clip](0)
        for actor in made.actors:
            plot.plot(actor.path[:, 0], color=drawing.MUTED, lw=3.5, alpha=0.35)
        steps, labels, x = tracked[clip][name][0].path.T
        tones = [drawing.colour(int(label) - 1) for label in labels]
        plot.scatter(steps, x, s=3.0, c=tones, linewidths=0)
        plot.set(title=f"{clip}: {name} (truth in grey)", ylabel="x (px)", xlabel="step")
    names = list(methods())
    bars = [(f"{clip}: {name}", measured[clip][name]["merged"], drawing.colour(names.index(name)))
            for clip in measured for name in names]  # fmt: skip
    drawing.bars(plots["errors"], *map(list, zip(*bars, strict=True)), named=True)
    plots["errors"].set_title("error while merged (px), lower is better")
    light.draw(plots["light"])
    return figure


EXPERIMENT = Experiment("association", CLAIM, run)
