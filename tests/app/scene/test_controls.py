"""The sliders: each parameter has one, values go both ways, and nothing goes round in circles."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, get_args

import numpy as np
import pytest
import viser
from hypothesis import given
from hypothesis import strategies as st

from app.paths import static_folder
from app.scene.keys import hotkeys
from app.scene.panel.controls import BUTTON, ORIGIN, Controls
from app.scene.panel.sliders import Scale, hint_text, label_text, number_text, symbol_parts
from app.state.workbench import Workbench
from tests.app.scene import scene_case
from tracker.parameters import Topic
from tracker.parameters.catalogue import METHODS, PARAMETERS, PRESETS, Parameter, RunParameters
from tracker.parameters.values import value_of, with_values

SECONDS = 20.0
P_D = "fusion.detection_probability"
NUMBERS = [p for p in PARAMETERS.values() if p.kind in ("float", "int")]


@pytest.fixture
def workbench() -> Workbench:
    return scene_case.opened(scene_case.sequence())


@pytest.fixture
def panel(server: viser.ViserServer, workbench: Workbench) -> Iterator[Controls]:
    made = Controls(server, workbench)
    assert made.wait(SECONDS)
    yield made
    made.close()


def move(panel: Controls, key: str, place: Any) -> None:
    """What viser does when a browser moves an input: any value, then the callbacks."""
    handle = panel._inputs.by_key[key]
    handle._impl.value = place
    for callback in handle._impl.update_cb:
        callback(viser.GuiEvent(None, 1, handle))  # type: ignore[arg-type]


def take_preset(panel: Controls, name: str) -> None:
    panel._presets._impl.value = name
    panel._take_preset(viser.GuiEvent(None, 1, panel._presets))  # type: ignore[arg-type]


def value(workbench: Workbench, key: str) -> Any:
    return value_of(workbench.snapshot().parameters, key)


class Eager:
    """Curves that have something to say as soon as somebody follows them, and time to wait."""

    def subscribe(self, follow: Callable[[], None]) -> None:
        follow()
        threading.Event().wait(0.2)

    def curves(self) -> dict[str, Any]:
        return {}


def test_who_asks_before_the_panel_is_there_is_answered_when_it_is(
    server: viser.ViserServer, workbench: Workbench
) -> None:
    made = Controls(server, workbench, Eager())  # type: ignore[arg-type]
    assert made.wait(SECONDS)
    made.close()


# the scales


def test_both_ends_and_the_default_stand_on_every_slider() -> None:
    faults = []
    for p in NUMBERS:
        scale = Scale(p)
        if not 0 < scale.step < scale.maximum - scale.minimum:
            faults.append(f"{p.key}: {scale.minimum} … {scale.maximum} by {scale.step}")
        for number in (p.minimum, p.maximum, p.default):
            place = scale.place(number)
            back = scale.value(place)
            if back != pytest.approx(number, rel=1e-9) or not scale.stands_at(place, number):
                faults.append(f"{p.key}: {number} stands at {place}, which is {back}")
    assert not faults


@given(st.sampled_from(NUMBERS), st.floats(-0.5, 1.5))
def test_every_place_gives_a_value_that_is_allowed(parameter: Parameter, share: float) -> None:
    scale = Scale(parameter)
    place = scale.minimum + share * (scale.maximum - scale.minimum)
    number = scale.value(place)
    changed = with_values(RunParameters(), {parameter.key: number})
    assert value_of(changed, parameter.key) == number
    # what was sent stands where it was put, unless it had to be moved into the range
    if 0.0 <= share <= 1.0:
        assert scale.stands_at(min(max(place, scale.minimum), scale.maximum), number)
    elif share < -1e-6 or share > 1.0 + 1e-6:
        assert not scale.stands_at(place, number)


def test_a_logarithmic_slider_moves_by_decades() -> None:
    scale = Scale(PARAMETERS["fusion.pruning_threshold"])
    assert scale.place(1e-4) == pytest.approx(-4.0)
    assert scale.value(-4.0) == 1e-4
    assert scale.value(-4.005) == 9.89e-5
    assert Scale(PARAMETERS["colour_phd.samples"]).value(2.5) == 316


def test_a_slider_needs_a_range() -> None:
    parameter = PARAMETERS["fusion.pruning_threshold"]
    with pytest.raises(ValueError, match="both bounds"):
        Scale(replace(parameter, maximum=None))
    with pytest.raises(ValueError, match="above 0, got 0"):
        Scale(replace(parameter, minimum=0.0))


@pytest.mark.parametrize(
    ("number", "text"),
    [
        (1e-4, "1e-4"),
        (2.5e-5, "2.5e-5"),
        (0.02, "0.02"),
        (0.9999, "0.9999"),
        (400, "400"),
        (50.0, "50"),
        (0.0, "0"),
    ],
)
def test_numbers_are_written_short(number: float, text: str) -> None:
    assert number_text(number) == text


def test_label_and_hint_say_what_it_is_and_whether_it_is_changed() -> None:
    parameter = PARAMETERS[P_D]
    assert symbol_parts(parameter.symbol) == ("p", "D")
    assert label_text(parameter, changed=False) == f"{parameter.label} p"
    assert label_text(parameter, changed=True) == f"• {parameter.label} p"
    assert hint_text(parameter).startswith(parameter.help)
    assert f"default {number_text(parameter.default)}" in hint_text(parameter)


# the panel


def visible_copies(panel: Controls) -> set[str]:
    return {key for key, copies in panel._inputs.copies.items() if any(h.visible for h in copies)}


def test_the_essentials_come_first_and_move_the_same_parameter(
    panel: Controls, workbench: Workbench
) -> None:
    essential = {key for key, p in PARAMETERS.items() if p.essential}
    shown = visible_copies(panel)
    assert shown == essential & set(panel._shown)
    assert {P_D, "fusion.survival_probability", "fusion.extraction_threshold"} <= shown
    assert panel._essentials.label == f"Essentials · {len(shown)}"
    handle = panel._inputs.copies[P_D][0]
    handle._impl.value = 0.6
    for callback in handle._impl.update_cb:
        callback(viser.GuiEvent(None, 1, handle))  # type: ignore[arg-type]
    assert panel.wait(SECONDS)
    assert value(workbench, P_D) == 0.6
    assert panel._inputs.by_key[P_D].value == 0.6
    assert panel._essentials.label.endswith(", 1 changed")
    assert panel._topics["Detection"].label.endswith(", 1 changed")
    assert not panel._topics["Birth"].label.endswith("changed")


def test_the_filter_lists_what_has_its_words_and_says_where_nothing_has(
    panel: Controls, workbench: Workbench
) -> None:
    workbench.set_parameters({P_D: 0.6}, "page")
    for text, only, expected in (
        ("detection prob", False, P_D),
        ("p_d", False, P_D),
        ("", True, P_D),
        ("survival", False, "fusion.survival_probability"),
    ):
        panel._sought._impl.value, panel._only_changed._impl.value = text, only
        panel._worker.ask("refresh")
        assert panel.wait(SECONDS)
        assert expected in visible_copies(panel)
        assert panel._found.visible
        assert not panel._essentials.visible
        assert not any(folder.visible for folder in panel._topics.values())
    assert visible_copies(panel) == {"fusion.survival_probability"}
    panel._sought._impl.value = "<xyz>"
    panel._worker.ask("refresh")
    assert panel.wait(SECONDS)
    assert "No parameter has “&lt;xyz&gt;”" in panel._nothing_found.content
    assert panel._nothing_found.visible
    panel._sought._impl.value = ""
    panel._worker.ask("refresh")
    assert panel.wait(SECONDS)
    assert panel._essentials.visible
    assert panel._topics["Motion"].visible


def test_every_parameter_is_about_one_thing_and_none_of_them_about_nothing(
    panel: Controls,
) -> None:
    about = {
        topic: {k for k, p in PARAMETERS.items() if p.topic == topic} for topic in get_args(Topic)
    }
    assert sum(map(len, about.values())) == len(PARAMETERS)
    for topic, key in (
        ("Motion", "fusion.acceleration_sigma"),
        ("Birth", "fusion.birth_rate"),
        ("Detection", "fusion.detection_probability"),
        ("Clutter", "detection_boxes.score_threshold"),
        ("Foreground", "colour_phd.foreground_weight"),
        ("Extraction", "fusion.extraction_threshold"),
    ):
        assert key in about[topic]  # type: ignore[index]
    held = [key for _, keys in panel._inputs.blocks for key in keys if not PARAMETERS[key].advanced]
    assert len(held) == len(set(held))


def test_every_parameter_and_method_has_one_input(panel: Controls) -> None:
    assert set(panel._inputs.by_key) == {*PARAMETERS, *METHODS}
    kinds = {
        "float": viser.GuiSliderHandle,
        "int": viser.GuiSliderHandle,
        "bool": viser.GuiCheckboxHandle,
        "choice": viser.GuiDropdownHandle,
    }
    for key, parameter in PARAMETERS.items():
        assert isinstance(panel._inputs.by_key[key], kinds[parameter.kind])


def test_edits_reach_the_workbench_the_last_of_many_and_within_the_range(
    panel: Controls, workbench: Workbench
) -> None:
    key = "fusion.survival_probability"
    for hundredth in range(50, 91):
        move(panel, key, hundredth / 100.0)
    move(panel, "fusion.pruning_threshold", -3.0)
    move(panel, "fusion.max_components", 80)
    assert panel.wait(SECONDS)
    assert value(workbench, key) == 0.9
    assert value(workbench, "fusion.pruning_threshold") == 1e-3
    assert value(workbench, "fusion.max_components") == 80
    assert workbench.snapshot().parameters_origin == ORIGIN
    move(panel, key, 7.0)
    assert panel.wait(SECONDS)
    assert value(workbench, key) == panel._inputs.by_key[key].value == 1.0


def test_a_change_elsewhere_moves_the_slider_without_an_echo(
    panel: Controls, workbench: Workbench
) -> None:
    news: list[str] = []
    workbench.subscribe(news.append)
    workbench.set_parameters(
        {"fusion.pruning_threshold": 3.3e-5, "fusion.misses": "per_person"}, "page"
    )
    assert panel.wait(SECONDS)
    assert 10.0 ** panel._inputs.by_key["fusion.pruning_threshold"].value == pytest.approx(3.3e-5)
    assert panel._inputs.by_key["fusion.misses"].value == "per_person"
    assert news == ["parameters"]
    assert workbench.snapshot().parameters_origin == "page"
    assert 'content: "3.3e-5"' in panel._values.content


def test_a_slider_that_is_being_moved_is_not_written(panel: Controls, workbench: Workbench) -> None:
    key = "fusion.pruning_threshold"
    handle = panel._inputs.by_key[key]
    handle._impl.value = -2.505  # further on than what the store knows
    with panel._inputs._lock:
        panel._inputs._moved[key] = handle
    workbench.set_parameters({key: 1e-6}, "page")
    assert panel.wait(SECONDS)
    assert handle.value == -2.505
    panel._worker.ask("edit")
    assert panel.wait(SECONDS)
    assert handle.value == -2.505  # its own edit: 3.13e-3, rounded, is not written back
    assert value(workbench, key) == 3.13e-3


def test_an_edit_that_is_not_told_of_yet_is_not_written_over(
    panel: Controls, workbench: Workbench
) -> None:
    handle = panel._inputs.by_key[P_D]
    handle._impl.value = 0.7  # viser takes the value first and calls back later
    workbench.set_parameters({P_D: 0.8}, "page")
    assert panel.wait(SECONDS)
    assert handle.value == value(workbench, P_D) == 0.7


@pytest.mark.parametrize(
    ("changes", "shown", "hidden"),
    [
        ({}, "fusion.clutter_rate", "jpda.gate_probability colour_phd.bandwidth"),
        (
            {"single_view": "colour_phd"},
            "colour_phd.bandwidth colour_phd.survival_probability",
            "detection_boxes.score_threshold",
        ),
        (
            {"single_view": "jpda"},
            "jpda.gate_probability foreground.threshold",
            "colour_phd.bandwidth",
        ),
        # of a shared group only the numbers that are read
        (
            {"single_view": "jpda", "jpda.measurements": "colour"},
            "colour_phd.bandwidth",
            "colour_phd.survival_probability",
        ),
        (
            {"single_view": "jpda", "jpda.measurements": "detections"},
            "detection_boxes.pixel_sigma",
            "foreground.threshold",
        ),
    ],
)
def test_only_what_the_methods_read_is_shown(
    panel: Controls, changes: dict[str, str], shown: str, hidden: str
) -> None:
    def is_shown(key: str) -> bool:
        blocks = [folder for folder, keys in panel._inputs.blocks if key in keys]
        return bool(panel._inputs.by_key[key].visible) and all(folder.visible for folder in blocks)

    for key, choice in changes.items():
        move(panel, key, choice)
    assert panel.wait(SECONDS)
    assert [key for key in shown.split() if not is_shown(key)] == []
    assert [key for key in hidden.split() if is_shown(key)] == []


def test_buttons_have_words_that_can_be_read() -> None:
    shares = np.array(BUTTON) / 255
    linear = np.where(shares <= 0.04045, shares / 12.92, ((shares + 0.055) / 1.055) ** 2.4)
    assert 1.05 / (linear @ (0.2126, 0.7152, 0.0722) + 0.05) >= 4.5


def test_changed_values_are_marked_and_can_be_reset(panel: Controls, workbench: Workbench) -> None:
    key = "fusion.survival_probability"
    assert not panel._reset_all.visible
    move(panel, key, 0.9)
    move(panel, "fusion.extraction_threshold", 0.6)
    assert panel.wait(SECONDS)
    assert panel._inputs.by_key[key].label.startswith("• ")
    assert panel._resets["Motion"].visible
    assert panel._resets["Extraction"].visible
    assert panel._reset_all.visible
    panel._reset("Motion")
    assert panel.wait(SECONDS)
    assert value(workbench, key) == PARAMETERS[key].default
    assert value(workbench, "fusion.extraction_threshold") == 0.6
    assert not panel._inputs.by_key[key].label.startswith("• ")
    assert not panel._resets["Motion"].visible
    panel._reset(None)
    assert panel.wait(SECONDS)
    assert not panel._reset_all.visible


def test_presets_move_the_sliders_and_those_of_ones_own_are_in_the_panel(
    panel: Controls, workbench: Workbench
) -> None:
    take_preset(panel, "published")
    assert panel.wait(SECONDS)
    for key, wanted in PRESETS["published"].items():
        assert value(workbench, key) == wanted
        at = panel._inputs.by_key[key].value
        assert at == wanted or panel._inputs.scales[key].stands_at(at, wanted)
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
