"""The one store: sequence, parameters, playhead, selection, layers and the current run.

A snapshot is replaced whole, by one at a time. Whoever changes something calls a method here;
whoever shows something subscribes and reads a :class:`~app.state.snapshot.Snapshot`. Two kinds of
news: a *change* says that a part of the state is another now (read it again), an *event* is a
passing request that leaves no trace in the state.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from types import MappingProxyType
from typing import Any, Literal

from app.colours import Theme
from app.state.scores import Scored, Scores
from app.state.snapshot import (
    CLAMPED_ORIGIN,
    LAYERS,
    PRESET_ORIGIN,
    Change,
    Command,
    Event,
    Ghosts,
    Level,
    Notice,
    Opening,
    Presets,
    RunState,
    Snapshot,
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
from tracker.runs.pipeline import Progress, Run
from tracker.sequences.built_in import place_of
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence


class Workbench:
    """A snapshot that is replaced under a lock, and those who are told of it. Thread-safe."""

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._snapshot = Snapshot()
        self._pending: list[Change] = []
        self._subscribers: list[Callable[[Change], None]] = []
        self._listeners: list[Callable[[Event], None]] = []
        self._last_good: Run | None = None
        self._running: list[StudyNews] = []

    def snapshot(self) -> Snapshot:
        """The state now."""
        return self._snapshot

    def subscribe(self, callback: Callable[[Change], None]) -> Callable[[], None]:
        """Be told of changes, from the thread that makes them: the callback must return fast.

        Returns:
            A function that ends the subscription.
        """
        return self._register(self._subscribers, callback)

    def subscribe_events(self, callback: Callable[[Event], None]) -> Callable[[], None]:
        """Be told of events, from the thread that makes them: the callback must return fast."""
        return self._register(self._listeners, callback)

    def _register(self, registry: list[Any], callback: Any) -> Callable[[], None]:
        with self._lock:
            registry.append(callback)

        def end() -> None:
            with self._lock:
                if callback in registry:
                    registry.remove(callback)

        return end

    @contextmanager
    def _edit(self) -> Iterator[Snapshot]:
        """Hold the lock while the state is changed, and tell of it when the lock is free again.

        A subscriber may hold a lock of its own and come back here from another
        thread; telling under our lock would let the two wait for each other.
        """
        pending: list[Change] = []
        with self._lock:
            self._pending = pending
            yield self._snapshot
            subscribers = list(self._subscribers)
        for change in pending:
            for callback in subscribers:
                callback(change)

    def _put(self, change: Change, **values: Any) -> None:
        self._snapshot = replace(self._snapshot, version=self._snapshot.version + 1, **values)
        self._pending.append(change)

    def _set(self, change: Change, **values: Any) -> None:
        """Put values, where one of them is another than it was."""
        with self._edit() as now:
            if any(getattr(now, name) != value for name, value in values.items()):
                self._put(change, **values)

    def _notify(self, event: Event) -> None:
        with self._lock:
            listeners = list(self._listeners)
        for callback in listeners:
            callback(event)

    # what those who open, compute and score report

    def set_opening(self, opening: Opening | None) -> None:
        """How far the opening of a sequence is; None: it is over."""
        self._set("opening", opening=opening)

    def open(
        self,
        sequence: Sequence,
        key: str,
        reader: FrameReader,
        parameters: RunParameters,
        opened_as: str = "",
        corrections: tuple[Correction, ...] = (),
        chosen: RunParameters | None = None,
    ) -> FrameReader | None:
        """Show another sequence, from its first step; the reader of the one before, to be closed.

        Args:
            sequence: It has been read and checked.
            key: Another for every content.
            reader: Its pictures.
            parameters: Its default parameters.
            opened_as: The name or folder that opens it again; its own name where none is given.
            corrections: Those of its log.
            chosen: What its parameters begin with; its defaults, where none are given.
        """
        with self._edit() as now:
            before = now.reader
            self._last_good = None
            self._put(
                "sequence",
                sequence=sequence,
                saved=sequence,
                editing_room=False,
                opened_as=opened_as or sequence.name,
                sequence_key=key,
                reader=reader,
                opening=None,
                parameters=chosen or parameters,
                defaults=parameters,
                corrections=corrections,
                parameters_origin="",
                playhead=0,
                playhead_origin="",
                sought=False,
                selection=None,
                view=None,
                run=None,
                run_state=RunState(total=sequence.frames),
                scores=Scores(),
                offers=None,
            )
            return before

    def run_begins(self, key: str, message: str = "") -> None:
        """The parameters ask for the run with this key: from now on only its news count.

        Args:
            key: The run's.
            message: What it waits for, where it cannot begin at once.
        """
        with self._edit() as now:
            total = now.sequence.frames if now.sequence is not None else 0
            state = RunState(key=key, state="computing", total=total, message=message)
            self._put("run", run_state=state)

    def run_waits(self, key: str, message: str) -> None:
        """The run with this key comes no further for now, and why: it has no speed meanwhile."""
        with self._edit() as now:
            if key == now.run_state.key and message != now.run_state.message:
                waits = replace(
                    now.run_state, message=message, steps_per_second=0.0, seconds_left=None
                )
                self._put("progress", run_state=waits)

    def run_progresses(self, run: Run, progress: Progress) -> None:
        """A run has new steps; from its first step on it is the one that is shown."""
        with self._edit() as now:
            if run.key != now.run_state.key:  # superseded
                return
            state = replace(
                now.run_state,
                done=progress.done,
                total=progress.total,
                steps_per_second=progress.steps_per_second,
                seconds_left=progress.seconds_left,
                message=progress.stage.replace("_", " "),
            )
            if now.run is not run and (progress.done or now.run is None):
                self._put("run", run=run, run_state=state)
            else:
                self._put("progress", run_state=state)

    def run_ends(
        self,
        key: str,
        phase: Literal["done", "cancelled", "failed"],
        error: str | None = None,
        warnings: Iterable[str] = (),
    ) -> None:
        """The run with this key is over; after a failure the last good one is shown again.

        Where none was finished yet, what was shown stays: an unfinished run says more than none.

        Args:
            key: The run's.
            phase: How it ended.
            error: Why it failed, in one sentence.
            warnings: What its result lacks, a sentence each.
        """
        with self._edit() as now:
            if key != now.run_state.key:  # superseded
                return
            run = now.run
            if phase == "failed":
                run = self._last_good or run
            elif phase == "done":
                self._last_good = run
            state = replace(
                now.run_state,
                state=phase,
                seconds_left=None,
                message="",
                error=error,
                warnings=tuple(warnings),
            )
            self._put("run", run=run, run_state=state)

    def show_instead(self, run: Run) -> None:
        """Show a run that is done in the place of the one that is asked for."""
        with self._edit() as now:
            if now.sequence is run.sequence:
                self._last_good = run
                self._put("run", run=run)

    def show_kept(
        self, run: Run, number: int, stands_for: str = "", warnings: Iterable[str] = ()
    ) -> None:
        """Show a run of the library with its parameters, in one change.

        Args:
            run: Its tracks; of the open recording.
            number: Its number in the library.
            stands_for: The key that a computation with its values would have, if another.
            warnings: What of it cannot be shown, a sentence each.
        """
        with self._edit() as now:
            if now.sequence is None or run.sequence is not now.sequence:
                return
            state = RunState(
                key=run.key,
                state="done",
                done=run.done,
                total=now.sequence.frames,
                kept=number,
                stands_for=stands_for,
                warnings=tuple(warnings),
            )
            self._last_good = run
            self._put("run", run=run, run_state=state, parameters=run.parameters)
            self._pending.append("parameters")

    def scored(self, scored: Scored) -> None:
        """A run was scored against the truth."""
        with self._edit() as now:
            if now.sequence is None or scored.sequence.views is not now.sequence.views:
                return
            pinned = now.scores.pinned
            if now.run is not None and scored.key == now.run.key:
                self._put("evaluation", scores=now.scores.add(scored))
            elif pinned is not None and scored.key == pinned.key:
                self._put("evaluation", scores=now.scores.pin(scored))

    # what a person does

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
        self._set("selection", selection=target)

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
                seconds=now.trail.seconds if seconds is None else seconds,
                fades=now.trail.fades if fades is None else fades,
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
        self._set("view", flies=flies)

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
                moved = shown.folder != now.sequence.folder
                opened_as = place_of(shown.folder) if moved else now.opened_as
                self._put("taught", sequence=shown, saved=saved, opened_as=opened_as)

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
        self._set("edits", undo_words=undo, redo_words=redo)

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
        self._set("editing", editing_room=on)

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
        self._set("fetching", fetching=percentage)

    def set_theme(self, theme: Theme) -> None:
        """Have the 3D view dark or light."""
        self._set("theme", theme=theme)

    def command(self, name: str) -> None:
        """Relay a key that was pressed inside the 3D view to the pages."""
        self._notify(Command(name))

    def notify(self, level: Level, message: str, hint: str | None = None) -> None:
        """Say one sentence to everyone who looks."""
        self._notify(Notice(level, message, hint))

    def study_changed(self, told: Mapping[str, Any]) -> None:
        """Tell everyone who looks of a study, and whoever looks later of those that run."""
        news = StudyNews(told)
        with self._lock:
            self._running = [one for one in self._running if one.told["name"] != told["name"]]
            if told["state"] == "running":
                self._running.append(news)
        self._notify(news)

    @property
    def running_studies(self) -> tuple[StudyNews, ...]:
        """The newest of each study that runs."""
        with self._lock:
            return tuple(self._running)
