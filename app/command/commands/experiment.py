"""``multiview-phd experiment``: the papers' claims, run again."""

from __future__ import annotations

import sys
import time
from pathlib import Path

from app.command.arguments.rooms import Experiment as Command
from app.command.terminal import Bar, CommandError, check_data, print_table, say
from tracker.experiments import (
    EXPERIMENTS,
    Context,
    Experiment,
    RandomRooms,
    Result,
    Unavailable,
)
from tracker.experiments.laboratory.pool import cores
from tracker.experiments.laboratory.writing import can_draw, write
from tracker.parameters import ParameterError


def experiment(command: Command) -> None:
    """Run one experiment or all; print tables and findings, write figures and numbers.

    Without a name, list them.

    Raises:
        ParameterError: If there is no such experiment.
        CommandError: If an experiment cannot be run here, or a folder is not as it must be.
    """
    check_data(command.data)
    if command.name is not None and command.name not in EXPERIMENTS:
        known = ", ".join(EXPERIMENTS)
        raise ParameterError("NAME", f"expected one of {known}, got {command.name!r}")
    if command.name is not None and command.all:
        raise ParameterError(
            "NAME", f"expected either a name or --all, got {command.name} and --all"
        )
    if command.name is None and not command.all:
        print_table(("name", "claim"), [(e.name, e.claim) for e in EXPERIMENTS.values()])
        return
    if command.seeds is not None and command.seeds < 1:
        raise ParameterError("--seeds", f"expected a whole number from 1, got {command.seeds}")
    if command.output.exists() and not command.output.is_dir():
        raise CommandError(f"--output {command.output}: expected a folder, found a file")
    chosen = list(EXPERIMENTS.values()) if command.all else [EXPERIMENTS[str(command.name)]]
    if not can_draw():
        say(
            "numbers without figures, since matplotlib is not installed: "
            'pip install "multiview-phd[figures]" brings it'
        )
    with _Bars() as bars:
        context = Context(
            quick=command.quick,
            seeds=command.seeds,
            data=command.data,
            output=command.output,
            rooms=RandomRooms(command.count, command.first, command.method, command.keep_rooms),
            processes=cores(),
            told=bars.told,
        )
        for one in chosen:
            begin = time.perf_counter()
            try:
                result = one.run(context)
            except Unavailable as missing:
                bars.close()
                if not command.all:
                    raise CommandError(f"{one.name}: {missing}") from None
                say(f"{one.name} is left out: {missing}")
                continue
            files = write(one, result, command.output, quick=command.quick, seeds=command.seeds)
            bars.close()
            _print(one, result)
            say(f"{one.name}: {time.perf_counter() - begin:.0f} s, {_listed(files)}")


def _print(one: Experiment, result: Result) -> None:
    sys.stdout.write(f"{one.name}: {one.claim}\n\n")
    print_table(result.head, result.rows)
    sys.stdout.write("\n")
    for note in result.notes:
        sys.stdout.write(f"{note}\n")
    for finding in result.findings:
        sys.stdout.write(f"{finding.verdict}: claimed: {finding.claim}; found: {finding.found}\n")
    sys.stdout.write("\n")
    sys.stdout.flush()


def _listed(files: list[Path]) -> str:
    return " and ".join(str(path) for path in files)


class _Bars:
    """One bar for whatever is being done now."""

    def __init__(self) -> None:
        self._words = ""
        self._bar: Bar | None = None

    def __enter__(self) -> _Bars:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def told(self, words: str, done: int, total: int) -> None:
        """Show how much is done; other words begin another bar."""
        if self._bar is None or words != self._words:
            self.close()
            self._words, self._bar = words, Bar(words, "step")
        self._bar.at(done, total)

    def close(self) -> None:
        """Remove the bar."""
        if self._bar is not None:
            self._bar.__exit__()
            self._bar = None
