"""The page of the command line, from what the program itself answers to ``--help``."""

from __future__ import annotations

import os
import re
import subprocess
import sys

from tests.manual.places import ROOT

INTRODUCTION = """# Command line

The output of `--help` for every command. Exit status 0 means success, 1 a failure, which is
reported in one line, 2 wrong usage, and 130 an end by Ctrl-C (0 of `serve`, which ends so). With
`import`, 3 means that the files allow several interpretations, and 4 that no interpretation
explains the boxes: in both cases nothing is written, and the output names the flags that decide.

```sh
multiview-phd serve [SEQUENCE] [--data DIR]           # the workbench; without SEQUENCE: room44-3p
multiview-phd track SEQUENCE -o tracks.csv            # the pipeline without a browser
multiview-phd track SEQUENCE -o tracks.csv --preset published --set fusion.clutter_rate=1.5
multiview-phd evaluate SEQUENCE tracks.csv --html report.html
```

`SEQUENCE` is a folder or the name of a built-in room. Every parameter is also a flag of `track`;
the page [Tuning](tuning.md) describes them all.

The program writes to three folders besides the sequences: compiled kernels and cached results of
stage 1 to `~/.cache/multiview-phd` or `$MULTIVIEW_PHD_CACHE`; presets, and the templates, entrances
and corrections of built-in rooms, to `~/.config/multiview-phd` or `$MULTIVIEW_PHD_SETTINGS`; the
library of runs and the studies to `~/.local/share/multiview-phd`. With `MULTIVIEW_PHD_TRACEBACK=1`
an unexpected failure is reported with its traceback.

## The cache

When a run has computed all steps of stage 1, their results are written to the folder `stages` of
the cache. A later run with other parameters of stages 2 to 4, also after a restart, then decodes no
picture again. The folder may be deleted at any time; the results are then computed again.

The cache takes at most 2 GB; `$MULTIVIEW_PHD_CACHE_GB` sets another limit for all commands, studies
and their workers, and `serve --disk GB` for one workbench; 0 disables the cache. The least recently
used results are deleted first, when a result is written and, if the limit was lowered, at the
start. A result that is larger than the limit is not written: an hour of one camera at 25 fps takes
about 0.8 GB, so long recordings of several cameras need a higher limit. If the disk is full or the
folder cannot be written to, runs continue without the cache, with a line in the log; `track
--no-cache` neither reads nor writes it.
"""

WIDTH = "88"
"""Columns: what a page shows without scrolling."""


def page() -> str:
    """The whole page."""
    commands = re.findall(r"• ([a-z-]+)", answer())
    parts = [INTRODUCTION, "## All commands", "", fenced(answer()), ""]
    for command in commands:
        parts += [f"## {command}", "", fenced(answer(command)), ""]
    return "\n".join(parts)


def fenced(text: str) -> str:
    """Text as it stands."""
    return f"```text\n{text}\n```"


def answer(*arguments: str) -> str:
    """What the program prints to ``--help``, the same on every machine."""
    environment = {
        key: value
        for key, value in os.environ.items()
        if key not in ("DISPLAY", "WAYLAND_DISPLAY", "FORCE_COLOR", "TERM")
    }
    environment |= {"COLUMNS": WIDTH, "NO_COLOR": "1", "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-m", "app", *arguments, "--help"],
        capture_output=True,
        text=True,
        check=True,
        cwd=ROOT,
        env=environment,
    )
    return "\n".join(line.rstrip() for line in done.stdout.strip().splitlines())
