"""The library's file: what is kept, what falls out, and what a person says of it."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from tests.library.runs import KEPT, RECORDING, filled, made_by_the_version_before, run
from tracker.library import schema
from tracker.library.errors import LibraryError
from tracker.library.keeping import remarks_of
from tracker.library.store import Library
from tracker.parameters.catalogue import RunParameters


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "somewhere" / "library.sqlite3"


def test_a_run_comes_back_after_the_program_ended(path: Path) -> None:
    with Library(path) as library:
        number = library.keep(RECORDING, run(7))
    with Library(path) as library:
        result = library.result(number)
        (recording,) = library.recordings()
    assert result.run.changes == {"fusion.clutter_rate": 1.5}
    assert (result.run.mota, result.run.hota, result.run.misses) == (0.9, None, 4)
    assert result.parameters == RunParameters()
    assert result.unknown == ()
    np.testing.assert_array_equal(result.kept.tracks.positions, KEPT.tracks.positions)
    assert (recording.name, recording.people, recording.runs) == ("room44-3p", 3, 1)


def test_the_newest_runs_come_first(path: Path) -> None:
    with filled(path, 3) as library:
        assert [one.key for one in library.runs()] == ["key-2", "key-1", "key-0"]
        assert library.runs(recording=99) == []


def test_the_same_run_computed_again_is_one_run(path: Path) -> None:
    with filled(path, 2) as library:
        number = library.keep(RECORDING, run(0, began=5000.0))
        assert [r.id for r in library.runs()] == [number, 2]
        assert (library.run(number).began, library.run(number).latest) == (1000.0, 5000.0)
        library.delete([number])
        library.keep(RECORDING, run(0, figures={"mota": 0.5}))
        assert len(library.runs()) == 2
        # scored by another gate: the list says what the run says
        result = library.result(number)
        assert (result.run.mota, result.run.idf1, result.figures) == (0.5, None, {"mota": 0.5})


def test_templates_and_names_are_listed_with_a_run(path: Path) -> None:
    with filled(path, 1) as library:
        assert (library.run(1).templates, library.run(1).names) == ([], {})
        library._set(1, "taught", "{}")  # as a version before stored it
        assert (library.run(1).templates, library.run(1).names) == (None, {})
        taught = {"templates": ("Zoë, cam1, step 20",), "names": {3: "Zoë"}}
        library.keep(RECORDING, run(0, **taught))
        assert (library.run(1).templates, library.run(1).names) == (
            ["Zoë, cam1, step 20"],
            {3: "Zoë"},
        )


def test_untouched_runs_beyond_the_budget_fall_out_and_others_never(path: Path) -> None:
    with filled(path, 6) as library:
        library.star(1)
        library.rename(2, "the  one for\nthe paper")
        library.note(3, "two ghosts at the door")
        library.tag(4, ["paper"])
        library.keep(RECORDING, run(100), budget=1)
        assert [r.id for r in library.runs()] == [7, 4, 3, 2, 1]
        assert library.find("the one for the paper").id == 2
        assert library.run(4).tags == ["paper"]


def test_deleted_runs_can_be_taken_back_until_their_space_is_freed(path: Path) -> None:
    with filled(path, 3) as library:
        assert library.delete([1, 2]) > 1000
        assert [r.id for r in library.runs()] == [3]
        library.restore([1])
        assert [r.id for r in library.runs()] == [3, 1]
        assert library.collect(budget=100)[0] == 1
        with pytest.raises(LibraryError, match="run 2 cannot be taken back"):
            library.restore([2])


def test_a_run_that_is_not_there_is_told(path: Path) -> None:
    with filled(path, 2) as library:
        for act in (library.run, library.result, lambda n: library.delete([n])):
            with pytest.raises(LibraryError, match="no run 9"):
                act(9)
        library.rename(1, "one")
        library.rename(2, "one")
        with pytest.raises(LibraryError, match=r"several \(2, 1\)"):
            library.find("one")


def test_of_several_deletions_all_are_made_or_none(path: Path) -> None:
    with filled(path, 2) as library:
        with pytest.raises(LibraryError):
            library.delete([1, 9])
        assert len(library.runs()) == 2


def test_values_of_another_version_are_taken_as_far_as_they_are_known(path: Path) -> None:
    values = RunParameters().model_dump(mode="json")
    values["fusion"] |= {"clutter_rate": 1.25, "of_the_future": 3}
    values["fusion_method"] = "of_the_future"
    with Library(path) as library:
        result = library.result(library.keep(RECORDING, run(1, parameters=values)))
    assert result.parameters.fusion.clutter_rate == 1.25
    assert set(result.unknown) == {"fusion_method", "fusion.of_the_future"}


def test_a_file_of_every_version_becomes_today_s(tmp_path: Path) -> None:
    for version in range(schema.VERSION):
        path = tmp_path / f"{version}.sqlite3"
        with sqlite3.connect(path, isolation_level=None) as old:
            schema.migrate(old, path, schema.MIGRATIONS[:version])
        old.close()
        with Library(path) as library:
            library.keep(RECORDING, run(1))
        with sqlite3.connect(path) as now:
            assert now.execute("PRAGMA user_version").fetchone() == (schema.VERSION,)
            assert now.execute("PRAGMA integrity_check").fetchone() == ("ok",)
        now.close()


def test_a_file_of_a_newer_version_is_refused_and_left_alone(path: Path) -> None:
    filled(path, 1).close()
    with closing(sqlite3.connect(path)) as newer:
        newer.execute(f"PRAGMA user_version = {schema.VERSION + 1}")
    before = path.read_bytes()
    for read_only in (False, True):
        with pytest.raises(LibraryError, match=r"of a newer version .* update the program"):
            Library(path, read_only=read_only)
    assert path.read_bytes() == before


def test_a_migration_that_fails_leaves_the_file_as_it_was(path: Path) -> None:
    filled(path, 2).close()
    broken = (*schema.MIGRATIONS, ("ALTER TABLE runs ADD COLUMN x TEXT", "NOT SQL"))
    with sqlite3.connect(path, isolation_level=None) as connection:
        with pytest.raises(sqlite3.OperationalError):
            schema.migrate(connection, path, broken)
        names = [row[1] for row in connection.execute("PRAGMA table_info(runs)")]
        assert "x" not in names
        assert connection.execute("PRAGMA user_version").fetchone() == (schema.VERSION,)
    connection.close()
    with Library(path) as library:
        assert len(library.runs()) == 2


def test_what_a_person_corrected_is_kept_with_the_run(path: Path) -> None:
    said = ({"kind": "exchange", "places": [[12, 0.5, 0.25, 1.0]], "note": "by the door"},)
    with Library(path) as library:
        plain = library.keep(RECORDING, run(1))
        number = library.keep(RECORDING, run(2, corrections=said))
        assert library.result(number).corrections == said
        assert [kept.corrected for kept in library.runs()] == [1, 0]
        assert library.result(plain).corrections == ()
        assert remarks_of(library.result(plain)) == ()
        assert remarks_of(library.result(number)) == ("1 correction by a person applied",)


def test_figures_that_the_page_stored_before_are_provisional_until_they_are_made_anew(
    path: Path,
) -> None:
    with Library(path) as library:
        library.keep(RECORDING, run(1, source="page", ospa=(0.3, 0.4)))
        library.keep(RECORDING, run(2, source="track"))
        library.keep(RECORDING, run(3, source="batch"))
        library.keep(RECORDING, run(4, source="page", figures={"missing_pictures": 2}))
    made_by_the_version_before(path)
    with Library(path) as library:
        library.keep(RECORDING, run(5, source="page"))
        assert {one.id: one.provisional for one in library.runs()} == {
            1: True, 2: False, 3: False, 4: False, 5: False,
        }  # fmt: skip
        assert library.run(1).to_json()["provisional"] is True
        library.score(1, {"mota": 0.7, "misses": 9}, (0.1, 0.2))
        result = library.result(1)
        assert not result.run.provisional
        assert (result.run.mota, result.run.idf1, result.run.misses) == (0.7, None, 9)
        assert (result.figures["mota"], result.ospa) == (0.7, (0.1, 0.2))
        np.testing.assert_array_equal(result.kept.tracks.positions, KEPT.tracks.positions)


def test_a_run_that_is_computed_again_has_final_figures(path: Path) -> None:
    with Library(path) as library:
        library.keep(RECORDING, run(1, source="page"))
    made_by_the_version_before(path)
    with Library(path) as library:
        library.keep(RECORDING, run(1, source="page", figures={"mota": 0.6, "misses": 1}))
        assert not library.run(1).provisional
        assert library.run(1).mota == 0.6
