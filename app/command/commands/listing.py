"""The small commands: what there is, rendered rooms, the benchmarks of a checkout."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from app.command.arguments.rooms import Benchmark, Render, Sequences
from app.command.flags import describe_range, show
from app.command.terminal import Bar, CommandError, check_data, check_seed, print_table, say
from tracker import parameters as table
from tracker.parameters import ParameterError


def benchmark(command: Benchmark) -> int:
    root = Path(__file__).resolve().parents[3]
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


def sequences(command: Sequences) -> None:
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


def render(command: Render) -> None:
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
    check_seed(command.seed)
    if command.random is not None:
        check_seed(command.random, "--random")
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


def parameters() -> None:
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
