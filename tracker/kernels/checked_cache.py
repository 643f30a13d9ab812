"""Storage of machine code with a checksum, and compilation by one process at a time.

numba reads stored code without verifying it: an empty file is an exception at every start, a
flipped bit a crash. Here the SHA-256 of a file's content stands at its end, and a file that was
cut off or changed is compiled anew. And two processes that need a kernel at once would both
compile it and the kernels that it calls; here one does, and the other waits and reads the stored
code. This uses numba's internals, which is why the project requires its exact version.
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
    """Storage of the index and the machine code of one kernel, with checksums."""

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
        """Whether machine code for a key is stored, intact or not."""
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
    """Let numba store a kernel's machine code with a checksum, and compile it in one process.

    Args:
        dispatcher: A dispatcher of numba with caching enabled.
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
    """The compilation of a kernel for given types, which locks it against other processes.

    No two processes wait for each other: one that holds the lock of a kernel waits only for the
    locks of the kernels that it calls.
    """

    def __init__(self, dispatcher: Any) -> None:
        self._dispatcher = dispatcher
        self._compile = dispatcher.compile
        self._is_held = False

    def __call__(self, signature: Any) -> Any:
        with global_compiler_lock, ExitStack() as held:
            if not self._is_held and self._is_missing(signature):
                with suppress(OSError):  # without a place for a lock each process compiles it
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
        """A context in which a recursive kernel does not lock itself again."""
        self._is_held = True
        try:
            yield
        finally:
            self._is_held = False


def _content(path: Path) -> bytes:
    """Read the content of a file before its checksum.

    Raises:
        OSError: If it cannot be read, or the checksum does not match; numba then compiles anew.
    """
    whole = path.read_bytes()
    content, checksum = whole[:-_SIZE], whole[-_SIZE:]
    if hashlib.sha256(content).digest() != checksum:
        raise OSError(f"{path} was changed or cut off since it was written")
    return content
