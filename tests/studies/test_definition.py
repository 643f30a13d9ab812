"""What a study's file may say, and the sentence for what it may not."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from app.state.presets import keep_preset
from tests.studies.small import PARAMETERS, definition, recording
from tracker.parameters.catalogue import PRESETS, REMOVED
from tracker.parameters.values import removed_notes
from tracker.studies.definition import definition_of, example, read_definition
from tracker.studies.errors import StudyError
from tracker.studies.store import create


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


def test_a_preset_is_built_in_or_ones_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MULTIVIEW_PHD_SETTINGS", str(tmp_path))
    presets = tmp_path / "presets.json"
    gone = next(iter(REMOVED))
    keep_preset(presets, "night", {"fusion.clutter_rate": 5.0, "fusion.birth_rate": 0.5, gone: 1.0})
    given = definition(tmp_path, preset="night", values={"fusion.birth_rate": 0.25})
    assert given.held() == {"fusion.clutter_rate": 5.0, "fusion.birth_rate": 0.25}
    assert given.notes == removed_notes([gone])
    assert definition(tmp_path, preset="published").held() == PRESETS["published"]

    # a study goes on with the values that it began with
    store = create(given, tmp_path / "studies")
    assert create(given, tmp_path / "studies").folder == store.folder
    keep_preset(presets, "night", {"fusion.clutter_rate": 9.0})
    assert store.definition().held() == given.held()

    known = "expected one of robust, published, night"
    with pytest.raises(StudyError, match=f'study.toml, preset: {known}, found "nigth"'):
        definition(tmp_path, preset="nigth")
    presets.write_text('{"night": 3}')
    with pytest.raises(StudyError, match=r"study.toml, preset: .*night: expected an object"):
        definition(tmp_path, preset="night")
    presets.unlink()
    presets.mkdir()
    with pytest.raises(StudyError, match=r"study.toml, preset: .*presets\.json: "):
        definition(tmp_path, preset="night")


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
