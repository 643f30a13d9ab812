"""A parameter that no longer exists: what names it opens all the same, with a note."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from app.command.flags import set_values
from tests.library.runs import RECORDING, run
from tests.parameters.test_renamed import stored
from tracker.library.store import Library, parameters_of
from tracker.parameters.catalogue import METHODS, PARAMETERS, REMOVED, RENAMED, RunParameters
from tracker.parameters.values import changed_values, removed_notes, with_current_keys, with_values
from tracker.studies.definition import definition_of
from tracker.studies.errors import StudyError

GONE: dict[str, Any] = dict.fromkeys(REMOVED, 7)
"""A value for each removed parameter."""

MEANT = {"fusion.clutter_rate": 0.25}
NOTES = tuple(f"{key} no longer exists: {REMOVED[key]}" for key in REMOVED)


def test_a_removed_parameter_is_none_of_now_and_a_note_tells_what_holds() -> None:
    assert not REMOVED.keys() & {*PARAMETERS, *METHODS, *RENAMED}
    assert all(words and not words.endswith(".") for words in REMOVED.values())
    assert removed_notes([*MEANT, *REMOVED]) == NOTES
    assert removed_notes([*MEANT, *RENAMED, "no.such"]) == ()


def test_values_beside_those_of_removed_parameters_count() -> None:
    assert with_current_keys({**GONE, **MEANT}) == MEANT
    assert changed_values(with_values(RunParameters(), {**GONE, **MEANT})) == MEANT
    parameters, unknown = parameters_of(stored({**GONE, **MEANT}))
    assert (changed_values(parameters), unknown) == (MEANT, ())


def test_the_command_line_says_what_a_renamed_parameter_is_called(
    capsys: pytest.CaptureFixture[str],
) -> None:
    old, new = next(iter(RENAMED.items()))
    assert set_values((f"{old}=0.3", "fusion.clutter_rate=2")) == {
        new: "0.3",
        "fusion.clutter_rate": "2",
    }
    assert f"{old} is called {new} now" in capsys.readouterr().err


def test_a_run_of_the_library_says_which_changes_no_longer_exist(tmp_path: Path) -> None:
    values = {**RunParameters().model_dump(mode="json"), **stored({**GONE, **MEANT})}
    with Library(tmp_path / "library.sqlite3") as library:
        number = library.keep(RECORDING, run(0, changes={**GONE, **MEANT}, parameters=values))
        result = library.result(number)
    assert (result.run.changes, result.run.removed, result.unknown) == (MEANT, NOTES, ())


def study(**tables: Any) -> dict[str, Any]:
    return {"name": "old", "recordings": ["room24-2p"], **tables}


@pytest.mark.parametrize("flat", [True, False])
def test_a_study_opens_without_the_removed_and_notes_them(tmp_path: Path, flat: bool) -> None:
    def written(values: dict[str, Any]) -> dict[str, Any]:
        return values if flat else stored(values)

    varied = {"fusion.clutter_rate": {"low": 0.1, "high": 1.0}}
    varied |= {key: {"low": 1, "high": 9} for key in list(REMOVED)[1:]}
    tables = {"values": written({next(iter(REMOVED)): 7}), "parameters": written(varied)}
    definition = definition_of(study(**tables), where="old.toml", folder=tmp_path)
    assert [one.key for one in definition.varied] == ["fusion.clutter_rate"]
    assert (dict(definition.values), sorted(definition.notes)) == ({}, sorted(NOTES))


def test_a_study_of_removed_parameters_alone_says_so(tmp_path: Path) -> None:
    ranges = {key: {"low": 1, "high": 9} for key in REMOVED}
    with pytest.raises(StudyError, match=r"found none; foreground\.\w+ no longer exists: "):
        definition_of(study(parameters=stored(ranges)), where="old.toml", folder=tmp_path)
