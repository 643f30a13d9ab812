"""The one store: sequence, parameters, playhead, selection, layers and the current run.

Whoever changes something calls a method here; whoever shows something subscribes
and reads a :class:`~app.state.snapshot.Snapshot`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any

from app.colours import Theme
from app.state.scores import Scored
from app.state.shown_run import ShownRun
from app.state.snapshot import (
    CLAMPED_ORIGIN,
    LAYERS,
    PRESET_ORIGIN,
    Command,
    Ghosts,
    Level,
    Notice,
    Presets,
    StudyNews,
    Task,
    Trail,
    View,
    clamp,
)
from tracker.corrections import Correction
from tracker.parameters.catalogue import METHODS, PARAMETERS, PRESETS, REMOVED, RunParameters
from tracker.parameters.values import (
    ParameterError,
    current_key,
    removed_notes,
    value_of,
    with_values,
)
from tracker.review.template_suggestions import Suggestion
from tracker.runs.pipeline import Run
from tracker.sequences.sequence import Sequence


class Workbench(ShownRun):
    """Thread-safe; what a person does is here, what is reported of runs in its base."""

    def __init__(self) -> None:
        super().__init__()
        self._running: list[StudyNews] = []

    def set_parameters(self, changes: Mapping[str, Any], origin: str) -> RunParameters:
        """Change some values by key, all or none.

        Args:
            changes: By key, numbers or text.
            origin: Who asks; numbers of viser's sliders are clamped to their range.

        Raises:
            ParameterError: If a key does not exist or a value does not fit.
        """
        if origin.startswith(CLAMPED_ORIGIN):
            changes = {key: clamp(key, value) for key, value in changes.items()}
        with self._edit() as now:
            parameters = self._put_parameters(with_values(now.parameters, changes), origin)
        self.note_removed(changes)
        return parameters

    def reset_parameters(self, keys: Iterable[str] | None = None) -> RunParameters:
        """Return some values, or all and the methods too, to what they are by default."""
        with self._edit() as now:
            wanted = (*METHODS, *PARAMETERS) if keys is None else tuple(map(current_key, keys))
            wanted = tuple(key for key in wanted if key not in REMOVED)
            for key in wanted:
                if key not in METHODS and key not in PARAMETERS:
                    with_values(now.parameters, {key: None})  # says what is wrong
            changes = {key: value_of(now.defaults, key) for key in wanted}
            return self._put_parameters(with_values(now.parameters, changes), "reset")

    def apply_preset(self, name: str) -> RunParameters:
        """Take a preset's values, and the defaults where it has none.

        The single-view method stays where the preset names none: it follows from what the
        sequence has.

        Raises:
            ParameterError: If there is no such preset.
        """
        with self._edit() as now:
            presets = {**now.presets, **PRESETS}
            if name not in presets:
                known = ", ".join(presets)
                raise ParameterError(
                    "preset",
                    f"expected one of {known}, got {name!r}",
                    "The tab Parameters lists the built-in presets and your own.",
                )
            changes = {"single_view": now.parameters.single_view, **presets[name]}
            values = with_values(now.defaults, changes)
            parameters = self._put_parameters(values, f"{PRESET_ORIGIN}{name}")
        self.note_removed(changes)
        return parameters

    def note_removed(self, keys: Iterable[str]) -> None:
        """Say what holds instead of those parameters among some that no longer exist."""
        for sentence in removed_notes(keys):
            self.notify("warn", sentence)

    def set_presets(self, presets: Presets) -> None:
        """Have these presets besides the built-in ones."""
        with self._edit():
            self._put("presets", presets=MappingProxyType(dict(presets)))

    def _put_parameters(self, parameters: RunParameters, origin: str) -> RunParameters:
        if parameters != self._snapshot.parameters:
            self._put("parameters", parameters=parameters, parameters_origin=origin)
        return parameters

    def seek(self, step: int, origin: str = "") -> int:
        """Move the playhead, as far as the sequence goes; the step it is at now."""
        with self._edit() as now:
            sequence = now.sequence
            last = sequence.frames - 1 if sequence is not None else 0
            step = max(0, min(int(step), last))
            if step != now.playhead or not now.sought:
                self._put("playhead", playhead=step, playhead_origin=origin, sought=True)
            return step

    def select(self, target: int | None) -> None:
        """Select a track by its id, or none."""
        with self._edit() as now:
            if target != now.selection:
                self._put("selection", selection=target)

    @property
    def layers(self) -> dict[str, bool]:
        """The layers of the 3D view and whether each is on."""
        return dict(self._snapshot.layers)

    def set_layers(self, changes: Mapping[str, bool]) -> None:
        """Switch some layers of the 3D view.

        Raises:
            ParameterError: If there is no such layer.
        """
        for name in changes:
            if name not in LAYERS:
                raise ParameterError(
                    f"layers.{name}",
                    f"expected one of {', '.join(LAYERS)}",
                    "The head of the 3D view has the layers.",
                )
        with self._edit() as now:
            layers = {**now.layers, **{k: bool(v) for k, v in changes.items()}}
            if layers != now.layers:
                self._put("layers", layers=MappingProxyType(layers))

    def set_trail(self, seconds: float | None = None, fades: bool | None = None) -> None:
        """Draw trails longer or shorter, seconds, fading or not; None leaves it as it is."""
        with self._edit() as now:
            trail = Trail(
                now.trail.seconds if seconds is None else seconds,
                now.trail.fades if fades is None else fades,
            )
            if trail != now.trail:
                self._put("layers", trail=trail)

    def pin(self) -> bool:
        """Pin the shown run, to set others against it; whether it was a finished one."""
        with self._edit() as now:
            if now.run is None or not now.run.finished:
                return False
            self._put("pinned", scores=now.scores.pin(Scored.of(now.run)))
            return True

    def pin_kept(self, run: Run) -> None:
        """Pin a run of the library, of the open recording, beside the one that is shown."""
        with self._edit() as now:
            if now.sequence is not None and run.sequence is now.sequence:
                self._put("pinned", scores=now.scores.pin(Scored.of(run)))

    def unpin(self) -> None:
        """Pin nothing any more."""
        with self._edit() as now:
            if now.scores.pinned is not None:
                self._put("pinned", scores=replace(now.scores, pinned=None))

    def look(self, view: View) -> None:
        """Have the 3D view look through a camera, from above, or freely.

        Args:
            view: A camera's index, from above, or None for the free view.

        Raises:
            ParameterError: If there is no such camera.
        """
        with self._edit() as now:
            cameras = len(now.sequence.views) if now.sequence is not None else 0
            if isinstance(view, int) and not 0 <= view < cameras:
                raise ParameterError(
                    "camera",
                    f"expected an index below {cameras}, top or null, got {view}",
                    "The head of the 3D view has the cameras.",
                )
            if view != now.view:
                self._put("view", view=view)

    def set_flies(self, flies: bool) -> None:
        """Have changes of the 3D view animated, or not (reduced motion)."""
        with self._edit() as now:
            if flies != now.flies:
                self._put("view", flies=flies)

    def teach(
        self,
        sequence: Sequence,
        defaults: RunParameters | None = None,
        changes: Mapping[str, Any] = MappingProxyType({}),
    ) -> None:
        """Have the open sequence with another room or other templates; its pictures stay.

        Args:
            sequence: Of the same recording; any other is refused silently, since the one it was
                made of is not open any more.
            defaults: Its default parameters; those before where none fit.
            changes: Values by key that come with it: one change for whoever takes it back.

        Raises:
            ParameterError: If a key does not exist or a value does not fit; nothing changes then.
        """
        with self._edit() as now:
            if now.sequence is None or sequence.views is not now.sequence.views:
                return
            parameters = with_values(now.parameters, changes)
            if sequence is now.sequence:
                self._put_parameters(parameters, "api")
                return
            taught = {"sequence": sequence, "defaults": defaults or now.defaults}
            if parameters == now.parameters:
                self._put("taught", **taught)
            else:
                self._put("taught", **taught, parameters=parameters, parameters_origin="api")
                self._pending.append("parameters")

    def mark_saved(self, saved: Sequence, shown: Sequence) -> None:
        """What was taught is in a file now.

        Args:
            saved: As the file has it.
            shown: What is open, in the folder that it was saved in.
        """
        with self._edit() as now:
            if now.sequence is not None and shown.views is now.sequence.views:
                self._put("taught", sequence=shown, saved=saved)

    def correct(self, sequence: Sequence, corrections: tuple[Correction, ...]) -> None:
        """Have the open recording with these corrections; the run that obeys them follows.

        Args:
            sequence: Of the recording that they are of; any other is refused silently.
            corrections: All of them, in their order.
        """
        with self._edit() as now:
            if now.sequence is None or sequence.views is not now.sequence.views:
                return
            if corrections != now.corrections:
                self._put("corrections", corrections=corrections)

    def show_edits(self, undo: str | None, redo: str | None) -> None:
        """Show what would be undone and redone; None for nothing."""
        with self._edit() as now:
            if (undo, redo) != (now.undo_words, now.redo_words):
                self._put("edits", undo_words=undo, redo_words=redo)

    def show_task(self, kind: str, task: Task | None) -> None:
        """Show how far some work in the background is, in place of what was shown of its kind.

        Args:
            kind: The kind of work.
            task: How far it is; None to show it no more.
        """
        with self._edit() as now:
            if task != now.tasks.get(kind):
                tasks = {**now.tasks, kind: task}
                shown = {key: one for key, one in tasks.items() if one is not None}
                self._put("tasks", tasks=MappingProxyType(shown))

    def runs_marked(self) -> None:
        """Tell everyone who looks that kept runs have other names or marks, or are deleted."""
        with self._edit() as now:
            self._put("marks", marks=now.marks + 1)

    def edit_room(self, on: bool) -> None:
        """Have the 3D view with handles on the room, or without."""
        with self._edit() as now:
            if on != now.editing_room:
                self._put("editing", editing_room=on)

    def show_ghosts(self, ghosts: Ghosts | None) -> None:
        """Have the 3D view show how tracks would be, or no more."""
        with self._edit() as now:
            if ghosts is not None or now.ghosts is not None:
                self._put("ghosts", ghosts=ghosts)

    def show_offers(self, sequence: Sequence, offers: tuple[Suggestion, ...] | None) -> None:
        """Have Teach list templates that may be taken, or no more.

        Args:
            sequence: Of the recording that they are of; any other is refused silently.
            offers: What is listed; None for no list.
        """
        with self._edit() as now:
            if now.sequence is None or sequence.views is not now.sequence.views:
                return
            if offers is not now.offers:
                self._put("offers", offers=offers)

    def show_fetching(self, percentage: int | None) -> None:
        """Show how much of a detection network is fetched; None while none is being fetched."""
        with self._edit() as now:
            if percentage != now.fetching:
                self._put("fetching", fetching=percentage)

    def set_theme(self, theme: Theme) -> None:
        """Have the 3D view dark or light."""
        with self._edit() as now:
            if theme != now.theme:
                self._put("theme", theme=theme)

    def command(self, name: str) -> None:
        """Relay a key that was pressed inside the 3D view to the pages."""
        self._tell(Command(name))

    def notify(self, level: Level, message: str, hint: str | None = None) -> None:
        """Say one sentence to everyone who looks."""
        self._tell(Notice(level, message, hint))

    def study_changed(self, told: Mapping[str, Any]) -> None:
        """Tell everyone who looks of a study, and whoever looks later of those that run."""
        news = StudyNews(told)
        with self._lock:
            self._running = [one for one in self._running if one.told["name"] != told["name"]]
            if told["state"] == "running":
                self._running.append(news)
        self._tell(news)

    @property
    def running_studies(self) -> tuple[StudyNews, ...]:
        """The newest of each study that runs."""
        with self._lock:
            return tuple(self._running)
