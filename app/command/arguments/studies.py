"""The arguments of ``study``, ``batch`` and ``tune`` as types."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import (
    FlagCreatePairsOff,
    OmitSubcommandPrefixes,
    Positional,
    UseAppendAction,
    arg,
    subcommand,
)

from app.command.arguments.library import LibraryFile
from tracker.library import KEEP

_STUDY = arg(
    metavar="[STUDY]",
    help="Its name or folder; the one that ran last, if none is named.",
    help_behavior_hint="(optional)",
)


@dataclass(kw_only=True)
class OfStudies:
    """What every command on studies takes."""

    studies: Annotated[
        Path | None,
        arg(metavar="DIR", help_behavior_hint="(default: $MULTIVIEW_PHD_STUDIES, or your own)"),
    ] = None
    """The folder of all studies."""
    json: FlagCreatePairsOff[bool] = False
    """Print everything as JSON."""


@dataclass(kw_only=True)
class Where:
    """Where runs are computed."""

    workers: Annotated[int | None, arg(metavar="INT", help_behavior_hint="(default: cores)")] = None
    """Processes on this machine."""
    scheduler: Annotated[
        str | None,
        arg(
            metavar="tcp://HOST:PORT",
            help_behavior_hint="(default: $DASK_SCHEDULER_ADDRESS, or this machine)",
        ),
    ] = None
    """A Dask cluster's scheduler that is there."""


@dataclass
class NewStudy:
    """Write a study's file with every field explained, to be changed and run."""

    file: Annotated[Positional[Path], arg(metavar="STUDY.toml")]
    """The file; it must not exist yet."""
    recording: Annotated[
        UseAppendAction[tuple[str, ...]],
        arg(metavar="NAME", help_behavior_hint="(repeatable; default: room44-3p)"),
    ] = ()
    """A built-in room, or a folder."""


@dataclass
class RunStudy(Where, OfStudies):
    """Run a study to its end; the same file goes on where it was."""

    file: Annotated[Positional[Path], arg(metavar="STUDY.toml", help="As `study new` writes it.")]


@dataclass
class ResumeStudy(Where, OfStudies):
    """Go on with a study that was stopped or killed: no trial is lost, none is run twice."""

    study: Annotated[Positional[str | None], _STUDY] = None


@dataclass
class ListStudies(OfStudies):
    """List the studies, the one that ran last first."""


@dataclass
class ShowStudy(OfStudies):
    """Tell how far a study is, or everything of one of its trials."""

    what: Annotated[
        Positional[tuple[str, ...]],
        arg(
            metavar="[STUDY] [TRIAL]",
            help="Its name or folder, and the number of a trial; a number alone is of the study "
            "that ran last.",
        ),
    ] = ()
    command: FlagCreatePairsOff[bool] = False
    """Print the `track` commands that repeat the trial."""


@dataclass
class BestOfStudy(OfStudies):
    """Tell what is best, and what it changes."""

    study: Annotated[Positional[str | None], _STUDY] = None
    save_as: Annotated[str | None, arg(metavar="NAME", help_behavior_hint="(optional)")] = None
    """Keep its values as a preset of yours."""


@dataclass
class StopStudy(OfStudies):
    """Have a study that another process runs end at once, with everything kept."""

    study: Annotated[Positional[str | None], _STUDY] = None


@dataclass
class ExportStudy(OfStudies):
    """Write a study as a table (.csv), everything (.json), or a report (.html)."""

    study: Annotated[Positional[str | None], _STUDY] = None
    output: Annotated[Path, arg(aliases=["-o"], metavar="FILE")] = Path("study.html")
    """The file to write; its suffix says what. It appears when it is complete."""


StudyAction = (
    Annotated[NewStudy, subcommand("new")]
    | Annotated[RunStudy, subcommand("run")]
    | Annotated[ListStudies, subcommand("list")]
    | Annotated[ShowStudy, subcommand("show")]
    | Annotated[ResumeStudy, subcommand("resume")]
    | Annotated[StopStudy, subcommand("stop")]
    | Annotated[BestOfStudy, subcommand("best")]
    | Annotated[ExportStudy, subcommand("export")]
)


@dataclass
class Study:
    """Many runs with other values, kept as they end: define, run, show, go on, best, export."""

    action: OmitSubcommandPrefixes[StudyAction]


@dataclass
class Batch(Where):
    """Track many recordings and keep every run; at the end a table of their figures."""

    recordings: Annotated[
        Positional[tuple[str, ...]],
        arg(
            metavar="RECORDING …",
            help="Built-in rooms, folders, patterns of folders, or @FILE with one a line.",
            help_behavior_hint="",
        ),
    ]
    preset: Annotated[str | None, arg(metavar="NAME", help_behavior_hint="(default: robust)")] = (
        None
    )
    """Named values to start from."""
    set: Annotated[
        UseAppendAction[tuple[str, ...]],
        arg(metavar="KEY=VALUE", help_behavior_hint="(repeatable)"),
    ] = ()
    """One parameter, as in --set fusion.survival_probability=0.98."""
    seeds: Annotated[int, arg(metavar="INT")] = 1
    """Runs of each recording, with the seeds 0, 1, …"""
    library: LibraryFile = None
    """The file that the runs are kept in."""
    keep: Annotated[int, arg(metavar="INT")] = KEEP
    """Kept runs without star, name, note and tags that stay, the newest ones."""
    no_corrections: FlagCreatePairsOff[bool] = False
    """Do not obey what was put right by hand in the recordings."""
    json: FlagCreatePairsOff[bool] = False
    """Print the figures of every run as JSON."""


@dataclass
class Tune(Where, OfStudies):
    """Find better values for a recording, measured again on other seeds before they are told."""

    recordings: Annotated[
        Positional[tuple[str, ...]],
        arg(metavar="RECORDING …", help="Built-in rooms, or folders.", help_behavior_hint=""),
    ]
    minutes: float = 5.0
    """How long it seeks."""
    set: Annotated[
        UseAppendAction[tuple[str, ...]],
        arg(metavar="KEY=VALUE", help_behavior_hint="(repeatable)"),
    ] = ()
    """One value where you are: what it finds is set against these values, and it tries them too."""
    without_truth: FlagCreatePairsOff[bool] = False
    """Do not look at the truth where there is one."""
    save_as: Annotated[str, arg(metavar="NAME")] = "tuned"
    """The preset that keeps what it found."""
