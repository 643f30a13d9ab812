"""One file to be recognised and read: its content on demand, within limits of size and depth.

Files come from anywhere. Whatever is read here is bounded in memory and time, executes
nothing and follows no reference to another file; what breaks a limit is an error in one sentence.
"""

from __future__ import annotations

import json
import os
import re
import tomllib
import xml.etree.ElementTree as ElementTree
from functools import cached_property
from pathlib import Path
from typing import Any

from tracker.files.text import not_utf_8
from tracker.io.read.pieces import FormatError
from tracker.io.read.yaml_text import parse_yaml

HEAD_BYTES = 65536
"""Read to recognise a file; a format shows itself within its first lines."""

MOST_BYTES = 256 * 2**20
"""A text table; an hour of a crowd in seven views takes some 100 MB."""

MOST_LINES = 10_000_000
"""Of a text: each takes some fifty bytes more in memory than in the file."""

MOST_TREE_BYTES = 64 * 2**20
"""JSON and XML, which take about ten times their size in memory."""

MOST_CONFIGURATION_BYTES = 4 * 2**20
"""TOML, YAML: calibrations, whose readers are slow."""

MOST_DEPTH = 100
"""Levels of lists and tables within each other."""


_UTF16 = (b"\xff\xfe", b"\xfe\xff")
_NOT_WRITTEN = re.compile(rb"[\x00-\x08\x0e-\x1f\x7f\x81\x8d\x8f\x90\x9d]")
"""Bytes that stand for no sign in Windows' encoding of western Europe."""

_MOST_FOREIGN = 0.2
"""Share of a text's bytes that may be other than ASCII, where it is not UTF-8."""


def _encoding(data: bytes, *, whole: bool = False) -> str | None:
    """How text is written: UTF-8, UTF-16 with its mark (Excel), or an older Windows' way.

    Args:
        data: The file, or its beginning.
        whole: Whether it is all of it, so that no sign can be cut in two.
    """
    if data.startswith(_UTF16):
        try:
            data[: len(data) // 2 * 2].decode("utf-16")
        except UnicodeDecodeError as error:
            return "utf-16" if not whole and error.start > len(data) - 5 else None
        return "utf-16"
    if b"\0" in data:
        return None
    try:
        data.decode("utf-8-sig")
        return "utf-8-sig"
    except UnicodeDecodeError as error:
        if not whole and len(data) == HEAD_BYTES and error.start > len(data) - 4:
            return "utf-8-sig"
    foreign = sum(data.count(byte) for byte in range(128, 256))
    written = _NOT_WRITTEN.search(data) is None and foreign <= _MOST_FOREIGN * len(data)
    return "cp1252" if written else None


class SourceFile:
    """One file, or a series of files whose names differ in a number only."""

    def __init__(self, path: Path, root: Path | None = None, series: tuple[Path, ...] = ()) -> None:
        """Wrap a file; nothing is read yet.

        Args:
            path: The file; of a series the one that stands for all.
            root: The folder that was asked for, which messages leave out.
            series: All files of the series in the order of their numbers, this one among them.
        """
        self.path = path
        self.series = series or (path,)
        self._root = root

    @property
    def where(self) -> str:
        """How messages call it."""
        if self._root is not None and self.path.is_relative_to(self._root):
            return self.path.relative_to(self._root).as_posix() or self.path.name
        return self.path.name

    def member(self, path: Path) -> SourceFile:
        """Another file of the series or of the folder, by itself."""
        return SourceFile(path, self._root)

    @property
    def label(self) -> str:
        """Folder and name without the suffix: what may name the camera."""
        return self.where.removesuffix(self.path.suffix)

    def error(self, message: str, field: str = "") -> FormatError:
        """An error about the file or one field of it."""
        return FormatError(f"{self.where}{', ' if field else ''}{field}: {message}")

    @cached_property
    def size(self) -> int:
        """Bytes."""
        return self.path.stat().st_size

    @cached_property
    def head(self) -> bytes:
        """The first bytes of the file."""
        # several times faster than a stream, which counts where there are thousands of files
        try:
            descriptor = os.open(self.path, os.O_RDONLY | getattr(os, "O_BINARY", 0))
            try:
                return os.read(descriptor, HEAD_BYTES)
            finally:
                os.close(descriptor)
        except OSError as error:
            raise self.error(f"cannot be read ({error.strerror})") from None

    @cached_property
    def is_text(self) -> bool:
        """Whether the beginning is text in UTF-8, UTF-16 or Windows' own encoding."""
        return _encoding(self.head) is not None

    @cached_property
    def head_text(self) -> str:
        """The beginning as text; empty where it is not text."""
        encoding = _encoding(self.head)
        return "" if encoding is None else self.head.decode(encoding, errors="ignore")

    def bytes(self, most: int = MOST_BYTES) -> bytes:
        """The whole file, at most so many bytes.

        Raises:
            FormatError: If it is larger or cannot be read.
        """
        if self.size > most:
            raise self.error(
                f"has {self.size / 2**20:,.0f} MB, expected at most {most / 2**20:,.0f}; "
                "leave out what is not needed or cut it into pieces"
            )
        try:
            return self.path.read_bytes()
        except OSError as error:
            raise self.error(f"cannot be read ({error.strerror})") from None

    def text(self, most: int = MOST_BYTES) -> str:
        """The whole file as text.

        Raises:
            FormatError: If it is too large, has too many lines or is not text in UTF-8.
        """
        data = self.bytes(most)
        count = data.count(b"\n")
        if count > MOST_LINES:
            raise self.error(
                f"has {count:,} lines, expected at most {MOST_LINES:,}; leave out what is not "
                "needed or cut it into pieces"
            )
        encoding = _encoding(data, whole=True)
        try:
            if encoding is not None:
                return data.decode(encoding)
            if b"\0" in data:
                raise self.error("expected text, found binary data; it may be cut short or spoilt")
            return data.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            raise self.error(not_utf_8(error)) from None

    def lines(self) -> list[str]:
        """The lines of a text file."""
        return self.text().splitlines()

    @cached_property
    def json(self) -> Any:
        """The content of a JSON file.

        Raises:
            FormatError: If it is not JSON, too large or too deep.
        """
        try:
            return json.loads(self.text(MOST_TREE_BYTES))
        except json.JSONDecodeError as error:
            raise self.error(
                f"line {error.lineno}: is not valid JSON ({error.msg.lower()}); "
                "it may be cut short: get the file again"
            ) from None
        except RecursionError:
            raise self._too_deep() from None
        except ValueError:
            raise self._too_long() from None

    @cached_property
    def json_lines(self) -> list[Any] | None:
        """The values of a file that has a JSON table on each line; None where it is no such file.

        Raises:
            FormatError: If a line is not JSON, or it is too large or too deep.
        """
        first, *rest = self.head_text.lstrip().split("\n", 1)
        if not rest or not (first.startswith("{") and first.rstrip().endswith("}")):
            return None
        values = []
        for number, line in enumerate(self.text(MOST_TREE_BYTES).splitlines(), 1):
            try:
                values += [json.loads(line)] if line.strip() else []
            except RecursionError:
                raise self._too_deep() from None
            except ValueError:
                raise self.error(f"line {number}: is not valid JSON, expected a record") from None
        return values

    @cached_property
    def xml(self) -> ElementTree.Element:
        """The root of an XML file. Entities, which can make a small file endless, are refused.

        Raises:
            FormatError: If it is not XML, too large, too deep, or declares entities.
        """
        text = self.text(MOST_TREE_BYTES)
        if re.search(r"<!\s*(ENTITY|DOCTYPE[^>]*\[)", text, re.IGNORECASE):
            raise self.error(
                "declares XML entities, which no calibration or annotation needs; "
                "remove its <!DOCTYPE …>"
            )
        parser: Any = ElementTree.XMLPullParser(events=("start", "end"))
        depth = 0
        root: ElementTree.Element | None = None
        try:
            # the declaration may name another encoding than the text has by now
            text = re.sub(r"^\s*<\?xml[^>]*\?>", "", text)
            for begin in range(0, len(text), HEAD_BYTES):
                parser.feed(text[begin : begin + HEAD_BYTES])
                for event, element in parser.read_events():
                    root = element if root is None else root
                    depth += 1 if event == "start" else -1
                    if depth > MOST_DEPTH:
                        raise self._too_deep()
            parser.close()
        except ElementTree.ParseError as error:
            raise self.error(
                f"line {error.position[0]}: is not valid XML ({error}); "
                "it may be cut short: get the file again"
            ) from None
        if root is None:
            raise self.error("is not valid XML: it is empty")
        return root

    @cached_property
    def toml(self) -> dict[str, Any]:
        """The content of a TOML file.

        Raises:
            FormatError: If it is not TOML, too large or too deep.
        """
        try:
            return tomllib.loads(self.text(MOST_CONFIGURATION_BYTES))
        except tomllib.TOMLDecodeError as error:
            raise self.error(f"is not valid TOML ({error})") from None
        except RecursionError:
            raise self._too_deep() from None
        except ValueError:
            raise self._too_long() from None

    @cached_property
    def yaml(self) -> Any:
        """The content of a YAML file; OpenCV's matrices come as tables of their fields.

        Raises:
            FormatError: If it is not YAML, too large, too deep, or uses references.
        """
        try:
            return parse_yaml(self.text(MOST_CONFIGURATION_BYTES), MOST_DEPTH)
        except RecursionError:
            raise self._too_deep() from None
        except ValueError as error:
            raise self.error(str(error)) from None

    def _too_long(self) -> FormatError:
        return self.error(
            "has a number of thousands of digits; it may be spoilt: get the file again"
        )

    def _too_deep(self) -> FormatError:
        return self.error(f"has more than {MOST_DEPTH} levels of nesting; it is no data of ours")
