"""Machine code on disk with a checksum, compiled by one process at a time.

numba reads back what it kept without looking at it: an empty file is an exception at every
start, a flipped bit a crash. Here the SHA-256 of a file's content stands at its end. And two
processes that need a kernel at once would both compile it, as they would the kernels that it
calls; here one does, and the other waits and reads what that has written. This leans on numba's
insides, and so does the exact version in the project's requirements.
"""

from __future__ import annotations

import hashlib
import io
import pickle
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO

from numba.core import caching, sigutils
from numba.core.compiler_lock import global_compiler_lock

from tracker.files.atomic import locked

_SIZE = hashlib.sha256().digest_size

_Base: Any = caching.IndexDataCacheFile


class CheckedFiles(_Base):  # type: ignore[misc]  # numba has no types
    """The index and the machine code of one kernel."""

    def _load_index(self) -> dict[Any, str]:
        try:
            file = io.BytesIO(_content(Path(self._index_path)))
        except OSError:
            return {}
        if pickle.load(file) != self._version:
            return {}
        stamp, overloads = pickle.load(file)
        return overloads if stamp == self._source_stamp else {}

    def holds(self, key: Any) -> bool:
        """Whether there is machine code of a version of the kernel, whole or not."""
        return key in self._load_index()

    def _load_data(self, name: str) -> Any:
        return pickle.loads(_content(Path(self._data_path(name))))

    @contextmanager
    def _open_for_write(self, filepath: str) -> Iterator[BinaryIO]:
        with io.BytesIO() as memory:
            yield memory
            content = memory.getvalue()
        with super()._open_for_write(filepath) as file:
            file.write(content + hashlib.sha256(content).digest())


def keep(dispatcher: Any) -> None:
    """Have a kernel's machine code kept with a checksum, and compiled by one process at a time.

    Args:
        dispatcher: numba's, with caching enabled.
    """
    cache = dispatcher._cache
    plain = cache._cache_file
    cache._cache_file = CheckedFiles(
        cache_path=plain._cache_path,
        filename_base=plain._index_name.removesuffix(".nbi"),
        source_stamp=plain._source_stamp,
    )
    dispatcher.compile = _OneProcess(dispatcher)


class _OneProcess:
    """What compiles a kernel for given types, or reads its machine code from disk.

    No two processes wait for each other: whoever holds a kernel waits only for those that it
    calls.
    """

    def __init__(self, dispatcher: Any) -> None:
        self._dispatcher = dispatcher
        self._compile = dispatcher.compile
        self._is_held = False

    def __call__(self, signature: Any) -> Any:
        with global_compiler_lock, ExitStack() as held:
            if not self._is_held and self._is_missing(signature):
                with suppress(OSError):  # where there is no place for a lock each compiles it
                    held.enter_context(locked(Path(self._files._index_path)))
                    held.enter_context(self._holding())
            return self._compile(signature)

    @property
    def _files(self) -> Any:
        return self._dispatcher._cache._cache_file

    def _is_missing(self, signature: Any) -> bool:
        dispatcher = self._dispatcher
        arguments, _ = sigutils.normalize_signature(signature)  # type: ignore[no-untyped-call]
        if tuple(arguments) in dispatcher.overloads:
            return False
        context = dispatcher.targetctx
        context.refresh()
        return not self._files.holds(dispatcher._cache._index_key(signature, context.codegen()))

    @contextmanager
    def _holding(self) -> Iterator[None]:
        """A kernel that calls itself is asked for again while it is compiled."""
        self._is_held = True
        try:
            yield
        finally:
            self._is_held = False


def _content(path: Path) -> bytes:
    """What a file holds before its checksum.

    Raises:
        OSError: If it cannot be read, or the two do not agree; numba then compiles anew.
    """
    whole = path.read_bytes()
    content, told = whole[:-_SIZE], whole[-_SIZE:]
    if hashlib.sha256(content).digest() != told:
        raise OSError(f"{path} was changed or cut off since it was written")
    return content
