"""A person's own presets: saved, taken, renamed, removed, and there again at the next start."""

from __future__ import annotations

from pathlib import Path

import pytest
from starlette.testclient import TestClient

from app.state.edits import Edits
from app.state.presets import LONGEST_NAME, OwnPresets
from app.state.snapshot import Event, Notice
from app.state.workbench import Workbench
from tests.app.conftest import command, run_is, wait_until
from tracker.files.folders import settings_folder
from tracker.parameters.values import ParameterError, value_of

P_D = "fusion.detection_probability"


def shown(workbench: Workbench) -> tuple[list[str], str | None]:
    """The names of the saved ones, and of the one whose values hold now."""
    now = workbench.snapshot()
    return list(now.presets), now.preset


def test_what_was_saved_is_there_again(tmp_path: Path) -> None:
    path = tmp_path / "settings" / "presets.json"
    workbench = Workbench()
    own = OwnPresets(workbench, Edits(workbench), path)
    assert shown(workbench) == ([], "robust")
    workbench.set_parameters({P_D: 0.7, "fusion_method": "sequential_phd"}, "test")
    assert shown(workbench) == ([], None)
    own.save("  büro   am Morgen ")
    assert shown(workbench) == (["büro am Morgen"], "büro am Morgen")
    workbench.reset_parameters()

    later = Workbench()
    OwnPresets(later, Edits(later), path)
    assert shown(later) == (["büro am Morgen"], "robust")
    later.set_parameters({"fusion.clutter_rate": 3.0}, "test")
    later.apply_preset("büro am Morgen")
    assert shown(later) == (["büro am Morgen"], "büro am Morgen")
    parameters = later.snapshot().parameters
    assert (value_of(parameters, P_D), parameters.fusion_method) == (0.7, "sequential_phd")
    assert [p.name for p in path.parent.iterdir() if p.suffix == ".json"] == [path.name]


def test_renaming_and_removing(tmp_path: Path) -> None:
    workbench = Workbench()
    own = OwnPresets(workbench, Edits(workbench), tmp_path / "presets.json")
    own.save("a")
    own.save("b")
    own.rename("a", "c")
    assert shown(workbench)[0] == ["c", "b"]
    with pytest.raises(ParameterError, match="a name that is free"):
        own.rename("c", "b")
    own.remove("c")
    assert shown(workbench)[0] == ["b"]
    with pytest.raises(ParameterError, match=r"expected one of your presets \(b\), got 'c'"):
        own.remove("c")


@pytest.mark.parametrize("name", ["", "   ", "x" * (LONGEST_NAME + 1), "published"])
def test_names_that_do_not_do(name: str) -> None:
    with pytest.raises(ParameterError, match="name: "):
        OwnPresets((bench := Workbench()), Edits(bench), None).save(name)


@pytest.mark.parametrize("text", ["{", "[]", '{"a": 1}', '{"\\ud800": {}}', "[" * 100_000])
def test_a_spoilt_file_is_kept_aside(tmp_path: Path, text: str) -> None:
    path = tmp_path / "presets.json"
    path.write_text(text)
    workbench = Workbench()
    heard: list[Event] = []
    workbench.subscribe_events(heard.append)
    own = OwnPresets(workbench, Edits(workbench), path)
    assert isinstance(heard[0], Notice)
    assert "presets.unreadable.json" in (heard[0].hint or "")
    assert (tmp_path / "presets.unreadable.json").read_text() == text
    own.save("new")
    assert shown(workbench)[0] == ["new"]


def test_a_value_that_is_no_parameter_any_more_is_told_when_it_is_taken(tmp_path: Path) -> None:
    path = tmp_path / "presets.json"
    path.write_text('{"old": {"fusion.gone": 1}}')
    workbench = Workbench()
    OwnPresets(workbench, Edits(workbench), path)
    assert shown(workbench) == (["old"], "robust")
    with pytest.raises(ParameterError, match=r"fusion\.gone"):
        workbench.apply_preset("old")


@pytest.mark.full
def test_the_routes(client: TestClient) -> None:
    command(client, "set_parameters", changes={P_D: 0.6})
    state = command(client, "save_preset", preset="night / cam 2").json()
    assert (state["presets"], state["preset"]) == (["night / cam 2"], "night / cam 2")
    state = command(client, "rename_preset", preset="night / cam 2", to="night").json()
    assert (state["presets"], state["preset"]) == (["night"], "night")
    command(client, "reset_parameters")
    state = command(client, "apply_preset", preset="night").json()
    assert state["parameters"][P_D] == 0.6
    assert command(client, "remove_preset", preset="night").json()["presets"] == []
    answer = command(client, "remove_preset", preset="night")
    assert answer.status_code == 422
    assert "none is saved" in answer.json()["detail"]
    wait_until(run_is(client, "done"))


def test_where_settings_are_kept(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("MULTIVIEW_PHD_SETTINGS", str(tmp_path))
    assert settings_folder() == tmp_path
    monkeypatch.delenv("MULTIVIEW_PHD_SETTINGS")
    assert settings_folder().name == "multiview-phd"
