"""What ``python -m tests.mutate`` tries: the list fits the code, and a sample is drawn from it."""

from __future__ import annotations

from pathlib import Path
from queue import Queue

import pytest

from tests.mutate import (
    ROOT,
    SORTS,
    Mutant,
    Unfit,
    changed,
    changes,
    draw,
    is_killed,
    read,
    tried_by,
)

MUTANTS = read()

SOURCE = '''"""A docstring: 1 < 2 and 3."""
LIMIT: float | int = 2.0


def gate(first: int | str, second, mask) -> int | None:
    """Not x < 5."""
    if first < second and mask[first, second]:
        raise ValueError(f"{first + 1} is {1 + 1}")
    return scale(first, -second) * 3
'''


def test_each_change_names_text_that_is_there_once_and_tests_that_exist() -> None:
    assert len(set(map(str, MUTANTS))) == len(MUTANTS)
    for mutant in MUTANTS:
        if mutant.equivalent:
            lines = " ".join((ROOT / mutant.file).read_text(encoding="utf-8").split())
            assert " ".join(mutant.old.split()) in lines, mutant
            assert not mutant.tests, mutant
            continue
        _, before, after = mutant.text(ROOT)
        assert before != after, mutant
        assert mutant.tests, mutant
        for test in mutant.tests:
            file, _, name = test.partition("::")
            assert f"def {name}(" in (ROOT / file).read_text(encoding="utf-8") or not name, test


def test_a_change_is_made_and_taken_back(tmp_path: Path) -> None:
    file = tmp_path / "kernel.py"
    file.write_text("gate = 3.0\nfar = 2.0 * gate\n")
    with changed(Mutant("kernel.py", "2.0 *", "", ()), tmp_path):
        assert file.read_text() == "gate = 3.0\nfar =  gate\n"
    assert file.read_text() == "gate = 3.0\nfar = 2.0 * gate\n"


@pytest.mark.parametrize(("old", "times"), [("gate", 2), ("nowhere", 0)])
def test_a_line_that_is_gone_or_there_twice_is_reported(
    tmp_path: Path, old: str, times: int
) -> None:
    (tmp_path / "kernel.py").write_text("gate = 3.0\nfar = 2.0 * gate\n")
    with pytest.raises(Unfit, match=f"expected the text once in the file, found it {times} times"):
        Mutant("kernel.py", old, "x", ()).text(tmp_path)
    with pytest.raises(Unfit, match="found it 0 times"):
        Mutant("missing.py", old, "x", ()).text(tmp_path)


def test_a_change_that_ends_the_interpreter_is_killed(tmp_path: Path) -> None:
    (tmp_path / "kernel.py").write_text("LAST = 1\n")
    (tmp_path / "test_it.py").write_text(
        "import os, signal, kernel\n"
        "def test_it():\n    kernel.LAST == 1 or os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    copies: Queue[Path] = Queue()
    for new, expected in (("2", True), ("1", False)):
        copies.put(tmp_path)
        mutant = Mutant("kernel.py", "1", new, ("test_it.py",))
        assert is_killed(mutant, copies)[0] is expected


def test_a_change_is_drawn_from_code_and_from_nothing_else(tmp_path: Path) -> None:
    (tmp_path / "gate.py").write_text(SOURCE)
    found = {(one.sort, one.lines[1]) for one in changes(tmp_path, "gate.py")}
    assert found == {
        ("factor", "LIMIT: float | int = 4.0"),
        ("bound", "if first <= second and mask[first, second]:"),
        ("and/or", "if first < second or mask[first, second]:"),
        ("negated", "if not (first < second and mask[first, second]):"),
        ("swapped", "if first < second and mask[second, first]:"),
        ("swapped", "return scale(-second, first) * 3"),
        ("sign", "return scale(first, second) * 3"),
        ("factor", "return scale(first, -second) / 3"),
        ("off by one", "return scale(first, -second) * 4"),
        ("off by one", "return scale(first, -second) * 2"),
    }


def test_every_drawn_change_leaves_a_program_and_is_another_one() -> None:
    for drawn in draw(ROOT, ["evaluation", "filters"], 60, 3):
        _, before, after = drawn.text(ROOT)
        assert before != after
        compile(after, drawn.file, "exec")


def test_a_seed_gives_the_same_sample_of_all_sorts() -> None:
    first, second, other = (draw(ROOT, ["filters"], 40, seed) for seed in (1, 1, 2))
    assert first == second
    assert first != other
    assert {drawn.sort for drawn in first} == set(SORTS)


def test_the_tests_that_import_a_module_come_first() -> None:
    near, others, whole_runs = tried_by(ROOT, "tracker/sequences/clock.py")
    assert "tests/sequences/test_clock.py" in near
    assert "tests/sequences/test_containers.py" in others
    assert whole_runs == ("tests/golden",)
    with pytest.raises(Unfit, match="no such package"):
        draw(ROOT, ["nowhere"], 1, 0)
