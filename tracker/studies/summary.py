"""The summary of a study: trials, the best one, the importance of parameters, sentences, and the
commands that repeat a trial."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tracker.files.text import shown
from tracker.parameters.values import changed_values, with_values
from tracker.review.self_consistency.estimate import WARNING
from tracker.runs import pipeline
from tracker.runs.track_command import track_command
from tracker.sequences.library import open_sequence
from tracker.studies.definition import StudyDefinition
from tracker.studies.errors import StudyError
from tracker.studies.judging import best_of, front_of, usable
from tracker.studies.objectives import (
    BESIDE,
    IDENTITY,
    OBJECTIVES,
    WITH_TRUTH,
    Objective,
)
from tracker.studies.store import RESULTS, JobRow, Status, Store, Trial

BETTER_SIGMAS = 2.0
"""Number of standard deviations over the seeds below which a difference is described as
uncertain."""


@dataclass(frozen=True, slots=True, eq=False)
class Summary:
    """The summary of a study."""

    name: str
    """The name of the study."""
    definition: StudyDefinition
    """The definition of the study."""
    status: Status
    """The status of the study."""
    objectives: tuple[Objective, ...]
    """The objectives, the most important first."""
    trials: tuple[Trial, ...]
    """The trials that have ended, by number."""
    best: Trial | None
    """The best trial, which is that of the defaults if none is better; None if none is complete and
    not vetoed."""
    front: list[int]
    """The numbers of the trials on the Pareto front."""
    importance: list[tuple[str, tuple[float, float]]]
    """The key of each parameter with its share of the variance of the first objective and the
    standard deviation of the share, largest first; empty before there are enough trials."""
    importance_trials: int
    """The number of trials that the importance is estimated from."""

    @property
    def default(self) -> Trial | None:
        """The trial of the defaults; None if it has not ended."""
        return next((one for one in self.trials if one.number == 0), None)

    @property
    def defaults(self) -> dict[str, Any]:
        """The default values of the varied parameters, by key."""
        return dict(self.default.values) if self.default is not None else {}

    @property
    def beside(self) -> list[Objective]:
        """The figures that are shown besides the objectives: those that at least one trial has.
        Studies of earlier versions may lack some."""
        known = {key for trial in self.trials for key in trial.figures}
        return [one for key, one in BESIDE.items() if key in known and one not in self.objectives]

    @property
    def ranked(self) -> list[Trial]:
        """The trials that are complete and not vetoed, the best first."""
        left, found = usable(self.trials), []
        while left and (best := best_of(left, self.objectives)) is not None:
            found.append(best)
            left.remove(best)
        return found

    def changes(self, trial: Trial) -> dict[str, Any]:
        """Return the values of a trial that differ from the defaults, by key."""
        return {k: v for k, v in trial.values.items() if self.defaults.get(k) != v}

    def remark(self, trial: Trial) -> str:
        """Return the remark on a trial, for instance that it is the best."""
        words = [trial.words] if trial.words else []
        if self.best is not None and trial.number == self.best.number:
            words.insert(0, "best")
        elif trial.number in self.front and len(self.objectives) > 1:
            words.insert(0, "on the front")
        return ", ".join(words)

    def sentences(self) -> list[str]:
        """Return the main results as sentences without full stops."""
        found = [*self.definition.notes]
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
    """Read the summary of a study.

    Args:
        store: The folder of the study.
        before: An earlier summary, to which only new trials are added, so that reading a long
            study repeatedly is fast.

    Raises:
        StudyError: If the study's files are not valid.
    """
    definition, status = store.definition(), store.status()
    if before is not None and (before.definition != definition or status.done < len(before.trials)):
        before = None  # the study was replaced by another one of the same name
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
    importance = store.fact("importance") or {"trials": 0, "shares": {}}
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


def objectives_of(store: Store, definition: StudyDefinition) -> tuple[Objective, ...]:
    """Return the objectives that were stored when the study began, or else those of its
    definition."""
    stored: Sequence[dict[str, Any]] | None = store.fact("objectives")
    if stored is not None:
        for one in stored:
            if one["key"] not in OBJECTIVES:
                raise StudyError(
                    f"{store.folder / RESULTS}, objectives: expected some of "
                    f"{', '.join(OBJECTIVES)}, found {shown(one['key'])}; start a study of "
                    "another name"
                )
        return tuple(OBJECTIVES[one["key"]] for one in stored)
    return tuple(OBJECTIVES[key] for key in definition.objectives or WITH_TRUTH)


def track_commands(definition: StudyDefinition, trial: Trial) -> list[str]:
    """Return the ``track`` command of each run of a trial.

    Args:
        definition: The definition of the study.
        trial: The trial.

    Raises:
        SequenceError: If a recording cannot be read.
    """
    return [
        track_command(
            row.recording, _output_of(definition, trial, row),
            changes_of(definition, trial, row.recording), row.seed, "--no-corrections",
        )
        for row in trial.jobs
    ]  # fmt: skip


def changes_of(definition: StudyDefinition, trial: Trial, recording: str) -> dict[str, Any]:
    """Return the values of a trial that differ from the recording's defaults, by key.

    Args:
        definition: The definition of the study.
        trial: The trial.
        recording: The name or folder of the recording.
    """
    defaults = pipeline.default_parameters(open_sequence(recording))
    values = trial.values if trial.number else {}
    return changed_values(with_values(defaults, {**definition.held(), **values}), defaults)


def _output_of(definition: StudyDefinition, trial: Trial, row: JobRow) -> str:
    name = f"{definition.name} trial {trial.number} {Path(row.recording).name} seed {row.seed}"
    return f"{name.replace(' ', '-')}.csv"
