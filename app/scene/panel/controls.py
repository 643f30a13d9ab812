"""The sliders in viser's panel, made from the definitions in :mod:`tracker.parameters`.

One edit goes one way round: browser → workbench → every other face.
"""

from __future__ import annotations

import html
import threading
from collections.abc import Set
from functools import partial
from typing import Any, get_args

import viser

from app.scene.keys import hotkeys
from app.scene.panel import curves, finding, style
from app.scene.panel.inputs import METHOD_LABELS, Inputs
from app.scene.panel.sliders import (
    manual_places,
    number_text,
    symbol_parts,
)
from app.scene.worker import LatestWorker
from app.state.snapshot import Change, Snapshot
from app.state.workbench import Workbench
from app.state.workers.sensitivity import Sensitivity
from tracker.parameters import Topic
from tracker.parameters.catalogue import METHODS, PARAMETERS, PRESETS, Parameter, RunParameters
from tracker.parameters.values import ParameterError, changed_values, shown_keys, value_of

ORIGIN = "viser"
PANEL_WIDTH = 276
"""Pixels."""

BUTTON = (73, 80, 87)
"""Red, green and blue of a button, 0 ... 255: white words on it have a contrast of 8.2 : 1."""

OWN_VALUES = "own values"
"""What the values are while they are no preset's, as on the page."""

MOST_CURVES = 12
"""Computed at one request."""


class Controls:
    """viser's panel, kept equal to the workbench's parameters, and the other way round."""

    def __init__(
        self,
        server: viser.ViserServer,
        workbench: Workbench,
        sensitivity: Sensitivity | None = None,
    ) -> None:
        """Make the panel and follow the workbench from now on.

        Args:
            server: Its panel belongs to this object.
            workbench: Whose parameters.
            sensitivity: Tells what parameters would change; without it nothing is offered.
        """
        self._sensitivity = sensitivity
        self._server = server
        self._workbench = workbench
        self._inputs = Inputs(server, lambda: self._worker.ask("edit"))
        self._resets: dict[Topic, viser.GuiButtonHandle] = {}
        self._built = threading.Event()
        self._worker = LatestWorker("controls", self._work)
        server.gui.main_panel.dock_right()
        server.gui.main_panel.set_width(PANEL_WIDTH)
        server.gui.add_html(style.PANEL)
        self._values = server.gui.add_html("")
        self._presets: Any = server.gui.add_dropdown(
            "Preset",
            (OWN_VALUES, *PRESETS),
            hint="Takes a named set of values; Changes on the page saves one of your own.",
        )
        self._presets.on_update(self._take_preset)
        self._sought: Any = server.gui.add_text(
            "Find", "", hint="Words of a parameter's name, symbol, unit or help."
        )
        self._only_changed: Any = server.gui.add_checkbox(
            "Changed only", False, hint="Leaves out what stands at its default."
        )
        for asked in (self._sought, self._only_changed):
            asked.on_update(lambda _: self._worker.ask("refresh"))
        self._essentials = server.gui.add_folder("Essentials")
        self._found = server.gui.add_folder("Found", visible=False)
        self._nothing_found = server.gui.add_html("", visible=False)
        for folder, wanted in ((self._essentials, False), (self._found, True)):
            with folder:
                # what all methods share comes first
                for parameter in sorted(PARAMETERS.values(), key=_is_of_one_method):
                    if wanted or parameter.essential:
                        self._inputs.add_copy(parameter)
        self._curves: Any = None
        if sensitivity is not None:
            self._offer_curves(sensitivity)
        self._methods = server.gui.add_folder("Methods")
        with self._methods:
            for method in METHOD_LABELS:
                self._inputs.add_method(method)
        self._topics: dict[Topic, viser.GuiFolderHandle] = {}
        for topic in get_args(Topic):
            self._make_topic(topic)
        server.gui.add_html(
            style.symbols(
                {
                    handle._impl.uuid: (
                        symbol_parts(PARAMETERS[key].symbol)[1],
                        PARAMETERS[key].unit,
                    )
                    for key in PARAMETERS
                    for handle in self._inputs.of(key)
                }
            )
        )
        self._reset_all = server.gui.add_button(
            "Reset all", hint="Every value and method to its default.", color=BUTTON
        )
        self._reset_all.on_click(lambda _: self._reset(None))
        server.gui.add_html(
            manual_places({key: handle._impl.uuid for key, handle in self._inputs.by_key.items()})
        )
        for hotkey in hotkeys():
            command = server.gui.add_command(
                hotkey.title, hotkey=hotkey.key, modifier=hotkey.modifier
            )
            command.on_trigger(partial(self._relay, hotkey.name))
        self._changed: set[str] = set()
        """The inputs whose labels are marked as changed."""
        self._shown: set[str] = set(self._inputs.by_key)
        """The inputs that are visible."""
        self._refresh(workbench.snapshot())
        self._unsubscribe = workbench.subscribe(self._note)
        self._built.set()
        self._worker.ask("refresh")

    def wait(self, timeout: float) -> bool:
        """Block until all edits and changes are done; whether within ``timeout`` seconds.

        Raises:
            Exception: What went wrong meanwhile.
        """
        return self._worker.wait(timeout)

    def close(self) -> None:
        """Stop following; the panel stays as it is."""
        self._unsubscribe()
        self._worker.close()

    # making the panel

    def _offer_curves(self, sensitivity: Sensitivity) -> None:
        """A button under what is listed, and where the curves are written."""
        for folder, copy in ((self._essentials, 0), (self._found, -1)):
            with folder:
                button = self._server.gui.add_button(
                    "What would each change?",
                    hint="Runs the recording with a few other values of each parameter listed "
                    "here, in the background, until somebody works again.",
                    color=BUTTON,
                )
            button.on_click(partial(self._ask_curves, copy))
        self._curves = self._server.gui.add_html("")
        sensitivity.subscribe(lambda: self._worker.ask("refresh"))

    def _ask_curves(self, copy: int, _: object) -> None:
        assert self._sensitivity is not None
        keys = [key for key, copies in self._inputs.copies.items() if copies[copy].visible]
        self._sensitivity.ask(keys[:MOST_CURVES])

    def _show_curves(self, parameters: RunParameters) -> None:
        if self._sensitivity is None:
            return
        content = curves.style_of(
            (
                curve,
                value_of(parameters, key),
                [h._impl.uuid for h in self._inputs.of(key)],
            )
            for key, curve in self._sensitivity.curves().items()
        )
        if self._curves.content != content:
            self._curves.content = content

    def _make_topic(self, topic: Topic) -> None:
        parameters = [p for p in PARAMETERS.values() if p.topic == topic]
        folder = self._topics[topic] = self._server.gui.add_folder(topic, expand_by_default=False)
        with folder:
            for group in dict.fromkeys(p.group for p in parameters):
                self._inputs.add_group([p for p in parameters if p.group == group])
            reset = self._server.gui.add_button(
                f"Reset {topic.lower()}", visible=False, color=BUTTON
            )
            reset.on_click(lambda _: self._reset(topic))
            self._resets[topic] = reset

    # what happens: these return at once

    def _note(self, change: Change) -> None:
        if change in ("parameters", "sequence", "taught", "presets"):
            self._worker.ask("refresh")

    def _relay(self, name: str, _: object) -> None:
        self._workbench.command(name)

    def _take_preset(self, event: viser.GuiEvent[Any]) -> None:
        now = self._workbench.snapshot()
        if event.client_id is not None and event.target.value in (*PRESETS, *now.presets):
            self._workbench.apply_preset(event.target.value)
        self._worker.ask("refresh")  # own values cannot be taken: it shows again what they are

    def _reset(self, topic: Topic | None) -> None:
        keys = None
        if topic is not None:
            keys = sorted(_about(topic, self._shown_keys(self._workbench.snapshot().parameters)))
        self._workbench.reset_parameters(keys)

    # the worker's thread

    def _work(self, topics: Set[str]) -> None:
        self._built.wait()  # a page that is open already may ask before all of it is there
        if "edit" in topics:
            self._take_edits()
        self._refresh(self._workbench.snapshot())

    def _take_edits(self) -> None:
        try:
            self._workbench.set_parameters(self._inputs.take_moved(), ORIGIN)
        except ParameterError as error:
            self._workbench.notify("error", str(error))

    def _refresh(self, snapshot: Snapshot) -> None:
        parameters, inputs = snapshot.parameters, self._inputs.by_key
        changed = inputs.keys() & changed_values(parameters, snapshot.defaults).keys()
        shown = inputs.keys() & self._shown_keys(parameters)
        with self._server.atomic():
            for key in inputs.keys() - METHODS.keys():
                self._inputs.write(key, value_of(parameters, key))
            for method, unfit in snapshot.unfit.items():
                self._inputs.write_method(method, getattr(parameters, method), unfit)
            # only what differs is written: the interpreter is wanted by the run
            for key in changed ^ self._changed:
                self._inputs.label(key, changed=key in changed)
            for key in shown ^ self._shown:
                inputs[key].visible = key in shown
            self._changed, self._shown = changed, shown
            self._show_found(shown, changed)
            for folder, keys in self._inputs.blocks:
                folder.visible = bool(keys & shown)
            for topic, reset in self._resets.items():
                reset.visible = bool(_about(topic, changed & shown))
            self._reset_all.visible = bool(changed)
            self._show_presets(snapshot)
            self._values.content = self._value_style(parameters, changed)
            self._show_curves(parameters)
        self._server.flush()

    def _show_found(self, shown: set[str], changed: set[str]) -> None:
        """Essentials and groups, or in their place what somebody looks for."""
        text, only_changed = self._sought.value.strip(), self._only_changed.value
        looks = bool(text or only_changed)
        keys = finding.found(shown, changed, text, only_changed=only_changed)
        for key, copies in self._inputs.copies.items():
            copies[-1].visible = looks and key in keys
            if len(copies) > 1:
                copies[0].visible = not looks and key in shown
        self._essentials.visible = self._methods.visible = not looks
        self._found.visible = looks and bool(keys)
        self._nothing_found.visible = looks and not keys
        what = f"No parameter has “{html.escape(text)}”" if text else "Nothing is changed"
        self._nothing_found.content = f'<div class="mvp-status">{what}.</div>'
        essential = {
            key for key in shown if key in self._inputs.copies and len(self._inputs.copies[key]) > 1
        }
        self._essentials.label = finding.title(
            "Essentials", len(essential), len(essential & changed)
        )
        self._found.label = finding.title("Found", len(keys), len(keys & changed))
        for topic, folder in self._topics.items():
            own = _about(topic, shown)
            folder.visible = not looks and bool(own)
            folder.label = finding.title(topic, len(own), len(own & changed))

    def _show_presets(self, snapshot: Snapshot) -> None:
        """Those that the page lists, in the same order, and which of them the values are."""
        own = () if snapshot.preset is not None else (OWN_VALUES,)
        options = (*own, *PRESETS, *snapshot.presets)
        if self._presets.options != options:
            self._presets.options = options
        self._presets.value = snapshot.preset or OWN_VALUES

    def _shown_keys(self, parameters: RunParameters) -> set[str]:
        """The choices of the methods, and what has an effect with what is chosen."""
        return set(shown_keys(parameters))

    def _value_style(self, parameters: RunParameters, changed: set[str]) -> str:
        """The readable numbers of logarithmic sliders, and stronger ink for changed labels."""
        numbers = {
            handle._impl.uuid: number_text(value_of(parameters, key))
            for key, scale in self._inputs.scales.items()
            if scale.parameter.log
            for handle in self._inputs.of(key)
        }
        marked = [handle._impl.uuid for key in sorted(changed) for handle in self._inputs.of(key)]
        return style.values(numbers, marked)


def _about(topic: Topic, keys: set[str]) -> set[str]:
    """Those of the keys whose parameters are about something."""
    return {key for key in keys & PARAMETERS.keys() if PARAMETERS[key].topic == topic}


def _is_of_one_method(parameter: Parameter) -> bool:
    return parameter.group in METHODS["single_view"] or parameter.group == "detection_boxes"
