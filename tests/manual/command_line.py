"""The page of the command line, from what the program itself answers to ``--help``."""

from __future__ import annotations

import os
import re
import subprocess
import sys

from tests.manual.places import ROOT

INTRODUCTION = """# Command line

This is what the program answers to `--help`. Status 0 means success, 1 a failure that is told
in one line, 2 wrong usage, 130 that it was ended by Ctrl-C. Of `import`, 3 means that the files
leave open how they are meant, and 4 that no interpretation explains the boxes: nothing is written,
and what is printed names the flags that decide.

```sh
multiview-phd serve [SEQUENCE] [--data DIR]           # the workbench; without SEQUENCE: room44-3p
multiview-phd track SEQUENCE -o tracks.csv            # the pipeline without a browser
multiview-phd track SEQUENCE -o tracks.csv --preset published --set fusion.clutter_rate=1.5
multiview-phd evaluate SEQUENCE tracks.csv --html report.html
```

`SEQUENCE` is a folder or a built-in name. Every parameter is a flag of `track` as well; what each
does stands on the page [Tuning](tuning.md).

Three places are kept outside the sequences: compiled kernels and what cameras found in
`~/.cache/multiview-phd` or `$MULTIVIEW_PHD_CACHE`; your presets, and what you teach and correct
of a built-in room, in `~/.config/multiview-phd` or `$MULTIVIEW_PHD_SETTINGS`; the library of runs
and the studies in `~/.local/share/multiview-phd`. With `MULTIVIEW_PHD_TRACEBACK=1` an unexpected
failure shows where it happened.

## The cache

What the methods of stage 1 found in the pictures of a recording is written to the folder
`stages` of the cache once a run has all of its steps, so that a run with other values of the
later stages, also after the next start, reads no picture again. All that lies there can be
computed anew and may be deleted at any time.

It takes 2 GB at most, or `$MULTIVIEW_PHD_CACHE_GB` of all commands, studies and their workers,
or `serve --disk GB` of one workbench; 0 keeps nothing. What was used least recently is deleted
first: when a result is written, and at the start for a limit that is lower than before. A
result that is larger than the limit is not written: an hour of one camera at 25 fps takes about
0.8 GB, so that long recordings of several cameras want a higher limit. Where the disk is full
or the folder cannot be written to, runs go on without the cache, with a line in the log; `track
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
