"""``study``: define, run, show, go on, best, export, in a terminal."""

from __future__ import annotations

import os
import shlex
import signal
import statistics
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any

from app.command.arguments import (
    Batch,
    BestOfStudy,
    ExportStudy,
    ListStudies,
    NewStudy,
    ResumeStudy,
    RunStudy,
    ShowStudy,
    StopStudy,
    Study,
    Tune,
    Where,
)
from app.command.flags import changes_of, set_values
from app.command.terminal import FAILURE, Bar, CommandError, print_json, print_table, rate, say
from tracker.files.folders import library_file
from tracker.library.store import open_library
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.values import ParameterError, with_values
from tracker.review.self_consistency.estimate import WARNING
from tracker.studies.batches import BatchRun, places_of, run_batch
from tracker.studies.errors import StudyError
from tracker.studies.store import (
    Status,
    Store,
    Trial,
    create,
    find,
    free_name,
    stores,
    studies_folder,
)
from tracker.studies.tuning import tuning

if TYPE_CHECKING:
    from tracker.studies.cluster import DaskCrew

INTERRUPTED = 130

_BEST = 10
"""Trials that ``study show`` lists."""


def study(command: Study) -> int:
    """Run one of the commands; returns the exit status.

    Raises:
        StudyError: If a study, or its file, is not as it must be.
    """
    action = command.action
    if isinstance(action, NewStudy):
        _new(action)
        return 0
    folder = action.studies or studies_folder()
    match action:
        case RunStudy():
            from tracker.studies.definition import read_definition

            definition = read_definition(action.file)
            for sentence in definition.notes:
                say(sentence)
            return run(create(definition, folder), action, as_json=action.json)
        case ResumeStudy():
            return run(find(action.study, folder), action, as_json=action.json)
        case ListStudies():
            _list(stores(folder), action)
        case ShowStudy():
            _show(action, folder)
        case StopStudy():
            store = find(action.study, folder)
            store.ask_to_stop()
            say(f"the study {store.name} is asked to stop; `study resume` goes on")
        case BestOfStudy():
            _best(find(action.study, folder), action)
        case ExportStudy():
            _export(find(action.study, folder), action)
    return 0


def _have_truth(recordings: Sequence[str], folder: Path) -> bool:
    """Return whether no recording lacks a truth, as far as they can be read yet."""
    from tracker.sequences.errors import SequenceError
    from tracker.sequences.library import open_sequence
    from tracker.studies.definition import places_of

    for name in recordings:
        try:
            opened = [open_sequence(place) for place in places_of([name], folder)]
        except (SequenceError, StudyError, OSError):
            continue
        if any(one.ground_truth is None for one in opened):
            return False
    return True


def _new(command: NewStudy) -> None:
    from tracker.files.atomic import replacing
    from tracker.studies.definition import example

    file = command.file
    if file.exists():
        raise CommandError(f"{file} exists; name a file that does not")
    if file.suffix != ".toml":
        raise CommandError(f"{file}: expected the name of a .toml file")
    recordings = [_from_file(file, name) for name in command.recording] or ["room44-3p"]
    objective = "score" if _have_truth(recordings, file.parent) else "identity"
    text = example(file.stem, recordings, objective=objective)
    with replacing(file) as begun:
        begun.write_text(text, encoding="utf-8")
    say(f"{file} is written: change it, then `multiview-phd study run {shlex.quote(str(file))}`")


def _from_file(file: Path, name: str) -> str:
    """Return what a study's file calls a recording: its relative paths refer to its own folder."""
    from tracker.sequences.library import is_room
    from tracker.studies.definition import places_of

    if is_room(name) or os.path.isabs(os.path.expanduser(name)):
        return name
    try:
        places_of([name], Path.cwd())
    except StudyError:
        return name  # it may be there as seen from the file, or is still to come
    place = Path(os.path.abspath(name))
    place, folder = Path(os.path.realpath(place.parent), place.name), file.parent.resolve()
    if not place.is_relative_to(folder.parent):
        return str(place)
    relative = Path(os.path.relpath(place, folder)).as_posix()
    return f"./{relative}" if is_room(relative) else relative


@contextmanager
def to_be_stopped() -> Iterator[threading.Event]:
    """Ctrl-C and the wish of the system to end are only noted; a second Ctrl-C is raised."""
    heard = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield heard
        return

    def note(number: int, frame: FrameType | None) -> None:
        if heard.is_set() and number == signal.SIGINT:
            signal.default_int_handler(number, frame)
        heard.set()

    before = {number: signal.signal(number, note) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield heard
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def crew_of(where: Where) -> Iterator[Any]:
    """What makes the workers that the flags name; they end with this."""
    from tracker.studies.cluster import ADDRESS, DaskCrew, check_address

    scheduler = where.scheduler or os.environ.get(ADDRESS) or None
    if scheduler is not None:
        try:
            check_address(scheduler)
        except StudyError as error:
            name = "--scheduler" if where.scheduler else f"${ADDRESS}"
            raise CommandError(f"{name}{str(error).removeprefix('scheduler')}") from None
    if where.workers is not None and where.workers < 1:
        raise CommandError(f"--workers: expected a whole number from 1, got {where.workers}")
    made: list[DaskCrew] = []

    def make(tell: Any) -> DaskCrew:
        made.append(DaskCrew(scheduler, workers=where.workers, tell=tell))
        return made[0]

    try:
        yield make
    finally:
        for crew in made:
            crew.close()


def run(store: Store, where: Where, *, as_json: bool = False, quiet: bool = False) -> int:
    """Run a study, or go on with it; returns the exit status.

    Args:
        store: Its folder.
        where: Who computes.
        as_json: Tell the end as JSON.
        quiet: Tell nothing at the end.
    """
    from tracker.studies.cluster import ADDRESS
    from tracker.studies.runner import run_study

    before: list[str] = []
    by_time_alone = store.definition().by_time_alone
    with (
        to_be_stopped() as stopped,
        store.running() as writer,
        crew_of(where) as crew,
        Bar(store.name, "trial") as bar,
    ):

        def told(status: Status) -> None:
            if status.words and status.words not in before[-1:] and status.state == "running":
                before.append(status.words)
                say(status.words)
            if status.done:
                bar.at(status.done, None if by_time_alone else status.trials)

        elsewhere = bool(where.scheduler or os.environ.get(ADDRESS))
        status = run_study(
            store, writer, crew, on_status=told, stopped=stopped.is_set, beside=elsewhere
        )
    if as_json:
        print_json({"study": store.name, "state": status.state, "trials": len(store.trials())})
    elif not quiet:
        _print_end(store, status)
    return INTERRUPTED if status.state == "stopped" and stopped.is_set() else 0


def _print_end(store: Store, status: Status) -> None:
    words = f"; {status.words}" if status.words else ""
    if status.state == "stopped":
        words += "; `study resume` goes on"
    say(
        f"{store.name}: {_trials(store, status)}, {status.runs} runs in "
        f"{status.seconds:.0f} s{words}"
    )
    if status.done:
        _show_trials(store)


def _trials(store: Store, status: Status) -> str:
    if store.definition().by_time_alone:
        return f"{status.done} trial{'' if status.done == 1 else 's'}"
    return f"{status.done} of {status.trials} trials"


def _list(found: list[Store], command: ListStudies) -> None:
    rows: list[dict[str, Any]] = []
    for store in found:
        status = store.status()
        rows.append(
            {
                "study": store.name,
                "state": status.state,
                "done": len(store.trials()),
                "trials": store.definition().trials,
                "touched": store.touched(),
                "words": status.words,
            }
        )
    if command.json:
        print_json(rows)
        return
    print_table(
        ("study", "state", ">done", ">trials", "last", ""),
        [
            (
                row["study"], row["state"], str(row["done"]), str(row["trials"]),
                time.strftime("%Y-%m-%d %H:%M", time.localtime(row["touched"])), row["words"],
            )
            for row in rows
        ],
    )  # fmt: skip


def _show(command: ShowStudy, folder: Path) -> None:
    store, number = _named(command.what, folder)
    if number is None:
        if command.command:
            raise CommandError("--command: name a trial by its number, as in `study show 12`")
        if command.json:
            print_json(_everything(store))
            return
        status = store.status()
        say(
            f"{store.name}: {status.state}, {_trials(store, status)}"
            + (f"; {status.words}" if status.words else "")
        )
        _show_trials(store)
        return
    trial = store.trial(number)
    if command.command:
        from tracker.studies.summary import track_commands

        sys.stdout.writelines(f"{one}\n" for one in track_commands(store.definition(), trial))
    elif command.json:
        outcomes = [store.outcome(row.key) for row in trial.jobs]
        print_json({**trial.to_json(), "runs": [o.to_json() for o in outcomes if o is not None]})
    else:
        _show_trial(store, trial)


def _named(what: tuple[str, ...], folder: Path) -> tuple[Store, int | None]:
    """The study and the trial that are meant."""
    if len(what) > 2 or (len(what) == 2 and not what[1].isdecimal()):
        raise CommandError(f"expected [STUDY] [TRIAL], got {' '.join(what)}")
    if len(what) == 2:
        return find(what[0], folder), int(what[1])
    alone = what[0] if what else None
    if alone is not None and alone.isdecimal() and not (folder / alone).exists():
        return find(None, folder), int(alone)
    return find(alone, folder), None


def _show_trials(store: Store) -> None:
    from tracker.studies.summary import summary_of

    summary = summary_of(store)
    keys = [key for key, _ in summary.importance[:6]] or [
        one.key for one in summary.definition.varied[:6]
    ]
    named = [one.key.rpartition(".")[2] for one in summary.definition.varied if one.key in keys]
    keys = [one.key for one in summary.definition.varied if one.key in keys]
    rows = []
    for trial in summary.ranked[:_BEST]:
        assert trial.objectives is not None
        measured = [
            one.words(value, spread)
            for one, value, spread in zip(
                summary.objectives, trial.objectives, trial.spreads, strict=True
            )
        ]
        values = [shown_value(trial.values.get(key)) for key in keys]
        rows.append((str(trial.number), *measured, *values, summary.remark(trial)))
    print_table((">trial", *(f">{one.name}" for one in summary.objectives), *named, ""), rows)
    for sentence in summary.sentences():
        say(sentence)


def _show_trial(store: Store, trial: Trial) -> None:
    facts = {
        "trial": f"{trial.number} of {store.name}, {trial.state}",
        **({"": trial.words} if trial.words else {}),
        **{f"value {key}": shown_value(value) for key, value in trial.values.items()},
        **{key: shown_value(value) for key, value in trial.figures.items()},
        "vetoed": "yes" if trial.vetoed else "no",
        "seconds": f"{trial.seconds:.1f}",
        **{f"run {row.key}": f"{row.recording}, seed {row.seed}" for row in trial.jobs},
    }
    print_table(("what", "value"), list(facts.items()))


def _best(store: Store, command: BestOfStudy) -> None:
    from tracker.studies.summary import summary_of

    summary = summary_of(store)
    best = summary.best
    if best is None:
        raise StudyError(f"study {store.name}: no trial has ended; `study resume` goes on")
    changes = summary.changes(best)
    if command.save_as is not None:
        save_preset(command.save_as, {**summary.definition.held(), **changes})
    if command.json:
        print_json({**best.to_json(), "changes": changes, "front": summary.front})
        return
    for sentence in summary.sentences():
        say(sentence)
    print_table(
        ("parameter", "default", "best"),
        [
            (key, shown_value(summary.defaults.get(key)), shown_value(v))
            for key, v in changes.items()
        ],
    )


def save_preset(name: str, values: dict[str, Any]) -> None:
    """Keep values as a preset of one's own.

    Raises:
        ParameterError: If the name does not do.
    """
    from app.state.presets import keep_preset
    from tracker.parameters.presets import presets_file

    keep_preset(presets_file(), name, values)
    say(f"kept as the preset {name!r}, which the page lists")


def _export(store: Store, command: ExportStudy) -> None:
    from tracker.studies.report import write_csv, write_json, write_report

    writers = {".csv": write_csv, ".json": write_json, ".html": write_report}
    output = command.output
    if output.suffix.lower() not in writers:
        raise CommandError(f"--output {output}: expected the name of a .csv, .json or .html file")
    writers[output.suffix.lower()](output, store)
    say(f"{store.name}, {len(store.trials())} trials, written to {output}")


def _everything(store: Store) -> dict[str, Any]:
    from tracker.studies.report import study_values

    return study_values(store)


def shown_value(value: Any) -> str:
    """A value in a few digits; a dash for none."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


_FIGURES = ("mota", "idf1", "hota", "ospa")


def batch(command: Batch) -> int:
    """Track them all; returns the exit status: 1 where one could not be tracked.

    Raises:
        StudyError: If a list of recordings cannot be read, or the workers cannot work on.
    """
    changes = changes_of(command)
    with_values(RunParameters(), changes)  # wrong usage shows before any work
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
        print_json([_to_json(one) for one in found])
    else:
        _print_batch(places, found)
    if stopped.is_set():
        say("stopped; what is there is kept: the same command goes on")
        return INTERRUPTED
    return FAILURE if any(one.run is None for one in found) else 0


def _to_json(one: BatchRun) -> dict[str, object]:
    run = None if one.run is None else one.run.to_json()
    return {
        "recording": one.recording, "seed": one.seed, "computed": one.computed, "run": run,
        "error": one.words or None,
    }  # fmt: skip


def _print_batch(places: Sequence[str], found: Sequence[BatchRun]) -> None:
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
    stored = [one.computed for one in found if one.run is not None]
    say(f"{len(stored)} of {len(found)} runs stored, {sum(stored)} of them computed now; "
        "`multiview-phd runs` lists them")  # fmt: skip


def _mean(values: Sequence[float | None], shown: Callable[[float], str] = "{:.3f}".format) -> str:
    there = [value for value in values if value is not None]
    if not there:
        return "–"
    about = f" ± {shown(statistics.stdev(there))}" if len(there) > 1 else ""
    return f"{shown(statistics.fmean(there))}{about}"


def tune(command: Tune) -> int:
    """Seek, measure again, tell and keep; returns the exit status.

    Raises:
        StudyError: If a recording cannot be read, or the study cannot go on.
    """
    if not command.recordings:
        raise ParameterError("RECORDING …", "expected at least one recording")
    changes = set_values(command.set)
    with_values(RunParameters(), changes)  # wrong usage shows before any work
    folder = command.studies or studies_folder()
    name = free_name(f"tune {os.path.basename(os.path.abspath(command.recordings[0]))}", folder)
    definition = tuning(
        name,
        command.recordings,
        minutes=command.minutes,
        changes=changes,
        ignore_truth=command.without_truth,
    )
    blind = definition.objectives == ("identity",)
    if blind:
        say(f"no truth is looked at: the score without truth is what counts. {WARNING}")
    store = create(definition, folder)
    status = run(store, command, quiet=True)
    if status == INTERRUPTED:
        say(f"stopped; `multiview-phd study resume {name!r}` goes on")
        return status
    found = store.fact("tuned")
    if found is None:
        raise StudyError(f"study {name}: it ended before anything was measured again")
    if found["better"]:
        save_preset(
            command.save_as,
            {k: v for k, v in {**definition.held(), **found["values"]}.items()},
        )
    if command.json:
        told = {"study": name, "trials": len(store.trials()), **found}
        print_json(told)
        return 0
    say(f"{len(store.trials())} trials; {found['words']}")
    if found["rows"]:
        print_table(
            ("parameter", ">before", ">default", ">now", ">brings"),
            [
                (
                    row["key"], shown_value(row["before"]), shown_value(row["default"]),
                    shown_value(row["after"]),
                    "–" if row["brought"] is None else f"{row['brought']:+.4f}",
                )
                for row in found["rows"]
            ],
        )  # fmt: skip
    print_table(
        ("figure", ">default", ">before", ">now"),
        [
            (row["name"], *(shown_value(row[key]) for key in ("default", "before", "after")))
            for row in found["figures"]
        ],
    )
    return 0
