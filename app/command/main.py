"""How the C library's allocator treats large arrays, where it can be told."""

from __future__ import annotations

import ctypes
import errno
import gc
import os
import sys
import tempfile
import threading
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.command import supervision
from app.command.arguments import OpenRun
from app.command.flags import Serve, parse, run
from app.command.terminal import FAILURE, CommandError, check_data, say
from tracker.files.folders import cache_bytes, library_file
from tracker.parameters.values import ParameterError

if TYPE_CHECKING:
    from tracker.library.records import Result

_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
"""Parameters of glibc's ``mallopt``, as ``malloc.h`` numbers them."""

LARGE = 1 << 20
"""Bytes from which an array has pages of its own, which are the system's again once it is freed."""


def return_large_arrays() -> None:
    """Let memory that large arrays had go back to the system.

    glibc raises its threshold to the largest array that was freed, up to 32 MB: from then on such
    arrays lie on the heap, where anything that is allocated behind them keeps their memory. After
    a long run that is as much as the run itself. A threshold that is set stays. Elsewhere nothing
    is done.
    """
    if sys.platform != "linux":
        return
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(_MMAP_THRESHOLD, LARGE)
        mallopt(_TRIM_THRESHOLD, LARGE)


USAGE, INTERRUPTED = 2, 130

TRACEBACK = "MULTIVIEW_PHD_TRACEBACK"
"""Environment variable: with any value, an unexpected failure shows where it happened."""


def main(arguments: list[str] | None = None) -> int:
    """Run one command; returns the exit status."""
    if arguments is None and sys.argv[1:2] == ["serve"]:
        return supervision.supervise(lambda: main(sys.argv[1:]))
    return_large_arrays()
    try:
        status = run(parse(arguments))
        sys.stdout.flush()  # a pipe that is closed raises here, where it is caught, not at exit
        return status
    except ParameterError as error:
        say(str(error))
        return USAGE
    except BrokenPipeError:  # the reader of our output closed its end, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (Exception, KeyboardInterrupt) as error:
        if _is_interruption(error):
            say("interrupted; nothing was written")
            return INTERRUPTED
        if os.environ.get(TRACEBACK):
            raise
        say(_sentence(error))
        return FAILURE


def _is_interruption(error: BaseException | None) -> bool:
    """Whether Ctrl-C caused an exception: inside a compiled kernel it is raised as another one."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__
    return error is not None


def _sentence(error: BaseException) -> str:
    words = " ".join(str(error).split())
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    if isinstance(error, ValueError | CommandError):
        return words
    return f"unexpected {type(error).__name__}: {words}; set {TRACEBACK}=1 to see where"


# serve


def serve_run(command: OpenRun, result: Result) -> int:
    asked = Serve(result.place, port=command.port, open=command.open, library=command.library)
    return serve(asked, result.run.id)


def _serve_bundle(command: Serve) -> int:
    from tracker.library.bundle import unpack_bundle

    with tempfile.TemporaryDirectory(prefix="multiview-phd-bundle-") as folder:
        result = unpack_bundle(Path(command.sequence), Path(folder))
        return serve(replace(command, sequence=result.place, keep=0), result)


def serve(command: Serve, run: int | Result | None = None) -> int:
    if run is None and command.sequence.lower().endswith(".zip"):
        return _serve_bundle(command)
    check_data(command.data)
    gc.disable()  # a seventh of the time: nothing that is imported ever goes
    from app.state.jobs import locate
    from app.web import server
    from app.web.access.security import is_loopback
    from app.web.access.tokens import PARAMETER, Keys, new_token, own_token
    from app.web.dependencies import Settings
    from tracker.library.records import Result
    from tracker.sequences import library
    from tracker.sequences.built_in import BUILT_IN

    gc.freeze()
    gc.enable()
    if not command.token and not is_loopback(command.host):
        raise ParameterError(
            "--no-token",
            f"expected --host of this machine alone, got {command.host}: others need one",
        )
    life = supervision.life  # the starts after a crash have token and port of the one before
    new = new_token() if life is None else life.token
    keys = Keys(own_token(os.environ) or new) if command.token else None
    place = locate(command.sequence, command.data)
    if place not in BUILT_IN:
        library.open_sequence(place)  # what cannot be read is told here, before a page is open
    if command.detector is not None:
        from tracker.single_view.onnx.network import Network

        Network.tried(command.detector)  # likewise
    listener = _listen(
        command if life is None or life.port is None else replace(command, port=life.port)
    )
    port = listener.getsockname()[1]
    if life is not None:
        life.listens(port)
    host = f"[{command.host}]" if ":" in command.host else command.host
    shown = "127.0.0.1" if command.host == "0.0.0.0" else "[::1]" if host == "[::]" else host
    address = f"http://{shown}:{port}/"
    if not is_loopback(command.host):
        say(f"whoever reaches {command.host} and has the token can change what you see")

    def link(key: str | None) -> str:
        return address if key is None else f"{address}?{PARAMETER}={key}"

    def ready() -> None:
        if life is not None and life.ended is not None:
            say(f"it is back at {address}")
            return
        sys.stdout.write(f"multiview-phd: {link(keys.token if keys else None)} (Ctrl-C ends it)\n")
        sys.stdout.flush()
        if command.open:
            import webbrowser

            opened = link(keys.ticket() if keys else None)
            threading.Thread(target=webbrowser.open, args=(opened,), daemon=True).start()

    app = server.create_app(
        Settings(
            host=command.host,
            keys=keys,
            sequence=command.sequence,
            data=command.data,
            detector=command.detector,
            keep_on_disk=True,
            library=None if isinstance(run, Result) else command.library or library_file(),
            keep=command.keep,
            memory=None if command.memory is None else int(command.memory * 2**30),
            disk=cache_bytes() if command.disk is None else int(command.disk * 2**30),
            run=run,
            say=say,
            ended=None if life is None else life.ended,
        )
    )
    try:
        server.serve(app, listener, ready)
    except KeyboardInterrupt:
        _leave(0)
    return 0


def _listen(command: Serve) -> Any:
    from app.web import server

    try:
        return server.bind(command.host, command.port)
    except OSError as error:
        if error.errno != errno.EADDRINUSE:
            raise CommandError(
                f"cannot listen on {command.host}:{command.port}: {error.strerror}"
            ) from None
    for port in range(command.port + 1, min(command.port + 100, 65536)):
        try:
            server.bind(command.host, port).close()
        except OSError:
            continue
        raise CommandError(f"port {command.port} is taken by another program; try --port {port}")
    raise CommandError(f"port {command.port} is taken by another program; try --port 0")


def _leave(status: int) -> None:
    """End now, even where a thread is still in the middle of a step that nothing can interrupt."""
    deadline = time.monotonic() + 0.2
    while time.monotonic() < deadline:
        if all(t.daemon or t is threading.main_thread() for t in threading.enumerate()):
            return
        time.sleep(0.02)
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)


if __name__ == "__main__":
    sys.exit(main())
