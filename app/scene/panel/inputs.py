"""The inputs of viser's panel: made from the parameters' definitions, listened to, written.

What the server writes into an input comes back to it without a client and is ignored; and it
writes into one only when that stands elsewhere than the store's value and nobody is just
moving it. viser tells of an edit some time after it has taken its value: an input that has another
value than the last one known is being moved, too.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from typing import Any, cast

import viser

from app.scene.panel.sliders import Scale, hint_text, label_text
from tracker.parameters import MethodKey
from tracker.parameters.catalogue import METHODS, PARAMETERS, Parameter, RunParameters

METHOD_LABELS: dict[MethodKey, str] = {
    "single_view": "Single view",
    "fusion_method": "Fusion",
    "smoothing_method": "Smoothing",
}
"""The words of the choices of a method."""

UNFIT = " · not here"
"""Behind the name of a method that cannot work on the open sequence, as on the page."""

Input = (
    viser.GuiInputHandle[float]
    | viser.GuiInputHandle[int]
    | viser.GuiInputHandle[bool]
    | viser.GuiInputHandle[str]
)


class Inputs:
    """Every parameter's and method's input, and what browsers move in them."""

    def __init__(self, server: viser.ViserServer, on_move: Callable[[], None]) -> None:
        """Without any input yet.

        Args:
            server: In whose panel they are made, where a folder is open.
            on_move: Told that a browser has moved one.
        """
        self._server = server
        self._on_move = on_move
        self._lock = threading.Lock()
        self._moved: dict[str, Any] = {}
        """Edits that nobody has taken yet: the input that was moved, by key."""
        self._known: dict[str, Any] = {}
        """The value of each input that was written into it or told of last, by viser's name."""
        self.by_key: dict[str, Any] = {}
        self.copies: dict[str, list[Any]] = {}
        """The same parameters among the essentials and among what is found."""
        self.scales: dict[str, Scale] = {}
        """Of the sliders."""
        self.blocks: list[tuple[viser.GuiFolderHandle, frozenset[str]]] = []
        """Folders without a name of their own, and the keys of what is in each."""

    def of(self, key: str) -> list[Any]:
        """A parameter's own input and its copies."""
        return [self.by_key[key], *self.copies.get(key, ())]

    # making them

    def add(self, parameter: Parameter) -> None:
        """The input of a parameter, where its group is."""
        self._follow(parameter.key, self._input_of(parameter))

    def add_copy(self, parameter: Parameter) -> None:
        """Another one of it, not shown yet."""
        handle = self._input_of(parameter)
        handle.visible = False
        self.copies.setdefault(parameter.key, []).append(handle)
        self._hear(parameter.key, handle)

    def add_method(self, method: MethodKey) -> None:
        """The choice of a method."""
        chooser = self._server.gui.add_dropdown(
            METHOD_LABELS[method],
            METHODS[method],
            initial_value=METHODS[method][0],
            hint=RunParameters.model_fields[method].description,
        )
        self._follow(method, chooser)

    def add_group(self, parameters: list[Parameter]) -> None:
        """The parameters of one group that are about one thing, the advanced ones folded away."""
        group = parameters[0].group
        folder = self._server.gui.add_folder(None)
        self.blocks.append((folder, frozenset(p.key for p in parameters)))
        with folder:
            whose = "all cameras" if parameters[0].stage != "single_view" else "each camera"
            self._server.gui.add_html(
                f'<div class="mvp-group">{whose} · {group.replace("_", " ")}</div>'
            )
            for parameter in parameters:
                if not parameter.advanced:
                    self.add(parameter)
            advanced = [p for p in parameters if p.advanced]
            if advanced:
                more = self._server.gui.add_folder("Advanced", expand_by_default=False)
                self.blocks.append((more, frozenset(p.key for p in advanced)))
                with more:
                    for parameter in advanced:
                        self.add(parameter)

    def _input_of(self, parameter: Parameter) -> Input:
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
            scale = self.scales[parameter.key] = Scale(parameter)
            handle = gui.add_slider(
                label,
                min=scale.minimum,
                max=scale.maximum,
                step=scale.step,
                initial_value=scale.place(parameter.default),
                hint=hint,
            )
        return handle

    def _follow(self, key: str, handle: Any) -> None:
        self.by_key[key] = handle
        self._hear(key, handle)

    def _hear(self, key: str, handle: Any) -> None:
        self._known[handle._impl.uuid] = handle.value

        @handle.on_update  # type: ignore[untyped-decorator]
        def _(event: viser.GuiEvent[Any]) -> None:
            if event.client_id is not None:  # else it is our own writing
                with self._lock:
                    self._take(key, handle)
                self._on_move()

    def _take(self, key: str, handle: Any) -> None:
        self._moved[key], self._known[handle._impl.uuid] = handle, handle.value

    def _is_moved(self, key: str, handle: Any) -> bool:
        if handle.value != self._known[handle._impl.uuid]:
            self._take(key, handle)
            self._on_move()
        return key in self._moved

    def _put(self, handle: Any, value: Any) -> None:
        handle.value = self._known[handle._impl.uuid] = value

    # reading and writing them

    def take_moved(self) -> dict[str, Any]:
        """The values of those that were moved since this was asked last, by key."""
        with self._lock:
            moved, self._moved = self._moved, {}
        return {key: self._value_of(key, handle) for key, handle in moved.items()}

    def _value_of(self, key: str, handle: Any) -> Any:
        place = handle.value
        if key in METHODS:
            return place.removesuffix(UNFIT)
        return self.scales[key].value(place) if key in self.scales else place

    def write(self, key: str, value: Any) -> None:
        """Have a parameter's inputs stand at a value, unless somebody is moving one."""
        scale = self.scales.get(key)
        for handle in self.of(key):
            with self._lock:
                if self._is_moved(key, handle):  # the edit comes next
                    return
                if scale is None:
                    if handle.value != value:
                        self._put(handle, value)
                elif not scale.stands_at(handle.value, value):
                    self._put(handle, scale.place(value))

    def write_method(self, key: MethodKey, name: str, unfit: Mapping[str, str]) -> None:
        """The methods, marked where one cannot work here; of the chosen one the hint says why."""
        handle = self.by_key[key]
        marked = {name: f"{name}{UNFIT}" if name in unfit else name for name in METHODS[key]}
        with self._lock:
            if self._is_moved(key, handle):
                return
            if handle.options != tuple(marked.values()):
                handle.options = tuple(marked.values())
            if handle.value != marked[name]:
                self._put(handle, marked[name])
            hint = unfit.get(name, RunParameters.model_fields[key].description)
            if handle.hint != hint:
                handle.hint = hint

    def label(self, key: str, *, changed: bool) -> None:
        """Write a name, marked where the value is not the default."""
        if key in PARAMETERS:
            label = label_text(PARAMETERS[key], changed=changed)
        else:
            words = METHOD_LABELS[cast(MethodKey, key)]
            label = f"• {words}" if changed else words
        for handle in self.of(key):
            handle.label = label
