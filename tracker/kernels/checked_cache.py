"""Storage of machine code: checksums, large kernels once, compilation by one process at a time.

numba reads stored code without verifying it: an empty file is an exception at every start, a
flipped bit a crash. Here the SHA-256 of a file's content stands at its end, and a file that was
cut off or changed is compiled anew. And two processes that need a kernel at once would both
compile it and the kernels that it calls; here one does, and the other waits and reads the stored
code.

numba copies a kernel into each kernel that calls it, where it is optimised and translated again,
at every level of calls. Here a large kernel is stored once, and its callers hold a reference to
it, which is resolved when they are loaded.

This uses numba's internals, which is why the project requires its exact version.
"""

from __future__ import annotations

import hashlib
import importlib
import io
import pickle
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from llvmlite import binding as llvm
from numba.core import caching, sigutils
from numba.core.compiler_lock import global_compiler_lock

from tracker.files.lock import locked

_SIZE = hashlib.sha256().digest_size

_LARGE = 20_000
"""Bytes of LLVM's bitcode from which a kernel is referred to and not copied. Copies up to this
size are what the compiler inlines, and cost little: compiling the kernels of a run takes as long
with a bound of 4,000, and 1.4 times as long when all are copied."""

_Base: Any = caching.IndexDataCacheFile
_BaseImpl: Any = caching.CompileResultCacheImpl


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


def keep(dispatcher: Any, folder: Path) -> None:
    """Let numba store a kernel's machine code with a checksum, and compile it in one process.

    Args:
        dispatcher: A dispatcher of numba with caching enabled.
        folder: A folder for this very content of the kernel's file and of what it imports, so
            that neither the file's place nor its time says anything more.

    Raises:
        RuntimeError: If numba could not write into the folder and chose another one.
    """
    cache = dispatcher._cache
    if folder not in Path(cache._cache_path).parents:
        raise RuntimeError(f"{folder} cannot be written to")
    cache._impl = _StoredOnce(dispatcher)
    cache._impl._locator._cache_path = str(folder)  # numba's own holds a hash of the place
    cache._cache_file = CheckedFiles(
        cache_path=str(folder),
        filename_base=cache._cache_file._index_name.removesuffix(".nbi"),
        source_stamp=None,
    )
    dispatcher.compile = _OneProcess(dispatcher)


@dataclass(frozen=True, slots=True)
class _Reference:
    """The machine code of a large kernel that a caller refers to.

    numba stores it with the caller, and calls it before the caller's code is loaded.
    """

    module: str
    function: str
    types: tuple[Any, ...]
    """The types of the kernel's arguments."""
    symbol: str
    """The name by which the caller's code knows the kernel's; it ends in a number that numba
    counts up in each process."""

    def __call__(self) -> None:
        """Load the kernel, or compile it.

        Raises:
            _OtherSymbolError: If it has been compiled again under another name since.
        """
        dispatcher = getattr(importlib.import_module(self.module), self.function)
        dispatcher.compile(self.types)
        if dispatcher.overloads[self.types].fndesc.llvm_func_name != self.symbol:
            raise _OtherSymbolError


class _OtherSymbolError(Exception):
    """A caller's stored code refers to a kernel by a name that it no longer has."""


class _StoredOnce(_BaseImpl):  # type: ignore[misc]  # numba has no types
    """Conversion of compiled kernels to stored ones, the large ones to be referred to."""

    def __init__(self, dispatcher: Any) -> None:
        super().__init__(dispatcher.py_func)
        self._function = dispatcher.py_func

    def reduce(self, result: Any) -> Any:
        """Convert a compiled kernel to what is stored; its callers are compiled after this."""
        library, symbol = result.library, result.fndesc.llvm_func_name
        if len(library._get_module_for_linking().as_bitcode()) > _LARGE:
            library._shared_module = _declaration(library, symbol)
            library._reload_init.add(self._reference(result))
        return super().reduce(result)

    def rebuild(self, context: Any, stored: Any) -> Any:
        """Convert what is stored to a compiled kernel; None, as if it were missing, where it refers
        to a kernel that was compiled again since."""
        described, references = stored[1], stored[7]
        # numba knows what a library defines from its bitcode, which here only declares it
        context.codegen()._engine._defined_symbols |= {
            described.llvm_func_name,
            described.llvm_cpython_wrapper_name,
            described.llvm_cfunc_wrapper_name,
        }
        try:
            result = super().rebuild(context, stored)
        except _OtherSymbolError:
            return None
        library = result.library
        library._reload_init.update(references)
        if library._shared_module.get_function(described.llvm_func_name).is_declaration:
            library._reload_init.add(self._reference(result))
        return result

    def _reference(self, result: Any) -> _Reference:
        function, types = self._function, tuple(result.signature.args)
        name = function.__qualname__
        return _Reference(function.__module__, name, types, result.fndesc.llvm_func_name)


def _declaration(library: Any, symbol: str) -> Any:
    """A module of LLVM that declares a library's function and does not define it."""
    function = library._final_module.get_function(symbol)
    returned, arguments = str(function.global_value_type).split(" (", 1)
    empty = str(library.codegen._create_empty_module(library.name))
    return llvm.parse_assembly(f'{empty}\ndeclare {returned} @"{symbol}"({arguments}\n')


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
