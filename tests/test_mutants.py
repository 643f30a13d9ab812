"""The list of changes that tests must notice fits the code: ``python -m tests.mutate`` tries it."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.mutate import ROOT, Mutant, Unfit, changed, read

MUTANTS = read()


def test_each_change_names_text_that_is_there_once_and_tests_that_exist() -> None:
    assert len(MUTANTS) == 42
    assert len(set(map(str, MUTANTS))) == len(MUTANTS)
    for mutant in MUTANTS:
        _, before, after = mutant.text(ROOT)
        assert before != after, mutant
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
def test_a_line_that_is_gone_or_there_twice_is_told(tmp_path: Path, old: str, times: int) -> None:
    (tmp_path / "kernel.py").write_text("gate = 3.0\nfar = 2.0 * gate\n")
    with pytest.raises(Unfit, match=f"expected the text once in the file, found it {times} times"):
        Mutant("kernel.py", old, "x", ()).text(tmp_path)
    with pytest.raises(Unfit, match="found it 0 times"):
        Mutant("missing.py", old, "x", ()).text(tmp_path)
