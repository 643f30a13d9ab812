"""The foreground's threshold over a change of light: the one that adapts against fixed ones."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray

from tests.papers.clips.association import FULL_LIGHT, coming_and_going, light, true_mask
from tests.papers.laboratory.experiment import Context, Finding
from tracker.evaluation.figures import number
from tracker.parameters.groups.foreground import ForegroundParams
from tracker.runs.pipeline import Cancelled
from tracker.runs.processes import WorkerControl
from tracker.single_view.pictures.adaptive import AdaptiveForeground, first_background

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FIXED = (10.0, 20.0, 30.0, 45.0, 60.0)
"""Grey levels."""

ADAPTIVE, ROBUST = "adaptive", "adaptive, defaults"

EVERY = 2
"""Of so many pictures one is compared with the truth."""


class FixedForeground(AdaptiveForeground):
    """The same background and the same cleaning, with a threshold that stays."""

    def __init__(
        self, first: UInt8[ndarray, "h w 3"], parameters: ForegroundParams, fixed: float
    ) -> None:
        super().__init__(first, parameters)
        self._fixed = np.full(3, fixed)

    def thresholds(self, difference: UInt8[ndarray, "h w 3"]) -> Float[ndarray, " 3"]:
        """The given one."""
        return self._fixed


def models() -> dict[str, float | None]:
    """What is compared, and its threshold where that is fixed."""
    return {ADAPTIVE: None, **{f"fixed {t:g}": t for t in FIXED}, ROBUST: None}


@dataclass(frozen=True, slots=True, eq=False)
class Light:
    """Right, false and missed pixels of every model over the clip."""

    counts: dict[str, Float[ndarray, "T 3"]]
    """By model; of each compared picture, summed over the seeds."""
    fps: float

    def figures(self, name: str) -> dict[str, float]:
        """Precision, recall and F over all pictures, and F in the worst second."""
        right, false, missed = self.counts[name].sum(axis=0)
        return {
            "precision": float(right / max(right + false, 1.0)),
            "recall": float(right / max(right + missed, 1.0)),
            "f": float(2.0 * right / max(2.0 * right + false + missed, 1.0)),
            "worst": float(np.min(self.over_time(name))),
        }

    def over_time(self, name: str) -> Float[ndarray, " T"]:
        """F in a second around each picture."""
        window = np.ones(max(1, round(self.fps / EVERY)))
        right, false, missed = (
            np.convolve(column, window, mode="same") for column in self.counts[name].T
        )
        # where nobody is to be found and nothing is found all is right
        total = 2.0 * right + false + missed
        return np.divide(2.0 * right, total, out=np.ones_like(total), where=total > 0.0)

    def numbers(self) -> dict[str, Any]:
        """As JSON takes them."""
        return {name: self.figures(name) for name in self.counts}

    def finding(self) -> Finding:
        """Whether the threshold that adapts is at least as good as every fixed one."""
        ours = self.figures(ADAPTIVE)
        best = max((f"fixed {t:g}" for t in FIXED), key=lambda name: self.figures(name)["f"])
        theirs = self.figures(best)
        return Finding(
            "the threshold that adapts holds over a change of light better than fixed ones",
            f"F {number(ours['f'], 3)}, in the worst second {number(ours['worst'], 3)}; best fixed "
            f"one ({best.removeprefix('fixed ')} grey levels) {number(theirs['f'], 3)} and "
            f"{number(theirs['worst'], 3)}; defaults {number(self.figures(ROBUST)['f'], 3)}",
            "better" if ours["f"] >= theirs["f"] else "worse",
        )

    def draw(self, axes: Axes) -> None:
        """F over time."""
        from tests.papers.laboratory import drawing

        steps = EVERY * np.arange(len(next(iter(self.counts.values()))))
        for index, name in enumerate((ADAPTIVE, "fixed 20", ROBUST, "fixed 60")):
            axes.plot(steps, self.over_time(name), color=drawing.colour(index), label=name)
        axes.plot(steps, light()[steps], color=drawing.MUTED, ls=":", label="light")
        axes.set(title="F of the foreground, higher is better", xlabel="step", ylim=(0.0, 1.5))
        axes.legend(loc="upper left", ncols=2)


def segment(context: Context, seeds: list[int]) -> Light:
    """Every model over the clip whose light changes."""
    answers = context.spread(
        _segment,
        seeds,
        words=f"{len(models())} thresholds",
        steps=len(light()) * len(seeds),
    )
    counts = {name: np.sum([answer[name] for answer in answers], axis=0) for name in models()}
    return Light(counts, coming_and_going(0).fps)


def _segment(seed: int, control: WorkerControl) -> dict[str, Float[ndarray, "T 3"]]:
    """Right, false and missed pixels of every model."""
    clip = coming_and_going(seed, light())
    published = ForegroundParams(
        model="adaptive", least_threshold=0.0, follow_exposure=False, drop_shadows=False
    )
    # the background is that of full light: nobody knows what is to come
    pictures = [clip.picture(step) for step in range(0, FULL_LIGHT, 2)]
    first = first_background(pictures, follow_exposure=False)
    aligned = first_background(pictures, follow_exposure=True)
    assert first is not None
    assert aligned is not None
    made: dict[str, AdaptiveForeground] = {
        name: AdaptiveForeground(first, published)
        if fixed is None
        else FixedForeground(first, published, fixed)
        for name, fixed in models().items()
    }
    made[ROBUST] = AdaptiveForeground(aligned, ForegroundParams(model="adaptive"))
    states = {name: model.start() for name, model in made.items()}
    rows: dict[str, list[list[int]]] = {name: [] for name in made}
    for step in range(clip.steps):
        if control.cancelled():
            raise Cancelled
        picture = clip.picture(step)
        truth = true_mask(clip, step) if step % EVERY == 0 else None
        for name, model in made.items():
            states[name], found = model.step(states[name], picture)
            if truth is not None:
                mask = found.mask > 0
                rows[name].append(
                    [int((mask & truth).sum()), int((mask & ~truth).sum()),
                     int((~mask & truth).sum())]
                )  # fmt: skip
        control.advance(1)
    return {name: np.array(counted, dtype=float) for name, counted in rows.items()}


def light_rows(found: Light) -> tuple[tuple[str, ...], ...]:
    """Lines of the experiment's table."""
    rows = []
    for index, name in enumerate(found.counts):
        figures = found.figures(name)
        rows.append(
            (
                "light" if index == 0 else "",
                name,
                f"P {number(figures['precision'], 3)}",
                f"R {number(figures['recall'], 3)}",
                f"F {number(figures['f'], 3)}",
                f"worst {number(figures['worst'], 3)}",
            )
        )
    return tuple(rows)
