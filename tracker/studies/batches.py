"""Batches: many recordings are tracked with the same parameters, and the library stores every run.

Runs that the library has already are not computed again. Each recording's corrections are applied,
as in a single run.
"""

from __future__ import annotations

import glob
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from tracker.corrections.log import place_of, read_log
from tracker.files.text import not_utf_8
from tracker.library.keeping import record_of_recording
from tracker.library.records import KeptRun
from tracker.library.store import Library
from tracker.parameters.values import changed_values, with_values
from tracker.runs import pipeline
from tracker.sequences.errors import SequenceError
from tracker.sequences.library import open_sequence
from tracker.studies import definition
from tracker.studies.cluster import Crew
from tracker.studies.errors import StudyError
from tracker.studies.jobs import job_of
from tracker.studies.transfer import content_of

WAIT_SECONDS = 0.5
"""Longest wait for an outcome before cancellation is checked, seconds."""


@dataclass(frozen=True, slots=True)
class BatchRun:
    """One run of a batch, or the reason why it failed."""

    recording: str
    """The name or folder of the recording."""
    seed: int
    """The seed of the run."""
    run: KeptRun | None
    """The stored run; None if it failed."""
    words: str = ""
    """The reason of a failure."""
    computed: bool = False
    """Whether the run was computed now, rather than found in the library."""


def places_of(names: Sequence[str]) -> list[str]:
    """Return the built-in recordings and the absolute folders that names refer to, without
    duplicates.

    A name that matches nothing is returned as it is: the batch reports why it cannot be opened.

    Args:
        names: Names of built-in recordings, folders, patterns of folders, or ``@FILE`` for a file
            with one of these on each line.

    Raises:
        StudyError: If a file of names cannot be read.
    """
    found: list[str] = []
    for name in _without_lists(names):
        try:
            found += definition.places_of([name], Path.cwd())
        except StudyError:
            found.append(name)
    return list(dict.fromkeys(found))


def _without_lists(names: Sequence[str], files: tuple[Path, ...] = ()) -> Iterator[str]:
    """Yield names, and those in files that are named by ``@FILE``.

    Args:
        names: The names.
        files: The file that has the names, and those that name it.
    """
    for name in names:
        if not name.startswith("@"):
            yield name
            continue
        file = Path(name[1:]).absolute()
        if file in files:
            raise StudyError(
                f"{files[0]}: expected recordings, found {name}, which names this file; take it out"
            )
        yield from _without_lists(_listed(file), (file, *files))


def _listed(file: Path) -> list[str]:
    """Return the names in a file, without empty lines and comments.

    Relative folders, patterns and files refer to the folder of the file; if there are none, to the
    working folder.
    """
    try:
        lines = file.read_text(encoding="utf-8").splitlines()
    except UnicodeDecodeError as error:
        raise StudyError(f"{file}, {not_utf_8(error)}") from None
    except OSError as error:
        raise StudyError(
            f"{file}: cannot be read ({error.strerror}); name a file with a recording a line"
        ) from None
    words = [line.strip() for line in lines]
    return [_beside(file.parent, word) for word in words if word and not word.startswith("#")]


def _beside(folder: Path, name: str) -> str:
    """Return a name as a path in a folder if there is such a path; else the name."""
    at = "@" if name.startswith("@") else ""
    path = str(folder / name.removeprefix("@"))
    return at + path if os.path.exists(path) or glob.glob(path) else name


def run_batch(
    places: Sequence[str],
    changes: Mapping[str, Any],
    seeds: int,
    library: Library,
    budget: int,
    crew: Callable[[], Crew],
    on_progress: Callable[[int, int], None] = lambda done, total: None,
    stopped: Callable[[], bool] = lambda: False,
    *,
    corrected: bool = True,
) -> list[BatchRun]:
    """Track recordings, and store every run when it ends.

    A recording that cannot be read or tracked is reported and does not affect the others.

    Args:
        places: Names of built-in recordings, and folders.
        changes: Values by key that differ from each recording's defaults.
        seeds: The number of runs of each recording.
        library: The library that stores the runs; runs that it has already, with final figures,
            are not computed again.
        budget: Largest number of unmarked runs that the library keeps.
        crew: A function that starts the workers; it is called once there is something to compute.
        on_progress: A callback that gets the number of runs done, and the number of all.
        stopped: A callback that returns whether to stop; it is called every half second, and the
            runs so far are then returned.
        corrected: Whether each recording's corrections are applied.

    Raises:
        StudyError: If the workers cannot continue.
        LibraryError: If a run cannot be stored.
    """
    found: dict[tuple[str, int], BatchRun] = {}
    wanted: dict[str, list[tuple[str, int]]] = {}
    jobs = []
    keys: dict[tuple[str, int], str] = {}
    total = len(places) * seeds
    for place in places:
        try:
            sequence = open_sequence(place)
            defaults = pipeline.default_parameters(sequence)
            parameters = with_values(defaults, changes)
            corrections = read_log(place_of(sequence.folder)) if corrected else ()
        except (SequenceError, ValueError, OSError) as error:
            words = " ".join(str(error).split())
            found |= {(place, seed): BatchRun(place, seed, None, words) for seed in range(seeds)}
            continue
        for seed in range(seeds):
            key = pipeline.stage_keys(sequence, parameters, seed, corrections)["tracks"]
            kept = library.with_key(key)
            if kept is not None and not kept.provisional:
                found[place, seed] = BatchRun(place, seed, kept)
                continue
            job = job_of(
                sequence, place, content_of(sequence), parameters,
                changed_values(parameters, defaults),
                seed, truth=sequence.ground_truth is not None, agreement=False, timed=False,
                keep=True, corrections=corrections,
            )  # fmt: skip
            keys[place, seed] = key
            if job.key not in wanted:
                jobs.append(job)
            wanted.setdefault(job.key, []).append((place, seed))
    on_progress(len(found), total)
    if jobs:
        workers = crew()
        for number, job in enumerate(jobs):
            workers.submit(job, -number)
        while wanted and not stopped():
            for outcome in workers.finished(WAIT_SECONDS):
                run = None
                if outcome.kept is not None:
                    recording, new = outcome.kept
                    here, seed = wanted[outcome.key][0]
                    # the worker may have the recording in another folder than this machine
                    recording = record_of_recording(open_sequence(here), here, recording.thumbnail)
                    new = replace(new, digest=recording.digest, key=keys[here, seed])
                    run = library.run(library.keep(recording, new, budget))
                for place, seed in wanted.pop(outcome.key, ()):
                    found[place, seed] = BatchRun(place, seed, run, outcome.words, True)
                on_progress(len(found), total)
    return [
        found[place, seed] for place in places for seed in range(seeds) if (place, seed) in found
    ]
