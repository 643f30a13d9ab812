"""The count of lines, by a source whose lines are counted by hand."""

from __future__ import annotations

from pathlib import Path

from tests.lines import kinds_of_lines, table

SOURCE = '''"""A module.

Of three lines."""

# a comment
LIMIT = 3  # code with a comment
"""What the limit is."""
TEXT = """code
# code too

"""


def double(x):
    """One line."""
    # another comment
    return 2 * x
'''


def test_every_line_is_of_one_kind() -> None:
    counts = kinds_of_lines(SOURCE)
    assert counts == {"code": 6, "docstrings": 5, "comments": 2, "blank": 4}
    assert counts.total() == len(SOURCE.splitlines())


def test_packages_and_totals(tmp_path: Path) -> None:
    for name, lines in {
        "tracker/one.py": 1, "tracker/filters/deep/two.py": 2, "app/three.py": 4,
        "tests/runs/four.py": 8, "tests/papers/five.py": 16, "static/js/a.js": 32,
        "static/a.css": 64,
    }.items():  # fmt: skip
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("x = 1;\n" * lines)
    rows = [line.rsplit(maxsplit=5) for line in table(tmp_path).splitlines()[1:-1]]
    code = {name: int(number) for name, number, *_ in rows}
    assert code == {
        "app": 4, "tracker": 1, "tracker/filters": 2, "tests/papers": 16, "tests/runs": 8,
        "tracker, total": 3, "app, total": 4, "tests, total": 24,
        "tests without papers, rooms, compatibility": 8,
    }  # fmt: skip
    assert table(tmp_path).splitlines()[-1].split()[-1] == "96"
