"""Arguments of the commands that need no recording: what there is, and measurements."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import FlagCreatePairsOff, Positional, arg


@dataclass
class Sequences:
    """List the sequences that can be opened by name."""

    data: Annotated[Path | None, arg(metavar="DIR", help_behavior_hint="(optional)")] = None
    """Folder whose folders are sequences too."""


@dataclass
class Benchmark:
    """Measure this machine: kernels, filters, pipeline, growth and server. From a checkout only."""

    names: Annotated[
        Positional[tuple[str, ...]],
        arg(
            metavar="[NAME …]",
            help="Which parts; all, if none is named.",
            help_behavior_hint="",
        ),
    ] = ()
    short: FlagCreatePairsOff[bool] = False
    """The shortened form that the checks run."""
    json: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint="(optional)")] = None
    """Write the figures to this file as well, with the machine and the versions."""
    record: FlagCreatePairsOff[bool] = False
    """Append the figures to the record of speed and accuracy over the commits."""
    chart: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint="(optional)")] = None
    """Measure nothing, but draw that record as one HTML page."""


@dataclass
class Parameters:
    """List every parameter with its range, unit, default and meaning."""

    json: FlagCreatePairsOff[bool] = False
    """Print everything as JSON ."""
