"""The command line's arguments as types; each parameter's flag is made from its definition.

Nothing here imports the engine: ``--help`` is there at once.
"""

from __future__ import annotations

import functools
import operator
import os
import sys
from collections.abc import Collection, Iterable
from dataclasses import dataclass, field, make_dataclass
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, Literal, get_args, get_type_hints

import tyro
from tyro.conf import (
    FlagCreatePairsOff,
    OmitArgPrefixes,
    Positional,
    UseAppendAction,
    arg,
    subcommand,
)

from app.command.arguments import (
    IMPORT_FLAGS,
    PAIRS,
    Batch,
    Benchmark,
    Bundle,
    Check,
    Corrections,
    Detector,
    ExportCalibration,
    FormatName,
    Formats,
    FromZero,
    FusionMethod,
    Import,
    LibraryCommand,
    LibraryFile,
    LogFile,
    Parameters,
    Port,
    PresetName,
    Runs,
    SequenceName,
    Sequences,
    SetValues,
    SingleView,
    SmoothingMethod,
    Study,
    Templates,
    Tune,
)
from app.command.terminal import say
from app.command.typed import WrongValue, flag_of, limited, registry
from tracker import __version__
from tracker.files.folders import MOST_GB
from tracker.library import KEEP
from tracker.parameters import presets
from tracker.parameters.catalogue import (
    GROUPS,
    METHODS,
    PARAMETERS,
    REMOVED,
    RENAMED,
    Parameter,
)
from tracker.parameters.values import ParameterError, current_key, removed_notes

DEFAULT_SEQUENCE = "room44-3p"

ONLY_IN_A_CHECKOUT = {
    "experiment": "python -m tests.papers NAME",
    "render": "python -m tests.rooms NAME -o FOLDER",
}
"""Commands of earlier versions that only developers need, and what replaces each."""


def has_screen() -> bool:
    """Whether a browser can be shown."""
    if sys.platform.startswith(("win", "darwin")):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def set_values(items: tuple[str, ...]) -> dict[str, str]:
    """The values of ``--set`` by the keys of now, without parameters that no longer exist; what has
    another key now, or is gone, is said.

    Raises:
        ParameterError: If one is not KEY=VALUE.
    """
    values = {}
    for item in items:
        key, mark, text = item.partition("=")
        if not mark:
            raise ParameterError("--set", f"expected KEY=VALUE, got {item!r}")
        given = key.strip()
        if (now := current_key(given)) != given:
            say(f"{given} is called {now} now")
        values[now] = text.strip()
    for sentence in removed_notes(values):
        say(sentence)
    return {key: text for key, text in values.items() if key not in REMOVED}


def preset_values(name: str | None) -> dict[str, Any]:
    """The values of ``--preset`` by key; none where none is named.

    Raises:
        ParameterError: If it is neither a built-in preset nor one of the user's own, or these
            cannot be read.
    """
    if name is None:
        return {}
    try:
        values = presets.preset_values(name)
    except ValueError as error:
        raise ParameterError("--preset", str(error)) from None
    for sentence in removed_notes(values):
        say(sentence)
    return values


def changes_of(command: Track | Batch, flags: Iterable[str] = METHODS) -> dict[str, Any]:
    """The values that a command asks for, by key: preset, then ``--set``, then flags.

    Args:
        command: The command.
        flags: Keys that have a flag of their own.

    Raises:
        ParameterError: If the preset or a ``--set`` is not as it must be.
    """
    changes: dict[str, Any] = {**preset_values(command.preset), **set_values(command.set)}
    given = {key: operator.attrgetter(key)(command) for key in flags}
    return changes | {key: value for key, value in given.items() if value is not None}


@dataclass
class Serve:
    """Start the workbench and serve its page on this machine."""

    sequence: Annotated[
        Positional[str],
        arg(metavar="[SEQUENCE]", help="A built-in room's name, a folder, or a bundle (.zip)."),
    ] = DEFAULT_SEQUENCE
    host: str = "127.0.0.1"
    """Address to listen on. Anything but this machine's own lets others change what you see."""
    port: Port = 8000
    """Port to listen on."""
    token: bool = True
    """Admit only requests with the token of the printed link; $MULTIVIEW_PHD_TOKEN chooses one."""
    open: bool = field(default_factory=has_screen)
    """Open the page in a browser; by default where there is a screen."""
    data: Annotated[Path | None, arg(metavar="DIR", help_behavior_hint="(optional)")] = None
    """Folder whose folders are sequences that can be chosen on the page."""
    detector: Annotated[Path | None, arg(metavar="MODEL", help_behavior_hint="(optional)")] = None
    """A detection network of your own, as ONNX, which onnx_detector runs on pictures instead of the
    fetched one."""
    library: LibraryFile = None
    """The library's file, in which finished runs are stored."""
    keep: FromZero = KEEP
    """Number of runs without star, name, note and tags that stay stored, the newest ones; 0 stores
    none."""
    memory: Annotated[
        float | None,
        limited(float, "0.0625 to 65536 GB", 0.0625, 65536.0),
        arg(metavar="GB", help_behavior_hint="(optional)"),
    ] = None
    """Memory of the caches of pictures and of runs' columns; by default half of the machine's, at
    most 1 GB."""
    disk: Annotated[
        float | None,
        limited(float, f"0 to {MOST_GB} GB", 0.0, MOST_GB),
        arg(metavar="GB", help_behavior_hint="(optional)"),
    ] = None
    """Disk space of the cache of stage 1, of which the least recently used results are deleted
    first; by default $MULTIVIEW_PHD_CACHE_GB, or 2 GB. 0 disables it."""


@dataclass
class Track:
    """Track the people of a sequence and write their tracks, as CSV or in another form."""

    sequence: SequenceName
    output: Annotated[Path, arg(aliases=["-o"])]
    """The file to write. It appears when it is complete."""
    format: FormatName = None
    """The form of the file; `runs export` lists them."""
    single_view: SingleView = None
    fusion_method: FusionMethod = None
    smoothing_method: SmoothingMethod = None
    preset: PresetName = None
    set: SetValues = ()
    """One parameter, as in --set fusion.survival_probability=0.98; `parameters` lists the keys."""
    seed: FromZero = 0
    """Seed of all randomness; the same seed gives the same tracks, but for the last digits on
    processors without fused multiply-add."""
    detector: Annotated[Path | None, arg(metavar="MODEL", help_behavior_hint="(optional)")] = None
    """A detection network of your own, as ONNX, which onnx_detector runs on pictures instead of the
    fetched one."""
    corrections: LogFile = None
    """The corrections that the run applies."""
    no_corrections: FlagCreatePairsOff[bool] = False
    """Apply no corrections, not even those of the sequence."""
    cache: bool = True
    """Read results of stage 1 with the same values from the cache, and write new ones to it."""
    strict: bool = False
    """End with status 1 where a picture was missing; the tracks are written all the same."""
    library: LibraryFile = None
    """The library's file, in which finished runs are stored."""
    keep: FromZero = KEEP
    """Number of runs without star, name, note and tags that stay stored, the newest ones; 0 stores
    none."""

    def changes(self) -> dict[str, Any]:
        """The values asked for, by key."""
        return changes_of(self, (*METHODS, *PARAMETERS))


@dataclass
class Detect:
    """Detect people with a network (ONNX) and write the boxes of every camera as CSV."""

    sequence: SequenceName
    output: Annotated[Path, arg(aliases=["-o"], metavar="FOLDER")]
    """Where `CAMERA.csv` is written for each camera, as `detections` of a sequence.toml."""
    model: Annotated[
        Path | None, arg(metavar="MODEL", help_behavior_hint="(default: the fetched one)")
    ] = None
    """An ONNX file; the layout of its outputs is inferred from their shapes."""
    set: SetValues = ()
    """One parameter, as in --set onnx_detector.score_threshold=0.5; `parameters` lists the keys."""


@dataclass
class Evaluate:
    """Score a track file against the truth, or, without one, estimate the consistency of ids."""

    sequence: SequenceName
    tracks: Annotated[
        Positional[Path | None],
        arg(
            metavar="TRACKS",
            help="As `track` and the page write them: CSV, JSON, Parquet, TRC, or MOTChallenge's "
            "folder or its ground plane (.txt). Without one no truth is needed: the sequence is "
            "tracked forward, backwards and without each camera.",
            help_behavior_hint="(optional)",
        ),
    ] = None
    truth: Annotated[Path | None, arg(metavar="TRUTH.csv", help_behavior_hint="(optional)")] = None
    """Another truth than the sequence's own, for instance that of `corrections truth`."""
    json: FlagCreatePairsOff[bool] = False
    """Print everything as JSON instead of tables."""
    html: Annotated[Path | None, arg(metavar="REPORT.html", help_behavior_hint="(optional)")] = None
    """Write a report as well: one file with figures, plots, paths and tracks."""


def describe_range(parameter: Parameter) -> str:
    """What a parameter may be, in words and without its unit: a range or its choices."""
    if parameter.kind == "choice":
        return "|".join(parameter.choices)
    if parameter.kind == "bool":
        return "true|false"
    return f"{parameter.minimum:g} … {parameter.maximum:g}"


def show(value: Any) -> str:
    """A value as it is typed."""
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value:g}" if isinstance(value, float) else str(value)


def _flag(parameter: Parameter) -> tuple[str, Any, Any]:
    metavar = {"float": "FLOAT", "int": "INT"}.get(parameter.kind, describe_range(parameter))
    bounds = f", {describe_range(parameter)} {parameter.unit}".rstrip()
    if parameter.kind not in ("float", "int"):
        bounds = ""  # the choices stand in the flag's own line
    annotation = Annotated[
        str | None,
        arg(
            metavar=metavar,
            help=f"{parameter.help} {parameter.symbol}{bounds}.",
            help_behavior_hint=f"(default: {show(parameter.default)})",
        ),
    ]
    return parameter.name, annotation, field(default=None)


def _track_with_flags() -> Any:
    """``Track`` with a flag for every parameter: ``--fusion.survival-probability`` and so on."""
    groups: list[tuple[str, Any, Any]] = []
    for group, text in GROUPS.items():
        flags = [_flag(p) for p in PARAMETERS.values() if p.group == group]
        kind = make_dataclass(f"{group.title().replace('_', '')}Flags", flags)
        kind.__doc__ = text
        groups.append((group, kind, field(default_factory=kind)))
    with_flags = make_dataclass("TrackWithFlags", groups, bases=(Track,))
    with_flags.__doc__ = Track.__doc__
    return with_flags


def _evaluate_with_settings() -> Any:
    """``Evaluate`` with a flag for every setting of the evaluation: ``--gate`` and so on."""
    from tracker.evaluation import EvaluationSettings

    settings = OmitArgPrefixes[EvaluationSettings]
    fields = [("settings", settings, field(default_factory=EvaluationSettings))]
    with_settings = make_dataclass("EvaluateWithSettings", fields, bases=(Evaluate,))
    with_settings.__doc__ = Evaluate.__doc__
    return with_settings


def _import_with_flags() -> Any:
    """``Import`` with a flag for every option of an import that a word can state."""
    from tracker.io.importing.options import ImportOptions

    flags: list[tuple[str, Any, Any]] = []
    for option, name in IMPORT_FLAGS.items():
        own = ImportOptions.model_fields[option]
        words = " ".join((own.description or "").split())
        if option in PAIRS:
            text = arg(help=words, metavar=PAIRS[option], help_behavior_hint="(repeatable)")
            kind: Any = Annotated[UseAppendAction[tuple[str, ...]], text]
        elif own.annotation is bool:
            kind = Annotated[FlagCreatePairsOff[bool], arg(help=words)]
        elif option == "boxes":  # the one flag of two options
            layouts = get_args(get_args(own.annotation)[0])
            choices: Any = Literal[*layouts, *(f"{one}-normalised" for one in layouts)] | None
            kind = Annotated[choices, arg(help=words, help_behavior_hint="(default: inferred)")]
        else:
            kind, _ = flag_of(ImportOptions, option, "default: inferred")
        flags.append((name, kind, field(default=own.default)))
    with_flags = make_dataclass("ImportWithFlags", flags, bases=(Import,))
    with_flags.__doc__ = Import.__doc__
    return with_flags


COMMANDS: dict[str, tuple[Any, str]] = {
    "serve": (Serve, "main:serve"),
    "track": (Track, "track:track"),
    "detect": (Detect, "detector:detect"),
    "detector": (Detector, "detector:detector"),
    "evaluate": (Evaluate, "evaluate:evaluate"),
    "benchmark": (Benchmark, "listing:benchmark"),
    "import": (Import, "importing:import_files"),
    "check": (Check, "importing:check_sequence"),
    "formats": (Formats, "importing:formats"),
    "export-calibration": (ExportCalibration, "importing:export_calibration"),
    "sequences": (Sequences, "listing:sequences"),
    "parameters": (Parameters, "listing:parameters"),
    "runs": (Runs, "runs:runs"),
    "bundle": (Bundle, "runs:bundle"),
    "library": (LibraryCommand, "runs:check"),
    "study": (Study, "studies:study"),
    "batch": (Batch, "studies:batch"),
    "tune": (Tune, "studies:tune"),
    "corrections": (Corrections, "correcting:corrections"),
    "templates": (Templates, "templates:templates"),
}
"""Each command: its arguments, and the module and function that do it. The module is imported when
the command is asked for, and the engine with it."""


def run(command: Any) -> int:
    """Do what a parsed command asks for; returns the exit status."""
    place = next(place for kind, place in COMMANDS.values() if isinstance(command, kind))
    module, _, name = place.partition(":")
    status: int | None = getattr(import_module(f"app.command.{module}"), name)(command)
    return status or 0


def _with_current_flags(arguments: Iterable[str]) -> list[str]:
    """The arguments with the flags of now for those that parameters had in earlier versions.

    A flag of a parameter that no longer exists becomes a ``--set``, which says what holds instead.
    """
    flags = {
        f"--{old}".replace("_", "-"): f"--{new}".replace("_", "-") for old, new in RENAMED.items()
    }
    removed = {f"--{key}".replace("_", "-"): key for key in REMOVED}
    found, rest = [], iter(arguments)
    for argument in rest:
        flag, mark, value = argument.partition("=")
        name = flag.replace("_", "-")
        if name in removed:
            found += ["--set", f"{removed[name]}={value if mark else next(rest, '')}"]
        else:
            found.append(flags.get(name, flag) + mark + value)
    return found


def parse(arguments: list[str] | None = None) -> Any:
    """The command and its arguments. Wrong usage ends the program with status 2.

    Raises:
        ParameterError: If there is no such command, or it is one that only a checkout has.
    """
    asked = _with_current_flags(sys.argv[1:] if arguments is None else arguments)
    if asked[:1] and asked[0] in ONLY_IN_A_CHECKOUT:
        raise ParameterError(
            asked[0],
            f"the program no longer has this command; run `{ONLY_IN_A_CHECKOUT[asked[0]]}` in a "
            "checkout",
        )
    if asked[:1] == ["study"] and asked[1:2] and asked[1].endswith(".toml"):
        asked = ["study", "run", *asked[1:]]  # `study STUDY.toml` runs it
    named = {name: kind for name, (kind, _) in COMMANDS.items()}
    named["track"] = _track_with_flags()
    # their settings come with the engine, which only who evaluates or imports has to wait for
    if asked[:1] == ["evaluate"]:
        named["evaluate"] = _evaluate_with_settings()
    if asked[:1] == ["import"]:
        named["import"] = _import_with_flags()
    if asked[:1] == ["--version"]:
        sys.stdout.write(f"multiview-phd {__version__}\n")
        raise SystemExit(0)
    _check_word(asked[:1], named, "")
    if asked[:1] and asked[0] in named:
        _check_word(asked[1:2], _actions(named[asked[0]]), f"{asked[0]} ")
    commands: Any = functools.reduce(
        operator.or_, (Annotated[kind, subcommand(name)] for name, kind in named.items())
    )
    try:
        return tyro.cli(
            commands,
            prog="multiview-phd",
            description="Track several people in 3D from calibrated cameras. --version says which "
            "version this is.",
            args=asked,
            registry=registry(),
        )
    except WrongValue as wrong:
        raise wrong.of(asked) from None


def _actions(command: Any) -> list[str]:
    """Return the names of a command's own commands: ``list``, ``show``, … of ``runs``."""
    if "action" not in command.__annotations__:
        return []
    action = get_type_hints(command, include_extras=True)["action"]
    kinds = get_args(get_args(action)[0] if hasattr(action, "__metadata__") else action)
    return [one.__metadata__[0].name for one in kinds if hasattr(one, "__metadata__")]


def _check_word(given: list[str], known: Collection[str], before: str) -> None:
    """Check that the word that a command begins with, if there is one, is known.

    Raises:
        ParameterError: If not; its message names the nearest.
    """
    if known and given and not given[0].startswith("-") and given[0] not in known:
        from tracker.sequences.fields import did_you_mean, listed

        raise ParameterError(
            f"{before}{given[0]}",
            f"expected one of the commands {listed(known)}{did_you_mean(given[0], known)}",
        )
