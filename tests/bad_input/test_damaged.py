"""Damaged recordings: what fell once, and more at random, each a sentence or a sound run."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.bad_input import strategies
from tests.bad_input.cases import make_bases, try_case
from tests.bad_input.drawing import Damage
from tests.synthetic import write_sequence
from tracker.sequences.csv_columns import read_columns
from tracker.sequences.errors import SequenceError
from tracker.sequences.reader import FILE, read_sequence, read_summary

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
@pytest.mark.parametrize("base", strategies.BASES)
def test_a_good_folder_runs(bases: dict[str, Path], tmp_path: Path, base: str) -> None:
    assert try_case(bases[base], [], tmp_path) == ""


@pytest.mark.full
@pytest.mark.parametrize("case", CORPUS, ids=lambda case: case["why"])
def test_what_fell_once_stands(bases: dict[str, Path], tmp_path: Path, case: Any) -> None:
    try_case(bases[case["base"]], [Damage(**one) for one in case["damages"]], tmp_path)


@given(case=strategies.folders())
@QUICK
def test_any_damage_leads_to_a_sentence(
    bases: dict[str, Path], tmp_path: Path, case: tuple[str, list[Damage]]
) -> None:
    base, damages = case
    try_case(bases[base], damages, tmp_path)


@given(text=strategies.tables("frame", "left", "top", "width", "height", "score"))
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


@given(value=strategies.toml_values(), field=st.integers(0, 11))
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
