"""``runs`` and ``library``: what is kept of runs, in a terminal."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

from app.command.arguments import (
    Bundle,
    CollectRuns,
    DeleteRuns,
    DiffRuns,
    ExportRun,
    LibraryCommand,
    ListRuns,
    OfLibrary,
    OpenRun,
    RenameRun,
    Runs,
    ShowRun,
    StarRun,
)
from app.command.terminal import Bar, CommandError, print_json, print_table, say
from tracker.evaluation import BY_KEY
from tracker.evaluation.figures import number
from tracker.evaluation.settings import EvaluationSettings
from tracker.files.folders import library_file
from tracker.files.text import visible
from tracker.library import KEEP, repair
from tracker.library.records import HEADLINES, PROVISIONAL, KeptRun
from tracker.library.store import Library, open_library
from tracker.sequences.reader import WHERE_NOW

DAMAGED = 1


def runs(command: Runs) -> int:
    """Run one of the commands; returns the exit status.

    Raises:
        LibraryError: If the library, or the run, is not as it must be.
    """
    action = command.action
    with _library(action) as library:
        match action:
            case ListRuns():
                _list(library, action)
            case ShowRun():
                _show(library, action)
            case OpenRun():
                result = library.result(library.find(action.run).id)
            case ExportRun():
                _export(library, action)
            case RenameRun():
                run = library.find(action.run)
                library.rename(run.id, action.name)
                _print_runs(action, [library.run(run.id)])
            case StarRun():
                numbers = [library.find(text).id for text in action.runs]
                for number in numbers:
                    library.star(number, not action.off)
                _print_runs(action, [library.run(number) for number in numbers])
            case DeleteRuns():
                _delete(library, action)
            case DiffRuns():
                _diff(library, action)
            case CollectRuns():
                gone, freed = library.collect(KEEP if action.keep is None else action.keep)
                if action.json:
                    print_json({"deleted": gone, "freed_bytes": freed})
                else:
                    say(f"{gone} runs gone, {freed / 1e6:.1f} MB freed")
    if not isinstance(action, OpenRun):
        return 0
    from app.command.main import serve_run

    return serve_run(action, result)


def bundle(command: Bundle) -> None:
    """Write a kept run as one ZIP file.

    Raises:
        LibraryError: If the library, or the run, is not as it must be.
    """
    from tracker.library.bundle import write_bundle
    from tracker.library.keeping import sequence_for_export

    output = command.output
    if output.suffix.lower() != ".zip":
        raise CommandError(f"--output {output}: expected the name of a .zip file")
    if not output.absolute().parent.is_dir():
        raise CommandError(f"--output {output}: there is no folder {output.parent}; make it first")
    with _library(command) as library:
        result = library.result(library.find(command.run).id)
        recording = library.recording(result.run.recording)
    if recording.missing is not None:
        raise CommandError(
            f"a bundle needs the recording, and {recording.missing}: {WHERE_NOW}, or write its "
            "tracks by `runs export`"
        )
    sequence = sequence_for_export(recording)
    write_bundle(output, result, sequence, videos=command.videos)
    size = output.stat().st_size
    if command.json:
        print_json({"run": result.run.id, "file": str(output), "bytes": size})
    else:
        say(f"{result.run.title}, {size / 1e6:.1f} MB, written to {output}")


def check(command: LibraryCommand) -> int:
    """Check the library, and repair it where that is asked for; returns the exit status.

    Raises:
        LibraryError: If the file is none, or nothing of it can be read.
    """
    path = command.library or library_file()
    found = repair.check(path)
    told: dict[str, Any] = {
        "file": str(path),
        "complaints": list(found.complaints),
        "readable_runs": found.runs,
    }
    if not command.json:
        for complaint in found.complaints:
            sys.stdout.write(f"{visible(complaint)}\n")
        say(f"{path}: {found.runs} runs can be read, {len(found.complaints)} complaints")
    status = DAMAGED if found.complaints else 0
    if command.repair and found.complaints:
        aside, saved, lost = repair.repair(path)
        told |= {"copy": str(aside), "saved_runs": saved, "lost_rows": lost}
        status = 0
        if not command.json:
            say(f"{saved} runs saved, {lost} rows lost; the damaged file is kept as {aside}")
    if command.json:
        print_json(told)
    return status


def _library(command: OfLibrary) -> Library:
    path: Path = command.library or library_file()
    if not path.exists():
        raise CommandError(
            f"{path}: there is no library yet; it is made when `track` or the page ends a run"
        )
    return open_library(path)


def _list(library: Library, command: ListRuns) -> None:
    wanted = command.recording
    folder = None if wanted is None else str(Path(wanted).absolute())
    places = {r.id for r in library.recordings() if r.place in (wanted, folder)}
    found = [
        run
        for run in library.runs()
        if wanted is None or wanted == run.recording_name or run.recording in places
    ]
    _print_runs(command, found)


def _print_runs(command: OfLibrary, found: list[KeptRun]) -> None:
    if command.json:
        print_json([run.to_json() for run in found])
        return
    print_table(
        (">run", "", "name", "recording", "began", "methods", "differs", ">MOTA", ">IDF1",
         ">HOTA", ">OSPA", ">tracks", "note"),
        [
            (
                str(run.id), "*" if run.star else "", run.name, run.recording_name,
                time.strftime("%Y-%m-%d %H:%M", time.localtime(run.began)),
                f"{run.single_view} › {run.fusion_method}",
                str(len(run.changes)),
                *(_marked(run, _number(getattr(run, name))) for name in HEADLINES[:4]),
                str(run.targets), run.note,
            )
            for run in found
        ],
    )  # fmt: skip
    if any(run.provisional for run in found):
        say(f"figures in brackets are provisional: {PROVISIONAL} (`runs open`)")


def _show(library: Library, command: ShowRun) -> None:
    result = library.result(library.find(command.run).id)
    run = result.run
    if command.json:
        told = {
            **run.to_json(),
            "place": result.place,
            "parameters": result.values,
            "figures": result.figures,
        }
        print_json({**told, "rows": len(result.kept.tracks)})
        return
    facts = {
        "run": run.title,
        "recording": f"{run.recording_name} ({result.place})",
        "began": _date(run.began),
        **({"computed again": _date(run.latest)} if run.latest > run.began else {}),
        "computed": f"{run.steps} steps in {run.seconds:.1f} s by {run.source} on {run.machine}",
        "program": f"{run.version}, code {run.code}",
        "methods": f"{run.single_view} › {run.fusion_method}, seed {run.seed}",
        **{f"value {key}": str(value) for key, value in run.changes.items()},
        "tracks": str(run.targets),
        **({"figures": f"provisional: {PROVISIONAL}"} if run.provisional else {}),
        **{
            _named(key): _marked(run, _with_unit(key, value)) if key in BY_KEY else str(value)
            for key, value in result.figures.items()
        },
        "star": "yes" if run.star else "no",
        "tags": ", ".join(run.tags),
        "note": run.note,
    }
    print_table(("what", "value"), list(facts.items()))


def _date(seconds: float) -> str:
    return time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(seconds))


def _export(library: Library, command: ExportRun) -> None:
    from tracker.export.exported_run import Options
    from tracker.export.registry import format_of, save
    from tracker.library.keeping import run_for_export, sequence_for_export

    form = format_of(command.output, command.format)
    result = library.result(library.find(command.run).id)
    written = run_for_export(sequence_for_export(library.recording(result.run.recording)), result)
    with Bar("writing", "step") as writing:
        options = Options(**dict(command.video), progress=writing.at)
        save(command.output, form, written, options)
    if command.json:
        print_json({"run": result.run.id, "format": form.name, "file": str(command.output)})
    else:
        say(f"{result.run.title} as {form.word}, written to {command.output}")


def _delete(library: Library, command: DeleteRuns) -> None:
    if command.undo:
        unknown = [text for text in command.runs if not text.isdecimal()]
        if unknown:
            raise CommandError(f"--undo: expected the numbers of runs, got {unknown[0]!r}")
        numbers = [int(text) for text in command.runs]
        library.restore(numbers)
        _print_runs(command, [library.run(number) for number in numbers])
        return
    numbers = [library.find(text).id for text in command.runs]
    size = library.delete(numbers)
    if command.json:
        print_json({"deleted": numbers, "bytes": size})
        return
    listed = " ".join(map(str, numbers))
    say(f"{len(numbers)} runs deleted, {size / 1e6:.1f} MB; `runs delete --undo {listed}` "
        "takes them back")  # fmt: skip


def _diff(library: Library, command: DiffRuns) -> None:
    a, b = (library.result(library.find(text).id) for text in (command.first, command.second))
    told = difference(a.run, a.values, b.run, b.values)
    if command.json:
        provisional = [run.id for run in (a.run, b.run) if run.provisional]
        print_json({"first": a.run.id, "second": b.run.id, "provisional": provisional, **told})
        return
    print_table(
        ("what", a.run.title, b.run.title),
        [(key, str(first), str(second)) for key, (first, second) in told["values"].items()]
        + [
            (
                _named(key),
                *(
                    _marked(run, _with_unit(key, value)) if key in BY_KEY else _number(value)
                    for run, value in zip((a.run, b.run), pair, strict=True)
                ),
            )
            for key, pair in told["figures"].items()
        ],
    )
    if a.run.provisional or b.run.provisional:
        say(f"figures in brackets are provisional: {PROVISIONAL} (`runs open`)")


def difference(
    a: KeptRun, values_a: dict[str, Any], b: KeptRun, values_b: dict[str, Any]
) -> dict[str, dict[str, tuple[Any, Any]]]:
    """What differs between two runs: values by key, and the headline figures."""
    flat_a, flat_b = _flat(values_a), _flat(values_b)
    facts = ("recording_name", "seed", "version", "code")
    values = {name: (getattr(a, name), getattr(b, name)) for name in facts}
    values |= {key: (flat_a.get(key), flat_b.get(key)) for key in {**flat_a, **flat_b}}
    return {
        "values": {key: pair for key, pair in values.items() if pair[0] != pair[1]},
        "figures": {name: (getattr(a, name), getattr(b, name)) for name in (*HEADLINES, "targets")},
    }


def _flat(values: dict[str, Any]) -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for group, value in values.items():
        if isinstance(value, dict):
            flat |= {f"{group}.{name}": one for name, one in value.items()}
        else:
            flat[group] = value
    return flat


def _named(key: str) -> str:
    """A figure by its name; a count of the library by its own."""
    return BY_KEY[key].name if key in BY_KEY else "Tracks" if key == "targets" else key


def _marked(run: KeptRun, text: str) -> str:
    """A figure of a run, in brackets where it is provisional."""
    return f"({text})" if run.provisional else text


def _with_unit(key: str, value: float | int | None) -> str:
    if key not in BY_KEY or value is None:
        return _number(value)
    figure = BY_KEY[key]
    return f"{number(value, figure.digits)} {figure.unit_for(EvaluationSettings())}".rstrip()


def _number(value: float | int | None) -> str:
    if value is None:
        return "–"
    return f"{value:.3f}" if isinstance(value, float) else str(value)
