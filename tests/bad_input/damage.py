"""Ways to damage a sequence folder: what bad luck, other programs and malice do to its files.

A damage is a value, so that a case can be written down, shrunk and replayed: which of the files,
what is done to it, where (parts of its length) and with what.
"""

from __future__ import annotations

import os
import re
from dataclasses import asdict, dataclass
from pathlib import Path
from random import Random
from typing import Any

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

KINDS = (
    "number", "word", "field", "line gone", "line twice", "lines exchanged", "cut off", "flipped",
    "bytes", "content", "gone", "folder", "link out", "link to itself", "pipe", "grown", "renamed",
)  # fmt: skip


WEIGHTS = (12, 6, 2, 2, 1, 1, 1, 2, 2, 2, 1, 1, 1, 1, 1, 1, 1)
"""How often each of the kinds is drawn: numbers do most harm, for they are read."""


@dataclass(frozen=True)
class Damage:
    """One thing done to one file."""

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
    return [
        Damage(
            random.choices(KINDS, WEIGHTS)[0],
            random.random(),
            random.random(),
            random.randrange(10_000),
        )
        for _ in range(random.choice((1, 1, 1, 2, 3, 5)))
    ]


def damage(folder: Path, done: Damage) -> None:
    """Do it. A folder whose files are gone is left as it is."""
    path = _file(folder, done.file)
    if path is None:
        return
    text_kinds = {
        "number": lambda text: _number(text, done),
        "word": lambda text: _word(text, done),
        "field": lambda text: _field(text, done),
        "line gone": lambda text: _lines(text, done, lambda lines, k: lines.pop(k)),
        "line twice": lambda text: _lines(text, done, lambda lines, k: lines.insert(k, lines[k])),
        "lines exchanged": lambda text: _lines(text, done, _exchange),
    }
    if path.stat().st_size > 8 * 2**20 and done.kind in (*text_kinds, "flipped", "bytes"):
        return  # it has grown: to read it here would take longer than the case
    if done.kind in text_kinds:
        text = path.read_bytes().decode("latin-1")
        path.write_bytes(text_kinds[done.kind](text).encode("latin-1", "replace"))
        return
    size = path.stat().st_size
    at = int(done.place * size)
    if done.kind == "cut off":
        os.truncate(path, at)
    elif done.kind in ("flipped", "bytes"):
        data = bytearray(path.read_bytes())
        count = 1 if done.kind == "flipped" else 1 + done.what % 64
        source = Random(done.what)
        for k in range(at, min(size, at + count)):
            data[k] = data[k] ^ (1 << done.what % 8) if count == 1 else source.randrange(256)
        path.write_bytes(data)
    elif done.kind == "content":
        path.write_bytes(CONTENTS[done.what % len(CONTENTS)])
    elif done.kind == "grown":
        with path.open("r+b") as file:
            file.truncate(size + (1 << (8 + done.what % 24)))
    elif done.kind == "renamed":
        path.rename(path.with_name(f"{done.what}{path.suffix}"))
    else:
        path.unlink()
        if done.kind == "folder":
            path.mkdir()
        elif done.kind == "link out":
            path.symlink_to(("/etc/passwd", "/dev/zero", "/", "/nowhere")[done.what % 4])
        elif done.kind == "link to itself":
            path.symlink_to(path)
        elif done.kind == "pipe":
            os.mkfifo(path)


def _file(folder: Path, which: float) -> Path | None:
    files = sorted(path for path in folder.rglob("*") if path.is_file() and not path.is_symlink())
    own = [path for path in files if path.name == "sequence.toml"]
    if own and which < 0.5:
        return own[0]
    others = [path for path in files if path not in own] or files
    index = int(2.0 * max(0.0, which - 0.5) * len(others))
    return others[min(len(others) - 1, index)] if files else None


def _spot(found: list[re.Match[str]], place: float) -> re.Match[str] | None:
    return found[min(len(found) - 1, int(place * len(found)))] if found else None


def _number(text: str, done: Damage) -> str:
    found = _spot(list(re.finditer(r"-?\d+(\.\d+)?(e-?\d+)?", text)), done.place)
    if found is None:
        return text
    return text[: found.start()] + NUMBERS[done.what % len(NUMBERS)] + text[found.end() :]


def _word(text: str, done: Damage) -> str:
    found = _spot(list(re.finditer(r"(?m)(?<==).*$|[^,\n]+(?=,|$)", text)), done.place)
    if found is None:
        return text
    return text[: found.start()] + " " + WORDS[done.what % len(WORDS)] + text[found.end() :]


def _field(text: str, done: Damage) -> str:
    found = _spot(list(re.finditer(r"(?m)^\s*\w+(?= =)|^\[+[\w.]+\]+", text)), done.place)
    if found is None:
        return text
    fields = [
        "fps", "frames", "time_offset", "timestamps", "video", "images", "detections", "K", "R",
        "t", "projection", "distortion", "lens", "image_size", "first_frame", "format",
        "detections_first_frame", "detected_steps", "appearance", "[room]", "[target]",
        "[[camera]]", "[[template]]", "[ground_truth]",
    ]  # fmt: skip
    return text[: found.start()] + fields[done.what % len(fields)] + text[found.end() :]


def _lines(text: str, done: Damage, change: Any) -> str:
    lines = text.splitlines(keepends=True)
    if lines:
        change(lines, min(len(lines) - 1, int(done.place * len(lines))))
    return "".join(lines)


def _exchange(lines: list[str], k: int) -> None:
    other = (k * 7 + 3) % len(lines)
    lines[k], lines[other] = lines[other], lines[k]
