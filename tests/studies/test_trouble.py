"""What goes wrong is told in a sentence, and nothing that ended is lost."""

from __future__ import annotations

import json
import os
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from app.command.arguments import Where
from app.command.studies import crew_of
from app.command.terminal import CommandError
from tests.studies.small import Serial, definition, made_up, run
from tracker.files.atomic import write_whole
from tracker.studies import store as studies_store
from tracker.studies.errors import StudyError
from tracker.studies.jobs import Job, Outcome
from tracker.studies.store import RESULTS, STATUS, Status, Store, Writer, create, find
from tracker.studies.summary import summary_of
from tracker.studies.transfer import packed


def study(folder: Path, **fields: object) -> Store:
    return create(definition(folder, **fields), folder / "studies")


@pytest.mark.full
def test_a_full_disk_is_told_and_gone_on_from(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = study(tmp_path, trials=400, search="random")
    do, keep = made_up(lambda values: 0.5), Writer.keep

    def full(self: Writer, outcome: Outcome) -> None:
        if self.runs == 20:  # SQLite's own bound stands for the disk's
            pages = self._connection.execute("PRAGMA page_count").fetchone()[0]
            self._connection.execute(f"PRAGMA max_page_count = {pages}")
        keep(self, outcome)

    monkeypatch.setattr(Writer, "keep", full)
    with pytest.raises(StudyError, match=r"there is no space left.*study resume"):
        run(store, Serial(do))
    monkeypatch.setattr(Writer, "keep", keep)
    assert store.status().state == "failed"
    before = store.trials()
    assert before
    run(store, Serial(do))
    assert store.trials()[: len(before)] == before
    assert len(store.trials()) == 400


@pytest.mark.parametrize("nth", [1, 2, 3])
def test_a_disk_that_is_full_at_the_start_leaves_a_study_that_can_be_begun(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, nth: int
) -> None:
    store, insert, done = study(tmp_path, trials=2), Writer._insert, 0

    def full(self: Writer, statement: str, *values: object) -> None:
        nonlocal done
        done += 1
        if done == nth:
            raise StudyError("there is no space left")
        insert(self, statement, *values)

    monkeypatch.setattr(Writer, "_insert", full)
    with pytest.raises(StudyError, match="no space left"):
        run(store, Serial(made_up(lambda values: 0.5)))
    monkeypatch.setattr(Writer, "_insert", insert)
    run(store, Serial(made_up(lambda values: 0.5)))
    assert len(store.trials()) == 2


def test_a_reader_finds_all_tables_or_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store, looked = study(tmp_path), 0
    tables = studies_store._TABLES

    def one_by_one() -> Iterator[str]:
        nonlocal looked
        for table in tables:
            assert store.trials() == []
            looked += 1
            yield table

    monkeypatch.setattr(studies_store, "_TABLES", one_by_one())
    with Writer(store.folder):
        assert store.trials() == []
    assert looked == len(tables)


def test_results_that_are_no_database_are_told(tmp_path: Path) -> None:
    store = study(tmp_path, trials=3)
    (store.folder / "results.sqlite3").write_text("nothing of the kind" * 100, encoding="utf-8")
    with pytest.raises(StudyError, match=r"results.sqlite3: cannot be"):
        run(store, Serial(made_up(lambda values: 0.5)))


@pytest.mark.parametrize(
    ("table", "change", "words"),
    [
        ("trials", {"values": True}, "trial 0, values: expected an object, found true"),
        ("trials", {"objectives": []}, "trial 0, objectives: expected 1, found 0"),
        ("trials", {"objectives": ["a"]}, "trial 0, objectives.0: expected a valid number"),
        ("trials", {"jobs": [{"key": 1}]}, "trial 0, jobs.0.key: expected a valid string"),
        ("trials", None, "trial 0: expected JSON, found something else"),
        ("trials", {"jobs": ...}, "trial 0, jobs: expected a value, found none"),
        ("jobs", {"became": "won"}, "became: expected 'done', 'failed'.*found \"won\""),
        ("told", {"key": "luck"}, 'objectives: expected some of .*found "luck"'),
    ],
)
def test_results_that_were_changed_are_told(
    tmp_path: Path, table: str, change: dict[str, object] | None, words: str
) -> None:
    store = study(tmp_path, trials=2)
    run(store, Serial(made_up(lambda values: 0.5)))
    column = {"trials": "told", "jobs": "outcome", "told": "value"}[table]
    own = "name = 'objectives'" if table == "told" else "1"
    with closing(sqlite3.connect(store.folder / RESULTS, isolation_level=None)) as connection:
        place, text = connection.execute(
            f"SELECT rowid, {column} FROM {table} WHERE {own} ORDER BY rowid"
        ).fetchone()
        kept = json.loads(text)
        of = kept[0] if table == "told" else kept
        of |= {key: value for key, value in (change or {}).items() if value is not ...}
        for key, value in (change or {}).items():
            if value is ...:
                del of[key]
        new = "{" if change is None else json.dumps(kept)
        connection.execute(f"UPDATE {table} SET {column} = ? WHERE rowid = ?", (new, place))
        key = kept["key"] if table == "jobs" else ""
    with pytest.raises(StudyError, match=f"{RESULTS}, .*{words}"):
        store.outcome(key) if key else summary_of(store, None)


@pytest.mark.parametrize("text", ["[" * 100_000, '{"state": [1]}', '{"workers": 3.5}', "[]"])
def test_a_spoilt_status_stops_nobody(tmp_path: Path, text: str) -> None:
    store = study(tmp_path, trials=1)
    (store.folder / STATUS).write_text(text)
    assert store.status() == Status()


def test_trials_that_are_gone_are_tried_again(tmp_path: Path) -> None:
    """A study of an earlier version has trials under way that only the sampler's own file knew."""
    store = study(tmp_path, trials=4)
    run(store, Serial(made_up(lambda values: 0.5)))
    before = store.trials()
    with closing(sqlite3.connect(store.folder / RESULTS, isolation_level=None)) as connection:
        connection.execute("DELETE FROM trials WHERE number IN (0, 2)")
    status = run(store, Serial(made_up(lambda values: 0.5)))
    assert (status.state, status.words) == ("done", "")
    assert [one.number for one in store.trials()] == [0, 1, 2, 3]
    assert store.trial(0).values == before[0].values
    assert store.trial(3) == before[3]


def test_a_study_that_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match="expected a study, found none is there"):
        find(None, tmp_path)
    store = study(tmp_path)
    with pytest.raises(StudyError, match='expected the study "smal", found small'):
        find("smal", tmp_path / "studies")
    assert find(str(store.folder), tmp_path).folder == store.folder


def test_a_worker_with_other_code_does_nothing(tmp_path: Path) -> None:
    from dataclasses import replace

    from tracker.studies.recordings import open_recordings
    from tracker.studies.worker import work

    (_, job), *_ = open_recordings(definition(tmp_path)).jobs({})
    outcome = work(replace(job, code="another"))
    assert outcome.became == "version"


def test_the_same_run_has_the_same_key_wherever_it_lies(tmp_path: Path) -> None:
    import shutil

    from tracker.studies.recordings import open_recordings

    made = definition(tmp_path)
    shutil.copytree(tmp_path / "recording", tmp_path / "copy")  # other times of the files
    copy = definition(tmp_path, recordings=["copy"])

    def keys(of: object, values: dict[str, float], seed: int) -> str:
        recordings = open_recordings(of)  # type: ignore[arg-type]
        job: Job = recordings.job(recordings.every[0], values, seed)
        return job.key

    one = keys(made, {}, 0)
    assert keys(copy, {}, 0) == one
    assert keys(made, {"fusion.clutter_rate": 3.0}, 0) == one  # the default
    assert keys(made, {"fusion.clutter_rate": 3.5}, 0) != one
    assert keys(made, {}, 1) != one
    boxes = tmp_path / "copy" / "cam1.csv"
    boxes.write_text(boxes.read_text(encoding="utf-8").replace("20.5", "21.5"), encoding="utf-8")
    assert keys(copy, {}, 0) != one


def test_a_recording_that_is_too_large_is_not_sent(tmp_path: Path) -> None:
    made = definition(tmp_path)
    with pytest.raises(StudyError, match="more than 0 MB are not sent; put it where every worker"):
        packed(Path(made.recordings[0]), limit=100)
    assert len(packed(Path(made.recordings[0]))) > 100


def test_what_is_no_address_is_told_with_where_it_was_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def asked(where: Where) -> str:
        with pytest.raises(CommandError) as told, crew_of(where):
            pass
        return str(told.value)

    monkeypatch.setenv("DASK_SCHEDULER_ADDRESS", "here")
    assert asked(Where()).startswith("$DASK_SCHEDULER_ADDRESS: expected an address as tcp://")
    assert asked(Where(scheduler="there")).startswith("--scheduler: expected an address as tcp://")


def test_nobody_waits_for_the_disk_to_tell_how_far_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store, synced = study(tmp_path), list[int]()
    monkeypatch.setattr(os, "fsync", synced.append)
    with store.running() as writer:
        writer.write_status(Status("running", done=2))
    assert store.folder.joinpath(STATUS).stat().st_size > 0
    assert not synced
    write_whole(tmp_path / "kept", b"kept")
    assert synced
