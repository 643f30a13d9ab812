"""A parameter that was renamed keeps the value that a file gave it under its old name."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.library.runs import RECORDING, run
from tracker.library.store import Library, parameters_of
from tracker.parameters.catalogue import METHODS, PARAMETERS, RENAMED, RunParameters
from tracker.parameters.values import (
    ParameterError,
    changed_values,
    value_of,
    with_current_keys,
    with_values,
)

DEFAULTS = RunParameters()
OTHER: dict[str, Any] = {old: PARAMETERS[new].maximum for old, new in RENAMED.items()}
"""A value that is not the default for each renamed parameter, by its old key."""

MEANT = {RENAMED[old]: value for old, value in OTHER.items()}


def test_every_old_key_leads_to_a_parameter_and_is_none_itself() -> None:
    assert set(RENAMED.values()) <= set(PARAMETERS)
    assert not set(RENAMED) & {*PARAMETERS, *METHODS}
    for old, new in RENAMED.items():
        assert old.split(".")[0] == new.split(".")[0], "a group's values are read by group"
        assert PARAMETERS[new].default != OTHER[old]


def test_values_by_old_keys_are_those_of_now() -> None:
    after = with_values(DEFAULTS, OTHER)
    assert changed_values(after) == MEANT
    assert {old: value_of(after, old) for old in OTHER} == OTHER


def test_a_wrong_value_is_refused_under_the_name_of_now() -> None:
    for old, new in RENAMED.items():
        with pytest.raises(ParameterError, match=rf"^{new}: must be between") as caught:
            with_values(DEFAULTS, {old: -1})
        assert caught.value.key == new


def test_where_both_names_are_given_the_one_of_now_counts() -> None:
    both = {**MEANT, **dict.fromkeys(RENAMED, 0.1)}
    assert with_current_keys(both) == MEANT
    assert with_current_keys({key: both[key] for key in reversed(both)}) == MEANT


def stored(values: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Values by key as a library and a bundle store them, by group and name."""
    groups: dict[str, dict[str, Any]] = {}
    for key, value in values.items():
        group, name = key.split(".")
        groups.setdefault(group, {})[name] = value
    return groups


def test_a_run_of_the_library_lists_its_changes_by_the_keys_of_now(tmp_path: Path) -> None:
    values = {**RunParameters().model_dump(mode="json"), **stored(OTHER)}
    with Library(tmp_path / "library.sqlite3") as library:
        number = library.keep(RECORDING, run(0, changes=OTHER, parameters=values))
        (row,) = library.runs()
        assert (row.id, row.changes) == (number, MEANT)
        assert library.result(number).unknown == ()
        for key, value in MEANT.items():
            assert value_of(library.result(number).parameters, key) == value


def test_a_run_of_the_library_is_read_whole() -> None:
    parameters, unknown = parameters_of(stored(OTHER))
    assert changed_values(parameters) == MEANT
    assert unknown == ()
    parameters, unknown = parameters_of({**stored(OTHER), "some": {"thing": 1}})
    assert changed_values(parameters) == MEANT
    assert unknown == ("some.thing",)
