"""The definition of a study: its file, recordings, varied parameters, seeds and objectives."""

from __future__ import annotations

import glob
import json
import os
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PrivateAttr,
    ValidationError,
    ValidationInfo,
    model_validator,
)

from tracker.files.text import not_utf_8, shown
from tracker.parameters.catalogue import METHODS, PARAMETERS, RunParameters
from tracker.parameters.presets import preset_values
from tracker.parameters.values import removed_notes, value_of, with_current_keys, with_values
from tracker.sequences.fields import did_you_mean
from tracker.sequences.reader import FILE
from tracker.studies.errors import StudyError
from tracker.studies.objectives import OBJECTIVES
from tracker.studies.space import GRID_STEPS, Varied, around

Search = Literal["auto", "tpe", "nsga2", "random", "grid"]
"""The search method; ``auto`` is TPE for one objective and NSGA-II for several."""

MOST_TRIALS = 1_000_000
"""Largest number of trials; with it and a limit of time, the time alone limits a study."""

_MOST_BYTES = 4 << 20
"""Largest size of a study's file, bytes."""

_EXPECTED = {
    "name": "1 to 60 letters, digits, spaces and . + -",
    "recordings": "a list of texts",
    "trials": f"a whole number from 1 to {MOST_TRIALS}",
    "minutes": "a number above 0",
    "seeds": "how many (1 to 1000), or a list of whole numbers from 0",
    "search": f"one of {', '.join(get_args(Search))}",
    "objectives": f"some of {', '.join(OBJECTIVES)}",
    "prune": "true or false",
    "preset": "the name of a preset, or a table [preset]",
    "propose": "a whole number from 0 to 100",
    "seed": f"a whole number from 0 to {2**32 - 1}",
    "values": "a table [values]",
    "start": "a table [start]",
    "parameters": "a table [parameters]",
}
"""The valid values of each field of a study's file, in words."""


class _InvalidFieldError(ValueError):
    """A field is not valid, for a reason in words of its own."""

    def __init__(self, field: str, words: str) -> None:
        super().__init__(words)
        self.field = field


def _listed(found: Any) -> Any:
    """Return a text, or a list of texts, as a tuple."""
    return (
        (found,) if isinstance(found, str) else tuple(found) if isinstance(found, list) else found
    )


def places_of(names: Iterable[str], folder: Path) -> list[str]:
    """Return the built-in recordings and the absolute folders that names refer to, without
    duplicates.

    Args:
        names: Names of built-in recordings, folders, and patterns of folders.
        folder: The folder that relative paths refer to.

    Raises:
        StudyError: If a name matches nothing.
    """
    from tracker.sequences.built_in import BUILT_IN
    from tracker.sequences.library import is_room

    found: list[str] = []
    for name in names:
        pattern = str(folder / os.path.expanduser(name))
        if is_room(name):
            found.append(name)
        elif os.path.exists(pattern):  # unlike Path.exists, this accepts names of any length
            found.append(pattern)
        elif some := sorted(p for p in glob.glob(pattern) if os.path.isfile(os.path.join(p, FILE))):
            found += some
        else:
            raise StudyError(
                f"expected the name of a built-in room, a folder or a pattern of folders with a "
                f"{FILE}, found nothing at {shown(name)}{did_you_mean(name, BUILT_IN)}"
            )
    return list(dict.fromkeys(found))


def _recordings(names: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
    """Return the places of recordings; relative paths refer to the folder in the context."""
    try:
        found = tuple(places_of(names, (info.context or {}).get("folder", Path())))
    except StudyError as error:
        raise _InvalidFieldError("recordings", str(error)) from None
    if not found:
        raise _InvalidFieldError("recordings", "expected at least one, found none")
    return found


def _seeds(found: Any) -> Any:
    """Return the seeds: those that are listed, or as many as the field states, from 0 on."""
    if type(found) is int and 1 <= found <= 1000:
        return tuple(range(found))
    return tuple(dict.fromkeys(found)) if isinstance(found, list | tuple) else found


def _known(objectives: tuple[str, ...]) -> tuple[str, ...]:
    """Check that texts are keys of objectives."""
    for one in objectives:
        if one not in OBJECTIVES:
            hint = did_you_mean(one, OBJECTIVES)
            words = f"expected {_EXPECTED['objectives']}, found {shown(one)}{hint}"
            raise _InvalidFieldError("objectives", words)
    return objectives


def _checked_values(found: Any, info: ValidationInfo) -> Any:
    """Return the valid values of parameters in a table, by key."""
    if not isinstance(found, Mapping):
        return found
    values = _flat(found)
    for key in values:
        try:
            values[key] = value_of(with_values(RunParameters(), {key: values[key]}), key)
        except ValueError as error:
            raise _InvalidFieldError(str(info.field_name), str(error)) from None
    return values


def _all_varied(found: Any) -> Any:
    """Return the varied parameters from their tables."""
    if not isinstance(found, Mapping):
        return found
    varied = tuple(_varied(key, table) for key, table in _flat_ranges(found).items())
    if not varied:
        gone = "".join(f"; {note}" for note in removed_notes(_keys(found)))
        words = f"expected at least one parameter to vary, found none{gone}"
        raise _InvalidFieldError("parameters", words)
    return varied


class StudyDefinition(BaseModel):
    """A validated definition of a study."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", strict=True, populate_by_name=True, allow_inf_nan=False
    )

    name: Annotated[str, Field(pattern=r"^[^\W_][\w .+-]{0,59}$")]
    """The name of the study and of its folder."""
    recordings: Annotated[tuple[str, ...], BeforeValidator(_listed), AfterValidator(_recordings)]
    """Names of built-in recordings, or absolute folders."""
    trials: Annotated[int, Field(ge=1, le=MOST_TRIALS)] = 100
    """Largest number of trials."""
    minutes: Annotated[float, Field(gt=0.0, le=1e6)] | None = None
    """Time after which no trial begins, minutes; None for no limit."""
    seeds: Annotated[
        tuple[Annotated[int, Field(ge=0)], ...], Field(min_length=1), BeforeValidator(_seeds)
    ] = (0,)
    """The seeds of the runs on each recording."""
    search: Search = "auto"
    """The search method."""
    objectives: Annotated[tuple[str, ...], BeforeValidator(_listed), AfterValidator(_known)] = ()
    """Keys of :data:`~tracker.studies.objectives.OBJECTIVES`, the most important one first; if
    empty, they are chosen by whether the recordings have ground truth."""
    prune: bool = True
    """Whether trials are pruned if they are worse than the median after their first runs."""
    propose: Annotated[int, Field(ge=0, le=100)] = 0
    """The number of further seeds on which the best trials are evaluated again at the end, so that
    the best of them can be proposed; 0 for no proposal."""
    seed: Annotated[int, Field(ge=0, le=2**32 - 1)] = 0
    """The seed of the sampler."""
    preset: Annotated[Mapping[str, Any], BeforeValidator(_checked_values)] = {}
    """The values of the preset that all trials have; a file may name the preset instead."""
    values: Annotated[Mapping[str, Any], BeforeValidator(_checked_values)] = {}
    """Fixed values of all trials, which override the recording's defaults and the preset."""
    start: Annotated[Mapping[str, Any], BeforeValidator(_checked_values)] = {}
    """Values of varied parameters that are tried right after the defaults."""
    varied: Annotated[tuple[Varied, ...], BeforeValidator(_all_varied), Field(alias="parameters")]
    """The varied parameters; in the file a table by key."""

    _notes: tuple[str, ...] = PrivateAttr(())

    @property
    def notes(self) -> tuple[str, ...]:
        """One sentence for each parameter that the file names and that no longer exists."""
        return self._notes

    @model_validator(mode="after")
    def _check_tables(self) -> StudyDefinition:
        """Check that each parameter is in the table where it belongs."""
        keys = {one.key for one in self.varied}
        for key in self.values:
            if key in keys:
                words = "it is varied under [parameters]; name it in one of the two"
                raise _InvalidFieldError(f"values.{key}", words)
        for key in self.start:
            if key not in keys:
                words = "it is not varied; name it under [values] instead"
                raise _InvalidFieldError(f"start.{key}", words)
        return self

    def held(self) -> dict[str, Any]:
        """Return the fixed values of all trials by key: the preset's, overridden by
        :attr:`values`."""
        return {**self.preset, **self.values}

    def to_json(self) -> dict[str, Any]:
        """Return the content of the study's file as plain values."""
        content = self.model_dump(mode="json", exclude={"varied"}, exclude_none=True)
        for name in ("preset", "values", "start"):
            if not content[name]:
                del content[name]
        return content | {"parameters": {one.key: one.table() for one in self.varied}}

    @property
    def by_time_alone(self) -> bool:
        """Whether the number of trials is limited by the time alone."""
        return self.minutes is not None and self.trials >= MOST_TRIALS

    def within(self) -> str:
        """Return the limit of trials in words, to be put after the number of trials done."""
        return f"in {self.minutes:g} minutes" if self.by_time_alone else f"of {self.trials}"

    def to_toml(self) -> str:
        """Return the text of the study's file."""
        import tomlkit

        return tomlkit.dumps(self.to_json())


def read_definition(path: Path) -> StudyDefinition:
    """Read a study's file.

    Raises:
        StudyError: If the file cannot be read or a field is not valid; the message names the field.
    """
    text = _text_of(path)
    try:
        found = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise StudyError(f"{path}: expected TOML, found something else ({error})") from None
    except (ValueError, RecursionError):
        raise StudyError(
            f"{path}: expected a few levels and numbers of at most 18 digits, found more; "
            "shorten it"
        ) from None
    return definition_of(found, where=str(path), folder=path.absolute().parent)


def _text_of(path: Path) -> str:
    """Read the text of a study's file."""
    try:
        size = path.stat().st_size
        if size > _MOST_BYTES:
            raise StudyError(
                f"{path}: expected at most {_MOST_BYTES >> 20} MB, found {size / 2**20:,.0f} MB; "
                "name a study's file"
            )
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise StudyError(
            f"{path}: cannot be read ({error.strerror}); name a study's file"
        ) from None
    except UnicodeDecodeError as error:
        raise StudyError(f"{path}, {not_utf_8(error)}") from None


def definition_of(found: Mapping[str, Any], *, where: str, folder: Path) -> StudyDefinition:
    """Validate the fields of a study's file, or of the page's form.

    Args:
        found: The values by field.
        where: The file's name, for messages.
        folder: The folder that relative paths refer to.

    Raises:
        StudyError: If a field is not valid; the message names the field, and states what was
            expected and found.
    """
    found = {"parameters": {}, **found}
    if isinstance(name := found.get("preset"), str):
        try:
            # its values and not its name are stored: the user may change a preset later
            found["preset"] = preset_values(name)
        except ValueError as error:
            raise StudyError(f"{where}, preset: {error}") from None
    try:
        definition = StudyDefinition.model_validate(found, context={"folder": folder})
        tables = (found.get(name) for name in ("preset", "values", "start", "parameters"))
        keys = [key for table in tables if isinstance(table, Mapping) for key in _keys(table)]
        definition._notes = removed_notes(dict.fromkeys(keys))
        return definition
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
    cause = first.get("ctx", {}).get("error")
    if isinstance(cause, _InvalidFieldError):
        raise StudyError(f"{where}, {cause.field}: {cause}")
    field = str(first["loc"][0])
    if first["type"] == "extra_forbidden":
        raise StudyError(
            f"{where}, {field}: there is no such field{did_you_mean(field, _EXPECTED)}"
        )
    there = "nothing" if first["type"] == "missing" else _shown(first["input"])
    raise StudyError(f"{where}, {field}: expected {_EXPECTED[field]}, found {there}")


def _varied(key: str, table: Any) -> Varied:
    """Return a varied parameter from its table; fields that are left out follow from the
    definition of the parameter."""

    def wrong(words: str) -> _InvalidFieldError:
        return _InvalidFieldError(f"parameters.{key}", words)

    if not isinstance(table, Mapping):
        raise wrong(f"expected a table such as {{ low = 1, high = 5 }}, found {_shown(table)}")
    for name in table:
        if name not in ("low", "high", "log", "steps", "choices"):
            raise wrong(f"expected some of low, high, log, steps and choices, found {shown(name)}")
    if key not in PARAMETERS and key not in METHODS:
        hint = did_you_mean(key, (*PARAMETERS, *METHODS))
        raise wrong(f"there is no such parameter{hint}; `multiview-phd parameters` lists them all")

    def number(found: Any) -> float:
        try:
            return float(value_of(with_values(RunParameters(), {key: found}), key))
        except ValueError as error:
            words = str(error).removeprefix(f"{key}: ")
            raise wrong(f"{words}; `multiview-phd parameters` tells how far each goes") from None

    allowed = _allowed(key)
    if allowed or "choices" in table:
        choices = table.get("choices", allowed)
        if not isinstance(choices, list | tuple):
            raise wrong(f"expected a list of choices, found {_shown(choices)}")
        for one in choices:
            if not allowed:
                number(one)
            elif one not in allowed:
                some = ", ".join(map(str, allowed))
                raise wrong(f"expected choices among {some}, found {_shown(one)}")
        if len(choices) < 2:
            raise wrong("expected at least two choices; name one under [values]")
        return Varied(key, choices=tuple(choices))
    parameter = PARAMETERS[key]
    low, high = (
        number(table.get(name, limit))
        for name, limit in (("low", parameter.minimum), ("high", parameter.maximum))
    )
    if not low < high:
        raise wrong(f"expected low below high, found {low:g} and {high:g}")
    log, steps = table.get("log", parameter.log), table.get("steps", GRID_STEPS)
    if not isinstance(log, bool) or (log and low <= 0.0):
        raise wrong(f"log: expected true with low above 0, or false, found {_shown(log)}")
    if type(steps) is not int or not 2 <= steps <= 1000:
        raise wrong(f"steps: expected a whole number from 2 to 1000, found {_shown(steps)}")
    return Varied(key, low, high, log, steps)


def _allowed(key: str) -> tuple[Any, ...]:
    """Return the values of a parameter, or of a choice of a method, that is not a number."""
    if key in METHODS:
        return tuple(METHODS[key])
    parameter = PARAMETERS[key]
    return (False, True) if parameter.kind == "bool" else tuple(parameter.choices)


def _flat(table: Mapping[str, Any]) -> dict[str, Any]:
    """Flatten nested tables of values, since TOML reads ``fusion.clutter_rate = 2`` without quotes
    as a table in a table."""
    flat: dict[str, Any] = {}
    for key, found in table.items():
        if isinstance(found, Mapping):
            flat |= {f"{key}.{name}": one for name, one in found.items()}
        else:
            flat[key] = found
    return with_current_keys(flat)


def _keys(table: Mapping[str, Any]) -> Iterator[str]:
    """Yield the keys of a table, and those of its tables with the group before them."""
    for key, found in table.items():
        yield key
        if isinstance(found, Mapping):
            yield from (f"{key}.{name}" for name in found)


def _flat_ranges(table: Mapping[str, Any]) -> dict[str, Any]:
    """Flatten nested tables of ranges, each of which is a table itself."""
    flat: dict[str, Any] = {}
    for key, found in table.items():
        groups = isinstance(found, Mapping) and key not in METHODS and "." not in key
        if groups and all(isinstance(one, Mapping) for one in found.values()) and found:
            flat |= {f"{key}.{name}": one for name, one in found.items()}
        else:
            flat[key] = found
    return with_current_keys(flat)


def _shown(found: Any) -> str:
    return "nothing" if found is None else shown(found)


_KEYS = ("fusion.detection_probability", "fusion.clutter_rate", "fusion.acceleration_sigma")


def example(name: str, recordings: Sequence[str], *, objective: str = "score") -> str:
    """Return the text of an example of a study's file.

    Args:
        name: The name of the study.
        recordings: Names of built-in recordings, or folders.
        objective: The key of its objective.
    """
    listed = ", ".join(json.dumps(one, ensure_ascii=False) for one in recordings)
    ranges = []
    for key in _KEYS:
        parameter, one = PARAMETERS[key], around(key, PARAMETERS[key].default)
        unit = f" {parameter.unit}" if parameter.unit else ""
        log = ", log = true" if one.log else ""
        ranges.append(f"# {parameter.symbol}{unit}: {parameter.help}")
        ranges.append(f'"{key}" = {{ low = {one.low:g}, high = {one.high:g}{log} }}')
    joined = "\n".join(ranges)
    return f"""# A study of multiview-phd. Run it by: multiview-phd study run FILE

name = {json.dumps(name, ensure_ascii=False)}

# Built-in rooms, folders, or patterns of folders such as "recordings/*"; paths from this file on.
recordings = [{listed}]

# How many values are tried. The first trial is always the defaults.
trials = 60

# No trial begins after so many minutes; without this line there is no such bound.
# minutes = 30

# How often each is run on each recording (seeds 0, 1, …), or a list of seeds.
seeds = 1

# "tpe", "nsga2", "random", "grid", or "auto": TPE for one objective, NSGA-II for several.
search = "auto"

# What is sought, the leading figure first: any of `evaluate`, "score" (the mean of HOTA and IDF1),
# "speed", or "identity", which needs no truth. Without this line: HOTA, IDF1 and speed where all
# recordings have a truth, else identity.
objectives = ["{objective}"]

# Whether hopeless trials are given up after a third of their runs.
prune = true

# On how many other seeds the best are measured again at the end, before one is proposed.
propose = 2

# The preset to start from, built in or one of your own, and the sampler's seed.
preset = "robust"
seed = 0

# What all trials have, by key; `multiview-phd parameters` lists the keys.
[values]
# smoothing_method = "none"

# What is varied. A number takes low, high, log and, for a grid, steps; what is left out follows
# from its definition. Anything else takes choices. A parameter counts only where its method and
# the values it depends on are chosen.
[parameters]
{joined}
smoothing_method = {{ choices = ["positions", "identities"] }}
"""
