"""The command line: serve, track, evaluate, experiment, benchmark, import, check, …

Status 0 for success, 1 for a failure told in one line on standard error, 2 for
wrong usage, 130 after Ctrl-C. The engine is imported by the command that needs it.
"""

from __future__ import annotations

import errno
import gc
import os
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.command.arguments.corrections import Corrections
from app.command.arguments.importing import Check, ExportCalibration, Formats, Import
from app.command.arguments.library import Bundle, LibraryCommand, OpenRun, Runs
from app.command.arguments.studies import Batch, Study, Tune
from app.command.flags import (
    Arguments,
    Benchmark,
    Detect,
    Evaluate,
    Experiment,
    Parameters,
    Render,
    Sequences,
    Serve,
    Track,
    describe_range,
    parse,
    show,
)
from app.command.interruption import between_steps
from app.command.terminal import Bar, CommandError, check_data, print_table, say
from tracker import parameters as table
from tracker.folders import library_file
from tracker.parameters import ParameterError

if TYPE_CHECKING:
    from tracker.library.records import Result
    from tracker.pipeline import Run

FAILURE, USAGE, INTERRUPTED = 1, 2, 130

TRACEBACK = "MULTIVIEW_PHD_TRACEBACK"
"""Environment variable: with any value, an unexpected failure shows where it happened."""


def main(arguments: list[str] | None = None) -> int:
    """Run one command; returns the exit status."""
    try:
        status = _run(parse(arguments))
        sys.stdout.flush()  # a pipe that is closed raises here, where it is caught, not at exit
        return status
    except ParameterError as error:
        say(str(error))
        return USAGE
    except BrokenPipeError:  # the reader of our output closed its end, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (Exception, KeyboardInterrupt) as error:
        if _is_interruption(error):
            say("interrupted; nothing was written")
            return INTERRUPTED
        if os.environ.get(TRACEBACK):
            raise
        say(_sentence(error))
        return FAILURE


def _run(command: Arguments) -> int:
    match command:
        case Serve():
            return _serve(command)
        case Track():
            return _track(command)
        case Detect():
            from app.command.detect import detect

            detect(command)
        case Evaluate():
            from app.command.evaluate import evaluate

            evaluate(command)
        case Experiment():
            from app.command.experiment import experiment

            experiment(command)
        case Benchmark():
            return _benchmark(command)
        case Import() | Check() | Formats() | ExportCalibration():
            from app.command.importing import run

            return run(command)
        case Sequences():
            _sequences(command)
        case Render():
            _render(command)
        case Parameters():
            _parameters()
        case Runs():
            from app.command.runs import runs

            return runs(command, _serve_run)
        case Bundle():
            from app.command.runs import bundle

            bundle(command)
        case LibraryCommand():
            from app.command.runs import check

            return check(command)
        case Study():
            from app.command.studies import study

            return study(command)
        case Batch():
            from app.command.batch import batch

            return batch(command)
        case Tune():
            from app.command.tune import tune

            return tune(command)
        case Corrections():
            from app.command.correcting import corrections

            return corrections(command)
    return 0


def _is_interruption(error: BaseException | None) -> bool:
    """Whether Ctrl-C caused an exception: inside a compiled kernel it is raised as another one."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__
    return error is not None


def _sentence(error: BaseException) -> str:
    words = " ".join(str(error).split())
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    if isinstance(error, ValueError | CommandError):
        return words
    return f"unexpected {type(error).__name__}: {words}; set {TRACEBACK}=1 to see where"


# serve


def _serve_run(command: OpenRun, result: Result) -> int:
    serve = Serve(result.place, port=command.port, open=command.open, library=command.library)
    return _serve(serve, result.run.id)


def _serve_bundle(command: Serve) -> int:
    from tracker.library.bundle import unpack_bundle

    with tempfile.TemporaryDirectory(prefix="multiview-phd-bundle-") as folder:
        result = unpack_bundle(Path(command.sequence), Path(folder))
        return _serve(replace(command, sequence=result.place, keep=0), result)


def _serve(command: Serve, run: int | Result | None = None) -> int:
    if run is None and command.sequence.lower().endswith(".zip"):
        return _serve_bundle(command)
    if not 0 <= command.port <= 65535:
        raise ParameterError(
            "--port", f"expected 0 (any that is free) to 65535, got {command.port}"
        )
    check_data(command.data)
    _check_keep(command.keep)
    if command.memory is not None and not 0.0625 <= command.memory <= 65536.0:
        raise ParameterError("--memory", f"expected 0.0625 to 65536 GB, got {command.memory:g}")
    gc.disable()  # a seventh of the time: nothing that is imported ever goes
    from app.state.workers.jobs import locate
    from app.web import server
    from app.web.access.security import is_loopback
    from app.web.access.tokens import PARAMETER, Keys, new_token, own_token
    from tracker.library.records import Result
    from tracker.sequences import library, rendering

    gc.freeze()
    gc.enable()
    if not command.token and not is_loopback(command.host):
        raise ParameterError(
            "--no-token",
            f"expected --host of this machine alone, got {command.host}: others need one",
        )
    keys = Keys(own_token(os.environ) or new_token()) if command.token else None
    place = locate(command.sequence, command.data)
    if place not in rendering.ROOMS:
        library.open_sequence(place)  # what cannot be read is told here, before a page is open
    if command.detector is not None:
        from tracker.single_view.onnx.network import Network, Settings

        Network(command.detector, Settings())  # likewise
    listener = _listen(command)
    port = listener.getsockname()[1]
    host = f"[{command.host}]" if ":" in command.host else command.host
    shown = "127.0.0.1" if command.host == "0.0.0.0" else "[::1]" if host == "[::]" else host
    address = f"http://{shown}:{port}/"
    if not is_loopback(command.host):
        say(f"whoever reaches {command.host} and has the token can change what you see")

    def link(key: str | None) -> str:
        return address if key is None else f"{address}?{PARAMETER}={key}"

    def ready() -> None:
        sys.stdout.write(f"multiview-phd: {link(keys.token if keys else None)} (Ctrl-C ends it)\n")
        sys.stdout.flush()
        if command.open:
            import webbrowser

            opened = link(keys.ticket() if keys else None)
            threading.Thread(target=webbrowser.open, args=(opened,), daemon=True).start()

    app = server.create_app(
        server.Settings(
            host=command.host,
            keys=keys,
            sequence=command.sequence,
            data=command.data,
            detector=command.detector,
            keep_on_disk=True,
            library=None if isinstance(run, Result) else command.library or library_file(),
            keep=command.keep,
            memory=None if command.memory is None else int(command.memory * 2**30),
            run=run,
            say=say,
        )
    )
    try:
        server.serve(app, listener, ready)
    except KeyboardInterrupt:
        _leave(0)
    return 0


def _listen(command: Serve) -> Any:
    from app.web import server

    try:
        return server.bind(command.host, command.port)
    except OSError as error:
        if error.errno != errno.EADDRINUSE:
            raise CommandError(
                f"cannot listen on {command.host}:{command.port}: {error.strerror}"
            ) from None
    for port in range(command.port + 1, min(command.port + 100, 65536)):
        try:
            server.bind(command.host, port).close()
        except OSError:
            continue
        raise CommandError(f"port {command.port} is taken by another program; try --port {port}")
    raise CommandError(f"port {command.port} is taken by another program; try --port 0")


def _leave(status: int) -> None:
    """End now, even where a thread is still in the middle of a step that nothing can interrupt."""
    deadline = time.monotonic() + 0.2
    while time.monotonic() < deadline:
        if all(t.daemon or t is threading.main_thread() for t in threading.enumerate()):
            return
        time.sleep(0.02)
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)


# track


def _track(command: Track) -> int:
    changes = command.changes()
    table.with_values(table.RunParameters(), changes)  # wrong usage shows before any work
    _check_seed(command.seed)
    _check_keep(command.keep)
    output = command.output
    from tracker.writing.registry import format_of, save
    from tracker.writing.written import Options, Written

    form = format_of(output, command.format)
    if output.is_dir() and not form.folder:
        raise CommandError(f"--output {output}: expected a file to write, found a folder")
    if not output.parent.is_dir():
        raise CommandError(f"--output {output}: there is no folder {output.parent}; make it first")

    from app.command.correcting import of_run
    from app.state.workers.compiling import Compiling
    from tracker import pipeline
    from tracker.checks import check
    from tracker.runs import gaps
    from tracker.runs.gates import notices
    from tracker.runs.outcome import why_no_tracks
    from tracker.runs.run import resting_of
    from tracker.runs.stage_cache import StageCache
    from tracker.sequences import library

    with Bar("rendering", "frame") as rendering:
        sequence = library.open_sequence(command.sequence, progress=rendering.at)
    sequence = library.with_detector(sequence, command.detector)
    form.check(sequence)
    for sentence in sequence.warnings:
        say(sentence)
    for found in check(sequence, quick=True):
        if found.status == "warning" and str(found) not in sequence.warnings:
            say(str(found))
    parameters = table.with_values(pipeline.default_parameters(sequence), changes)
    told_by_hand = of_run(sequence, command.corrections, none=command.no_corrections)
    begin, began = time.perf_counter(), time.time()
    stages: set[table.Stage] = set()

    def told(_: pipeline.Run, progress: pipeline.Progress) -> None:
        stages.add(progress.stage)
        tracking.at(progress.done, progress.total)

    with (
        Bar("tracking", "step") as tracking,
        closing(Compiling(say)) as compiling,
        between_steps() as interrupted,
    ):
        tracking.at(0, sequence.frames)
        compiling.wait(lambda done, total: None, interrupted)
        run = pipeline.compute(
            sequence,
            parameters,
            seed=command.seed,
            corrections=told_by_hand,
            cache=StageCache.on_disk() if command.cache else None,
            on_progress=told,
            cancelled=interrupted,
        )
    seconds = time.perf_counter() - begin
    with Bar("writing", "step") as writing:
        missing = gaps.sentences(run)
        written = Written(
            sequence,
            run.tracks,
            parameters,
            command.seed,
            remarks=tuple(missing),
            resting=resting_of(run),
        )
        save(output, form, written, Options(progress=writing.at))
    targets = len(set(run.tracks.ids.tolist()))
    kept = "" if "single_view" in stages else "; stage 1 was kept from an earlier run"
    if (reason := why_no_tracks(run)) is not None:
        say(reason)
    for sentence in notices(run):
        say(sentence)
    if told_by_hand:
        unmet = {one.id: one.why for one in run.outcomes if not one.met}
        say(f"{len(told_by_hand) - len(unmet)} of {len(told_by_hand)} corrections met")
        for one in told_by_hand:
            if one.id in unmet:
                say(f"unmet: {one.words}: {unmet[one.id]}")
    if command.keep and not any(gap.unexpected for gap in gaps.gaps(run)):
        _keep(command, run, began, seconds)
    incomplete = "".join(f"; {one}" for one in missing)
    say(
        f"{sequence.frames} steps, {targets} tracks, {sequence.frames / seconds:.0f} steps/s "
        f"({sequence.frames / seconds / sequence.fps:.1f} × real time{kept}), written to {output}"
        f"{incomplete}"
    )
    return FAILURE if command.strict and missing else 0


def _keep(command: Track, run: Run, began: float, seconds: float) -> None:
    """Put a finished run into the library; where that cannot be used, say so and go on."""
    from tracker.evaluation import evaluate_sequence
    from tracker.library.errors import LibraryError
    from tracker.library.keeping import recording_of, run_of, thumbnail_of
    from tracker.library.store import open_library

    sequence = run.sequence
    try:
        with open_library(command.library or library_file()) as library:
            evaluation = None
            if sequence.ground_truth is not None:
                evaluation = evaluate_sequence(sequence, run.tracks)
            new = run_of(run, source="track", began=began, seconds=seconds, evaluation=evaluation)
            recording = recording_of(sequence, command.sequence, thumbnail_of(sequence))
            library.keep(recording, new, command.keep)
    except LibraryError as error:
        say(f"the run was not kept: {error}")


# the rest


def _benchmark(command: Benchmark) -> int:
    root = Path(__file__).resolve().parents[2]
    if not (root / "tests" / "benchmarks" / "__main__.py").is_file():
        raise CommandError(
            "the benchmarks belong to the source, not to the installed package: get a checkout, "
            'install it by `pip install --editable ".[test]"`, and run `multiview-phd benchmark` '
            "from there"
        )
    line = [sys.executable, "-m", "tests.benchmarks", *command.names]
    line += ["--short"] if command.short else []
    line += ["--json", str(command.json.absolute())] if command.json is not None else []
    line += ["--record"] if command.record else []
    line += ["--chart", str(command.chart.absolute())] if command.chart is not None else []
    return subprocess.run(line, cwd=root).returncode


def _sequences(command: Sequences) -> None:
    check_data(command.data)
    from tracker.sequences import library

    rows = [
        (
            entry.name,
            entry.kind,
            "" if entry.cameras is None else str(entry.cameras),
            "" if entry.frames is None else str(entry.frames),
            "no" if entry.error else "yes" if entry.ready else "when opened",
            entry.error or entry.description,
        )
        for entry in library.available(command.data)
    ]
    print_table(("name", "kind", "cameras", "steps", "ready", "description"), rows)


def _render(command: Render) -> None:
    from tracker.sequences import rendering

    if len(command.places) != (2 if command.random is None else 1):
        wanted = "NAME FOLDER" if command.random is None else "FOLDER alone with --random"
        found = " ".join(command.places) or "nothing"
        raise ParameterError("[NAME] FOLDER", f"expected {wanted}, got {found}")
    folder = Path(command.places[-1])
    name = f"random room {command.random}" if command.random is not None else command.places[0]
    if command.random is None and name not in rendering.ROOMS:
        known = ", ".join(rendering.ROOMS)
        raise ParameterError("NAME", f"expected one of {known}, got {name!r}")
    _check_seed(command.seed)
    if command.random is not None:
        _check_seed(command.random, "--random")
    if command.cameras not in (2, 3):
        raise ParameterError("--cameras", f"expected 2 or 3, got {command.cameras}")
    if folder.exists():
        raise CommandError(f"{folder} exists; name a folder that does not")
    cameras = command.cameras
    with Bar("rendering", "frame") as bar:
        if command.random is not None:
            cameras = rendering.render_random(
                command.random, folder, detections=command.detections, progress=bar.at
            ).cameras
        else:
            rendering.render(name, folder, cameras=cameras, seed=command.seed, progress=bar.at)
    say(f"{name} with {cameras} cameras, written to {folder}")


def _check_keep(keep: int) -> None:
    if keep < 0:
        raise ParameterError("--keep", f"expected a whole number from 0, got {keep}")


def _check_seed(seed: int, flag: str = "--seed") -> None:
    if seed < 0:
        raise ParameterError(flag, f"expected a whole number from 0, got {seed}")


def _parameters() -> None:
    methods = {
        "single_view": "Method of stage 1 (--single-view).",
        "fusion_method": "Method of stage 2 (--fusion).",
        "smoothing_method": "Method of stage 3 (--smoothing).",
    }
    defaults = table.RunParameters()
    chosen = {
        "single_view": table.FOLLOWS,
        "fusion_method": defaults.fusion_method,
        "smoothing_method": defaults.smoothing_method,
    }
    rows: list[tuple[str, ...]] = [
        (key, "", "|".join(choices), "", chosen[key], methods[key])
        for key, choices in table.METHODS.items()
    ]
    rows += [
        (p.key, p.symbol, describe_range(p), p.unit, show(p.default), p.help)
        for p in table.PARAMETERS.values()
    ]
    print_table(("key", "symbol", "range", "unit", "default", "help"), rows)


if __name__ == "__main__":
    sys.exit(main())
