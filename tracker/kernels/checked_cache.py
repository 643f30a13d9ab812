"""Machine code on disk with a checksum: a file that was cut off or changed is compiled anew.

numba reads back what it kept without looking at it: an empty file is an exception at every
start, a flipped bit a crash. Here the SHA-256 of a file's content stands at its end. This leans
on numba's insides, and so does the exact version in the project's requirements.
"""

from __future__ import annotations

import hashlib
import io
import pickle
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from numba.core import caching

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

    def _load_data(self, name: str) -> Any:
        return pickle.loads(_content(Path(self._data_path(name))))

    @contextmanager
    def _open_for_write(self, filepath: str) -> Iterator[BinaryIO]:
        with io.BytesIO() as memory:
            yield memory
            content = memory.getvalue()
        with super()._open_for_write(filepath) as file:
            file.write(content + hashlib.sha256(content).digest())


def check_files_of(dispatcher: Any) -> None:
    """Have a kernel's machine code kept with a checksum.

    Args:
        dispatcher: Of numba, with caching enabled.
    """
    cache = dispatcher._cache
    plain = cache._cache_file
    cache._cache_file = CheckedFiles(
        cache_path=plain._cache_path,
        filename_base=plain._index_name.removesuffix(".nbi"),
        source_stamp=plain._source_stamp,
    )


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
