"""The errors of a library."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


class LibraryError(ValueError):
    """The library cannot be used; the message says why, and what the user can do."""


class NoSuchRun(LibraryError):
    """The library has no run of this number; it may have been deleted."""


@contextmanager
def explained(path: Path) -> Iterator[None]:
    """Replace every exception of the database by an error that names the file and says what to do.

    Args:
        path: The library's file.

    Raises:
        LibraryError: If SQLite fails, a row is damaged, or the file cannot be reached.
    """
    try:
        yield
    except LibraryError:
        raise
    except sqlite3.Error as error:
        raise LibraryError(_sentence(path, error)) from error
    except (ValueError, TypeError, OverflowError, KeyError, IndexError) as error:
        raise LibraryError(
            f"{path}: a row of the library is not as it was written ({error}); "
            "`multiview-phd library check` says how much can be read"
        ) from error
    except OSError as error:
        raise LibraryError(f"{path}: the library cannot be reached ({error.strerror})") from error


_HELD = "another program holds the library; end it, or wait until it has written"
_REMEDIES = {
    sqlite3.SQLITE_BUSY: _HELD,
    sqlite3.SQLITE_LOCKED: _HELD,
    sqlite3.SQLITE_FULL: "there is no space left for the library; free some, or name another place",
    sqlite3.SQLITE_READONLY: "the library can be read but not written; change its rights, or name "
    "another by --library",
    sqlite3.SQLITE_CANTOPEN: "the library cannot be opened; see that its folder is there and can "
    "be written to, or name another by --library",
    sqlite3.SQLITE_IOERR: "the disk failed under the library ({words}); name another by --library",
    sqlite3.SQLITE_CONSTRAINT: "the library refuses what it was given ({words})",
}
_DAMAGED = (
    "the library is damaged ({words}); `multiview-phd library check --repair` keeps a copy aside "
    "and saves what can be read"
)


def _sentence(path: Path, error: sqlite3.Error) -> str:
    """Return the message for an error of SQLite."""
    code = getattr(error, "sqlite_errorcode", 0) & 0xFF
    return f"{path}: {_REMEDIES.get(code, _DAMAGED).format(words=error)}"
