"""The parsing of a study's file, or of the page's form, into a :class:`Definition`."""

from __future__ import annotations

import glob
import os
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, get_args

from tracker.files.text import not_utf_8, shown
from tracker.parameters.catalogue import METHODS, PARAMETERS, PRESETS, RunParameters
from tracker.parameters.values import value_of, with_current_keys, with_values
from tracker.sequences.fields import did_you_mean
from tracker.studies.definition.definition import (
    GRID_STEPS,
    MOST_TRIALS,
    Definition,
    Search,
    Varied,
)
from tracker.studies.definition.objectives import OBJECTIVES
from tracker.studies.errors import StudyError

_NAME = re.compile(r"[^\W_][\w .+-]{0,59}")
"""The pattern of a study's name, which is also the name of its folder."""

_TOP = frozenset(
    {"name", "recordings", "trials", "minutes", "seeds", "search", "objectives", "prune", "preset",
     "propose", "seed", "values", "start", "parameters"}
)  # fmt: skip
"""The fields of a study's file."""

_MOST_BYTES = 4 << 20
"""Largest size of a study's file, bytes."""

_RANGE = frozenset({"low", "high", "log", "steps", "choices"})
"""The fields of a varied parameter."""


def read_definition(path: Path) -> Definition:
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


def definition_of(found: Mapping[str, Any], *, where: str, folder: Path) -> Definition:
    """Validate the fields of a study's file, or of the page's form.

    Args:
        found: The values by field.
        where: The file's name, for messages.
        folder: The folder that relative paths refer to.

    Raises:
        StudyError: If a field is not valid; the message names the field, and states what was
            expected and found.
    """
    fields = _Fields(found, where)
    fields.only(_TOP)
    name = fields.text("name")
    if not _NAME.fullmatch(name):
        raise fields.error(
            "name", f"expected 1 to 60 letters, digits, spaces and . + -, found {_shown(name)}"
        )
    preset = fields.text("preset", "") or None
    if preset is not None and preset not in PRESETS:
        raise fields.error(
            "preset", f"expected one of {', '.join(PRESETS)}, found {_shown(preset)}"
        )
    search = fields.text("search", "auto")
    if search not in get_args(Search):
        known = ", ".join(get_args(Search))
        raise fields.error("search", f"expected one of {known}, found {_shown(search)}")
    objectives = tuple(fields.texts("objectives", []))
    for one in objectives:
        if one not in OBJECTIVES:
            hint = did_you_mean(one, OBJECTIVES)
            raise fields.error(
                "objectives", f"expected some of {', '.join(OBJECTIVES)}, found {_shown(one)}{hint}"
            )
    varied = tuple(_varied(fields, key, table) for key, table in fields.table("parameters").items())
    if not varied:
        raise fields.error("parameters", "expected at least one parameter to vary, found none")
    values = _values(fields, "values")
    start = _values(fields, "start")
    keys = {one.key for one in varied}
    for key in values:
        if key in keys:
            raise fields.error(
                f"values.{key}", "it is varied under [parameters]; name it in one of the two"
            )
    for key in start:
        if key not in keys:
            raise fields.error(f"start.{key}", "it is not varied; name it under [values] instead")
    return Definition(
        name=name,
        recordings=_recordings(fields, folder),
        varied=varied,
        trials=fields.whole("trials", 100, 1, MOST_TRIALS),
        minutes=fields.minutes(),
        seeds=_seeds(fields),
        search=search,  # type: ignore[arg-type]  # checked above
        objectives=objectives,
        prune=fields.yes("prune", True),
        preset=preset,
        propose=fields.whole("propose", 0, 0, 100),
        seed=fields.whole("seed", 0, 0, 2**32 - 1),
        values=values,
        start=start,
    )


def _recordings(fields: _Fields, folder: Path) -> tuple[str, ...]:
    """Return the names of built-in recordings and the folders that the field ``recordings`` names.

    Args:
        fields: The fields of the study.
        folder: The folder that relative paths refer to.
    """
    from tracker.sequences.built_in import BUILT_IN
    from tracker.sequences.library import is_room

    found: list[str] = []
    for name in fields.texts("recordings", None):
        if is_room(name):
            found.append(name)
            continue
        pattern = str(folder / os.path.expanduser(name))
        if os.path.exists(pattern):  # unlike Path.exists, this accepts names of any length
            found.append(pattern)
            continue
        some = sorted(
            path
            for path in glob.glob(pattern)
            if os.path.isfile(os.path.join(path, "sequence.toml"))
        )
        if not some:
            raise fields.error(
                "recordings",
                f"expected the name of a built-in room, a folder or a pattern of folders with a "
                f"sequence.toml, found nothing at {_shown(name)}{did_you_mean(name, BUILT_IN)}",
            )
        found += some
    if not found:
        raise fields.error("recordings", "expected at least one, found none")
    return tuple(dict.fromkeys(found))


def _seeds(fields: _Fields) -> tuple[int, ...]:
    """Return the seeds: those that are listed, or as many as the field states, from 0 on."""
    seeds = fields.found.get("seeds", 1)
    if isinstance(seeds, int) and not isinstance(seeds, bool) and 1 <= seeds <= 1000:
        return tuple(range(seeds))
    if isinstance(seeds, list) and seeds and all(type(s) is int and s >= 0 for s in seeds):
        return tuple(dict.fromkeys(seeds))
    raise fields.error(
        "seeds",
        f"expected how many (1 to 1000), or a list of whole numbers from 0, found {_shown(seeds)}",
    )


def _values(fields: _Fields, name: str) -> dict[str, Any]:
    """Return the valid values of parameters in a table, by key."""
    values = dict(fields.table(name))
    for key in values:
        try:
            values[key] = value_of(with_values(RunParameters(), {key: values[key]}), key)
        except ValueError as error:
            raise StudyError(f"{fields.where}, {name}: {error}") from None
    return values


def _varied(fields: _Fields, key: str, table: Any) -> Varied:
    """Return a varied parameter from its table; fields that are left out follow from the
    definition of the parameter."""
    where = f"parameters.{key}"
    if not isinstance(table, Mapping):
        raise fields.error(
            where, f"expected a table such as {{ low = 1, high = 5 }}, found {_shown(table)}"
        )
    for name in table:
        if name not in _RANGE:
            raise fields.error(
                where, f"expected some of low, high, log, steps and choices, found {_shown(name)}"
            )
    if key not in PARAMETERS and key not in METHODS:
        hint = did_you_mean(key, (*PARAMETERS, *METHODS))
        raise fields.error(
            where, f"there is no such parameter{hint}; `multiview-phd parameters` lists them all"
        )
    if key in METHODS or PARAMETERS[key].kind in ("bool", "choice"):
        allowed: tuple[Any, ...] = (
            METHODS[key]
            if key in METHODS
            else (False, True)
            if PARAMETERS[key].kind == "bool"
            else PARAMETERS[key].choices
        )
        choices = table.get("choices", allowed)
        if not isinstance(choices, list | tuple):
            raise fields.error(where, f"expected a list of choices, found {_shown(choices)}")
        choices = tuple(choices)
        for one in choices:
            if one not in allowed:
                raise fields.error(
                    where,
                    f"expected choices among {', '.join(map(str, allowed))}, found {_shown(one)}",
                )
        if len(choices) < 2:
            raise fields.error(where, "expected at least two choices; name one under [values]")
        return Varied(key, choices=choices)
    parameter = PARAMETERS[key]
    if "choices" in table:
        choices = tuple(table["choices"]) if isinstance(table["choices"], list) else ()
        if len(choices) < 2:
            raise fields.error(
                where, f"expected at least two choices, found {_shown(table['choices'])}"
            )
        for one in choices:
            _number(fields, where, key, one)
        return Varied(key, choices=choices)
    low = _number(fields, where, key, table.get("low", parameter.minimum))
    high = _number(fields, where, key, table.get("high", parameter.maximum))
    if not low < high:
        raise fields.error(where, f"expected low below high, found {low:g} and {high:g}")
    log = table.get("log", parameter.log)
    if not isinstance(log, bool) or (log and low <= 0.0):
        raise fields.error(
            where, f"log: expected true with low above 0, or false, found {_shown(log)}"
        )
    steps = table.get("steps", GRID_STEPS)
    if type(steps) is not int or not 2 <= steps <= 1000:
        raise fields.error(
            where, f"steps: expected a whole number from 2 to 1000, found {_shown(steps)}"
        )
    return Varied(key, low, high, log, steps)


def _number(fields: _Fields, where: str, key: str, found: Any) -> float:
    """Return a valid value of a numeric parameter.

    Args:
        fields: The fields of the study.
        where: The field, for messages.
        key: The key of the parameter.
        found: The value in the file.
    """
    try:
        return float(value_of(with_values(RunParameters(), {key: found}), key))
    except ValueError as error:
        words = str(error).removeprefix(f"{key}: ")
        hint = "`multiview-phd parameters` tells how far each goes"
        raise fields.error(where, f"{words}; {hint}") from None


class _Fields:
    """The fields of a definition, with checks of their types and error messages."""

    def __init__(self, found: Mapping[str, Any], where: str) -> None:
        self.found = found
        self.where = where

    def error(self, name: str, words: str) -> StudyError:
        return StudyError(f"{self.where}, {name}: {words}")

    def only(self, known: frozenset[str]) -> None:
        for name in self.found:
            if name not in known:
                raise self.error(name, f"there is no such field{did_you_mean(name, known)}")

    def text(self, name: str, default: str | None = None) -> str:
        found = self.found.get(name, default)
        if not isinstance(found, str):
            raise self.error(name, f"expected text, found {_shown(found)}")
        return found

    def texts(self, name: str, default: list[str] | None) -> list[str]:
        found = self.found.get(name, default)
        if isinstance(found, str):
            found = [found]
        if not isinstance(found, list) or not all(isinstance(one, str) for one in found):
            raise self.error(name, f"expected a list of texts, found {_shown(found)}")
        return found

    def whole(self, name: str, default: int, low: int, high: int) -> int:
        found = self.found.get(name, default)
        if type(found) is not int or not low <= found <= high:
            raise self.error(
                name, f"expected a whole number from {low} to {high}, found {_shown(found)}"
            )
        return found

    def minutes(self) -> float | None:
        found = self.found.get("minutes")
        if found is None:
            return None
        if type(found) not in (int, float) or not 0.0 < found <= 1e6:
            raise self.error("minutes", f"expected a number above 0, found {_shown(found)}")
        return float(found)

    def yes(self, name: str, default: bool) -> bool:
        found = self.found.get(name, default)
        if not isinstance(found, bool):
            raise self.error(name, f"expected true or false, found {_shown(found)}")
        return found

    def table(self, name: str) -> Mapping[str, Any]:
        found = self.found.get(name, {})
        if not isinstance(found, Mapping):
            raise self.error(name, f"expected a table [{name}], found {_shown(found)}")
        return _flat(found) if name != "parameters" else _flat_ranges(found)


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
