"""The recordings of a study, opened: their content, what is held on each, and their jobs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from tracker.parameters import METHODS, RunParameters, changed, value, with_values
from tracker.runs import pipeline
from tracker.runs.fitting import unfit_methods
from tracker.sequences.errors import SequenceError
from tracker.sequences.library import open_sequence
from tracker.sequences.sequence import Sequence
from tracker.studies.defined import objectives
from tracker.studies.defined.definition import Definition
from tracker.studies.defined.objectives import Objective
from tracker.studies.errors import StudyError
from tracker.studies.kept.records import JobRow
from tracker.studies.kept.store import Store
from tracker.studies.kept.writer import Writer
from tracker.studies.work.jobs import Job, code_version, job_of
from tracker.studies.work.recordings import content_of


@dataclass(frozen=True, slots=True, eq=False)
class Opened:
    """One recording."""

    place: str
    """What opens it: a room's name, or a folder."""
    sequence: Sequence
    content: str
    """Hash of its files."""
    defaults: RunParameters
    base: RunParameters
    """What is held on it."""

    @property
    def has_truth(self) -> bool:
        """Whether it can be scored."""
        return self.sequence.ground_truth is not None

    def told(self) -> dict[str, Any]:
        """What is written down of it."""
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
    """All of a study, and what is asked of each run."""

    every: tuple[Opened, ...]
    objectives: tuple[Objective, ...]
    seeds: tuple[int, ...]

    @property
    def bases(self) -> list[RunParameters]:
        """What is held on each."""
        return [one.base for one in self.every]

    def jobs(self, values: Mapping[str, Any]) -> list[tuple[JobRow, Job]]:
        """The runs of a trial: all recordings with the first seed, then with the next.

        Args:
            values: Of what is varied.
        """
        found = []
        for seed in self.seeds:
            for one in self.every:
                job = self.job(one, values, seed)
                found.append((JobRow(job.key, one.place, seed), job))
        return found

    def job(self, one: Opened, values: Mapping[str, Any], seed: int) -> Job:
        """One run."""
        parameters = with_values(one.base, values)
        return job_of(
            one.sequence,
            one.place,
            one.content,
            parameters,
            changed(parameters, one.defaults),
            seed,
            truth=one.has_truth,
            agreement=any(each.of == "agreement" for each in self.objectives),
            timed=any(each.key == "speed" for each in self.objectives),
        )

    def parameters(self, place: str, values: Mapping[str, Any]) -> RunParameters:
        """What a trial was run with on a recording."""
        one = next(each for each in self.every if each.place == place)
        return with_values(one.base, values)


def open_recordings(
    definition: Definition,
    tell: Callable[[str], None] = lambda words: None,
) -> Recordings:
    """Open all recordings of a study.

    Args:
        definition: Of the study.
        tell: Told what is being waited for.

    Raises:
        StudyError: If one cannot be read, its method cannot work on it, or an objective needs a
            truth that it does not have.
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


def _check_methods(definition: Definition, sequence: Sequence, base: RunParameters) -> None:
    unfit = unfit_methods(sequence, base)
    choices = {one.key: one.choices for one in definition.varied if one.key in METHODS}
    for key in METHODS:
        for name in choices.get(key, (value(base, key),)):
            if why := unfit[key].get(name):
                raise StudyError(f"{key} = {name}: {why}")


def check_same(store: Store, writer: Writer, recordings: Recordings) -> None:
    """Old trials stand beside new ones only where nothing but the values differs.

    The first time it is written down what they are of.

    Raises:
        StudyError: If a recording or the code is another than when the study began.
    """
    now, before = [one.told() for one in recordings.every], store.told("recordings")
    if before is None:
        writer.tell("recordings", now)
        writer.tell("code", code_version())
        writer.tell("objectives", [asdict(one) for one in recordings.objectives])
        return
    for one, other in zip(before, now, strict=True):
        if one["content"] != other["content"]:
            raise StudyError(
                f"{other['place']} has changed since the study {store.name} began; its trials "
                "cannot be set beside new ones: give the study a new name"
            )
    if store.told("code") != code_version():
        raise StudyError(
            f"the study {store.name} was begun by another version of the program; its trials "
            "cannot be set beside new ones: give the study a new name"
        )
