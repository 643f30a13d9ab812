"""The sliders in viser's panel, made from the definitions in :mod:`tracker.parameters`.

One edit goes one way round: browser → workbench → every other face. What the server
writes into a slider comes back to it without a client and is ignored; and it writes
into a slider only when that stands elsewhere than the store's value and nobody is
just moving it.
"""

from __future__ import annotations

import threading
from collections.abc import Set
from functools import partial
from typing import Any

import viser

from app.scene import style
from app.scene.keys import hotkeys
from app.scene.panel.sliders import Scale, hint_text, label_text, number_text
from app.scene.worker import LatestWorker
from app.state.snapshot import Change, Snapshot
from app.state.workbench import Workbench
from tracker import parameters as table
from tracker.parameters import Parameter, ParameterError, RunParameters, Stage

ORIGIN = "viser"
PANEL_WIDTH = 276
"""Pixels."""

OWN_VALUES = "own values"
"""What the values are while they are no preset's, as on the page."""

STAGES: dict[Stage, str] = {
    "single_view": "Single view",
    "fusion": "Fusion",
    "smoothing": "Smoothing",
    "tracks": "Tracks",
}
METHOD_STAGE: dict[str, Stage] = {
    "single_view": "single_view",
    "fusion_method": "fusion",
    "smoothing_method": "smoothing",
}

Input = (
    viser.GuiInputHandle[float]
    | viser.GuiInputHandle[int]
    | viser.GuiInputHandle[bool]
    | viser.GuiInputHandle[str]
)


class Controls:
    """viser's panel, kept equal to the workbench's parameters, and the other way round."""

    def __init__(self, server: viser.ViserServer, workbench: Workbench) -> None:
        """Make the panel and follow the workbench from now on.

        Args:
            server: Its panel belongs to this object.
            workbench: Whose parameters.
        """
        self._server = server
        self._workbench = workbench
        self._inputs: dict[str, Any] = {}
        self._scales: dict[str, Scale] = {}
        self._groups: dict[str, list[viser.GuiFolderHandle]] = {}
        self._resets: dict[Stage, viser.GuiButtonHandle] = {}
        self._lock = threading.Lock()
        self._moved: set[str] = set()
        """Edits of browsers that are not yet in the workbench."""
        self._worker = LatestWorker("controls", self._work)
        server.gui.main_panel.dock_right()
        server.gui.main_panel.set_width(PANEL_WIDTH)
        server.gui.add_html(style.PANEL)
        self._values = server.gui.add_html("")
        self._presets: Any = server.gui.add_dropdown(
            "Preset",
            (OWN_VALUES, *table.PRESETS),
            hint="Takes a named set of values; Changes on the page saves one of your own.",
        )
        self._presets.on_update(self._take_preset)
        for stage, title in STAGES.items():
            self._make_stage(stage, title)
        self._reset_all = server.gui.add_button(
            "Reset all", hint="Every value and method to its default."
        )
        self._reset_all.on_click(lambda _: self._reset(None))
        for hotkey in hotkeys():
            command = server.gui.add_command(
                hotkey.title, hotkey=hotkey.key, modifier=hotkey.modifier
            )
            command.on_trigger(partial(self._relay, hotkey.name))
        self._changed: set[str] = set()
        """The inputs whose labels are marked as changed."""
        self._shown: set[str] = set(self._inputs)
        """The inputs that are visible."""
        self._refresh(workbench.snapshot())
        self._unsubscribe = workbench.subscribe(self._note)
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

    def _make_stage(self, stage: Stage, title: str) -> None:
        parameters = [p for p in table.PARAMETERS.values() if p.stage == stage]
        with self._server.gui.add_folder(title):
            for method, owner in METHOD_STAGE.items():
                if owner == stage:
                    self._make_method(method)
            for group in dict.fromkeys(p.group for p in parameters):
                self._make_group([p for p in parameters if p.group == group])
            reset = self._server.gui.add_button(f"Reset {title.lower()}", visible=False)
            reset.on_click(lambda _: self._reset(stage))
            self._resets[stage] = reset

    def _make_method(self, method: str) -> None:
        field = RunParameters.model_fields[method]
        chooser = self._server.gui.add_dropdown(
            "Method",
            table.METHODS[method],
            initial_value=table.METHODS[method][0],
            hint=field.description,
        )
        self._follow(method, chooser)

    def _make_group(self, parameters: list[Parameter]) -> None:
        group = parameters[0].group
        folder = self._server.gui.add_folder(None)
        self._groups.setdefault(group, []).append(folder)
        with folder:
            for parameter in parameters:
                if not parameter.advanced:
                    self._make_input(parameter)
            advanced = [p for p in parameters if p.advanced]
            if advanced:
                with self._server.gui.add_folder("Advanced", expand_by_default=False):
                    for parameter in advanced:
                        self._make_input(parameter)

    def _make_input(self, parameter: Parameter) -> None:
        gui = self._server.gui
        label, hint = label_text(parameter, changed=False), hint_text(parameter)
        handle: Input
        if parameter.kind == "bool":
            handle = gui.add_checkbox(label, bool(parameter.default), hint=hint)
        elif parameter.kind == "choice":
            handle = gui.add_dropdown(
                label, parameter.choices, initial_value=parameter.default, hint=hint
            )
        else:
            scale = self._scales[parameter.key] = Scale(parameter)
            handle = gui.add_slider(
                label,
                min=scale.minimum,
                max=scale.maximum,
                step=scale.step,
                initial_value=scale.place(parameter.default),
                hint=hint,
            )
        self._follow(parameter.key, handle)

    def _follow(self, key: str, handle: Any) -> None:
        self._inputs[key] = handle

        @handle.on_update  # type: ignore[untyped-decorator]
        def _(event: viser.GuiEvent[Any]) -> None:
            if event.client_id is not None:  # else it is our own writing
                with self._lock:
                    self._moved.add(key)
                self._worker.ask("edit")

    # what happens: these return at once

    def _note(self, change: Change) -> None:
        if change in ("parameters", "sequence", "taught", "presets"):
            self._worker.ask("refresh")

    def _relay(self, name: str, _: object) -> None:
        self._workbench.command(name)

    def _take_preset(self, event: viser.GuiEvent[Any]) -> None:
        now = self._workbench.snapshot()
        if event.client_id is not None and event.target.value in (*table.PRESETS, *now.presets):
            self._workbench.apply_preset(event.target.value, ORIGIN)
        self._worker.ask("refresh")  # own values cannot be taken: it shows again what they are

    def _reset(self, stage: Stage | None) -> None:
        keys = None
        if stage is not None:
            shown = self._shown_keys(self._workbench.snapshot().parameters)
            keys = [key for key in shown if self._stage_of(key) == stage]
        self._workbench.reset_parameters(keys, ORIGIN)

    # the worker's thread

    def _work(self, topics: Set[str]) -> None:
        if "edit" in topics:
            self._take_edits()
        self._refresh(self._workbench.snapshot())

    def _take_edits(self) -> None:
        with self._lock:
            moved, self._moved = self._moved, set()
        edits = {key: self._value_of(key) for key in moved}
        try:
            self._workbench.set_parameters(edits, ORIGIN)
        except ParameterError as error:
            self._workbench.notify("error", str(error))

    def _value_of(self, key: str) -> Any:
        place = self._inputs[key].value
        return self._scales[key].value(place) if key in self._scales else place

    def _refresh(self, snapshot: Snapshot) -> None:
        parameters = snapshot.parameters
        changed = self._inputs.keys() & table.changed(parameters, snapshot.defaults).keys()
        shown = self._inputs.keys() & self._shown_keys(parameters)
        with self._server.atomic():
            for key, handle in self._inputs.items():
                self._write(key, handle, table.value(parameters, key))
            # only what differs is written: the interpreter is wanted by the run
            for key in changed ^ self._changed:
                if key in table.PARAMETERS:
                    label = label_text(table.PARAMETERS[key], changed=key in changed)
                else:
                    label = "• Method" if key in changed else "Method"
                self._inputs[key].label = label
            for key in shown ^ self._shown:
                self._inputs[key].visible = key in shown
            self._changed, self._shown = changed, shown
            groups = {table.PARAMETERS[key].group for key in shown if key in table.PARAMETERS}
            for group, folders in self._groups.items():
                for folder in folders:
                    folder.visible = group in groups
            for stage, reset in self._resets.items():
                reset.visible = any(self._stage_of(k) == stage for k in changed if k in shown)
            self._reset_all.visible = bool(changed)
            self._show_presets(snapshot)
            self._values.content = self._value_style(parameters, changed)
        self._server.flush()

    def _show_presets(self, snapshot: Snapshot) -> None:
        """Those that the page lists, in the same order, and which of them the values are."""
        own = () if snapshot.preset is not None else (OWN_VALUES,)
        options = (*own, *table.PRESETS, *snapshot.presets)
        if self._presets.options != options:
            self._presets.options = options
        self._presets.value = snapshot.preset or OWN_VALUES

    def _write(self, key: str, handle: Any, value: Any) -> None:
        scale = self._scales.get(key)
        with self._lock:
            if key in self._moved:  # somebody is moving it; the edit comes next
                return
            if scale is None:
                if handle.value != value:
                    handle.value = value
            elif not scale.stands_at(handle.value, value):
                handle.value = scale.place(value)

    def _shown_keys(self, parameters: RunParameters) -> set[str]:
        """The keys that the chosen methods read, the choices themselves included."""
        stages = (table.stage_values(parameters, stage) for stage in STAGES)
        return {*table.METHODS, *(key for values in stages for key in values)}

    def _stage_of(self, key: str) -> Stage:
        return METHOD_STAGE[key] if key in METHOD_STAGE else table.PARAMETERS[key].stage

    def _value_style(self, parameters: RunParameters, changed: set[str]) -> str:
        """The readable numbers of logarithmic sliders, and stronger ink for changed labels."""
        numbers = {
            self._inputs[key]._impl.uuid: number_text(table.value(parameters, key))
            for key, scale in self._scales.items()
            if scale.parameter.log
        }
        marked = [self._inputs[key]._impl.uuid for key in sorted(changed)]
        return style.values(numbers, marked)
