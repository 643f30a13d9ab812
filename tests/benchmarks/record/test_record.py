"""The record of figures: what is refused, what is told, what is kept, and its page."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from tests.benchmarks import record
from tests.benchmarks.engine.accuracy import TOLERANCES
from tests.benchmarks.measure import Measurement, machine
from tests.benchmarks.record import Entry, chart

MOTA = Measurement("room: MOTA", 0.95, "", better="higher", tolerance=0.01)
OSPA = Measurement("room: OSPA", 0.10, "m", better="lower", tolerance=0.01)
STEP = Measurement("filter: step", 2.0, "ms")
RATE = Measurement("filter: rate", 50.0, "steps/s")
ALL = [MOTA, OSPA, STEP, RATE]


def with_value(figure: Measurement, value: float) -> Measurement:
    return replace(figure, value=value)


def entry(commit: str = "abc", **changes: object) -> Entry:
    return replace(record.entry(ALL, short=True), commit=commit, **changes)


@pytest.mark.parametrize(
    ("figure", "value", "refused"),
    [
        *((MOTA, 0.941, 0), (MOTA, 0.93, 1), (MOTA, 1.0, 0)),
        *((OSPA, 0.109, 0), (OSPA, 0.12, 1), (OSPA, 0.0, 0)),
    ],
)
def test_a_loss_beyond_the_tolerance_is_refused(
    figure: Measurement, value: float, refused: int
) -> None:
    told = list(record.losses([with_value(figure, value), STEP], [entry()]))
    assert len(told) == refused
    assert all("abc" in sentence and figure.name in sentence for sentence in told)


def test_the_last_entry_counts_and_any_machines() -> None:
    entries = [entry("old"), entry("new", accuracy={MOTA.name: 0.90}, machine={"cores": 512})]
    assert list(record.losses([with_value(MOTA, 0.895)], entries)) == []
    (told,) = record.losses([with_value(MOTA, 0.88), with_value(OSPA, 0.105)], entries)
    assert "new" in told
    assert list(record.losses(ALL, [])) == []


def test_speed_is_told_beyond_noise_and_only_of_such_a_machine() -> None:
    slow = [with_value(STEP, 2.0 * 1.6), with_value(RATE, 50.0 / 1.6), MOTA]
    assert len(list(record.slower(slow, [entry()], short=True))) == 2
    near = [with_value(STEP, 2.0 * 1.4), with_value(RATE, 50.0 / 1.4)]
    assert list(record.slower(near, [entry()], short=True)) == []
    assert list(record.slower(slow, [entry()], short=False)) == []
    other = entry(machine={**machine(), "cores": 4096})
    assert list(record.slower(slow, [other], short=True)) == []


def test_what_is_appended_is_read_again(tmp_path: Path) -> None:
    file = tmp_path / "record.json"
    assert record.read(file) == []
    first, second = entry("one"), entry("two")
    record.append(first, file)
    record.append(second, file)
    record.append(replace(first, speed={STEP.name: 1.0}), file)  # measured again
    assert record.read(file) == [second, replace(first, speed={STEP.name: 1.0})]
    assert first.accuracy == {MOTA.name: 0.95, OSPA.name: 0.1}
    assert first.speed == {STEP.name: 2.0, RATE.name: 50.0}
    file.write_text("[{}]")
    with pytest.raises(ValueError, match=r"record.json: expected what"):
        record.read(file)


def test_the_record_in_the_repository_has_every_figure_of_accuracy() -> None:
    entries = record.read()
    names = set().union(*(entry.accuracy for entry in entries))
    for room in ("room24-2p", "room35-2p", "room44-3p"):
        assert sum(name.startswith(f"{room}, ") for name in names) == len(TOLERANCES)
    assert record.FILE.stat().st_size < 500_000


@pytest.mark.full
def test_the_page_shows_every_figure(tmp_path: Path) -> None:
    file = tmp_path / "chart.html"
    chart.write([entry("one"), entry("two", machine={"processor": "other", "cores": 1})], file)
    text = file.read_text(encoding="utf-8")
    for words in ("MOTA", "OSPA", "filter: step (short; other, 1 cores)", entry("two").date):
        assert json.dumps(words)[1:-1] in text
    assert 'src="http' not in text
    with pytest.raises(ValueError, match="the record is empty"):
        chart.write([], file)
