"""The keys of the 3D view: those of the page's one list of commands that viser can take.

Inside the page its keys are heard in the frame itself; these are for a 3D view that
somebody has opened in a window of its own, from where they reach every page.
"""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator, Set
from dataclasses import dataclass
from functools import partial
from typing import Any, get_args

import viser
from viser._messages import HotkeyKey, KeyModifier

from app.errors import parameter_detail
from app.paths import static_folder
from app.scene.worker import Follower
from app.state.snapshot import Change, Snapshot
from app.state.workbench import Workbench
from tracker.parameters import MethodKey
from tracker.parameters.catalogue import METHODS, PARAMETERS, PRESETS, Parameter, RunParameters
from tracker.parameters.values import ParameterError, shown_keys, value_of

VISERS_OWN = frozenset({*"WASDQE", "arrowup", "arrowdown", "arrowleft", "arrowright"})
"""Keys with which viser itself moves the viewpoint."""

_MODIFIERS: dict[str, KeyModifier | None] = {"": None, "Shift": "shift", "Ctrl": "cmd/ctrl"}
_KNOWN: dict[str, HotkeyKey] = {key.lower(): key for key in get_args(HotkeyKey)}


@dataclass(frozen=True, slots=True)
class Hotkey:
    """A command of the page and the key that it has inside the 3D view."""

    name: str
    title: str
    key: HotkeyKey
    modifier: KeyModifier | None


def hotkeys() -> Iterator[Hotkey]:
    """The commands of ``static/commands.json`` with a key that viser knows and does not use.

    Of a key that means something else at another place of the page the first meaning counts.
    """
    taken: set[tuple[HotkeyKey, KeyModifier | None]] = set()
    text = (static_folder() / "commands.json").read_text(encoding="utf-8")
    for commands in json.loads(text).values():
        for command in commands:
            for written in command["keys"]:
                modifier, _, letter = written.rpartition("+")
                key = _KNOWN.get(letter.lower())
                if key is None or modifier not in _MODIFIERS:
                    continue
                chord = (key, _MODIFIERS[modifier])
                if (key in VISERS_OWN and modifier == "") or chord in taken:
                    continue
                taken.add(chord)
                yield Hotkey(command["name"], command["title"], *chord)
                break


ORIGIN = "viser"

WIDTH = 276
"""Width of the panel in pixels."""

TITLE = "Essential parameters"
"""What the panel's head says in place of viser's word that it is connected."""

OWN_VALUES = "own values"
"""What the panel calls values that are no preset's, as the page does."""

METHOD_LABELS: dict[MethodKey, str] = {
    "single_view": "Single view",
    "fusion_method": "Fusion",
    "smoothing_method": "Smoothing",
}

UNFIT = " · not here"
"""Text behind the name of a method that cannot work on the open sequence, as on the page."""


class Panel(Follower):
    """viser's panel, kept equal to the workbench's parameters, and the other way round.

    What the server writes into an input comes back without a client and is ignored. An input is
    written only where the store has another value and no browser is just moving it. viser calls
    back some time after it has taken the value of an edit: an input with another value than the
    last one known is being moved, too.
    """

    def __init__(self, server: viser.ViserServer, workbench: Workbench) -> None:
        """Make the panel and follow the workbench from now on.

        Args:
            server: The server whose panel belongs to this object.
            workbench: The store of the parameters.
        """
        super().__init__("panel", workbench)
        self._server = server
        self._lock = threading.Lock()
        self._moved: set[str] = set()
        """The keys of inputs that a browser has moved, and that were not taken yet."""
        self._known: dict[str, Any] = {}
        """The value that was written into each input or told of it last, by key."""
        self._built = threading.Event()
        server.gui.main_panel.dock_right()
        server.gui.main_panel.set_width(WIDTH)
        server.gui.set_panel_label(TITLE)
        essential = [parameter for parameter in PARAMETERS.values() if parameter.essential]
        # what all methods share comes first
        essential.sort(key=lambda parameter: parameter.stage == "single_view")
        self._inputs: dict[str, Any] = {p.key: self._slider(p) for p in essential}
        self._presets: Any = server.gui.add_dropdown(
            "Preset",
            (OWN_VALUES, *PRESETS),
            hint="Takes a named set of values; the tab Parameters saves one of your own.",
        )
        self._presets.on_update(self._take_preset)
        for method, label in METHOD_LABELS.items():
            self._inputs[method] = server.gui.add_dropdown(
                label, METHODS[method], hint=RunParameters.model_fields[method].description
            )
        for key, handle in self._inputs.items():
            self._known[key] = handle.value
            handle.on_update(partial(self._hear, key))
        for hotkey in hotkeys():
            command = server.gui.add_command(
                hotkey.title, hotkey=hotkey.key, modifier=hotkey.modifier
            )
            command.on_trigger(partial(self._relay, hotkey.name))
        self._refresh(workbench.snapshot())
        self._built.set()
        self.follow()

    def _slider(self, parameter: Parameter) -> viser.GuiSliderHandle[float]:
        assert parameter.slider is not None
        low, high, step = parameter.slider
        return self._server.gui.add_slider(
            parameter.label,
            min=low,
            max=high,
            step=step,
            initial_value=float(parameter.default),
            hint=hint_of(parameter),
            visible=False,
        )

    # what happens: these return at once

    def _note(self, change: Change) -> None:
        if change in ("parameters", "sequence", "taught", "presets"):
            self._worker.ask("refresh")

    def _relay(self, name: str, _: object) -> None:
        self._workbench.command(name)

    def _hear(self, key: str, event: viser.GuiEvent[Any]) -> None:
        if event.client_id is not None:  # else it is our own writing
            with self._lock:
                self._take(key)
            self._worker.ask("edit")

    def _take_preset(self, event: viser.GuiEvent[Any]) -> None:
        now = self._workbench.snapshot()
        if event.client_id is not None and event.target.value in (*PRESETS, *now.presets):
            self._workbench.apply_preset(event.target.value)
        self._worker.ask("refresh")  # own values cannot be taken: it shows again what they are

    # the worker's thread

    def _work(self, topics: Set[str]) -> None:
        self._built.wait()  # a page that is open already may ask before all of it is there
        if "edit" in topics:
            self._take_edits()
        self._refresh(self._workbench.snapshot())

    def _take_edits(self) -> None:
        with self._lock:
            moved, self._moved = self._moved, set()
            changes = {key: self._inputs[key].value for key in moved}
        for method in METHODS.keys() & changes.keys():
            changes[method] = changes[method].removesuffix(UNFIT)
        try:
            self._workbench.set_parameters(changes, ORIGIN)
        except ParameterError as error:
            self._workbench.notify("error", parameter_detail(error).message)

    def _refresh(self, snapshot: Snapshot) -> None:
        parameters = snapshot.parameters
        shown = set(shown_keys(parameters))
        own = () if snapshot.preset is not None else (OWN_VALUES,)
        with self._server.atomic():
            for key in self._inputs.keys() - METHODS.keys():
                _put(self._inputs[key], "visible", key in shown)
                self._write(key, value_of(parameters, key))
            for method, unfit in snapshot.unfit.items():
                marked = tuple(f"{n}{UNFIT}" if n in unfit else n for n in METHODS[method])
                now = getattr(parameters, method)
                self._write(method, marked[METHODS[method].index(now)], marked)
                help_text = RunParameters.model_fields[method].description
                _put(self._inputs[method], "hint", unfit.get(now, help_text))
            _put(self._presets, "options", (*own, *PRESETS, *snapshot.presets))
            self._presets.value = snapshot.preset or OWN_VALUES
        self._server.flush()

    def _take(self, key: str) -> None:
        self._moved.add(key)
        self._known[key] = self._inputs[key].value

    def _write(self, key: str, value: Any, options: tuple[str, ...] = ()) -> None:
        """Have an input stand at a value, unless a browser is moving it."""
        handle = self._inputs[key]
        with self._lock:
            if handle.value != self._known[key]:
                self._take(key)
                self._worker.ask("edit")
            if key in self._moved:  # the edit comes next
                return
            if options:
                _put(handle, "options", options)
            else:
                for name, end in zip(
                    ("min", "max"), PARAMETERS[key].slider_range(value), strict=True
                ):
                    _put(handle, name, end)
            if handle.value != value:
                handle.value = value
            self._known[key] = handle.value


def _put(handle: Any, name: str, value: Any) -> None:
    """Write only what differs: the interpreter is wanted by the run."""
    if getattr(handle, name) != value:
        setattr(handle, name, value)


def hint_of(parameter: Parameter) -> str:
    """What a parameter does, its symbol, its range with the unit, and its default."""
    unit = f" {parameter.unit}" if parameter.unit else ""
    limits = f"{parameter.minimum:g} … {parameter.maximum:g}{unit}"
    published = "" if parameter.published is None else f", as published {parameter.published:g}"
    default = f"default {parameter.default:g}{published}"
    return f"{parameter.help} {parameter.symbol}: {limits}, {default}."
