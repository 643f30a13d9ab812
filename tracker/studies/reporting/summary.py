"""A study as it is read: trials in their order, what is best, what matters, in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from tracker.files.text import shown
from tracker.review.self_consistency.estimate import WARNING
from tracker.studies.defined.definition import Definition
from tracker.studies.defined.objectives import BESIDE, IDENTITY, OBJECTIVES, WITH_TRUTH, Objective
from tracker.studies.errors import StudyError
from tracker.studies.judging import best_of, front_of, usable
from tracker.studies.kept.records import Status, Trial
from tracker.studies.kept.store import Store
from tracker.studies.kept.writer import RESULTS

BETTER_SIGMAS = 2.0
"""A difference within so many standard deviations over the seeds is said to be no sure one."""


@dataclass(frozen=True, slots=True, eq=False)
class Summary:
    """What is told of a study."""

    name: str
    definition: Definition
    status: Status
    objectives: tuple[Objective, ...]
    trials: tuple[Trial, ...]
    best: Trial | None
    """None where none ended. The defaults, where nothing is better."""
    front: list[int]
    """Trials that no other beats in all objectives."""
    importance: list[tuple[str, tuple[float, float]]]
    """Share of the variance of the first objective and its standard deviation, largest first;
    nothing before there are enough trials."""
    importance_trials: int

    @property
    def default(self) -> Trial | None:
        """The trial of the defaults."""
        return next((one for one in self.trials if one.number == 0), None)

    @property
    def defaults(self) -> dict[str, Any]:
        """What the varied parameters are by default."""
        return dict(self.default.values) if self.default is not None else {}

    @property
    def beside(self) -> list[Objective]:
        """Other figures worth a column: those that are known of a trial at least. Studies that
        were run before a figure was kept do not have it."""
        known = {key for trial in self.trials for key in trial.figures}
        return [one for key, one in BESIDE.items() if key in known and one not in self.objectives]

    @property
    def ranked(self) -> list[Trial]:
        """Those that may be taken, the best first."""
        left, found = usable(self.trials), []
        while left and (best := best_of(left, self.objectives)) is not None:
            found.append(best)
            left.remove(best)
        return found

    def changes(self, trial: Trial) -> dict[str, Any]:
        """What a trial has that is not the default."""
        return {k: v for k, v in trial.values.items() if self.defaults.get(k) != v}

    def remark(self, trial: Trial) -> str:
        """What a trial is."""
        words = [trial.words] if trial.words else []
        if self.best is not None and trial.number == self.best.number:
            words.insert(0, "best")
        elif trial.number in self.front and len(self.objectives) > 1:
            words.insert(0, "on the front")
        return ", ".join(words)

    def sentences(self) -> list[str]:
        """What there is to say of it."""
        found = []
        best, default = self.best, self.default
        lead = self.objectives[0]
        if best is not None and default is not None:
            assert best.objectives is not None
            assert default.objectives is not None
            if best.number == 0:
                found.append("the default is as good: nothing better was found")
            else:
                here, there = best.objectives[0], default.objectives[0]
                sure = ""
                spreads = [s for s in (best.spreads[0], default.spreads[0]) if s is not None]
                if spreads and abs(here - there) < BETTER_SIGMAS * max(spreads):
                    sure = ", which is within what the seeds make of it"
                found.append(
                    f"best is trial {best.number}: {lead.name} {lead.words(here, None)}, the "
                    f"default has {lead.words(there, None)}{sure}"
                )
        if self.importance and best is not None:
            key, (share, spread) = self.importance[0]
            found.append(
                f"{key} matters most: {100 * share:.0f} ± {100 * spread:.0f} % of what "
                f"{lead.name} varies"
            )
        if lead.key == IDENTITY.key:
            found.append(f"no truth was looked at. {WARNING.removesuffix('.')}")
        return found


def summary_of(store: Store, before: Summary | None = None) -> Summary:
    """Read a study.

    Args:
        store: Its folder.
        before: As it was read last: what was written since is read alone, so that who looks often
            at a long study does not read all of it each time.

    Raises:
        StudyError: If its files are not as they must be.
    """
    definition, status = store.definition(), store.status()
    if before is not None and (before.definition != definition or status.done < len(before.trials)):
        before = None  # another one of that name
    known = {} if before is None else {one.number: one for one in before.trials}
    news = store.trials(max((one.ended for one in known.values()), default=0.0))
    known |= {one.number: one for one in news}
    trials = [known[number] for number in sorted(known)]
    objectives = objectives_of(store, definition)
    for one in news:
        if one.objectives is not None and len(one.objectives) != len(objectives):
            raise StudyError(
                f"{store.folder / RESULTS}, trial {one.number}, objectives: expected "
                f"{len(objectives)}, found {len(one.objectives)}; start a study of another name"
            )
    same = before is not None and not news and objectives == before.objectives
    importance = store.told("importance") or {"trials": 0, "shares": {}}
    return Summary(
        store.name,
        definition,
        status,
        objectives,
        tuple(trials),
        before.best if same and before is not None else best_of(trials, objectives),
        before.front if same and before is not None else front_of(trials, objectives),
        [(key, (pair[0], pair[1])) for key, pair in importance["shares"].items()],
        importance["trials"],
    )


def objectives_of(store: Store, definition: Definition) -> tuple[Objective, ...]:
    """As they were chosen when it began; before that as its definition has them."""
    told: Sequence[dict[str, Any]] | None = store.told("objectives")
    if told is not None:
        for one in told:
            if one["key"] not in OBJECTIVES:
                raise StudyError(
                    f"{store.folder / RESULTS}, objectives: expected some of "
                    f"{', '.join(OBJECTIVES)}, found {shown(one['key'])}; start a study of "
                    "another name"
                )
        return tuple(OBJECTIVES[one["key"]] for one in told)
    return tuple(OBJECTIVES[key] for key in definition.objectives or WITH_TRUTH)
