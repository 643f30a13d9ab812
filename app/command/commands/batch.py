"""``batch``: many recordings, every run kept, one table at the end."""

from __future__ import annotations

import json
import statistics
import sys
from collections.abc import Callable, Sequence

from app.command.arguments.studies import Batch
from app.command.commands.studies import INTERRUPTED, crew_of, to_be_stopped
from app.command.flags import preset_values, set_values
from app.command.terminal import FAILURE, Bar, print_table, rate, say
from tracker.files.folders import library_file
from tracker.library.store import open_library
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.values import ParameterError, with_values
from tracker.studies.batches import BatchRun, places_of, run_batch

_FIGURES = ("mota", "idf1", "hota", "ospa")


def batch(command: Batch) -> int:
    """Track them all; returns the exit status: 1 where one could not be tracked.

    Raises:
        StudyError: If a name stands for nothing, or the workers cannot work on.
    """
    changes = {**preset_values(command.preset), **set_values(command.set)}
    with_values(RunParameters(), changes)  # wrong usage shows before any work
    if command.seeds < 1:
        raise ParameterError("--seeds", f"expected a whole number from 1, got {command.seeds}")
    if command.keep < 1:
        raise ParameterError("--keep", f"expected a whole number from 1, got {command.keep}")
    places = places_of(command.recordings)
    with (
        to_be_stopped() as stopped,
        open_library(command.library or library_file()) as library,
        crew_of(command) as crew,
        Bar("tracking", "run") as bar,
    ):
        found = run_batch(
            places, changes, command.seeds, library, command.keep,
            lambda: crew(say), bar.at, stopped.is_set, corrected=not command.no_corrections,
        )  # fmt: skip
    if command.json:
        sys.stdout.write(json.dumps([_told(one) for one in found], allow_nan=False) + "\n")
    else:
        _tell(places, found)
    if stopped.is_set():
        say("stopped; what is there is kept: the same command goes on")
        return INTERRUPTED
    return FAILURE if any(one.run is None for one in found) else 0


def _told(one: BatchRun) -> dict[str, object]:
    run = None if one.run is None else one.run.to_json()
    return {
        "recording": one.recording, "seed": one.seed, "computed": one.computed, "run": run,
        "error": one.words or None,
    }  # fmt: skip


def _tell(places: Sequence[str], found: Sequence[BatchRun]) -> None:
    rows = []
    for place in places:
        runs = [one.run for one in found if one.recording == place and one.run is not None]
        why = next((one.words for one in found if one.recording == place and one.words), "")
        name = runs[0].recording_name if runs else place
        figures = [_mean([getattr(run, key) for run in runs]) for key in _FIGURES]
        targets = _mean([float(run.targets) for run in runs], "{:.1f}".format)
        speed = _mean([run.steps_per_second for run in runs], rate)
        kept = " ".join(str(run.id) for run in runs)
        rows.append((name, str(len(runs)), *figures, targets, speed, kept, why))
    print_table(
        ("recording", ">runs", ">MOTA", ">IDF1", ">HOTA", ">OSPA", ">tracks", ">steps/s",
         "kept as", ""),
        rows,
    )  # fmt: skip
    computed = sum(one.computed for one in found)
    say(f"{len(found)} runs, {computed} of them computed now; `multiview-phd runs` lists them")


def _mean(values: Sequence[float | None], shown: Callable[[float], str] = "{:.3f}".format) -> str:
    there = [value for value in values if value is not None]
    if not there:
        return "–"
    about = f" ± {shown(statistics.stdev(there))}" if len(there) > 1 else ""
    return f"{shown(statistics.fmean(there))}{about}"
