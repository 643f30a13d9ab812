"""The tables of the library, and the migrations of older files.

``PRAGMA user_version`` is the number of migrations that a file has gone through. A migration is
never changed once it is released; changes of the schema are new migrations.
"""

from __future__ import annotations

import sqlite3
from pathlib import Path

from tracker.library.errors import LibraryError

APPLICATION_ID = 0x4D56_5048
"""The bytes ``MVPH``, by which the program ``file`` and SQLite's tools recognise the file."""

MIGRATIONS: tuple[tuple[str, ...], ...] = (
    (
        """
        CREATE TABLE recordings (
            id INTEGER PRIMARY KEY,
            place TEXT NOT NULL UNIQUE,      -- a rendered room's name, or a folder
            name TEXT NOT NULL,
            kind TEXT NOT NULL,              -- rendered, or folder
            digest TEXT NOT NULL,            -- of its content when it was opened last
            cameras INTEGER NOT NULL,
            frames INTEGER NOT NULL,
            fps REAL NOT NULL,
            has_pictures INTEGER NOT NULL,
            has_detections INTEGER NOT NULL,
            people INTEGER,                  -- of the truth; NULL where there is none
            thumbnail BLOB,                  -- JPEG
            opened REAL NOT NULL             -- seconds since 1970
        ) STRICT
        """,
        """
        CREATE TABLE runs (
            id INTEGER PRIMARY KEY AUTOINCREMENT,
            recording INTEGER NOT NULL REFERENCES recordings (id),
            key TEXT NOT NULL,               -- of recording, parameters, seed and code
            digest TEXT NOT NULL,            -- of the recording as it was tracked
            began REAL NOT NULL,             -- seconds since 1970
            seconds REAL NOT NULL,
            steps INTEGER NOT NULL,
            single_view TEXT NOT NULL,
            fusion_method TEXT NOT NULL,
            changes TEXT NOT NULL,           -- JSON: the values that are not the defaults
            seed INTEGER NOT NULL,
            version TEXT NOT NULL,           -- of the program
            code TEXT NOT NULL,              -- hash of what makes the numbers
            machine TEXT NOT NULL,
            source TEXT NOT NULL,            -- track, page or bundle
            targets INTEGER NOT NULL,        -- how many tracks
            mota REAL, idf1 REAL, hota REAL, ospa REAL, position_error REAL,
            misses INTEGER, false_positives INTEGER, id_switches INTEGER,
            name TEXT NOT NULL DEFAULT '',
            star INTEGER NOT NULL DEFAULT 0,
            note TEXT NOT NULL DEFAULT '',
            tags TEXT NOT NULL DEFAULT '[]',
            deleted REAL                     -- when; it can still be taken back
        ) STRICT
        """,
        "CREATE INDEX runs_by_recording ON runs (recording, began)",
        "CREATE INDEX runs_by_key ON runs (key)",
        """
        CREATE TABLE results (               -- apart: a list of runs reads past none of it
            run INTEGER PRIMARY KEY REFERENCES runs (id) ON DELETE CASCADE,
            parameters BLOB NOT NULL,        -- JSON by zlib: all
            figures BLOB NOT NULL,           -- JSON by zlib: all of them; {} without a truth
            columns BLOB NOT NULL            -- the tracks
        ) STRICT
        """,
        f"PRAGMA application_id = {APPLICATION_ID}",
    ),
    (
        # the number of corrections of the run, and the corrections as JSON compressed by zlib
        "ALTER TABLE runs ADD COLUMN corrected INTEGER NOT NULL DEFAULT 0",
        "ALTER TABLE results ADD COLUMN corrections BLOB",
    ),
    (
        # whether the figures are of the finished run's tracks: the page also stored figures of
        # unfinished runs, `track` and `batch` did not
        "ALTER TABLE runs ADD COLUMN final INTEGER NOT NULL DEFAULT 0",
        "UPDATE runs SET final = 1 WHERE source IN ('track', 'batch')",
    ),
    (
        # when the run was computed last, seconds since 1970; ``began`` is of the first time
        "ALTER TABLE runs ADD COLUMN latest REAL NOT NULL DEFAULT 0.0",
        "UPDATE runs SET latest = began",
    ),
    (
        # the colour templates of the run and the names of its tracks, as JSON
        "ALTER TABLE runs ADD COLUMN taught TEXT NOT NULL DEFAULT '{}'",
    ),
)
"""The statements that migrate a file from each version to the next, the first from an empty
file."""

VERSION = len(MIGRATIONS)
"""The current version of the schema."""


def version_of(connection: sqlite3.Connection, path: Path) -> int:
    """Return the version of a file; 0 for an empty one.

    Raises:
        LibraryError: If the file is another program's, or of a newer version of this one.
    """
    (version,) = connection.execute("PRAGMA user_version").fetchone()
    (application,) = connection.execute("PRAGMA application_id").fetchone()
    if version > VERSION and application == APPLICATION_ID:
        raise LibraryError(
            f"{path}: the library is of a newer version of multiview-phd ({version}, this one "
            f"knows {VERSION}); update the program, or name another library by --library"
        )
    (tables,) = connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
    if application != APPLICATION_ID and (tables or version):
        raise LibraryError(
            f"{path}: expected a library of multiview-phd, found another database; name another "
            "file by --library"
        )
    return int(version)


def migrate(
    connection: sqlite3.Connection,
    path: Path,
    migrations: tuple[tuple[str, ...], ...] = MIGRATIONS,
) -> None:
    """Migrate a file to the current version in one transaction.

    Args:
        connection: The open file.
        path: The path of the file, for messages.
        migrations: The migrations up to the wanted version.
    """
    connection.execute("BEGIN IMMEDIATE")
    try:
        for number in range(version_of(connection, path), len(migrations)):
            for statement in migrations[number]:
                connection.execute(statement)
            connection.execute(f"PRAGMA user_version = {number + 1}")
        connection.execute("COMMIT")
    except BaseException:
        connection.execute("ROLLBACK")
        raise
