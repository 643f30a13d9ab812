"""Compilation of kernels: once on each machine, into a writable folder.

numba stores machine code beside the source, where an installed package may be read-only,
and its stamp covers the file of a kernel only, not those of the kernels that it calls. So the
code is stored in the cache folder, under the hash of the kernel's file and of those that it
imports kernels, tuples and constants from: after a change no stale code is used, and code that
does not depend on it remains. ``NUMBA_CACHE_DIR`` names another folder.

While another process compiles (:func:`while_compiling`), a kernel without machine code runs as
plain Python: with the same numbers and far slower, which is bearable for a few people. Kernels
that loop over pixels or samples would take seconds for each image; they are
:func:`pixel_kernel`, and are always compiled. So is a kernel that is called with a large array,
such as the rays of all pixels that a room is rendered through.
"""

from __future__ import annotations

import ast
import contextlib
import hashlib
import os
import re
import shutil
import sys
import time
import types
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import cache, partial, wraps
from pathlib import Path
from typing import Any, Literal, TypeVar, cast

import numba
import numpy as np
from numba.core import event
from numba.core.compiler_lock import global_compiler_lock

from tracker.files.folders import cache_folder
from tracker.kernels import checked_cache

_F = TypeVar("_F", bound=Callable[..., Any])

_KERNELS: list[Any] = []
"""Every kernel of the modules that have been imported, in the order of definition."""

_KEPT_SECONDS = 30 * 86400.0
"""Time after which unused machine code is deleted, seconds."""

_LARGE = 50_000
"""Number of elements of an array from which plain Python takes longer than the compilation, some
two seconds at 30 microseconds each."""

_LEVEL = 1
"""The level of optimisation by LLVM of kernels that do not loop over pixels; numba's own is 3."""

_config: Any = numba.config

_ROOT = Path(__file__).resolve().parents[1]
_HAS_KERNELS = re.compile(rb"^@(?:pixel_)?kernel$", re.MULTILINE)
_IMPORT_WORD = re.compile(rb"\bimport\b")
_IMPORT = re.compile(
    rb"^[ \t]*((?:from[ \t]+[\w.]+[ \t]+)?import[ \t]+(?:\([^()]*\)|[\w., \t]+))[ \t]*(?:#.*)?$",
    re.MULTILINE,
)
"""An import statement that has its lines for itself."""


def kernel(function: _F) -> _F:
    """Compile on the first call, store the machine code on disk, release the interpreter's lock."""
    compiled: Any = pixel_kernel(function)
    if not _config.DISABLE_JIT:  # numba's own variable: then it is the function itself
        compiled.compile = partial(_optimised_less, compiled.compile)
        compiled._compile_for_args = _Chooser(compiled)
    return cast(_F, compiled)


def pixel_kernel(function: _F) -> _F:
    """Compile like :func:`kernel`, for loops over pixels or samples, never run as plain Python."""
    compiled = compiled_later(function)
    if not _config.DISABLE_JIT:
        _KERNELS.append(compiled)
    return compiled


def compiled_later(function: _F) -> _F:
    """Compile like :func:`kernel` a function that is not counted among the kernels."""
    folder = _folder_of(Path(function.__code__.co_filename))
    before = _config.CACHE_DIR
    _config.CACHE_DIR = str(folder)
    try:
        compiled = numba.njit(cache=True, nogil=True)(function)
        if not _config.DISABLE_JIT:
            checked_cache.keep(compiled, folder)
    except RuntimeError:  # no writable folder: it is compiled at every start
        compiled = numba.njit(nogil=True)(function)
    finally:
        _config.CACHE_DIR = before
    return cast(_F, compiled)


def _optimised_less(compile_for: Callable[..., Any], *arguments: Any) -> Any:
    """Compile a kernel whose speed is not that of a loop over pixels, with fewer passes of LLVM.

    The passes that are left out unroll loops and turn them into vector instructions, which matrices
    of 3 to 9 rows do not gain from: see the benchmark ``kernels``. What the kernel calls is
    compiled at its own level.
    """
    with global_compiler_lock:  # the level belongs to the whole process
        before = _config.OPT
        _config.OPT = min(before, type(before)(_LEVEL))
        try:
            return compile_for(*arguments)
        finally:
            _config.OPT = before


class _Chooser:
    """The choice between machine code and plain Python for arguments of new types.

    It replaces the function of numba that compiles for given arguments; numba calls the function
    that it returns.
    """

    def __init__(self, dispatcher: Any) -> None:
        self._dispatcher = dispatcher
        self._compile = dispatcher._compile_for_args
        self._looked_at = -1

    def __call__(self, *arguments: Any) -> Callable[..., Any]:
        news = _Elsewhere.news
        if (
            not _Elsewhere.compiles
            or any(isinstance(each, np.ndarray) and each.size > _LARGE for each in arguments)
            or (self._looked_at != news and self._is_kept(arguments))
        ):
            return cast(Callable[..., Any], self._compile(*arguments))
        self._looked_at = news
        return by_hand(self._dispatcher)

    def _is_kept(self, arguments: tuple[Any, ...]) -> bool:
        """Whether the other process has stored the machine code by now."""
        dispatcher = self._dispatcher
        signature = tuple(dispatcher.typeof_pyval(each) for each in arguments)
        with global_compiler_lock:  # the code is read into memory that all threads share
            found = dispatcher._cache.load_overload(signature, dispatcher.targetctx)
        return found is not None


class _Elsewhere:
    """The state of compilation in another process."""

    compiles = False
    news = 0


def while_compiling() -> None:
    """Note that another process compiles: kernels without machine code run as plain Python."""
    _Elsewhere.compiles = True


@contextmanager
def only_of_pixels() -> Iterator[None]:
    """A context in which only :func:`pixel_kernel` is compiled."""
    while_compiling()
    try:
        yield
    finally:
        no_longer_compiling()


def news_of_compiling() -> None:
    """Note that the other process has stored more machine code."""
    _Elsewhere.news += 1


def no_longer_compiling() -> None:
    """Note that no other process compiles: missing kernels are compiled when they are called."""
    _Elsewhere.compiles = False


@cache
def by_hand(dispatcher: Any) -> Callable[..., Any]:
    """A kernel as plain Python, together with all kernels that it calls."""
    plain = _plain(dispatcher)

    @wraps(plain)
    def silently(*arguments: Any) -> Any:
        # machine code gives no warnings for division by zero and overflow
        with np.errstate(all="ignore"):
            return plain(*arguments)

    return silently


@cache  # many kernels call the same ones
def _plain(dispatcher: Any) -> Callable[..., Any]:
    function = dispatcher.py_func
    names = dict(function.__globals__)
    for name in function.__code__.co_names:
        called = names.get(name)
        if called is not dispatcher and getattr(called, "_compile_for_args", None) is not None:
            names[name] = _plain(called)
    plain = types.FunctionType(function.__code__, names, closure=function.__closure__)
    plain.__defaults__ = function.__defaults__
    names[function.__name__] = plain  # for recursive kernels
    return plain


def kernel_folder() -> Path:
    """The folder of machine code: ``$NUMBA_CACHE_DIR``, else one in the cache folder."""
    given = os.environ.get("NUMBA_CACHE_DIR")
    return Path(given) if given else cache_folder() / "kernels"


@cache
def _folder_of(file: Path) -> Path:
    """The folder of the machine code of a file's kernels, which is marked as used."""
    folder = kernel_folder() / _digest(_with_used(file, set()))
    with contextlib.suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        os.utime(folder)
    return folder


def _with_used(file: Path, known: set[Path]) -> set[Path]:
    """A file and all files that are part of its machine code by direct or indirect import."""
    if file not in known:
        compiled_in, imported = _looked_at(file)
        if compiled_in or (not known and file.is_file()):
            known.add(file)
            for other in imported:
                _with_used(other, known)
    return known


@cache  # each file is imported by many kernel files
def _looked_at(file: Path) -> tuple[bool, tuple[Path, ...]]:
    """Whether a file may be part of machine code, and the files that it may import."""
    if not file.is_file():
        return False, ()
    text = file.read_bytes()
    places = [_ROOT.parent.joinpath(*name.split(".")) for name in _imported(text)]
    files = [each for path in places for each in (path.with_suffix(".py"), path / "__init__.py")]
    return _is_compiled_in(file, text), tuple(files)


def _is_compiled_in(file: Path, text: bytes) -> bool:
    """Whether a file has kernels, or the tuples and constants of the package of kernels."""
    in_package = _ROOT / "kernels" in file.parents and file.name != Path(__file__).name
    return in_package or _HAS_KERNELS.search(text) is not None


def _imported(source: bytes) -> tuple[str, ...]:
    """Every module of the engine that a source may import, by any form of import statement."""
    statements = [match.group(1) for match in _IMPORT.finditer(source)]
    if len(statements) == len(_IMPORT_WORD.findall(source)):  # parsing all takes far longer
        source = b"\n".join(statements)
    found: list[str] = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            found += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
    return tuple(name for name in found if name.split(".")[0] == _ROOT.name)


def _digest(files: Iterable[Path]) -> str:
    digest = hashlib.sha256(f"{numba.__version__} {sys.version} checked".encode())
    for file in sorted(files):
        digest.update(file.name.encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()[:16]


@cache
def _version() -> str:
    """A digest of all files that are part of machine code."""
    return _digest(p for p in _ROOT.rglob("*.py") if _is_compiled_in(p, p.read_bytes()))


def _mark(of: Literal["complete", "pixels"]) -> Path:
    """The path of a file that exists once all kernels, or the loops over pixels, were compiled.

    The machine code belongs to the content of the sources: installations of one version share it.
    """
    return kernel_folder() / f"{_version()}.{of}"


def is_compiled() -> bool:
    """Whether every kernel has been compiled on this machine."""
    return _mark("complete").is_file()


def are_pixels_compiled() -> bool:
    """Whether the kernels that a first run cannot do without, the loops over pixels, have been
    compiled on this machine."""
    return _mark("pixels").is_file()


def mark_pixels_compiled() -> None:
    """Note that the loops over pixels were compiled."""
    with contextlib.suppress(OSError):
        _mark("pixels").parent.mkdir(parents=True, exist_ok=True)
        _mark("pixels").touch()


def mark_compiled() -> None:
    """Note that every kernel was compiled, and delete machine code long out of use."""
    mark_pixels_compiled()
    with contextlib.suppress(OSError):
        _mark("complete").touch()
        for other in kernel_folder().iterdir():
            is_ours = re.fullmatch(r"[0-9a-f]{16}(\.complete|\.pixels)?", other.name)
            if is_ours and time.time() - other.stat().st_mtime > _KEPT_SECONDS:
                shutil.rmtree(other) if other.is_dir() else other.unlink()


def counts() -> tuple[int, int]:
    """The number of kernels that are compiled for some arguments, and the number of all."""
    return sum(1 for each in _KERNELS if each.signatures), len(_KERNELS)


def without_signature() -> list[str]:
    """The names of the kernels that were never called."""
    return [each.py_func.__qualname__ for each in _KERNELS if not each.signatures]


@contextmanager
def followed(on_compiled: Callable[[], None]) -> Iterator[None]:
    """A context that calls a function whenever a kernel is compiled rather than read from disk."""

    class Listener(event.Listener):
        def on_start(self, _: object) -> None:
            on_compiled()

        def on_end(self, _: object) -> None:
            on_compiled()

    listener = Listener()
    event.register("numba:compile", listener)  # type: ignore[no-untyped-call]
    try:
        yield
    finally:
        event.unregister("numba:compile", listener)  # type: ignore[no-untyped-call]
