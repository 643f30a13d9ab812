"""Run a claim of the papers again; without a name, list them.

Prints tables and findings, and writes the numbers and the figure of each experiment into a folder.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro
from tyro.conf import FlagCreatePairsOff, Positional, UseAppendAction, arg

from app.command.terminal import Bar, CommandError, check_data, print_table
from tests.papers.laboratory.experiment import Context, Experiment, RandomRooms, Result, Unavailable
from tests.papers.laboratory.writing import write
from tests.papers.registry import EXPERIMENTS
from tracker.parameters.values import ParameterError
from tracker.runs.processes import available_cores

FAILURE, USAGE, INTERRUPTED = 1, 2, 130


@dataclass
class Arguments:
    """What is run, how, and where to."""

    name: Annotated[
        Positional[str | None],
        arg(metavar="NAME", help="Which one.", help_behavior_hint="(optional)"),
    ] = None
    all: FlagCreatePairsOff[bool] = False
    """Run every one."""
    quick: FlagCreatePairsOff[bool] = False
    """Shortened to what shows the direction of each claim."""
    seeds: Annotated[int | None, arg(help_behavior_hint="(default: each experiment's own)")] = None
    """How many seeds each case is run with, where chance plays a part."""
    count: int = 20
    """Of `rooms`: how many random rooms."""
    first: int = 0
    """Of `rooms`: seed of the first; the others follow."""
    method: Annotated[
        UseAppendAction[tuple[str, ...]],
        arg(metavar="NAME", help_behavior_hint="(repeatable; default: all)"),
    ] = ()
    """Of `rooms`: only this single-view method."""
    keep_rooms: FlagCreatePairsOff[bool] = False
    """Of `rooms`: leave the rendered rooms in the output folder, about 15 MB each."""
    output: Annotated[Path, arg(metavar="DIR")] = Path("experiment-results")
    """Folder for the figures (PNG) and numbers (JSON)."""
    data: Annotated[Path | None, arg(metavar="DIR", help_behavior_hint="(optional)")] = None
    """Folder that holds the real recordings, for the experiments that need one."""


def main(arguments: list[str] | None = None) -> int:
    """Run what the arguments name; returns the exit status.

    Status 0 is success, 1 a failure and 2 wrong usage, each stated in one line on standard error;
    130 follows Ctrl-C.
    """
    given = tyro.cli(Arguments, prog="python -m tests.papers", description=__doc__, args=arguments)
    try:
        run(given)
    except (ParameterError, CommandError) as error:
        _say(str(error))
        return USAGE if isinstance(error, ParameterError) else FAILURE
    except KeyboardInterrupt:
        _say("interrupted; nothing was written")
        return INTERRUPTED
    return 0


def run(given: Arguments) -> None:
    """Run one experiment or all; without a name, list them.

    Raises:
        ParameterError: If there is no such experiment.
        CommandError: If an experiment cannot be run here, or a folder is not as it must be.
    """
    check_data(given.data)
    if given.name is not None and given.name not in EXPERIMENTS:
        known = ", ".join(EXPERIMENTS)
        raise ParameterError("NAME", f"expected one of {known}, got {given.name!r}")
    if given.name is not None and given.all:
        raise ParameterError("NAME", f"expected either a name or --all, got {given.name} and --all")
    if given.name is None and not given.all:
        print_table(("name", "claim"), [(e.name, e.claim) for e in EXPERIMENTS.values()])
        return
    if given.seeds is not None and given.seeds < 1:
        raise ParameterError("--seeds", f"expected a whole number from 1, got {given.seeds}")
    if given.output.exists() and not given.output.is_dir():
        raise CommandError(f"--output {given.output}: expected a folder, found a file")
    with _Bars() as bars:
        context = Context(
            quick=given.quick,
            seeds=given.seeds,
            data=given.data,
            output=given.output,
            rooms=RandomRooms(given.count, given.first, given.method, given.keep_rooms),
            processes=available_cores(),
            told=bars.told,
        )
        for one in EXPERIMENTS.values() if given.all else [EXPERIMENTS[str(given.name)]]:
            begin = time.perf_counter()
            try:
                result = one.run(context)
            except Unavailable as missing:
                bars.close()
                if not given.all:
                    raise CommandError(f"{one.name}: {missing}") from None
                _say(f"{one.name} is left out: {missing}")
                continue
            files = write(one, result, given.output, quick=given.quick, seeds=given.seeds)
            bars.close()
            _print(one, result)
            listed = " and ".join(str(path) for path in files)
            _say(f"{one.name}: {time.perf_counter() - begin:.0f} s, {listed}")


def _say(text: str) -> None:
    print(f"tests.papers: {text}", file=sys.stderr, flush=True)


def _print(one: Experiment, result: Result) -> None:
    print(f"{one.name}: {one.claim}\n")
    print_table(result.head, result.rows)
    print("", *result.notes, sep="\n")
    for finding in result.findings:
        print(f"{finding.verdict}: claimed: {finding.claim}; found: {finding.found}")
    print(flush=True)


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
            if not sys.stderr.isatty():  # where there is no bar
                _say(f"{words} …")
            self._words, self._bar = words, Bar(words, "step")
        self._bar.at(done, total)

    def close(self) -> None:
        """Remove the bar."""
        if self._bar is not None:
            self._bar.__exit__()
            self._bar = None


if __name__ == "__main__":
    sys.exit(main())
