"""The page Architecture says what the largest packages of an installation are for."""

from __future__ import annotations

from tests.manual.installed import sizes
from tests.manual.places import PAGES

MB = 1_000_000


def test_the_ten_largest_packages_are_named_with_what_they_are_for() -> None:
    page = (PAGES / "architecture.md").read_text(encoding="utf-8")
    rows = [line for line in page.splitlines() if line.startswith("| `")]
    found = sizes()
    assert len(found) > 30
    largest = {*list(found)[:10], *(name for name, size in found.items() if size > 40 * MB)}
    named = {name: [row for row in rows if f"`{name}`" in row.split("|")[1]] for name in largest}
    assert not [name for name, its in named.items() if len(its) != 1 or len(its[0]) < 60]
