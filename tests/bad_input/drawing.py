"""Damages of a sequence folder that are drawn at random: values in numbers' places, lines, bytes.

Those that the table has are drawn as well: what can be done to any file, and its edits.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from random import Random
from typing import Any

from tests.bad_input.damage import MOST_BYTES, OF_A_FILE, Change, grow, random_bytes
from tests.bad_input.table import rows

NUMBERS = (
    "0", "-0.0", "1", "-1", "0.5", "2", "3", "1e-3", "1e-5", "1e-160", "1e-308", "5e-324", "1e3",
    "1e4", "1e5", "999999", "1e6", "1e7", "1e12", "1e154", "1e300", "1e308", "1e309", "-1e6",
    "-1e308", "nan", "inf", "-inf", "1" + "0" * 30, "1" + "0" * 400, "1" + "0" * 5000,
    "0x" + "f" * 300,
    "0x" + "f" * 9000, "2147483648", "9223372036854775807", "9223372036854775808", "1_000",
)  # fmt: skip
"""What stands in a number's place."""

WORDS = (
    "", '""', '"x"', "true", "[]", "{}", "[[]]", "[1, 2]", "1979-05-27", '"../../etc/passwd"',
    '"/etc/passwd"', '"/dev/zero"', '"\\u001b[31mred"', '"\\u0000"', '"=1+1"',
    '"' + "n" * 3000 + '"',
    "[" * 40 + "]" * 40, "[" * 3000 + "]" * 3000, "{ a = { b = { c = 1 } } }", "'''\n\n'''",
    '"cam1"', '"%d.jpg"', '"**/*"', '"*"', "[1e308, 1e308, 1e308]", "[0, 0, 0]", "[nan, 1, 1]",
    "[[0, 0, 0], [0, 0, 0], [0, 0, 0]]", "[[1, 0, 0], [0, 1, 0], [0, 0, 1]]", "[1e6, 1e6, 1e6]",
    "[1e-4, 1e-4, 1e-4]", "[-1e6, -1e6, -1e6]",
)  # fmt: skip
"""What stands in a whole value's place."""

CONTENTS = (
    b"", b"\0", b"\n" * 5, b"#EXTM3U\n/etc/passwd\n", b"ffconcat version 1.0\nfile /etc/passwd\n",
    b"v=0\nc=IN IP4 127.0.0.1\nm=video 5004 RTP/AVP 96\n", b"RIFF\0\0\0\0AVI ", b"\xff\xd8\xff\xe0",
    b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\xff\xff\0\0\xff\xff\x08\x02\0\0\0", b"\0\0\0\x18ftypisom",
    b"\xff\xfe\0a", b"frame,left,top,width,height\n", b"frame,id,x,y,z\n", b"a,b\n1,2\n",
    b"frame,left,top,width,height\n" + b"0,1,1,1,1\n" * 3000,
    b"frame,id,x,y,z\n" + b"0,0,0,0,0\n" * 2,
)  # fmt: skip
"""What stands in a whole file's place."""


def in_text(change: Callable[[str, float, int], str]) -> Change:
    """A change of a file's text."""

    def changed(path: Path, place: float, what: int) -> None:
        if path.stat().st_size <= MOST_BYTES:
            text = path.read_bytes().decode("latin-1")
            path.write_bytes(change(text, place, what).encode("latin-1", "replace"))

    return changed


def in_lines(change: Callable[[list[str], int], object]) -> Change:
    """A change of a file's lines."""

    def changed(text: str, place: float, what: int) -> str:
        lines = text.splitlines(keepends=True)
        if lines:
            change(lines, min(len(lines) - 1, int(place * len(lines))))
        return "".join(lines)

    return in_text(changed)


def _spot(pattern: str, text: str, place: float) -> re.Match[str] | None:
    found = list(re.finditer(pattern, text))
    return found[min(len(found) - 1, int(place * len(found)))] if found else None


def at_match(pattern: str, values: tuple[str, ...]) -> Change:
    """One of some values where a pattern matches."""

    def changed(text: str, place: float, what: int) -> str:
        spot = _spot(pattern, text, place)
        new = values[what % len(values)]
        return text if spot is None else text[: spot.start()] + new + text[spot.end() :]

    return in_text(changed)


def _exchange(lines: list[str], k: int) -> None:
    other = (k * 7 + 3) % len(lines)
    lines[k], lines[other] = lines[other], lines[k]


FIELDS = (
    "fps", "frames", "time_offset", "timestamps", "video", "images", "detections", "K", "R",
    "t", "projection", "distortion", "lens", "image_size", "first_frame", "format",
    "detections_first_frame", "detected_steps", "appearance", "[room]", "[target]",
    "[[camera]]", "[[template]]", "[ground_truth]",
)  # fmt: skip
"""What stands in a field's name's place."""

KINDS: dict[str, tuple[int, Change]] = {
    "number": (12, at_match(r"-?\d+(\.\d+)?(e-?\d+)?", NUMBERS)),
    "word": (6, at_match(r"(?m)(?<==).*$|[^,\n]+(?=,|$)", tuple(f" {word}" for word in WORDS))),
    "field": (2, at_match(r"(?m)^\s*\w+(?= =)|^\[+[\w.]+\]+", FIELDS)),
    "line gone": (2, in_lines(lambda lines, k: lines.pop(k))),
    "line twice": (1, in_lines(lambda lines, k: lines.insert(k, lines[k]))),
    "lines exchanged": (1, in_lines(_exchange)),
    "flipped": (2, random_bytes(1)),
    "bytes": (2, random_bytes(64)),
    "content": (2, lambda path, _, what: path.write_bytes(CONTENTS[what % len(CONTENTS)])),
    "grown": (
        1,
        lambda path, _, what: grow(path, path.stat().st_size + (1 << (8 + what % 24))),
    ),
    "renamed": (1, lambda path, _, what: path.rename(path.with_name(f"{what}{path.suffix}"))),
    "row": (4, lambda path, _, what: edit_of_table(path, what)),
    **{name: (1, change) for name, change in OF_A_FILE.items()},
}
"""How often each is drawn, and what it does: numbers do most harm, for they are read."""


@dataclass(frozen=True)
class Damage:
    """One thing done to one file: a value, so that a case can be written down and replayed."""

    kind: str
    file: float
    """Which of the files, 0 … 1 of their list; the folder's own file up to one half."""
    place: float
    """Where in it, 0 … 1."""
    what: int
    """Which of the values that can be put there."""

    def to_json(self) -> dict[str, Any]:
        """As it is written down."""
        return asdict(self)


def drawn(random: Random) -> list[Damage]:
    """Some damages."""
    weights = [weight for weight, _ in KINDS.values()]
    return [
        Damage(
            random.choices(list(KINDS), weights)[0],
            random.random(),
            random.random(),
            random.randrange(10_000),
        )
        for _ in range(random.choice((1, 1, 1, 2, 3, 5)))
    ]


def damage(folder: Path, done: Damage) -> None:
    """Do it. A folder whose files are gone is left as it is."""
    path = _file(folder, done.file)
    if path is not None:
        KINDS[done.kind][1](path, done.place, done.what)


def edit_of_table(path: Path, what: int) -> None:
    """One of the edits that the table has for files of that ending, where its text is there."""
    found = [row for row in rows() if row.new is not None and row.file.endswith(path.suffix)]
    row = found[what % len(found)] if found else None
    if row is not None and path.stat().st_size <= MOST_BYTES:
        old, new = str(row.old).encode(), str(row.new).encode()
        path.write_bytes(path.read_bytes().replace(old, new, 1))


def _file(folder: Path, which: float) -> Path | None:
    files = sorted(path for path in folder.rglob("*") if path.is_file() and not path.is_symlink())
    own = [path for path in files if path.name == "sequence.toml"]
    if own and which < 0.5:
        return own[0]
    others = [path for path in files if path not in own] or files
    index = int(2.0 * max(0.0, which - 0.5) * len(others))
    return others[min(len(others) - 1, index)] if files else None
