"""What a study's file may say, and the sentence for what it may not."""

from __future__ import annotations

import tomllib
from pathlib import Path

from tests.studies.small import PARAMETERS, definition, recording
from tracker.studies.definition import definition_of, example, read_definition


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
