"""`multiview-phd serve` as a person starts it."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import httpx2
import psutil

from tracker.kernels.compilation import kernel_folder
from tracker.studies.store import stores


def folders_in(home: Path) -> dict[str, str]:
    """The environment of a person whose caches, settings, library and studies are in a folder."""
    return {
        "MULTIVIEW_PHD_CACHE": str(home),
        "MULTIVIEW_PHD_SETTINGS": str(home / "settings"),
        "MULTIVIEW_PHD_LIBRARY": str(home / "library.sqlite3"),
        "MULTIVIEW_PHD_STUDIES": str(home / "studies"),
    }


class Server:
    """`multiview-phd serve` as a person starts it, on a free port."""

    def __init__(
        self,
        sequence: Path | str,
        cache: Path | None,
        *,
        kernels: Path | None = None,
        data: Path | None = None,
        wait: bool = True,
        token: str | None = None,
    ) -> None:
        """Start it on a sequence, with a cache folder of its own or the person's.

        Kernels are those of the machine, whatever the cache folder, unless a folder is given.
        """
        self.folder = sequence
        self.cache = cache
        self._arguments = [str(sequence), "--no-open"]
        self._arguments += [] if data is None else ["--data", str(data)]
        self._arguments += ["--no-token"] if token is None else []
        self._environment = dict(os.environ)
        self.use(token)
        self._environment["NUMBA_CACHE_DIR"] = str(kernels or kernel_folder())
        if cache is not None:
            self._environment |= folders_in(cache)
        self.port = 0
        self.start()
        if wait:
            self.wait(lambda state: state["sequence"] is not None and state["opening"] is None)

    def start(self) -> None:
        """Start, on the port used before if there was one; it then answers."""
        self.process = subprocess.Popen(
            [sys.executable, "-m", "app", "serve", *self._arguments, "--port", str(self.port)],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env=self._environment,
        )
        assert self.process.stdout is not None
        said, found = "", None
        while found is None:  # it may say first that it compiles its kernels
            line = self.process.stdout.readline()
            assert line, f"the server did not say where it is: {said}"
            said += line
            found = re.search(r"http://[\w.]+:(\d+)", line)
        self.port = int(found[1])

    def use(self, token: str | None) -> None:
        """Have a token from the next start on."""
        self.token = token
        self._environment["MULTIVIEW_PHD_TOKEN"] = token or "none-is-asked-for"

    @property
    def serving(self) -> psutil.Process:
        """The process that serves; the one that was started waits for it."""
        (found,) = psutil.Process(self.process.pid).children()
        return found

    @property
    def address(self) -> str:
        """Of the page."""
        return f"http://127.0.0.1:{self.port}/"

    def get(self, path: str) -> httpx2.Response:
        """One answer."""
        headers = {"Authorization": f"Bearer {self.token}"}
        return httpx2.get(self.address.rstrip("/") + path, headers=headers, timeout=30.0)

    def command(self, name: str, **fields: object) -> None:
        """Have a command done."""
        headers = {"Authorization": f"Bearer {self.token}"}
        body = {"name": name, **fields}
        answer = httpx2.post(
            f"{self.address}api/commands", json=body, headers=headers, timeout=30.0
        )
        answer.raise_for_status()

    def wait(self, condition: Callable[[dict], bool], seconds: float = 300.0) -> dict:
        """The state, once it is as wished."""
        deadline = time.monotonic() + seconds
        state: dict = {}
        while time.monotonic() < deadline:
            try:
                state = self.get("/api/state").json()
                if condition(state):
                    return state
            except httpx2.TransportError:
                pass
            time.sleep(0.1)
        told = {key: value for key, value in state.items() if key != "parameters"}
        raise AssertionError(f"the server did not get there within {seconds} s: {told}")

    def wait_for_run(self, seconds: float = 300.0) -> dict:
        """The state with a finished run of the parameters that hold now."""
        return self.wait(lambda state: state["run"]["state"] == "done", seconds)

    def stop(self) -> float:
        """End it as Ctrl-C does; the seconds that took."""
        begin = time.monotonic()
        self.process.send_signal(signal.SIGINT)
        self.process.wait(timeout=60.0)
        taken = time.monotonic() - begin
        if self.process.stdout is not None:
            self.process.stdout.close()
        return taken

    def kill(self) -> None:
        """End it at this instant, with no last word: the process that serves and its starter."""
        for process in (self.process, self.serving):  # the starter first: it would start anew
            process.kill()
        self.process.wait(timeout=60.0)
        if self.process.stdout is not None:
            self.process.stdout.close()

    def end_studies(self) -> None:
        """Have the studies that it started end too: they go on without it."""
        running = [
            store
            for store in stores(Path(self._environment["MULTIVIEW_PHD_STUDIES"]))
            if store.is_running()
        ]
        for store in running:
            store.ask_to_stop()
        deadline = time.monotonic() + 60.0
        while any(store.is_running() for store in running):
            assert time.monotonic() < deadline, "a study did not stop"
            time.sleep(0.1)
