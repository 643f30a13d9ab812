"""The small commands: what there is, the benchmarks of a checkout."""

from __future__ import annotations

import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

from app.command.arguments import Benchmark, Parameters, Sequences
from app.command.flags import describe_range, show
from app.command.terminal import CommandError, check_data, print_json, print_table
from tracker.parameters.catalogue import DEFAULT_RULE, METHODS, PARAMETERS, RunParameters

_INDENT = "    "


def benchmark(command: Benchmark) -> int:
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


def sequences(command: Sequences) -> None:
    check_data(command.data)
    from tracker.sequences import library

    rows = [
        (
            entry.name,
            entry.kind,
            "" if entry.cameras is None else str(entry.cameras),
            "" if entry.frames is None else str(entry.frames),
            entry.error or entry.description,
        )
        for entry in library.available(command.data)
    ]
    print_table(("name", "kind", "cameras", "steps", "description"), rows)


def parameters(command: Parameters) -> None:
    methods = {
        "single_view": "Method of stage 1 (--single-view).",
        "fusion_method": "Method of stage 2 (--fusion).",
        "smoothing_method": "Method of stage 3 (--smoothing).",
    }
    defaults = RunParameters()
    chosen = {
        "single_view": DEFAULT_RULE,
        "fusion_method": defaults.fusion_method,
        "smoothing_method": defaults.smoothing_method,
    }
    rows: list[tuple[str, ...]] = [
        (key, "", "|".join(choices), "", chosen[key], methods[key])
        for key, choices in METHODS.items()
    ]
    rows += [
        (p.key, p.symbol, describe_range(p), p.unit, show(p.default), p.help)
        for p in PARAMETERS.values()
    ]
    head = ("key", "symbol", "range", "unit", "default", "help")
    if command.json:
        print_json([dict(zip(head, row, strict=True)) for row in rows])
    else:
        for row in rows:
            _print_parameter(*row)


def _print_parameter(
    key: str, symbol: str, values: str, unit: str, default: str, meaning: str
) -> None:
    """Print a parameter's key, symbol, range and default, and below them what it means, in lines
    that fit the terminal, also in a file."""
    width = shutil.get_terminal_size().columns - 1
    facts = [key, symbol, f"{values} {unit}".strip(), f"default {default}"]
    line = "  ".join(fact for fact in facts if fact)
    if len(line) > width:  # the bars of a choice are where it can be wrapped
        line = line.replace("|", " | ")
    for text, first in ((line, ""), (meaning, _INDENT)):
        wrapped = textwrap.wrap(
            text, width, initial_indent=first, subsequent_indent=_INDENT, break_on_hyphens=False
        )
        sys.stdout.write("\n".join(wrapped) + "\n")
