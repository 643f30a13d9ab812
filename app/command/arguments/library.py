"""The arguments of ``runs`` and ``library`` as types."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import (
    FlagCreatePairsOff,
    OmitArgPrefixes,
    OmitSubcommandPrefixes,
    Positional,
    arg,
    subcommand,
)

from app.command.typed import reader_of
from app.messages import Marks, VideoPart

LibraryFile = Annotated[
    Path | None,
    arg(metavar="FILE", help_behavior_hint="(default: $MULTIVIEW_PHD_LIBRARY, or your own)"),
]

FormatName = Annotated[
    Literal["csv", "motchallenge", "json", "parquet", "trc", "gltf", "rerun", "html", "mp4"] | None,
    arg(
        metavar="csv|motchallenge|json|parquet|trc|gltf|rerun|html|mp4",
        help_behavior_hint="(default: by the suffix, csv without one)",
    ),
]

_RUN = arg(metavar="RUN", help="Its number, or its name.")
_RUNS = arg(metavar="RUN …", help="Their numbers or names.")


@dataclass(kw_only=True)
class OfLibrary:
    """What every command on the library takes."""

    library: LibraryFile = None
    """The library's file."""
    json: FlagCreatePairsOff[bool] = False
    """Print everything as JSON."""


@dataclass
class ListRuns(OfLibrary):
    """List the kept runs, the newest first."""

    recording: Annotated[str | None, arg(metavar="NAME", help_behavior_hint="(optional)")] = None
    """Only those of the recording with this name or folder."""


@dataclass
class ShowRun(OfLibrary):
    """Tell everything that is kept of a run but its tracks."""

    run: Annotated[Positional[str], _RUN]


@dataclass
class OpenRun(OfLibrary):
    """Start the workbench with a run as it was."""

    run: Annotated[Positional[str], _RUN]
    port: int = 8000
    """Port to listen on."""
    open: bool = True
    """Open the page in a browser."""


@dataclass
class ExportRun(OfLibrary):
    """Write a run's tracks in a form of your choice.

    csv: one row a person a step · motchallenge: a folder for TrackEval · json · parquet · trc: for
    OpenSim · gltf: boxes that move (.glb) · rerun: for its viewer (.rrd) · html: the report · mp4:
    the cameras with boxes, the room from above, lanes.
    """

    run: Annotated[Positional[str], _RUN]
    output: Annotated[Path, arg(aliases=["-o"], metavar="FILE")]
    """The file to write, of motchallenge the folder. It appears when it is complete."""
    format: FormatName = None
    """Its form."""
    video: OmitArgPrefixes[VideoPart] = field(default_factory=VideoPart)


@dataclass
class RenameRun(OfLibrary):
    """Give a run a name, which keeps it for ever; an empty one takes it away."""

    run: Annotated[Positional[str], _RUN]
    name: Annotated[
        Positional[str],
        reader_of(Marks, "title"),
        arg(metavar="NAME", help="What it is called from now on."),
    ]


@dataclass
class StarRun(OfLibrary):
    """Star runs, which keeps them for ever."""

    runs: Annotated[Positional[tuple[str, ...]], _RUNS]
    off: FlagCreatePairsOff[bool] = False
    """Take the star away."""


@dataclass
class DeleteRuns(OfLibrary):
    """Delete runs; for a day, or until `runs gc`, they can be taken back."""

    runs: Annotated[Positional[tuple[str, ...]], _RUNS]
    undo: FlagCreatePairsOff[bool] = False
    """Take deleted runs back, by their numbers."""


@dataclass
class DiffRuns(OfLibrary):
    """Set two runs against each other: values and figures that differ."""

    first: Annotated[Positional[str], arg(metavar="A", help="Number or name of a run.")]
    second: Annotated[Positional[str], arg(metavar="B", help="Number or name of another.")]


@dataclass
class CollectRuns(OfLibrary):
    """Free the space of deleted runs, and of untouched ones beyond a number."""

    keep: Annotated[int | None, arg(metavar="INT", help_behavior_hint="(default: 1000)")] = None
    """How many runs without star, name, note and tags stay, the newest ones."""


RunsAction = (
    Annotated[ListRuns, subcommand("list")]
    | Annotated[ShowRun, subcommand("show")]
    | Annotated[OpenRun, subcommand("open")]
    | Annotated[ExportRun, subcommand("export")]
    | Annotated[RenameRun, subcommand("rename")]
    | Annotated[StarRun, subcommand("star")]
    | Annotated[DeleteRuns, subcommand("delete")]
    | Annotated[DiffRuns, subcommand("diff")]
    | Annotated[CollectRuns, subcommand("gc")]
)


@dataclass
class Runs:
    """What is kept of runs: list, show, open, export, rename, star, delete, diff."""

    action: OmitSubcommandPrefixes[RunsAction] = field(default_factory=ListRuns)


@dataclass
class Bundle(OfLibrary):
    """Put a kept run into one ZIP file that `serve FILE.zip` shows on any machine, read only."""

    run: Annotated[Positional[str], _RUN]
    output: Annotated[Path, arg(aliases=["-o"], metavar="FILE.zip")]
    """The file to write. It appears when it is complete."""
    videos: FlagCreatePairsOff[bool] = False
    """Take small videos along."""


@dataclass
class LibraryCommand(OfLibrary):
    """Look through the file that keeps runs, and repair it."""

    action: Annotated[
        Positional[Literal["check"]], arg(help="Read every page of it and every run's tracks.")
    ]
    repair: FlagCreatePairsOff[bool] = False
    """Where it is damaged: keep a copy aside, and make a new file of what can be read."""
