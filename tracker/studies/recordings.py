"""The opened recordings of a study: their content, fixed parameters, and jobs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from tracker.parameters.catalogue import METHODS, RunParameters
from tracker.parameters.values import changed_values, value_of, with_values
from tracker.runs import pipeline
from tracker.runs.fitting import unfit_methods
from tracker.sequences.errors import SequenceError
from tracker.sequences.library import open_sequence
from tracker.sequences.sequence import Sequence
from tracker.studies import objectives
from tracker.studies.definition import StudyDefinition
from tracker.studies.errors import StudyError
from tracker.studies.jobs import Job, figures_version, job_of
from tracker.studies.objectives import Objective
from tracker.studies.store import JobRow, Store, Writer
from tracker.studies.transfer import content_of


@dataclass(frozen=True, slots=True, eq=False)
class Opened:
    """An opened recording of a study."""

    place: str
    """The name or folder by which the recording is opened."""
    sequence: Sequence
    """The recording."""
    content: str
    """The hash of the recording's files."""
    defaults: RunParameters
    """The default parameters for the recording."""
    base: RunParameters
    """The default parameters with the fixed values of the study; trials change the varied ones."""

    @property
    def has_truth(self) -> bool:
        """Whether the recording has ground truth."""
        return self.sequence.ground_truth is not None

    def to_json(self) -> dict[str, Any]:
        """Return the facts that the study stores, as plain values."""
        return {
            "place": self.place,
            "name": self.sequence.name,
            "content": self.content,
            "has_truth": self.has_truth,
            "frames": self.sequence.frames,
            "cameras": len(self.sequence.views),
        }


@dataclass(frozen=True, slots=True, eq=False)
class Recordings:
    """All recordings of a study, with the objectives and seeds of their runs."""

    every: tuple[Opened, ...]
    """The recordings."""
    objectives: tuple[Objective, ...]
    """The objectives, the most important first."""
    seeds: tuple[int, ...]
    """The seeds of the runs on each recording."""

    @property
    def bases(self) -> list[RunParameters]:
        """The parameters on each recording with the fixed values of the study."""
        return [one.base for one in self.every]

    def jobs(self, values: Mapping[str, Any]) -> list[tuple[JobRow, Job]]:
        """Return the runs of a trial: all recordings with the first seed, then with the next.

        Args:
            values: The varied parameters, by key.
        """
        found = []
        for seed in self.seeds:
            for one in self.every:
                job = self.job(one, values, seed)
                found.append((JobRow(job.key, one.place, seed), job))
        return found

    def job(self, one: Opened, values: Mapping[str, Any], seed: int) -> Job:
        """Return the job of one run.

        Args:
            one: The recording.
            values: The varied parameters, by key.
            seed: The seed of the run.
        """
        parameters = with_values(one.base, values)
        return job_of(
            one.sequence,
            one.place,
            one.content,
            parameters,
            changed_values(parameters, one.defaults),
            seed,
            truth=one.has_truth,
            agreement=any(each.of == "agreement" for each in self.objectives),
            timed=any(each.key == "speed" for each in self.objectives),
        )


def open_recordings(
    definition: StudyDefinition,
    tell: Callable[[str], None] = lambda words: None,
) -> Recordings:
    """Open all recordings of a study.

    Args:
        definition: The study's definition.
        tell: A callback that gets a sentence on what is being done.

    Raises:
        StudyError: If a recording cannot be read, a method cannot track it, or an objective needs
            ground truth that it does not have.
    """
    every = []
    for place in definition.recordings:
        tell(f"opening {place}")
        try:
            sequence = open_sequence(place)
        except (SequenceError, OSError) as error:
            words = " ".join(str(error).split())
            raise StudyError(f"recordings: {place} cannot be read: {words}") from None
        defaults = pipeline.default_parameters(sequence)
        base = with_values(defaults, definition.held())
        _check_methods(definition, sequence, base)
        every.append(Opened(place, sequence, content_of(sequence), defaults, base))
    has_truth = {one.sequence.name: one.has_truth for one in every}
    return Recordings(
        tuple(every), objectives.chosen(definition.objectives, has_truth), definition.seeds
    )


def _check_methods(definition: StudyDefinition, sequence: Sequence, base: RunParameters) -> None:
    """Check that all methods of the trials can track a recording.

    Raises:
        StudyError: If one of them cannot.
    """
    unfit = unfit_methods(sequence, base)
    choices = {one.key: one.choices for one in definition.varied if one.key in METHODS}
    for key in METHODS:
        for name in choices.get(key, (value_of(base, key),)):
            if why := unfit[key].get(name):
                raise StudyError(f"{key} = {name}: {why}")


def check_same(store: Store, writer: Writer, recordings: Recordings) -> None:
    """Check that recordings and code are those of the earlier trials, so that all are comparable.

    At the first start of a study, the facts on its recordings, code and objectives are stored.

    Raises:
        StudyError: If a recording or the code has changed since the study began.
    """
    now, before = [one.to_json() for one in recordings.every], store.fact("recordings")
    if before is None:
        writer.put_facts(
            recordings=now,
            code=figures_version(),
            objectives=[asdict(one) for one in recordings.objectives],
        )
        return
    for one, other in zip(before, now, strict=True):
        if one["content"] != other["content"]:
            raise StudyError(
                f"{other['place']} has changed since the study {store.name} began; its trials "
                "cannot be set beside new ones: give the study a new name"
            )
    if store.fact("code") != figures_version():
        raise StudyError(
            f"the study {store.name} was begun by another version of the program; its trials "
            "cannot be set beside new ones: give the study a new name"
        )
