"""Stored JSON: what was written is read, and what is not what was written is named."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tracker.files.atomic import size_of
from tracker.files.validated import (
    MOST_BYTES,
    InvalidJson,
    parse_json,
    read_as,
    read_json,
    set_aside,
    write_json,
)

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=10,
)


@dataclass(frozen=True)
class Box:
    """A type that is stored."""

    name: str
    sides: list[float]


@given(VALUES)
def test_what_is_written_is_read(tmp_path_factory: pytest.TempPathFactory, value: Any) -> None:
    path = tmp_path_factory.mktemp("files") / "new" / "value.json"
    try:
        write_json(path, value)
    except UnicodeEncodeError:  # an unpaired surrogate is no text of a file
        assert not path.exists()
        return
    assert read_json(path) == value


def test_every_changed_byte_of_the_value_is_noticed(tmp_path: Path) -> None:
    path = tmp_path / "value.json"
    write_json(path, {"a": "long enough", "b": [1, 2]})
    whole = path.read_bytes()
    begin = whole.index(b'"value"') + 9
    for place in range(begin, len(whole)):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
        with pytest.raises(ValueError, match=r"expected JSON|it was changed"):
            read_json(path)


@pytest.mark.parametrize("text", ['{"a": 1}', '{"value": {"a": 1}}', '{"value": {"a": 1}}\n'])
def test_files_without_a_checksum_are_read(tmp_path: Path, text: str) -> None:
    path = tmp_path / "value.json"
    path.write_text(text)
    assert read_json(path) == {"a": 1}


def test_what_another_program_wrote_is_a_value_as_it_is(tmp_path: Path) -> None:
    path = tmp_path / "value.json"
    for value in ({"value": 1, "other": 2}, {"sha256": "0"}, [1], "text"):
        path.write_text(json.dumps(value))
        assert read_json(path) == value


@pytest.mark.parametrize("data", [b"", b"{", b"\xff", b"[" * 100_000])
def test_what_is_no_json_is_refused(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "value.json"
    path.write_bytes(data)
    with pytest.raises(ValueError, match="expected JSON, found something else"):
        read_json(path)


def test_what_is_no_file_or_too_large_is_not_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for name in ("pipe", "."):
        with pytest.raises(OSError, match="folder, pipe or device"):
            size_of(tmp_path / name)
        with pytest.raises(OSError, match="folder, pipe or device"):
            read_json(tmp_path / name)
    with (tmp_path / "large").open("wb") as file:
        file.truncate(MOST_BYTES + 1)
    assert size_of(tmp_path / "large") == MOST_BYTES + 1
    with pytest.raises(ValueError, match="expected at most 64 MB"):
        read_json(tmp_path / "large")
    with pytest.raises(FileNotFoundError):
        read_json(tmp_path / "nothing")


@pytest.mark.parametrize(
    ("value", "field", "problem"),
    [
        ({"name": "a"}, "sides", "expected a value, found none"),
        ({"name": 1, "sides": []}, "name", "expected a valid string, found 1"),
        ({"name": "a", "sides": [1, "x"]}, "sides.1", 'expected a valid number, found "x"'),
        ([], "", "an object"),
    ],
)
def test_the_first_wrong_field_is_named(
    tmp_path: Path, value: Any, field: str, problem: str
) -> None:
    write_json(tmp_path / "box.json", value)
    with pytest.raises(InvalidJson) as caught:
        read_as(tmp_path / "box.json", Box)
    assert caught.value.field == field
    assert problem in caught.value.problem
    with pytest.raises(InvalidJson) as again:
        parse_json(Box, json.dumps(value))
    assert str(again.value) == str(caught.value)


def test_right_fields_make_the_value(tmp_path: Path) -> None:
    write_json(tmp_path / "box.json", {"name": "a", "sides": [1, 2.5]})
    assert read_as(tmp_path / "box.json", Box) == Box("a", [1.0, 2.5])


def test_what_is_set_aside_replaces_nothing(tmp_path: Path) -> None:
    path = tmp_path / "box.json"
    for text in ("first", "second", "third"):
        path.write_text(text)
        aside = set_aside(path)
        assert aside is not None
        assert not path.exists()
        assert aside.read_text() == text
    assert len(list(tmp_path.iterdir())) == 3
    assert set_aside(path) is None
