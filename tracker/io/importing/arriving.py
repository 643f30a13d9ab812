"""Files that are still being copied to where they are looked for: half a video is none.

Three signs: a file that grew between two looks; a video that says of itself how long it is and
is shorter, as long as something was written lately; and files that changed while, or after,
they were read.
"""

from __future__ import annotations

import stat
import struct
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from tracker.io.importing.gathering import MOST_FILES, ParsedFiles, gather, walk
from tracker.io.read.pieces import FormatError

FRESH_SECONDS = 2.0
"""A file that was written to within this time is looked at twice."""

BETWEEN_SECONDS = 0.25
"""From one look to the next."""

STALLED_SECONDS = 15.0
"""A video that is shorter than it says, and was not written to for so long, stays so."""

_MOST_BOXES = 64
"""Parts of an MP4 on its first level; a recorder of fragments writes thousands."""

Footprint = dict[Path, tuple[int, int]]
"""Of each file the bytes, and when it was changed, nanoseconds."""


def footprint(sources: Sequence[Path]) -> Footprint:
    """Every file of some files and folders."""
    found: Footprint = {}
    for path in _files(sources):
        try:
            known = path.stat()
        except OSError:  # gone between two looks
            continue
        if stat.S_ISREG(known.st_mode):
            found[path] = (known.st_size, known.st_mtime_ns)
    return found


def _files(sources: Sequence[Path]) -> Iterator[Path]:
    count = 0
    for source in sources:
        if not source.is_dir():
            yield source
            continue
        for here, names, _ in walk(source):
            yield from (here / name for name in names)
            count += len(names)
            if count > MOST_FILES:
                return  # who gathers them says so


def growing(sources: Sequence[Path], sleep: Callable[[float], object] = time.sleep) -> str:
    """A sentence about the first file that is not whole yet; empty where all are.

    Args:
        sources: Files and folders.
        sleep: Waits, between two looks at files that were written to a moment ago.
    """
    before = footprint(sources)
    fresh = [path for path, (_, changed) in before.items() if _age(changed) < FRESH_SECONDS]
    if fresh:
        sleep(BETWEEN_SECONDS)
        after = footprint(fresh)
        for path in fresh:
            if path in after and after[path][0] != before[path][0]:
                return f"{path.name} is still growing ({_megabytes(after[path][0])} so far)"
    for path, (size, changed) in before.items():
        if _age(changed) < STALLED_SECONDS:
            said = said_bytes(path)
            if said > size:
                return (
                    f"{path.name} is not complete ({_megabytes(size)} of {_megabytes(said)} are "
                    "there)"
                )
    return ""


def gather_whole(
    sources: Sequence[Path],
    told: Callable[[str], object],
    sleep: Callable[[float], object] = time.sleep,
) -> tuple[list[ParsedFiles], Footprint]:
    """Recognise and read everything as :func:`gather` does, once nothing grows any more.

    Args:
        sources: Files and folders.
        told: Called with a sentence about what is waited for, again with every look.
        sleep: Waits; what it raises ends the waiting.

    Returns:
        What the files were taken for, and the files as they were then.

    Raises:
        FormatError: As of :func:`gather`.
    """
    while True:
        for source in sources:
            if not source.exists():
                raise FormatError(f"{source}: there is no such file or folder")
        while sentence := growing(sources, sleep):
            told(f"{sentence}; waiting until it has come")
            sleep(2.0 * BETWEEN_SECONDS)
        before = footprint(sources)
        taken = gather(sources)
        if not changed_since(sources, before):
            return taken, before


def changed_since(sources: Sequence[Path], before: Footprint) -> list[Path]:
    """Files that came, went or were written to."""
    after = footprint(sources)
    return sorted(p for p in before.keys() | after.keys() if before.get(p) != after.get(p))


def short_videos(taken: Sequence[ParsedFiles]) -> list[str]:
    """Sentences about videos that end before they say they do, and grow no more."""
    sentences = []
    for path in dict.fromkeys(path for one in taken if one.pieces for path in one.files):
        said, size = said_bytes(path), path.stat().st_size
        if said > size:
            sentences.append(
                f"{path.name} says that it has {_megabytes(said)}, {_megabytes(size)} are there: "
                "what is there is used; copy it again if it is cut short"
            )
    return sentences


def said_bytes(path: Path) -> int:
    """How many bytes an MP4, a QuickTime or an AVI says that it has; 0 where it does not.

    Sources: ISO/IEC 14496-12, "Object structure"; Microsoft, "AVI RIFF file reference".
    """
    try:
        with path.open("rb") as file:
            head = file.read(12)
            if head[:4] == b"RIFF" and head[8:12] == b"AVI ":
                return _riff_bytes(head)
            if head[4:8] in (b"ftyp", b"moov", b"mdat", b"wide", b"free", b"skip"):
                return _boxes_bytes(file.seek, file.read)
    except OSError:
        pass
    return 0


def _riff_bytes(head: bytes) -> int:
    """Eight more than the first part says; recorders that were cut off leave 0 or the largest."""
    (size,) = struct.unpack("<I", head[4:8])
    return 0 if size in (0, 0xFFFFFFFF) or size >= 1 << 31 else int(size) + 8


def _boxes_bytes(seek: Callable[[int], int], read: Callable[[int], bytes]) -> int:
    """Where the last of the parts ends that can be reached from the beginning."""
    place = 0
    for _ in range(_MOST_BOXES):
        seek(place)
        head = read(16)
        if len(head) < 8:
            return place
        (size,) = struct.unpack(">I", head[:4])
        if not all(32 <= letter < 127 for letter in head[4:8]):
            return 0  # not a part: what follows is of another kind
        if size == 1 and len(head) == 16:
            (size,) = struct.unpack(">Q", head[8:])
        if size < 8:
            return 0  # "to the end of the file", or damaged
        place += size
        if place > 1 << 60:
            return 0
    return 0


def _age(changed: int) -> float:
    """Seconds since then; a clock that is ahead counts, too."""
    return abs(time.time() - changed * 1e-9)


def _megabytes(size: int) -> str:
    return f"{size / 1e6:.1f} MB" if size >= 1e6 else f"{size / 1e3:.1f} kB"
