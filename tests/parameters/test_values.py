"""Every parameter has a face, a range and one stage; old names and removed ones are read."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import product
from math import inf, nextafter
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from app.command.flags import set_values
from tests.library.runs import RECORDING, run
from tracker.library.store import Library, parameters_of
from tracker.parameters import Stage
from tracker.parameters.catalogue import (
    GROUPS,
    METHODS,
    PARAMETERS,
    PRESETS,
    REMOVED,
    RENAMED,
    Parameter,
    RunParameters,
)
from tracker.parameters.values import (
    ParameterError,
    changed_values,
    removed_notes,
    stage_values,
    value_of,
    with_current_keys,
    with_values,
)
from tracker.studies.definition import definition_of
from tracker.studies.errors import StudyError

STAGES: tuple[Stage, ...] = ("single_view", "fusion", "smoothing", "tracks")
DEFAULTS = RunParameters()


def numbers(kind: str) -> list[Parameter]:
    """The parameters of one kind."""
    return [p for p in PARAMETERS.values() if p.kind == kind]


def refusal(key: str, wrong: Any) -> str:
    """The sentence by which a value is refused; none where it is taken."""
    try:
        with_values(DEFAULTS, {key: wrong})
    except ParameterError as error:
        return str(error)
    return ""


def test_every_parameter_has_a_sentence_a_symbol_and_a_range_around_its_values() -> None:
    def faults(p: Parameter) -> Iterator[str]:
        values = [v for v in (p.default, p.published) if v is not None]
        if not (p.help.endswith(".") and p.help[0].isupper()):
            yield f"the help is no sentence: {p.help!r}"
        if not (p.symbol and p.label and p.group in GROUPS):
            yield "symbol, label and group are needed"
        if p.kind == "choice":
            if len(p.choices) < 2 or not set(values) <= set(p.choices):
                yield f"{values} are not among {p.choices}"
        elif p.kind == "bool":
            if {type(v) for v in values} != {bool}:
                yield f"{values} are no switches"
        elif p.minimum is None or p.maximum is None or p.minimum >= p.maximum:
            yield f"no range: {p.minimum} … {p.maximum}"
        else:
            if not all(p.minimum <= v <= p.maximum for v in values):
                yield f"{values} are not in {p.minimum} … {p.maximum}"
            if p.log and p.minimum <= 0.0:
                yield "a logarithmic slider needs a positive range"
            if p.step is not None and not 0.0 < p.step <= p.maximum - p.minimum:
                yield f"a slider cannot move by {p.step}"
            if p.kind == "int" and not all(isinstance(v, int) for v in values):
                yield f"{values} are no whole numbers"

    assert not [f"{p.key}: {fault}" for p in PARAMETERS.values() for fault in faults(p)]


def test_every_group_says_what_it_is_for() -> None:
    assert {p.group for p in PARAMETERS.values()} == set(GROUPS)
    assert all(text.endswith(".") for text in GROUPS.values())


def test_every_value_belongs_to_exactly_one_stage() -> None:
    covered: set[str] = set()
    for *chosen, model in product(*METHODS.values(), ("learnt", "adaptive")):
        methods = dict(zip(METHODS, chosen, strict=True))
        parameters = with_values(DEFAULTS, {**methods, "foreground.model": model})
        keys = [key for stage in STAGES for key in stage_values(parameters, stage)]
        assert len(keys) == len(set(keys))
        assert set(METHODS) <= set(keys)
        for stage in STAGES:
            for key, found in stage_values(parameters, stage).items():
                assert found == value_of(parameters, key)
        covered |= set(keys)
    assert covered == {*METHODS, *PARAMETERS}, "a value that no stage depends on does nothing"


def test_the_extraction_threshold_reruns_nothing_but_the_tracks() -> None:
    after = with_values(DEFAULTS, {"fusion.extraction_threshold": 0.7})
    for stage in STAGES:
        same = stage_values(after, stage) == stage_values(DEFAULTS, stage)
        assert same == (stage != "tracks")


def test_both_bounds_are_taken_and_what_lies_beyond_is_refused_with_range_and_value() -> None:
    faults = []
    for p in (*numbers("float"), *numbers("int")):
        assert p.minimum is not None
        assert p.maximum is not None
        beyond = (p.minimum - 1, p.maximum + 1)
        if p.kind == "float":
            beyond = (nextafter(p.minimum, -inf), nextafter(p.maximum, inf))
        for wrong in beyond:
            said = refusal(p.key, wrong)
            expected = f"{p.key}: must be between {p.minimum:g} and {p.maximum:g}"
            if not (said.startswith(expected) and p.unit in said and said.endswith(f"got {wrong}")):
                faults.append(f"{p.key}: {wrong} is refused by {said!r}")
        for right in (p.minimum, p.maximum):
            if value_of(with_values(DEFAULTS, {p.key: right}), p.key) != right:
                faults.append(f"{p.key}: {right} is not taken as it is")
    assert not faults


@pytest.mark.parametrize("wrong", ["nan", "inf", "-inf", float("nan"), float("inf")])
def test_no_parameter_takes_a_number_that_is_none(wrong: Any) -> None:
    for parameter in (*numbers("float"), *numbers("int")):
        with pytest.raises(ParameterError):
            with_values(DEFAULTS, {parameter.key: wrong})


@pytest.mark.parametrize("wrong", ["", "half", "0,5", None, [0.5], {}, True])
def test_what_is_no_number_is_refused(wrong: Any) -> None:
    with pytest.raises(ParameterError, match=r"fusion\.survival_probability: expected a number"):
        with_values(DEFAULTS, {"fusion.survival_probability": wrong})


def test_numbers_may_come_as_text() -> None:
    after = with_values(
        DEFAULTS, {"fusion.survival_probability": "0.9", "fusion.max_components": "20"}
    )
    assert after.fusion.survival_probability == 0.9
    assert after.fusion.max_components == 20
    assert isinstance(after.fusion.max_components, int)


@pytest.mark.parametrize("wrong", ["20.5", 20.5, 1e300, "x"])
def test_a_count_is_a_whole_number(wrong: Any) -> None:
    with pytest.raises(ParameterError, match=r"fusion\.max_components: expected a"):
        with_values(DEFAULTS, {"fusion.max_components": wrong})


def test_a_switch_understands_words() -> None:
    words = {"true": True, "Off": False, True: True, 0: False, "1": True}
    faults = []
    for p in numbers("bool"):
        for word, meant in words.items():
            if value_of(with_values(DEFAULTS, {p.key: word}), p.key) is not meant:
                faults.append(f"{p.key}: {word!r} is not {meant}")
        if not refusal(p.key, "perhaps").endswith("expected true or false, got 'perhaps'"):
            faults.append(f"{p.key}: 'perhaps' is refused by {refusal(p.key, 'perhaps')!r}")
    assert not faults


def test_a_choice_that_does_not_exist_is_told_the_ones_that_do() -> None:
    faults = []
    for key, choices in {**METHODS, **{p.key: p.choices for p in numbers("choice")}}.items():
        for choice in choices:
            if value_of(with_values(DEFAULTS, {key: choice}), key) != choice:
                faults.append(f"{key}: {choice} is not taken")
        for wrong in ("magic", 3, None):
            expected = f"{key}: expected one of {', '.join(choices)}, got {wrong!r}"
            if refusal(key, wrong) != expected:
                faults.append(f"{key}: {wrong!r} is refused by {refusal(key, wrong)!r}")
    assert not faults


@pytest.mark.parametrize(
    ("wrong", "meant"),
    [
        ("fusion.survival_probabilty", "fusion.survival_probability"),
        ("fusion.merging_treshold", "fusion.merging_threshold"),
        ("fusion_metod", "fusion_method"),
    ],
)
def test_a_misspelt_key_is_told_the_nearest(wrong: str, meant: str) -> None:
    with pytest.raises(ParameterError, match=rf"; did you mean {re.escape(meant)}\? `") as caught:
        with_values(DEFAULTS, {wrong: 1.0})
    assert caught.value.key == wrong


@pytest.mark.parametrize("wrong", ["", "zzz", "fusion", "fusion."])
def test_an_unknown_key_is_refused(wrong: str) -> None:
    with pytest.raises(ParameterError, match=r"there is no such parameter; .* lists them all"):
        with_values(DEFAULTS, {wrong: 1.0})


@st.composite
def changes(draw: st.DrawFn) -> dict[str, Any]:
    """Any values that fit."""
    result: dict[str, Any] = {}
    for key in draw(st.lists(st.sampled_from(sorted(PARAMETERS)), unique=True)):
        parameter = PARAMETERS[key]
        if parameter.kind == "choice":
            result[key] = draw(st.sampled_from(parameter.choices))
        elif parameter.kind == "bool":
            result[key] = draw(st.booleans())
        elif parameter.kind == "int":
            assert parameter.minimum is not None
            assert parameter.maximum is not None
            result[key] = draw(st.integers(int(parameter.minimum), int(parameter.maximum)))
        else:
            result[key] = draw(st.floats(parameter.minimum, parameter.maximum))
    return result


@given(changes())
def test_changes_go_round(wanted: dict[str, Any]) -> None:
    after = with_values(DEFAULTS, wanted)
    differing = {k: v for k, v in wanted.items() if v != PARAMETERS[k].default}
    assert changed_values(after) == differing
    assert with_values(DEFAULTS, changed_values(after)) == after
    assert with_values(DEFAULTS, {k: str(v) for k, v in changed_values(after).items()}) == after
    assert RunParameters.model_validate_json(after.model_dump_json()) == after
    assert changed_values(after, after) == {}
    assert set(changed_values(DEFAULTS, after)) == set(differing)


@pytest.mark.parametrize("name", sorted(PRESETS))
def test_a_preset_sets_what_it_says_and_nothing_else(name: str) -> None:
    after = with_values(DEFAULTS, PRESETS[name])
    assert all(value_of(after, key) == wanted for key, wanted in PRESETS[name].items())
    assert set(changed_values(after)) <= set(PRESETS[name])


def test_values_are_never_changed_in_place() -> None:
    before = DEFAULTS.model_dump()
    with_values(DEFAULTS, {"fusion.survival_probability": 0.9, "single_view": "none"})
    assert DEFAULTS.model_dump() == before
    with pytest.raises(ValidationError):
        DEFAULTS.fusion.survival_probability = 0.5


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


GONE: dict[str, Any] = dict.fromkeys(REMOVED, 7)
"""A value for each removed parameter."""

MEANT_NOW = {"fusion.clutter_rate": 0.25}
NOTES = tuple(f"{key} no longer exists: {REMOVED[key]}" for key in REMOVED)


def test_a_removed_parameter_is_none_of_now_and_a_note_tells_what_holds() -> None:
    assert not REMOVED.keys() & {*PARAMETERS, *METHODS, *RENAMED}
    assert all(words and not words.endswith(".") for words in REMOVED.values())
    assert removed_notes([*MEANT_NOW, *REMOVED]) == NOTES
    assert removed_notes([*MEANT_NOW, *RENAMED, "no.such"]) == ()


def test_values_beside_those_of_removed_parameters_count() -> None:
    assert with_current_keys({**GONE, **MEANT_NOW}) == MEANT_NOW
    assert changed_values(with_values(RunParameters(), {**GONE, **MEANT_NOW})) == MEANT_NOW
    parameters, unknown = parameters_of(stored({**GONE, **MEANT_NOW}))
    assert (changed_values(parameters), unknown) == (MEANT_NOW, ())


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
    values = {**RunParameters().model_dump(mode="json"), **stored({**GONE, **MEANT_NOW})}
    with Library(tmp_path / "library.sqlite3") as library:
        number = library.keep(RECORDING, run(0, changes={**GONE, **MEANT_NOW}, parameters=values))
        result = library.result(number)
    assert (result.run.changes, result.run.removed, result.unknown) == (MEANT_NOW, NOTES, ())


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
