"""Damaged recordings: what fell once, and more at random, each a sentence or a sound run."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from tests.bad_input.cases import make_bases, try_case
from tests.bad_input.drawing import CONTENTS, KINDS, NUMBERS, WORDS, Damage
from tests.synthetic import write_sequence
from tracker.sequences.csv_columns import read_columns
from tracker.sequences.errors import SequenceError
from tracker.sequences.reader import FILE, read_sequence, read_summary

BASES = ("boxes", "videos", "images", "bare")


def damages() -> SearchStrategy[list[Damage]]:
    """What is done to a folder."""
    part = st.floats(0.0, 1.0, exclude_max=True)
    what = st.integers(0, max(len(NUMBERS), len(WORDS), len(CONTENTS), 64) * 8)
    return st.lists(
        st.builds(Damage, kind=st.sampled_from(list(KINDS)), file=part, place=part, what=what),
        min_size=1,
        max_size=4,
    )


def folders() -> SearchStrategy[tuple[str, list[Damage]]]:
    """A good folder by its name, and what is done to it."""
    return st.tuples(st.sampled_from(BASES), damages())


def cells() -> SearchStrategy[str]:
    """A cell of a table: mostly a number, in any notation."""
    numbers = st.one_of(
        st.floats().map(repr), st.integers().map(str), st.sampled_from(NUMBERS[:-3])
    )
    return st.one_of(numbers, numbers, st.text(max_size=12), st.just(""))


def tables(*columns: str) -> SearchStrategy[str]:
    """A CSV file with about these columns."""
    header = st.lists(st.sampled_from((*columns, "id", "other")), min_size=1, max_size=8)
    whole = st.one_of(st.just(list(columns)), header)
    rows = st.lists(st.lists(cells(), min_size=0, max_size=8), max_size=12)
    ends = st.sampled_from(("\n", "\r\n", "\n\n"))

    def text(parts: tuple[list[str], list[list[str]], str]) -> str:
        names, lines, end = parts
        return end.join([",".join(names), *(",".join(line) for line in lines)])

    return st.tuples(whole, rows, ends).map(text)


def toml_values() -> SearchStrategy[str]:
    """A value as TOML has it, of any type and depth."""
    leaves = st.one_of(
        st.sampled_from((*NUMBERS, *WORDS)),
        st.floats(allow_nan=False, allow_infinity=False).map(repr),
        st.integers().map(str),
        st.text(max_size=20).map(lambda text: '"' + text.replace('"', "").replace("\\", "") + '"'),
    )
    return st.recursive(
        leaves,
        lambda inner: st.lists(inner, max_size=4).map(lambda some: f"[{', '.join(some)}]"),
        max_leaves=12,
    )


CORPUS: list[dict[str, Any]] = json.loads(
    Path(__file__).with_name("corpus.json").read_text(encoding="utf-8")
)
QUICK = settings(
    max_examples=25,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)


@pytest.fixture(scope="module")
def bases(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return make_bases(tmp_path_factory.mktemp("bases"))


@pytest.mark.full
@pytest.mark.parametrize("base", BASES)
def test_a_good_folder_runs(bases: dict[str, Path], tmp_path: Path, base: str) -> None:
    assert try_case(bases[base], [], tmp_path) == ""


@pytest.mark.full
@pytest.mark.parametrize("case", CORPUS, ids=lambda case: case["why"])
def test_what_fell_once_stands(bases: dict[str, Path], tmp_path: Path, case: Any) -> None:
    try_case(bases[case["base"]], [Damage(**one) for one in case["damages"]], tmp_path)


@given(case=folders())
@QUICK
def test_any_damage_leads_to_a_sentence(
    bases: dict[str, Path], tmp_path: Path, case: tuple[str, list[Damage]]
) -> None:
    base, damages = case
    try_case(bases[base], damages, tmp_path)


@given(text=tables("frame", "left", "top", "width", "height", "score"))
@settings(QUICK, max_examples=150)
def test_any_table_is_read_or_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "case.csv"
    path.write_text(text, encoding="utf-8")
    told = refused(
        lambda: read_columns(
            path, "case.csv", needed=("frame", "left"), optional={"score": 1.0}, blank=("left",)
        )
    )
    assert told is None or told.startswith("case.csv, line ")


@given(value=toml_values(), field=st.integers(0, 11))
@settings(QUICK, max_examples=100)
def test_any_value_of_any_field_is_read_or_refused(tmp_path: Path, value: str, field: int) -> None:
    folder = tmp_path / "case"
    if not (folder / "good").is_file():
        write_sequence(folder, frames=4, container=None, detections=True)
        (folder / FILE).rename(folder / "good")
    lines = (folder / "good").read_text(encoding="utf-8").splitlines()
    places = [k for k, line in enumerate(lines) if " = " in line and not line.startswith(" ")]
    place = places[field % len(places)]
    lines[place] = f"{lines[place].partition(' = ')[0]} = {value}"
    (folder / FILE).write_text("\n".join(lines), encoding="utf-8")
    for read in (read_summary, read_sequence):
        told = refused(lambda read=read: read(folder))
        assert told is None or "case" in told


def refused(read: Callable[[], object]) -> str | None:
    """The sentence with which something is refused; None where it is taken."""
    try:
        read()
    except SequenceError as error:
        told = str(error)
    else:
        return None
    assert told.isprintable()
    assert len(told) < 1500
    return told
