"""Opens sequences in the background: the newest request wins, what was open stays on a failure."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from pathlib import Path
from typing import Any

from app.errors import sentence
from app.state.kept.crashes import Crashes
from app.state.snapshot import Opening
from app.state.workbench import Workbench
from app.state.workers.threads import be_nice
from tracker.corrections import Correction
from tracker.corrections.log import open_log
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.values import changed_values, with_values
from tracker.runs import pipeline
from tracker.runs.pipeline import Cancelled
from tracker.sequences import library
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence

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
