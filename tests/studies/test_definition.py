"""What a study's file may say, and the sentence for what it may not."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest

from tests.studies.small import PARAMETERS, definition, recording
from tracker.studies.defined.defining import definition_of, read_definition
from tracker.studies.defined.example import example
from tracker.studies.errors import StudyError


def test_what_is_written_is_read_back(tmp_path: Path) -> None:
    given = definition(
        tmp_path,
        minutes=2.5,
        seeds=[3, 1],
        preset="published",
        values={"fusion.acceleration_sigma": 2},
        start={"fusion.clutter_rate": 5},
        parameters={**PARAMETERS, "fusion_method": {}, "fusion.update": {}},
    )
    file = tmp_path / "again.toml"
    file.write_text(given.to_toml(), encoding="utf-8")
    assert read_definition(file) == given
    assert given.seeds == (3, 1)
    assert given.recordings == (str(tmp_path / "recording"),)


def test_the_example_is_a_study(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(example("mine", ["room44-3p"]), encoding="utf-8")
    found = read_definition(file)
    assert found.name == "mine"
    assert found.objectives == ("score",)
    assert len(found.varied) == 4


def test_keys_may_be_written_without_quotes(tmp_path: Path) -> None:
    recording(tmp_path / "r")
    text = """
    name = "plain"
    recordings = "r"
    [values]
    fusion.acceleration_sigma = 2.0
    [parameters]
    fusion.clutter_rate = { low = 1, high = 2 }
    fusion.detection_probability = {}
    fusion_method = { choices = ["multi_bernoulli", "sequential_phd"] }
    """
    found = definition_of(tomllib.loads(text), where="x", folder=tmp_path)
    assert [one.key for one in found.varied] == [
        "fusion.clutter_rate", "fusion.detection_probability", "fusion_method",
    ]  # fmt: skip
    assert found.values == {"fusion.acceleration_sigma": 2.0}


BAD: dict[str, tuple[dict[str, Any], str]] = {
    "field": ({"trails": 5}, r"trails: there is no such field; did you mean \"trials\""),
    "name": ({"name": "../up"}, "name: expected 1 to 60 letters"),
    "no recording": ({"recordings": []}, "recordings: expected at least one"),
    "recording": ({"recordings": ["nowhere"]}, "recordings: expected the name .* \"nowhere\""),
    "parameter": (
        {"parameters": {"fusion.cluter_rate": {}}},
        r"parameters.fusion.cluter_rate: there is no such parameter; did you mean \"fusion.clutter",
    ),
    "range": (
        {"parameters": {"fusion.detection_probability": {"low": 0.5, "high": 1.5}}},
        "parameters.fusion.detection_probability: must be between .* got 1.5",
    ),
    "empty range": (
        {"parameters": {"fusion.clutter_rate": {"low": 3, "high": 3}}},
        "expected low below high, found 3 and 3",
    ),
    "log of nothing": (
        {"parameters": {"fusion.acceleration_sigma": {"low": 0.0, "high": 1.0, "log": True}}},
        "fusion.acceleration_sigma: ",
    ),
    "choice": (
        {"parameters": {"fusion_method": {"choices": ["multi_bernoulli", "magic"]}}},
        "expected choices among .* found \"magic\"",
    ),
    "nothing varied": ({"parameters": {}}, "parameters: expected at least one"),
    "varied and held": (
        {"values": {"fusion.clutter_rate": 2.0}},
        "values.fusion.clutter_rate: it is varied under",
    ),
    "held": ({"values": {"fusion.nothing": 2.0}}, "values: fusion.nothing: there is no such"),
    "start": ({"start": {"fusion.birth_rate": 2.0}}, "start.fusion.birth_rate: it is not varied"),
    "trials": ({"trials": 0}, "trials: expected a whole number from 1"),
    "seeds": ({"seeds": [-1]}, "seeds: expected how many"),
    "minutes": ({"minutes": -3}, "minutes: expected a number above 0"),
    "search": ({"search": "magic"}, "search: expected one of auto, tpe"),
    "objective": ({"objectives": ["hotta"]}, r"objectives: expected .* did you mean \"hota\""),
    "preset": ({"preset": "mine"}, "preset: expected one of robust"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_what_does_not_fit_is_told_with_its_field(tmp_path: Path, name: str) -> None:
    fields, words = BAD[name]
    with pytest.raises(StudyError, match=words):
        definition(tmp_path, **fields)


def test_a_file_that_is_none_is_told(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match=r"nothing.toml: cannot be read"):
        read_definition(tmp_path / "nothing.toml")
    (tmp_path / "broken.toml").write_text("name = ", encoding="utf-8")
    with pytest.raises(StudyError, match=r"broken.toml: expected TOML"):
        read_definition(tmp_path / "broken.toml")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("trials = 6", "trials = " + "[" * 3000 + "]" * 3000, "expected TOML"),
        ("trials = 6", "trials = 1" + "0" * 5000, "expected TOML"),
        ("trials = 6", "trials = 0x" + "f" * 9000, "a number with thousands of digits"),
        ("trials = 6", 'trials = "' + "n" * 3000 + '"', "trials: expected .*…"),
        ('"recording"', '"' + "n" * 3000 + '"', "recordings: expected .*…"),
        ('"recording"', '"~nobody-of-that-name/x"', "recordings: expected .*nobody"),
        ("trials = 6", "fusion_method = 3", "fusion_method: there is no such field"),
        ("trials = 6", 'trials = "\\u001b[31m"', "trials: expected a whole number"),
    ],
)
def test_a_damaged_file_is_told(tmp_path: Path, old: str, new: str, words: str) -> None:
    recording(tmp_path / "recording")
    path = tmp_path / "study.toml"
    text = """
name = "small"
recordings = ["recording"]
trials = 6
parameters.fusion.clutter_rate = { low = 1.0, high = 5.0 }
"""
    path.write_text(text)
    assert read_definition(path).trials == 6
    path.write_text(text.replace(old, new))
    with pytest.raises(StudyError, match=words) as told:
        read_definition(path)
    assert str(told.value).startswith(str(path))
    assert str(told.value).isprintable()
    assert len(str(told.value)) < 600 + len(str(path))


def test_choices_that_are_no_list_are_told(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match="fusion_method: expected a list of choices, found 3"):
        definition(tmp_path, parameters={"fusion_method": {"choices": 3}})
