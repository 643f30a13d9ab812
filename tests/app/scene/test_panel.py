"""The panel beside the 3D view: values go both ways, and nothing goes round in circles."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import pytest
import viser

from app.paths import static_folder
from app.scene.panel import ORIGIN, UNFIT, Panel, hint_of, hotkeys
from app.state.workbench import Workbench
from tests.app.scene import scene_case
from tracker.parameters.catalogue import METHODS, PARAMETERS, PRESETS
from tracker.parameters.values import shown_keys, value_of

SECONDS = 20.0
P_D = "fusion.detection_probability"
P_S = "fusion.survival_probability"
BIRTH = "fusion.birth_rate"
ESSENTIAL = {key: p for key, p in PARAMETERS.items() if p.essential}


@pytest.fixture
def workbench() -> Workbench:
    return scene_case.opened(scene_case.sequence())


@pytest.fixture
def panel(server: viser.ViserServer, workbench: Workbench) -> Iterator[Panel]:
    made = Panel(server, workbench)
    assert made.wait(SECONDS)
    yield made
    made.close()


def move(panel: Panel, key: str, place: Any) -> None:
    """What viser does when a browser moves an input: any value, then the callbacks."""
    handle = panel._inputs[key]
    handle._impl.value = place
    for callback in handle._impl.update_cb:
        callback(viser.GuiEvent(None, 1, handle))  # type: ignore[arg-type]


def take_preset(panel: Panel, name: str) -> None:
    panel._presets._impl.value = name
    panel._take_preset(viser.GuiEvent(None, 1, panel._presets))  # type: ignore[arg-type]


def value(workbench: Workbench, key: str) -> Any:
    return value_of(workbench.snapshot().parameters, key)


def visible(panel: Panel) -> set[str]:
    return {key for key in ESSENTIAL if panel._inputs[key].visible}


def test_essential_sliders_hold_their_default_and_what_is_published() -> None:
    faults = []
    for key, parameter in ESSENTIAL.items():
        assert parameter.slider is not None
        low, high, step = parameter.slider
        assert parameter.minimum is not None
        assert parameter.maximum is not None
        if not parameter.minimum <= low < low + step < high <= parameter.maximum:
            faults.append(f"{key}: {parameter.slider} in {parameter.minimum} … {parameter.maximum}")
        for number in (parameter.default, parameter.published):
            if number is not None and not low <= number <= high:
                faults.append(f"{key}: {number} is not on {parameter.slider}")
    assert not faults
    assert all(p.slider is None for key, p in PARAMETERS.items() if key not in ESSENTIAL)


def test_a_hint_says_what_it_is_in_which_unit_and_what_is_published() -> None:
    hint = hint_of(PARAMETERS[BIRTH])
    assert hint.startswith(PARAMETERS[BIRTH].help)
    assert hint.endswith("γ: 0.0001 … 10 1/(entrance·s), default 0.05, as published 0.5.")


@pytest.mark.parametrize(
    "changes",
    [{}, {"single_view": "colour_phd"}, {"single_view": "jpda"}, {"fusion.motion": "random_walk"}],
)
def test_the_essentials_of_the_methods_in_use_are_shown(
    panel: Panel, workbench: Workbench, changes: dict[str, str]
) -> None:
    workbench.set_parameters(changes, "page")
    assert panel.wait(SECONDS)
    shown = set(shown_keys(workbench.snapshot().parameters))
    assert visible(panel) == ESSENTIAL.keys() & shown
    assert ("fusion.acceleration_sigma" in visible(panel)) == ("fusion.motion" not in changes)
    assert ("colour_phd.acceptance_distance" in visible(panel)) == (
        changes.get("single_view") == "colour_phd"
    )


def test_edits_reach_the_workbench_the_last_of_many_and_within_the_range(
    panel: Panel, workbench: Workbench
) -> None:
    for hundredth in range(50, 91):
        move(panel, P_S, hundredth / 100.0)
    move(panel, BIRTH, 0.2)
    move(panel, "smoothing_method", "none")
    assert panel.wait(SECONDS)
    assert value(workbench, P_S) == 0.9
    assert value(workbench, BIRTH) == 0.2
    assert workbench.snapshot().parameters.smoothing_method == "none"
    assert workbench.snapshot().parameters_origin == ORIGIN
    move(panel, P_S, 7.0)
    assert panel.wait(SECONDS)
    assert value(workbench, P_S) == panel._inputs[P_S].value == 1.0


def test_a_change_elsewhere_moves_the_slider_without_an_echo(
    panel: Panel, workbench: Workbench
) -> None:
    news: list[str] = []
    workbench.subscribe(news.append)
    workbench.set_parameters({P_D: 0.533, "smoothing_method": "positions"}, "page")
    assert panel.wait(SECONDS)
    assert panel._inputs[P_D].value == 0.533
    assert panel._inputs["smoothing_method"].value == "positions"
    assert news == ["parameters"]
    assert workbench.snapshot().parameters_origin == "page"


def test_a_value_beyond_the_slider_stands_where_it_is(panel: Panel, workbench: Workbench) -> None:
    assert PARAMETERS[BIRTH].slider is not None
    low, high, _ = PARAMETERS[BIRTH].slider
    for number in (0.0001, 8.0):
        assert not low <= number <= high
        workbench.set_parameters({BIRTH: number}, "page")
        assert panel.wait(SECONDS)
        handle = panel._inputs[BIRTH]
        assert handle.value == number
        assert (handle.min, handle.max) == (min(low, number), max(high, number))
        assert value(workbench, BIRTH) == number, "it is not written back"
    workbench.reset_parameters([BIRTH])
    assert panel.wait(SECONDS)
    assert (handle.min, handle.max) == (low, high)


def test_a_slider_that_is_being_moved_is_not_written(panel: Panel, workbench: Workbench) -> None:
    handle = panel._inputs[P_D]
    handle._impl.value = 0.7
    with panel._lock:
        panel._moved.add(P_D)  # told of, and not taken yet
    workbench.set_parameters({P_D: 0.8}, "page")
    assert panel.wait(SECONDS)
    assert handle.value == 0.7
    panel._worker.ask("edit")
    assert panel.wait(SECONDS)
    assert handle.value == value(workbench, P_D) == 0.7


def test_an_edit_that_is_not_told_of_yet_is_not_written_over(
    panel: Panel, workbench: Workbench
) -> None:
    handle = panel._inputs[P_D]
    handle._impl.value = 0.7  # viser takes the value first and calls back later
    workbench.set_parameters({P_D: 0.8}, "page")
    assert panel.wait(SECONDS)
    assert handle.value == value(workbench, P_D) == 0.7


def test_methods_that_cannot_work_here_are_marked(panel: Panel, workbench: Workbench) -> None:
    unfit = workbench.snapshot().unfit["single_view"]
    assert unfit
    options = panel._inputs["single_view"].options
    assert options == tuple(f"{n}{UNFIT}" if n in unfit else n for n in METHODS["single_view"])
    name = next(iter(unfit))
    move(panel, "single_view", f"{name}{UNFIT}")
    assert panel.wait(SECONDS)
    assert workbench.snapshot().parameters.single_view == name
    assert panel._inputs["single_view"].hint == unfit[name]


def test_presets_move_the_sliders_and_those_of_ones_own_are_in_the_panel(
    panel: Panel, workbench: Workbench
) -> None:
    take_preset(panel, "published")
    assert panel.wait(SECONDS)
    for key, wanted in PRESETS["published"].items():
        assert value(workbench, key) == wanted
        if key in panel._inputs:
            assert panel._inputs[key].value == wanted
    workbench.apply_preset("robust")
    assert panel.wait(SECONDS)
    assert panel._presets.value == "robust"
    assert panel._presets.options == tuple(PRESETS)
    workbench.set_presets({"quick": {P_D: 0.6}})
    take_preset(panel, "quick")
    assert panel.wait(SECONDS)
    assert value(workbench, P_D) == 0.6
    assert (panel._presets.value, panel._presets.options) == ("quick", (*PRESETS, "quick"))
    workbench.set_parameters({P_D: 0.7}, "api")
    assert panel.wait(SECONDS)
    assert (panel._presets.value, panel._presets.options[0]) == ("own values", "own values")
    take_preset(panel, "own values")
    workbench.set_presets({})
    assert panel.wait(SECONDS)
    assert value(workbench, P_D) == 0.7
    assert "quick" not in panel._presets.options


def test_keys_of_the_3d_view_are_those_of_the_page() -> None:
    groups = json.loads((static_folder() / "commands.json").read_text(encoding="utf-8"))
    page = {command["name"]: command["keys"] for rows in groups.values() for command in rows}
    found = list(hotkeys())
    for hotkey in found:
        modifier = {None: "", "shift": "shift+", "cmd/ctrl": "ctrl+"}[hotkey.modifier]
        assert f"{modifier}{hotkey.key.lower()}" in [key.lower() for key in page[hotkey.name]]
    keys = [(hotkey.key, hotkey.modifier) for hotkey in found]
    assert len(set(keys)) == len(keys)
    assert not {"W", "A", "S", "D", "Q", "E", "arrowleft"} & {k for k, m in keys if m is None}
    names = {hotkey.name for hotkey in found}
    assert {"play", "first", "next-event", "previous-event", "camera-9", "palette"} <= names
