"""The only owner of the threads that open recordings and compute runs, which follow them.

Runs are coalesced, not queued: at most one is under way, the newest parameters
win, the last always runs, and a superseded one stops between two steps.
"""

from __future__ import annotations

import logging
import sys
import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from app.errors import sentence
from app.state.compiling import Compiling
from app.state.crashes import Crashes, Note
from app.state.snapshot import Change, Opening, RunState, Snapshot
from app.state.threads import CLOSING_SECONDS, be_nice
from app.state.workbench import Workbench
from tracker.corrections import Correction
from tracker.corrections.log import open_log
from tracker.fusion.trajectories import Trajectories, apply_corrections
from tracker.library.keeping import run_for_display
from tracker.library.records import Result
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.values import ParameterError, changed_values, with_values
from tracker.runs import gaps, pipeline
from tracker.runs.camera_notes import camera_notes
from tracker.runs.gates import notices
from tracker.runs.outcome import why_no_tracks
from tracker.runs.pipeline import Cancelled, Progress, Run
from tracker.runs.stage_cache import StageCache
from tracker.sequences import library
from tracker.sequences.pictures.frames import CACHE_BYTES, FrameReader
from tracker.sequences.sequence import Sequence

SILENT_SECONDS = 20.0
"""Longer than any step takes, and than learning a background of most recordings."""

_LOOKS_SECONDS = 2.0


class Watchdog:
    """Within it, work must call :meth:`heard` now and then."""

    def __init__(
        self,
        on_silence: Callable[[float], None],
        *,
        after: float = SILENT_SECONDS,
        looks: float = _LOOKS_SECONDS,
    ) -> None:
        """Nothing runs before it is entered.

        Args:
            on_silence: Called from a thread of its own with the seconds of silence, while it lasts.
            after: Seconds from which on it is called.
            looks: Seconds between two looks.
        """
        self._on_silence = on_silence
        self._after = after
        self._looks = looks
        self._last = 0.0
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="watchdog", daemon=True)

    def __enter__(self) -> Watchdog:
        self._last = time.monotonic()
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()

    def heard(self) -> None:
        """The work goes on."""
        self._last = time.monotonic()

    def _watch(self) -> None:
        while not self._ended.wait(self._looks):
            silent = time.monotonic() - self._last
            if silent >= self._after:
                self._on_silence(silent)


logger = logging.getLogger("app")

Corrections = tuple[Correction, ...]


def locate(name: str, data: Path | None) -> str:
    """The folder under the data folder that a name of the list stands for, else the name."""
    if data is not None and (data / name / "sequence.toml").is_file():
        return str(data / name)
    return name


class Opener:
    """Opens sequences in threads of its own and shows them in the workbench."""

    def __init__(
        self,
        workbench: Workbench,
        crashes: Crashes,
        retire: Callable[[FrameReader], None],
        begin: Callable[[Sequence, RunParameters, Corrections], RunParameters],
        *,
        data: Path | None,
        detector: Path | None,
        computes: bool,
        picture_bytes: int,
    ) -> None:
        """Open nothing yet.

        Args:
            workbench: Where they are shown.
            crashes: Told what is opened, for the start after a crash.
            retire: Closes the pictures of what was open, when nobody reads them any more.
            begin: The parameters that a recording begins with, given its own.
            data: Its folders are sequences by name.
            detector: A network that may be run on the pictures of all of them.
            computes: Whether runs will be computed, which need pictures or boxes.
            picture_bytes: Bound on the memory of decoded pictures.
        """
        self._workbench = workbench
        self._crashes = crashes
        self._retire = retire
        self._begin = begin
        self._data = data
        self._detector = detector
        self._own_detectors: dict[str, Path | None] = {}
        """Chosen on the page, each for a recording, by the name that it is opened by."""
        self._computes = computes
        self._picture_bytes = picture_bytes
        self._refused = ""
        self._lock = threading.Lock()
        self._showing = threading.Lock()  # who was not cancelled is shown before a newer one
        self._newest: threading.Event | None = None
        self._threads: list[threading.Thread] = []
        self._closed = False

    def refuse_once(self, place: str) -> None:
        """Do not open this place the next time it is asked for: the program crashed with it."""
        self._refused = place

    def open(self, name: str, values: Mapping[str, Any] | None = None) -> Future[None]:
        """Open a sequence, built-in or a folder, in the background; the newest request wins.

        Args:
            name: Of it.
            values: The parameters that are not at its defaults; None for those that it was left
                with.

        Returns:
            Done when it is shown; its exception says why it is not. Whatever was
            open stays open after a failure.
        """
        future: Future[None] = Future()
        cancelled = threading.Event()
        if name and name == self._refused:  # by a page that comes back
            self._refused = ""
            error = ValueError("the program crashed when it was opened; open it again to try anew")
            self._failed(name, cancelled, error)
            future.set_exception(error)
            return future
        with self._lock:
            if self._closed:
                raise RuntimeError("nothing is opened any more: the workbench is closed")
            if self._newest is not None:
                self._newest.set()
            self._newest = cancelled
            thread = threading.Thread(
                target=self._open,
                args=(name, values, cancelled, future),
                name="opening",
                daemon=True,
            )
            self._threads = [t for t in self._threads if t.is_alive()] + [thread]
        self._workbench.set_opening(Opening(name))
        thread.start()
        return future

    def use_detector(self, model: Path | None) -> Future[None]:
        """Have another detection network, or none, and open what is open again with it.

        All values stay but the single-view method, which is the one that then fits.

        Args:
            model: An ONNX file that can be used; None where there is to be none.

        Returns:
            As :meth:`open`.
        """
        now = self._workbench.snapshot()
        self._own_detectors[now.opened_as] = model
        values = changed_values(now.parameters, now.defaults)
        values.pop("single_view", None)
        return self.open(now.opened_as, values)

    def _open(
        self,
        name: str,
        values: Mapping[str, Any] | None,
        cancelled: threading.Event,
        future: Future[None],
    ) -> None:
        be_nice()
        try:
            with self._crashes.opening(name):
                sequence = library.open_sequence(locate(name, self._data))
                detector = self._own_detectors.get(name, self._detector)
                sequence = library.with_detector(sequence, detector)
                parameters = RunParameters()
                if self._computes:  # else neither pictures nor boxes are needed
                    parameters = pipeline.default_parameters(sequence)
                reader = FrameReader(sequence, cache_bytes=self._picture_bytes)
            key = sequence.digest[:16]
            corrections = open_log(sequence.folder).corrections
            if values is None:
                chosen = self._begin(sequence, parameters, corrections)
            else:
                chosen = with_values(parameters, values)
            with self._showing:
                with self._lock:
                    if cancelled.is_set():
                        reader.close()
                        raise Cancelled
                    self._newest = None
                before = self._workbench.open(
                    sequence, key, reader, parameters, name, corrections, chosen
                )  # fmt: skip
        except Exception as error:
            if cancelled.is_set():
                future.set_exception(Cancelled("another sequence was asked for"))
                return
            if not isinstance(error, ValueError | OSError):
                logger.exception("opening %s failed", name)
            self._failed(name, cancelled, error)
            future.set_exception(error)
        else:
            if before is not None:
                self._retire(before)
            future.set_result(None)

    def _failed(self, name: str, cancelled: threading.Event, error: Exception) -> None:
        with self._lock:
            if cancelled.is_set():
                return
            self._newest = None
        self._workbench.set_opening(None)
        words = sentence(error).removeprefix(f"{name}: ")
        self._workbench.notify(
            "error", f"{name} cannot be opened: {words}", "What was open still is."
        )

    def close(self) -> list[threading.Thread]:
        """Open nothing any more; the threads that may still be about to notice."""
        with self._lock:
            self._closed = True
            if self._newest is not None:
                self._newest.set()
            return list(self._threads)


CRASHED = (
    "the program crashed while this run was computed; it is left out until it is asked for again"
)

LEFT_AT_A_CRASH = (
    "was left with parameters under which the program crashed; it begins with those of the last "
    "run that was done"
)

ENDING = "ending the run before"
"""What a run waits for while the one before it comes to a place where it can stop."""

SWITCH_SECONDS = 0.001
"""A thread that computes gives the interpreter back this soon; Python's own 5 ms add up
when a request needs it several times."""

LOOKS_SECONDS = 0.05
"""So often who waits for a run looks: a change comes before the run that it asks for."""


@dataclass(eq=False)
class _Wanted:
    """A run that is asked for."""

    snapshot: Snapshot
    key: str
    cancelled: threading.Event = field(default_factory=threading.Event)
    stopped_by_person: bool = False


class Jobs:
    """Opens sequences and computes runs in threads of its own; reports to the workbench."""

    def __init__(
        self,
        workbench: Workbench,
        *,
        data: Path | None = None,
        detector: Path | None = None,
        seed: int = 0,
        cache: StageCache | None = None,
        compiling: Compiling | None = None,
        computes: bool = True,
        picture_bytes: int = CACHE_BYTES,
        crashes: Crashes | None = None,
        draft_of: Callable[[Path], Path | None] = lambda folder: None,
        left_with: Callable[[Path], Mapping[str, Any]] = lambda folder: {},
    ) -> None:
        """Begin to follow the workbench.

        Args:
            workbench: Whom to serve.
            data: Its folders are sequences by name.
            detector: A network that may be run on the pictures of all of them.
            seed: Of all runs.
            cache: Where columns of runs are kept; in memory only, if none is given.
            compiling: Whom to wait for before the first run;
                closed with this.
            computes: Whether runs are computed at all, rather than only shown.
            picture_bytes: Bound on the memory of decoded pictures.
            crashes: Told what is computed with, for the start after a crash.
            draft_of: The file of what was taught of a folder and not saved.
            left_with: The parameters that a folder was left with, by key.
        """
        self._workbench = workbench
        self._seed = seed
        self._condition = threading.Condition()
        self._wanted: _Wanted | None = None
        self._under_way: _Wanted | None = None
        self._cache = cache or StageCache()
        self._compiling = compiling
        self._computes = computes
        self._crashes = crashes or Crashes(None)
        self._draft_of = draft_of
        self._left_with = left_with
        self._opener = Opener(
            workbench,
            self._crashes,
            self._close_when_unused,
            self._begin_with,
            data=data,
            detector=detector,
            computes=computes,
            picture_bytes=picture_bytes,
        )
        self._closed = False
        self._unsubscribe = workbench.subscribe(self._on_change)
        self._switch_interval = sys.getswitchinterval()
        sys.setswitchinterval(SWITCH_SECONDS)
        self._worker = threading.Thread(target=self._work, name="runs", daemon=True)
        self._worker.start()

    # opening

    def open(self, name: str, values: Mapping[str, Any] | None = None) -> Future[None]:
        """Open a sequence in the background, as :meth:`Opener.open` does."""
        return self._opener.open(name, values)

    def use_detector(self, model: Path | None) -> Future[None]:
        """Open what is open again with a network, as :meth:`Opener.use_detector` does."""
        return self._opener.use_detector(model)

    def take_up(self, note: Note) -> Future[None]:
        """Open what a start had open that crashed, with its values; its run is left out.

        Returns:
            As :meth:`open`; where it crashed when that was opened, it is not, and is refused once.
        """
        if note.opening or not note.place:
            self._opener.refuse_once(note.place)
            nothing: Future[None] = Future()
            nothing.set_result(None)
            return nothing
        return self.open(note.place, note.values)

    def _begin_with(
        self, sequence: Sequence, defaults: RunParameters, corrections: Corrections
    ) -> RunParameters:
        """The parameters that a recording was left with; where the program crashed under them,
        those of the last run that was done."""
        try:
            parameters = with_values(defaults, self._left_with(sequence.folder))
        except ParameterError as error:
            logger.warning("%s begins with its defaults: %s", sequence.name, sentence(error))
            return defaults
        key = pipeline.stage_keys(sequence, parameters, self._seed, corrections)["tracks"]
        if key not in self._crashes.left_out:
            return parameters
        self._workbench.notify("warn", f"{sequence.name} {LEFT_AT_A_CRASH}")
        return with_values(defaults, self._crashes.left_out[key] or {})

    def _close_when_unused(self, reader: FrameReader) -> None:
        """Close a reader as soon as the run that may decode from it is over."""
        with self._condition:
            self._condition.wait_for(
                lambda: (
                    self._closed
                    or self._under_way is None
                    or self._under_way.snapshot.reader is not reader
                )
            )
        reader.close()

    # running

    def run_again(self) -> None:
        """Go on with a run that was cancelled or failed, or with which the program crashed."""
        self._crashes.ask_again(self._workbench.snapshot().run_state.key)
        self._ask(again=True)

    def show_kept(self, result: Result) -> None:
        """Show a run of the library, of the open recording, instead of computing one.

        Where this code, this recording and its corrections would give other tracks, it is another
        run than the one that a computation gives.

        Raises:
            ValueError: If the recording does not fit it any more.
        """
        with self._condition:
            snapshot = self._workbench.snapshot()
            if snapshot.sequence is None:
                raise ValueError("no recording is open")
            run = run_for_display(snapshot.sequence, result)
            wanted = pipeline.stage_keys(
                snapshot.sequence, result.parameters, self._seed, snapshot.corrections
            )["tracks"]
            if self._under_way is not None:
                self._under_way.cancelled.set()
            self._wanted = None
            stands_for = "" if run.key == wanted else wanted
            warnings = (*result.run.removed, *_beyond_the_end(run, result))
            self._workbench.show_kept(run, result.run.id, stands_for, warnings)

    def cancel(self) -> None:
        """Stop the run under way; its steps stay shown."""
        with self._condition:
            for wanted in (self._wanted, self._under_way):
                if wanted is not None:
                    wanted.stopped_by_person = True
                    wanted.cancelled.set()

    def settled(self, seconds: float) -> Snapshot:
        """The state with the run that its values and corrections ask for.

        Who has just said something is told what came of it, not what was before: a change is seen
        a moment before the run that it asks for begins.

        Args:
            seconds: After these, the state as it is.
        """
        deadline = time.monotonic() + seconds
        with self._condition:
            while True:
                now = self._workbench.snapshot()
                left = deadline - time.monotonic()
                if left <= 0.0 or now.sequence is None or self._has_run(now):
                    return now
                self._condition.wait(min(left, LOOKS_SECONDS))

    def _has_run(self, snapshot: Snapshot) -> bool:
        """Whether the run that is asked for is over."""
        assert snapshot.sequence is not None
        state = snapshot.run_state
        keys = pipeline.stage_keys(
            snapshot.sequence, snapshot.parameters, self._seed, snapshot.corrections
        )
        return state.state != "computing" and keys["tracks"] in (state.key, state.stands_for)

    def _on_change(self, change: Change) -> None:
        if change in ("sequence", "parameters", "taught", "corrections"):
            self._ask()

    def _ask(self, *, again: bool = False) -> None:
        with self._condition:
            snapshot = self._workbench.snapshot()
            if snapshot.sequence is None or self._closed or not self._computes:
                return
            key = pipeline.stage_keys(
                snapshot.sequence, snapshot.parameters, self._seed, snapshot.corrections
            )["tracks"]
            newest = self._wanted or self._under_way
            if newest is not None and newest.key == key and not newest.cancelled.is_set():
                return  # it is under way already
            shown = (snapshot.run_state.key, snapshot.run_state.stands_for)
            idle = newest is None or newest.cancelled.is_set()
            if idle and key in shown and not again:
                return  # it is there already, or was stopped on purpose
            if self._under_way is not None:
                self._under_way.cancelled.set()
            self._wanted = _Wanted(snapshot, key)
            # subscribers are called under the lock, so that of two changes at once the newer comes
            # last; they only take note and return
            waits = ENDING if self._under_way is not None else ""
            self._workbench.run_begins(key, waits)
            self._condition.notify_all()

    def _work(self) -> None:
        while True:
            with self._condition:
                self._under_way = None
                self._condition.notify_all()
                self._condition.wait_for(lambda: self._closed or self._wanted is not None)
                if self._closed:
                    return
                wanted, self._wanted = self._wanted, None
                self._under_way = wanted
            assert wanted is not None
            self._compute(wanted)

    def _compute(self, wanted: _Wanted) -> None:
        snapshot, workbench = wanted.snapshot, self._workbench
        sequence = snapshot.sequence
        assert sequence is not None

        def on_progress(run: Run, progress: Progress) -> None:
            watchdog.heard()
            if not wanted.cancelled.is_set():
                workbench.run_progresses(run, progress)

        def on_silence(seconds: float) -> None:
            if not wanted.cancelled.is_set():
                compiling = "" if self._compiling is None else self._compiling.words
                words = silence(workbench.snapshot().run_state, seconds, compiling)
                workbench.run_waits(wanted.key, words)

        def on_compiling(words: str) -> None:
            if not wanted.cancelled.is_set():
                workbench.run_waits(wanted.key, words)

        try:
            if self._compiling is not None:
                self._compiling.wait(on_compiling, wanted.cancelled.is_set)
            if wanted.key in self._crashes.left_out:
                self._leave_out(wanted, self._crashes.left_out[wanted.key])
                return
            with Watchdog(on_silence) as watchdog:
                run = self._tracked(wanted, snapshot.parameters, wanted.key, on_progress)
        except Cancelled:
            if wanted.stopped_by_person:
                workbench.run_ends(wanted.key, "cancelled")
        except MemoryError:
            self._cache.clear()
            workbench.run_ends(
                wanted.key, "failed", "there is not enough memory for this run; what was kept of "
                "others has been let go"
            )  # fmt: skip
        except Exception as error:
            if not isinstance(error, ValueError | OSError):
                logger.exception("a run failed")
            workbench.run_ends(wanted.key, "failed", sentence(error))
        else:
            reason = why_no_tracks(run)
            told = [*([reason] if reason else []), *gaps.sentences(run), *notices(run)]
            told += camera_notes(run)
            workbench.run_ends(wanted.key, "done", warnings=told)

    def _leave_out(self, wanted: _Wanted, good: Mapping[str, Any] | None) -> None:
        """Say that a run crashed the program; the last one that went well is shown in its place."""
        snapshot, workbench = wanted.snapshot, self._workbench
        if good is not None and workbench.snapshot().run is None:
            assert snapshot.sequence is not None
            parameters = with_values(snapshot.defaults, good)
            key = pipeline.stage_keys(
                snapshot.sequence, parameters, self._seed, snapshot.corrections
            )["tracks"]
            if key != wanted.key:
                workbench.show_instead(self._tracked(wanted, parameters, key, lambda *_: None))
        workbench.run_ends(wanted.key, "failed", CRASHED)

    def _tracked(
        self,
        wanted: _Wanted,
        parameters: RunParameters,
        key: str,
        on_progress: Callable[[Run, Progress], None],
    ) -> Run:
        snapshot = wanted.snapshot
        assert snapshot.sequence is not None
        draft = self._draft_of(snapshot.sequence.folder)
        with self._crashes.computing(draft, key, changed_values(parameters, snapshot.defaults)):
            return pipeline.compute(
                snapshot.sequence,
                parameters,
                seed=self._seed,
                corrections=snapshot.corrections,
                meanwhile=_meanwhile(snapshot, self._seed),
                reader=snapshot.reader,
                cache=self._cache,
                wanted=lambda: self._workbench.snapshot().playhead,
                on_progress=on_progress,
                cancelled=wanted.cancelled.is_set,
                thread_begins=be_nice,
            )

    def close(self) -> None:
        """Stop everything; what is under way ends after its step."""
        self._unsubscribe()
        opening = self._opener.close()
        with self._condition:
            self._closed = True
            if self._under_way is not None:
                self._under_way.cancelled.set()
            self._condition.notify_all()
        if self._compiling is not None:
            self._compiling.stop()
        deadline = time.monotonic() + CLOSING_SECONDS
        for thread in (self._worker, *opening):
            if thread.ident is not None:
                thread.join(timeout=max(0.0, deadline - time.monotonic()))
        if self._compiling is not None and not self._worker.is_alive():
            self._compiling.close()
        sys.setswitchinterval(self._switch_interval)
        reader = self._workbench.snapshot().reader
        if reader is not None:
            reader.close()


def silence(now: RunState, seconds: float, compiling: str = "") -> str:
    """What is said of a run of which nothing was heard for so long: after its last step the tracks
    are smoothed.

    Args:
        now: The state of the run.
        seconds: The time since something was heard.
        compiling: What is said of kernels that are being compiled, for one of which the run may
            wait; empty if none are.
    """
    what = "smoothing" if 0 < now.total == now.done else "no new step"
    return f"{what} for {seconds:.0f} s{compiling and '; '}{compiling}"


def _beyond_the_end(run: Run, result: Result) -> tuple[str, ...]:
    """The warning that a stored run has more steps than its recording has now, if it does."""
    stored, shown = result.run.steps, run.done
    if stored <= shown:
        return ()
    return (
        f"{result.run.title} has {stored} steps and the recording {shown} now: the first {shown} "
        "are shown, of the recording as it was; `runs export` writes all of them",
    )


def _meanwhile(snapshot: Snapshot, seed: int) -> Trajectories | None:
    """What shows at once, where only corrections changed: the shown tracks with what is new."""
    shown, sequence = snapshot.run, snapshot.sequence
    if shown is None or sequence is None or not shown.complete or shown.sequence is not sequence:
        return None
    if shown.seed != seed or shown.parameters != snapshot.parameters:
        return None
    known = set(shown.corrections)
    if not known <= set(snapshot.corrections):
        return None  # something was taken back: that run is kept, and there at once
    new = [one for one in snapshot.corrections if one not in known]
    return apply_corrections(shown.tracks, new, sequence.step_time)
