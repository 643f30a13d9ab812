"""The figures of earlier commits: ``record.json``, which ``benchmark --record`` appends to.

An entry holds the commit that was measured, the day, the machine and each figure. Accuracy is
the same on every machine but for the last bits, and must not fall below the last entry by more
than each figure's tolerance. Speed is compared with the last entry of such a machine only, and a
loss is told, not refused: other work on a machine easily costs half of it.
"""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from tests.benchmarks.measure import Measurement, machine

FILE = Path(__file__).with_name("record.json")
ROOT = Path(__file__).resolve().parents[3]

NOISE = 1.5
"""A speed that differs by less than this factor may be the same."""

SAME = ("processor", "cores", "system")
"""What makes two machines comparable."""


@dataclass(frozen=True, slots=True)
class Entry:
    """What was measured at one commit."""

    commit: str
    """Short hash; with a plus where there were changes on top of it."""
    date: str
    """Year, month and day, UTC."""
    machine: dict[str, Any]
    short: bool
    """Whether these are figures of the short form: the others are never set beside them."""
    accuracy: dict[str, float]
    speed: dict[str, float]


def read(file: Path = FILE) -> list[Entry]:
    """All entries, oldest first.

    Raises:
        ValueError: If the file is not what :func:`append` writes, with its name.
    """
    if not file.is_file():
        return []
    try:
        return [Entry(**entry) for entry in json.loads(file.read_text(encoding="utf-8"))]
    except (TypeError, json.JSONDecodeError) as error:
        raise ValueError(f"{file}: expected what `benchmark --record` writes: {error}") from error


def entry(found: Iterable[Measurement], *, short: bool) -> Entry:
    """These figures as an entry of now and here."""
    figures: dict[bool, dict[str, float]] = {True: {}, False: {}}
    for figure in found:
        figures[figure.tolerance is not None][figure.name] = float(f"{figure.value:.4g}")
    return Entry(commit(), datetime.now(UTC).date().isoformat(), machine(), short, *(
        figures[accurate] for accurate in (True, False)
    ))  # fmt: skip


def append(new: Entry, file: Path = FILE) -> None:
    """One more entry; an earlier one of the same commit, form and machine is replaced."""
    kept = [
        old
        for old in read(file)
        if (old.commit, old.short) != (new.commit, new.short)
        or not _alike(old.machine, new.machine)
    ]
    rows = [
        json.dumps({name: getattr(one, name) for name in Entry.__slots__}, ensure_ascii=False)
        for one in (*kept, new)
    ]
    file.write_text("[\n" + ",\n".join(rows) + "\n]\n", encoding="utf-8")


def losses(found: Iterable[Measurement], entries: list[Entry]) -> Iterator[str]:
    """A sentence for each figure of accuracy that is worse than the last one on record."""
    for figure in found:
        if figure.tolerance is None:
            continue
        old = next((e for e in reversed(entries) if figure.name in e.accuracy), None)
        if old is None:
            continue
        before = old.accuracy[figure.name]
        worse = before - figure.value if figure.direction == "higher" else figure.value - before
        if worse > figure.tolerance:
            yield (
                f"{figure.name}: {figure.value:.4g}{_unit(figure)}, {before:.4g} at {old.commit}: "
                f"worse by {worse:.3g}, more than {figure.tolerance:g}; where that is the price "
                "of something better, `multiview-phd benchmark accuracy --record` accepts it"
            )


def slower(found: Iterable[Measurement], entries: list[Entry], *, short: bool) -> Iterator[str]:
    """A sentence for each figure of speed that is worse beyond noise, on a machine of the kind."""
    here = machine()
    alike = [e for e in entries if e.short == short and _alike(e.machine, here)]
    for figure in found:
        old = next((e for e in reversed(alike) if figure.name in e.speed), None)
        if figure.tolerance is not None or old is None:
            continue
        before, now = old.speed[figure.name], figure.value
        factor = before / now if figure.direction == "higher" else now / before if before else 1.0
        if factor > NOISE:
            yield (
                f"{figure.name}: {now:.4g}{_unit(figure)}, {before:.4g} at {old.commit} on such a "
                f"machine: {factor:.1f} times as slow"
            )


def commit() -> str:
    """The commit that is checked out."""
    line = ["git", "describe", "--always", "--exclude", "*", "--dirty=+"]
    done = subprocess.run(line, cwd=ROOT, capture_output=True, text=True)
    return done.stdout.strip() or "unknown"


def _alike(one: dict[str, Any], other: dict[str, Any]) -> bool:
    return all(one.get(name) == other.get(name) for name in SAME)


def _unit(figure: Measurement) -> str:
    return f" {figure.unit}" if figure.unit else ""
