"""Every parameter has a face, a range and one stage; wrong values are told in a sentence."""

from __future__ import annotations

import re
from itertools import product
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from tracker.parameters import (
    GROUPS,
    METHODS,
    PARAMETERS,
    PRESETS,
    Parameter,
    ParameterError,
    RunParameters,
    Stage,
    changed,
    stage_values,
    value,
    with_values,
)

STAGES: tuple[Stage, ...] = ("single_view", "fusion", "smoothing", "tracks")
DEFAULTS = RunParameters()

every_parameter = pytest.mark.parametrize("parameter", PARAMETERS.values(), ids=lambda p: p.key)


def numbers(kind: str) -> list[Parameter]:
    """The parameters of one kind."""
    return [p for p in PARAMETERS.values() if p.kind == kind]


@every_parameter
def test_every_parameter_has_a_face(parameter: Parameter) -> None:
    assert parameter.help.endswith("."), "help is a sentence"
    assert parameter.help[0].isupper()
    assert parameter.symbol
    assert parameter.label
    assert parameter.key == f"{parameter.group}.{parameter.name}"
    assert parameter.group in GROUPS
    assert parameter.stage in STAGES
    assert value(DEFAULTS, parameter.key) == parameter.default


@every_parameter
def test_every_range_holds_its_default_and_its_published_value(parameter: Parameter) -> None:
    values = [
        parameter.default,
        *([parameter.published] if parameter.published is not None else []),
    ]
    if parameter.kind == "choice":
        assert len(parameter.choices) >= 2
        assert set(values) <= set(parameter.choices)
    elif parameter.kind == "bool":
        assert {type(v) for v in values} == {bool}
    else:
        assert parameter.minimum is not None
        assert parameter.maximum is not None
        assert parameter.minimum < parameter.maximum
        assert all(parameter.minimum <= v <= parameter.maximum for v in values)
        if parameter.log:
            assert parameter.minimum > 0.0, "a logarithmic slider needs a positive range"
        if parameter.step is not None:
            assert 0.0 < parameter.step <= parameter.maximum - parameter.minimum
        if parameter.kind == "int":
            assert all(isinstance(v, int) for v in values)


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
                assert found == value(parameters, key)
        covered |= set(keys)
    assert covered == {*METHODS, *PARAMETERS}, "a value that no stage depends on does nothing"


def test_the_extraction_threshold_reruns_nothing_but_the_tracks() -> None:
    after = with_values(DEFAULTS, {"fusion.extraction_threshold": 0.7})
    for stage in STAGES:
        same = stage_values(after, stage) == stage_values(DEFAULTS, stage)
        assert same == (stage != "tracks")


@pytest.mark.parametrize("parameter", [*numbers("float"), *numbers("int")], ids=lambda p: p.key)
def test_a_value_out_of_range_is_refused_with_range_and_value(parameter: Parameter) -> None:
    assert parameter.minimum is not None
    assert parameter.maximum is not None
    for wrong in (parameter.minimum - 1, parameter.maximum + 1):
        with pytest.raises(ParameterError) as caught:
            with_values(DEFAULTS, {parameter.key: wrong})
        message = str(caught.value)
        assert caught.value.key == parameter.key
        assert message.startswith(f"{parameter.key}: must be between ")
        assert f"{parameter.minimum:g} and {parameter.maximum:g}" in message
        assert message.endswith(f"got {wrong}")
        assert parameter.unit in message
    for right in (parameter.minimum, parameter.maximum):
        assert value(with_values(DEFAULTS, {parameter.key: right}), parameter.key) == right


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


@pytest.mark.parametrize("parameter", numbers("bool"), ids=lambda p: p.key)
def test_a_switch_understands_words(parameter: Parameter) -> None:
    for word, meant in (("true", True), ("Off", False), (True, True), (0, False), ("1", True)):
        assert value(with_values(DEFAULTS, {parameter.key: word}), parameter.key) is meant
    with pytest.raises(ParameterError, match="expected true or false, got 'perhaps'"):
        with_values(DEFAULTS, {parameter.key: "perhaps"})


@pytest.mark.parametrize("key", [*METHODS, *(p.key for p in numbers("choice"))])
def test_a_choice_that_does_not_exist_is_told_the_ones_that_do(key: str) -> None:
    choices = METHODS[key] if key in METHODS else PARAMETERS[key].choices
    for choice in choices:
        assert value(with_values(DEFAULTS, {key: choice}), key) == choice
    for wrong in ("magic", 3, None):
        with pytest.raises(ParameterError) as caught:
            with_values(DEFAULTS, {key: wrong})
        expected = f"{key}: expected one of {', '.join(choices)}, got {wrong!r}"
        assert str(caught.value) == expected


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
    assert changed(after) == differing
    assert with_values(DEFAULTS, changed(after)) == after
    assert with_values(DEFAULTS, {k: str(v) for k, v in changed(after).items()}) == after
    assert RunParameters.model_validate_json(after.model_dump_json()) == after
    assert changed(after, after) == {}
    assert set(changed(DEFAULTS, after)) == set(differing)


@pytest.mark.parametrize("name", sorted(PRESETS))
def test_a_preset_sets_what_it_says_and_nothing_else(name: str) -> None:
    after = with_values(DEFAULTS, PRESETS[name])
    assert all(value(after, key) == wanted for key, wanted in PRESETS[name].items())
    assert set(changed(after)) <= set(PRESETS[name])


def test_values_are_never_changed_in_place() -> None:
    before = DEFAULTS.model_dump()
    with_values(DEFAULTS, {"fusion.survival_probability": 0.9, "single_view": "none"})
    assert DEFAULTS.model_dump() == before
    with pytest.raises(ValidationError):
        DEFAULTS.fusion.survival_probability = 0.5
