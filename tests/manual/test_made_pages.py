"""What is made from the code and the records stands in the manual as it would be made now."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.manual.places import PAGES, ROOT, between, made_pages
from tests.manual.plots import picture
from tests.manual.records import results, sweeps
from tracker.parameters.catalogue import PARAMETERS

PAGES_OF_PROCESSES = ("command-line.md",)
"""Made by starting the program once a command."""


@pytest.mark.parametrize(
    "path",
    [
        pytest.param(path, marks=[pytest.mark.full] if path.name in PAGES_OF_PROCESSES else [])
        for path in made_pages()
    ],
    ids=lambda path: path.name,
)
def test_a_made_page_is_up_to_date(path: Path) -> None:
    assert path.read_text(encoding="utf-8") == made_pages()[path](), (
        f"{path.relative_to(ROOT)} is not what the code and the records say; "
        "`python3 -m tests.manual` makes it anew"
    )


def test_the_records_hold_every_number_of_the_tables() -> None:
    page = (PAGES / "results.md").read_text(encoding="utf-8")
    documents = results.kept()
    assert documents
    for document in documents:
        for row in document["table"]["rows"]:
            assert f"| {' | '.join(row)} |" in page


def test_a_shortened_run_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    document = json.loads((results.FOLDER / "cmc.json").read_text(encoding="utf-8"))
    monkeypatch.setattr(results, "FOLDER", tmp_path / "records")
    results.FOLDER.mkdir()
    path = tmp_path / "cmc.json"
    for quick, seeds, form in ((True, None, "--quick"), (False, 3, "--seeds 3"), (False, None, "")):
        path.write_text(json.dumps({**document, "quick": quick, "seeds": seeds}), encoding="utf-8")
        results.keep(path)
        assert (f"`python -m tests.papers cmc {form}`" in results.page()) == bool(form)


def test_the_sweeps_are_of_parameters_that_there_are() -> None:
    kept = sweeps.kept()
    assert set(kept) <= set(PARAMETERS), "`python3 -m tests.manual --sweeps` forgets the others"
    for key, sweep in kept.items():
        drawn = picture(PARAMETERS[key], sweep)
        known = [v for point in sweep["points"] for v in point[1:] if v is not None]
        assert drawn.count("<circle") == len(known), key
        assert "nan" not in drawn, key


def test_values_cover_the_range_and_the_default() -> None:
    for parameter in PARAMETERS.values():
        tried = sweeps.values(parameter)
        assert parameter.default in tried, parameter.key
        if parameter.minimum is not None:
            assert tried[0] == parameter.minimum, parameter.key
            assert tried[-1] == parameter.maximum, parameter.key


def test_marks_must_be_there() -> None:
    made = between("a <!-- made by python3 -m tests.manual: x --> old <!-- end --> b", "x", "new")
    assert "new" in made
    assert "old" not in made
    with pytest.raises(ValueError, match="expected the marks"):
        between("no marks", "x", "new")
