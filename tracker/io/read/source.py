"""A file of another program: its content is parsed on demand, within limits of size and depth.

Files are not trusted. Reading is bounded in memory and time, executes nothing and follows no
reference to another file; a file beyond a limit is an error with one sentence.
"""

from __future__ import annotations

import io
import json
import math
import os
import re
import tomllib
import xml.etree.ElementTree as ElementTree
import zipfile
import zlib
from collections.abc import Iterator, Sequence
from functools import cached_property
from pathlib import Path, PurePosixPath
from typing import IO, Any

import numpy as np
import yaml
from numpy import ndarray

from tracker.files.text import not_utf_8
from tracker.io.read.pieces import FormatError

HEAD_BYTES = 65536
"""The number of bytes by which a file is recognised."""

MOST_BYTES = 256 * 2**20
"""Largest size of a text table, bytes; an hour of a crowd in seven views takes some 100 MB."""

MOST_LINES = 10_000_000
"""Most lines of a text; each takes some fifty bytes more in memory than in the file."""

MOST_TREE_BYTES = 64 * 2**20
"""Largest size of JSON and XML, which take about ten times their size in memory, bytes."""

MOST_CONFIGURATION_BYTES = 4 * 2**20
"""Largest size of TOML and YAML, whose parsers are slow, bytes."""

MOST_DEPTH = 100
"""Deepest nesting of lists and tables."""


_UTF16 = (b"\xff\xfe", b"\xfe\xff")
_NOT_WRITTEN = re.compile(rb"[\x00-\x08\x0e-\x1f\x7f\x81\x8d\x8f\x90\x9d]")
"""Bytes without a character in Windows' encoding of western Europe."""

_MOST_FOREIGN = 0.2
"""Largest share of bytes other than ASCII in a text that is not UTF-8."""


def _encoding(data: bytes, *, whole: bool = False) -> str | None:
    """Return the encoding of a text: UTF-8, UTF-16 with byte-order mark (Excel), or that of older
    Windows programs; None for binary data.

    Args:
        data: The file, or its beginning.
        whole: Whether the data is the whole file, so that no character is cut at its end.
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
        """Wrap a file, which is read when its content is needed.

        Args:
            path: The file, or the one that represents a series.
            root: The folder to which paths in messages are relative.
            series: All files of the series in the order of their numbers, this one included.
        """
        self.path = path
        self.series = series or (path,)
        self.companions: list[Path] = []
        """The other files whose content was read with this one's."""
        self._root = root

    @property
    def where(self) -> str:
        """The path of the file in messages."""
        if self._root is not None and self.path.is_relative_to(self._root):
            return self.path.relative_to(self._root).as_posix() or self.path.name
        return self.path.name

    def member(self, path: Path) -> SourceFile:
        """Return another file of the series or of the folder."""
        member = SourceFile(path, self._root)
        member.companions = self.companions
        return member

    def frames(self) -> Iterator[tuple[int, SourceFile]]:
        """Yield each file of a series of one file a frame, after its frame: the number in its name,
        else its place in the series."""
        for place, path in enumerate(self.series):
            number = number_in(path.name)
            yield place if number is None else number, self.member(path)

    @property
    def label(self) -> str:
        """Folder and name without the suffix, which may contain the camera's name."""
        return self.where.removesuffix(self.path.suffix)

    def error(self, message: str, field: str = "") -> FormatError:
        """Return an error that names the file and, if given, a field of it."""
        return FormatError(f"{self.where}{', ' if field else ''}{field}: {message}")

    @cached_property
    def size(self) -> int:
        """The size of the file, bytes."""
        return self.path.stat().st_size

    @cached_property
    def head(self) -> bytes:
        """The first bytes of the file."""
        # several times faster than a stream, which matters for thousands of files
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
        """Whether the beginning is text in a known encoding."""
        return _encoding(self.head) is not None

    @cached_property
    def head_text(self) -> str:
        """The beginning as text; empty where it is not text."""
        encoding = _encoding(self.head)
        return "" if encoding is None else self.head.decode(encoding, errors="ignore")

    def bytes(self, most: int = MOST_BYTES) -> bytes:
        """Read the whole file.

        Args:
            most: Largest size, bytes.

        Raises:
            FormatError: If the file is larger or cannot be read.
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
        """Read the whole file as text.

        Args:
            most: Largest size, bytes.

        Raises:
            FormatError: If the file is too large, has too many lines or is not text.
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
        """Read the lines of a text file."""
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
        """The values of a file with a JSON object on each line; None for other files.

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
                raise self.error(
                    f"line {number}: is not valid JSON, expected a record; "
                    "it may be cut short: get the file again"
                ) from None
        return values

    @cached_property
    def xml(self) -> ElementTree.Element:
        """The root of an XML file. Entities, which can expand without limit, are refused.

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
            # the declaration may name the encoding that the text had before it was decoded
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
            raise self.error("is not valid XML: it is empty; get the file again")
        return root

    @cached_property
    def xml_tree(self) -> Any:
        """The content of an XML file: an element is a table of its attributes and children, of
        which those of one name are a list; one without either is its text.

        Raises:
            FormatError: As :attr:`xml`.
        """
        return _tree_of_xml(self.xml)

    @property
    def tree(self) -> Any:
        """The content of a file of JSON, XML or YAML, whichever its first sign states.

        Raises:
            FormatError: If it is not valid.
        """
        sign = self.head_text.lstrip()[:1]
        if sign == "<":
            return self.xml_tree
        return self.json if sign in ("{", "[") else self.yaml

    @cached_property
    def toml(self) -> dict[str, Any]:
        """The content of a TOML file.

        Raises:
            FormatError: If it is not TOML, too large or too deep.
        """
        try:
            return tomllib.loads(self.text(MOST_CONFIGURATION_BYTES))
        except tomllib.TOMLDecodeError as error:
            raise self.error(
                f"is not valid TOML ({error}); it may be cut short: get the file again"
            ) from None
        except RecursionError:
            raise self._too_deep() from None
        except ValueError:
            raise self._too_long() from None

    @cached_property
    def yaml(self) -> Any:
        """The content of a YAML file; OpenCV's matrices are mappings of their fields.

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


TEXT = "text()"
"""The key of the text of an XML element that has attributes."""


def _tree_of_xml(element: ElementTree.Element) -> Any:
    children: dict[str, list[Any]] = {}
    for child in element:
        children.setdefault(child.tag, []).append(_tree_of_xml(child))
    if not children and not element.attrib:
        return element.text or ""
    several = {tag: own if len(own) > 1 else own[0] for tag, own in children.items()}
    text = {TEXT: element.text} if not children and (element.text or "").strip() else {}
    return {**element.attrib, **several, **text}


def listed(value: Any) -> list[Any]:
    """Return the children of one name in a tree of XML, which is a list only of several."""
    return value if isinstance(value, list) else [] if value is None else [value]


class FileOfLines(SourceFile):
    """A text file of which only some lines count."""

    def __init__(self, file: SourceFile, lines: Sequence[str]) -> None:
        """Wrap a file.

        Args:
            file: The file.
            lines: The lines that count.
        """
        super().__init__(file.path, file._root)
        self.companions = file.companions
        self._data = "\n".join([*lines, ""]).encode()

    def member(self, path: Path) -> SourceFile:
        """Return this file by its path, or another one of the folder."""
        return self if path == self.path else super().member(path)

    @cached_property
    def size(self) -> int:
        """The size of the lines, bytes."""
        return len(self._data)

    @cached_property
    def head(self) -> bytes:
        """The first bytes of the lines."""
        return self._data[:HEAD_BYTES]

    def bytes(self, most: int = MOST_BYTES) -> bytes:
        """Return the lines, which were read within the limits."""
        return self._data


class _Loader(yaml.CSafeLoader):
    """A loader of YAML that makes plain data alone, and of OpenCV's matrices mappings."""


def _matrix(loader: yaml.CSafeLoader, node: yaml.Node) -> Any:
    if not isinstance(node, yaml.MappingNode):
        raise ValueError("is not valid YAML (an opencv-matrix must have rows, cols, dt and data)")
    return loader.construct_mapping(node, deep=True)


for _kind in ("opencv-matrix", "opencv-nd-matrix"):
    _Loader.add_constructor(f"tag:yaml.org,2002:{_kind}", _matrix)


NPY, ZIP = b"\x93NUMPY", b"PK\x03\x04"
"""The first bytes of a NumPy array, and of an archive such as one of several arrays."""


def npy_header(stream: IO[bytes]) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Read the shape and the kind of numbers of a NumPy array; its numbers follow in the stream.

    Raises:
        ValueError: If it is no header of an array.
    """
    old = np.lib.format.read_magic(stream) == (1, 0)
    read = np.lib.format.read_array_header_1_0 if old else np.lib.format.read_array_header_2_0
    shape, _, kind = read(stream)
    return shape, kind


def read_npy(data: bytes) -> ndarray:
    """Read a NumPy array, for which no more memory is taken than its bytes.

    Raises:
        ValueError: If it is cut short or has Python's objects.
    """
    stream = io.BytesIO(data)
    shape, kind = npy_header(stream)
    if kind.hasobject or math.prod(shape) * kind.itemsize != len(data) - stream.tell():
        raise ValueError("the header says another size")
    return np.asarray(np.load(io.BytesIO(data), allow_pickle=False))


def read_npz(data: bytes, most: int) -> dict[str, ndarray] | None:
    """Unpack the arrays of an ``.npz``, of which a few bytes may stand for gigabytes.

    Args:
        data: The archive.
        most: Largest size of all arrays together, bytes.

    Returns:
        The arrays by their names; None if together they are larger.

    Raises:
        ValueError: If it is no archive, or a damaged one, or an array is not valid.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = [one for one in archive.infolist() if one.filename.endswith(".npy")]
            if sum(one.file_size for one in members) > most:
                return None
            return {
                one.filename.removesuffix(".npy"): read_npy(archive.read(one)) for one in members
            }
    except (zipfile.BadZipFile, EOFError, NotImplementedError, zlib.error) as error:
        raise ValueError(f"is no intact archive ({error})") from None


def parse_yaml(text: str, most_depth: int = 100) -> Any:
    """Parse the first document of a YAML text, as calibrations use it.

    Args:
        text: The text.
        most_depth: Deepest nesting that is accepted.

    Raises:
        ValueError: If the text is not YAML, has references or unknown tags, or is nested too deep.
    """
    # OpenCV begins with "%YAML:1.0", which is not a valid directive
    text = re.sub(r"\A%YAML[: ]\d\.\d\s*\n", "", text)
    # older versions of OpenCV write no space after the colon of a key
    text = re.sub(r"^(\s*\w+):(?=[^\s:/\\])", r"\1: ", text, flags=re.MULTILINE)
    try:
        depth = 0
        for event in yaml.parse(text, Loader=yaml.CSafeLoader):
            if isinstance(event, yaml.AliasEvent):  # nested references expand without limit
                raise ValueError("uses YAML references (&name, *name), expected plain values")
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            if depth > most_depth:
                raise ValueError(f"has more than {most_depth} levels of nesting")
        loader: Any = _Loader(text)
        try:
            return loader.get_data() if loader.check_data() else None
        finally:
            loader.dispose()
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        place = f"line {mark.line + 1}: " if mark is not None else ""
        problem = getattr(error, "problem", None) or "it cannot be parsed"
        raise ValueError(f"{place}is not valid YAML ({problem})") from None


def number_in(text: str) -> int | None:
    """Return the last number in a name, which is the frame of ``cam1/frame_0012.jpg``; None if
    there is none."""
    name = text.replace("\\", "/").rsplit("/", 1)[-1]
    stem = re.sub(r"\.[A-Za-z]\w{0,4}$", "", name)  # of "cam1.0012.json" the number stays
    runs = re.findall(r"\d+", stem)
    return int(runs[-1]) if runs and len(runs[-1]) <= 15 else None


def camera_of(name: str) -> str:
    """Return the folder of an image, or else the part of its name before the frame number."""
    path = PurePosixPath(name.replace("\\", "/"))
    if path.parent.name:
        return path.parent.as_posix()
    return re.sub(r"[\W_]*\d+\D*$", "", path.stem)


def is_camera_number(name: object) -> bool:
    """Whether a name is like ``cam1``, so that its number is the camera's and not the frame's."""
    return isinstance(name, str) and re.fullmatch(r"(cam|view)\D*\d+", name.lower()) is not None
