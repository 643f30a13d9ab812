"""The arguments of ``corrections`` as types."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import FlagCreatePairsOff, OmitSubcommandPrefixes, Positional, arg, subcommand

_SEQUENCE = arg(metavar="SEQUENCE", help="A built-in room's name or a folder.")
_LOG = arg(metavar="LOG", help="A corrections.toml, or a sequence for its own.")

LogFile = Annotated[
    Path | None, arg(metavar="FILE", help_behavior_hint="(default: the sequence's own)")
]


@dataclass
class ListCorrections:
    """List the corrections of a log, in their order."""

    log: Annotated[Positional[str], _LOG]
    json: FlagCreatePairsOff[bool] = False
    """Print everything as JSON."""


@dataclass
class CheckCorrections:
    """Track a sequence with its corrections, and tell which are met and, where not, why.

    Status 1 where one is not met.
    """

    sequence: Annotated[Positional[str], _SEQUENCE]
    corrections: LogFile = None
    """Another log than the sequence's own."""
    json: FlagCreatePairsOff[bool] = False
    """Print everything as JSON."""


@dataclass
class DiffCorrections:
    """Tell what two logs say differently. Status 1 where they differ."""

    first: Annotated[Positional[str], _LOG]
    second: Annotated[Positional[str], _LOG]
    json: FlagCreatePairsOff[bool] = False
    """Print everything as JSON."""


@dataclass
class MergeCorrections:
    """Write what two logs say as one, in the order of time; refused where they contradict."""

    first: Annotated[Positional[str], _LOG]
    second: Annotated[Positional[str], _LOG]
    output: Annotated[Path, arg(aliases=["-o"])]
    """The log to write."""


@dataclass
class TruthOfCorrections:
    """Write the corrected tracks of the steps that were checked as a truth for `evaluate`."""

    sequence: Annotated[Positional[str], _SEQUENCE]
    output: Annotated[Path, arg(aliases=["-o"])]
    """The file to write, for [ground_truth] or `evaluate --truth`."""
    corrections: LogFile = None
    """Another log than the sequence's own."""


CorrectionsAction = (
    Annotated[ListCorrections, subcommand("list")]
    | Annotated[CheckCorrections, subcommand("check")]
    | Annotated[DiffCorrections, subcommand("diff")]
    | Annotated[MergeCorrections, subcommand("merge")]
    | Annotated[TruthOfCorrections, subcommand("truth")]
)


@dataclass
class Corrections:
    """Read, check, compare and merge what was put right by hand, and make truth of it."""

    action: OmitSubcommandPrefixes[CorrectionsAction]
