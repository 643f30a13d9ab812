"""What holds when processes are killed, and when a cluster does the work."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import Any

import pytest

from app.command.main import main
from tests.studies.processes import cluster, finish, kill, outcomes, start, wait, workers_of
from tests.studies.small import Serial, definition, recording, run
from tracker.export.exported_run import ExportedRun, Options
from tracker.export.registry import format_of, save
from tracker.parameters.values import with_values
from tracker.runs import pipeline
from tracker.sequences.library import open_sequence
from tracker.studies import transfer, worker
from tracker.studies.recordings import open_recordings
from tracker.studies.store import Store, Writer, create
from tracker.studies.summary import changes_of, track_commands
from tracker.studies.worker import tracks_hash

pytestmark = [
    pytest.mark.full,
    pytest.mark.skipif(sys.platform != "linux", reason="finds processes by /proc"),
]


def study(folder: Path, name: str = "small", **fields: Any) -> Store:
    fields = {"trials": 12, "seeds": 2, "search": "random", "prune": False, **fields}
    return create(definition(folder, name, **fields), folder / "studies")


def done(store: Store) -> int:
    return len(store.trials())


def check_whole(store: Store, trials: int = 12) -> None:
    """Every trial once, every run kept."""
    assert [one.number for one in store.trials()] == list(range(trials))
    keys = {row.key for one in store.trials() for row in one.jobs}
    assert keys == set(outcomes(store))


def test_program_and_worker_are_killed_and_nothing_is_lost_or_run_twice(tmp_path: Path) -> None:
    store = study(tmp_path, trials=40)
    program = start(store, "--workers", "2")
    wait(lambda: done(store) >= 3)
    kill(program.pid)
    program.wait()
    assert store.status().state == "stopped"
    before, runs = store.trials(), outcomes(store)
    assert 3 <= len(before) < 40
    program = start(store, "--workers", "2")
    wait(lambda: done(store) >= len(before) + 2)
    kill(workers_of(program.pid)[0])
    assert program.wait(timeout=600) == 0
    check_whole(store, 40)
    assert [store.trial(one.number) for one in before] == before
    assert {key: outcomes(store)[key] for key in runs} == runs
    status = store.status()
    assert status.runs == len(outcomes(store)) - len(runs), "what had ended was not run again"


def test_a_killed_scheduler_is_told_and_another_gives_the_same_bit_for_bit(tmp_path: Path) -> None:
    there = study(tmp_path, "there", trials=40)
    with cluster(where=tmp_path) as (address, processes):
        program = start(there, "--scheduler", address)
        wait(lambda: done(there) >= 2)
        kill(processes[0].pid)
        assert program.wait(timeout=600) == 1
    assert there.status().state == "failed"
    assert f"the scheduler at {address} is gone" in there.status().words
    before, runs = there.trials(), outcomes(there)
    assert len(before) < 40
    with cluster(where=tmp_path) as (address, _):
        finish(there, "--scheduler", address)
    check_whole(there, 40)
    assert [there.trial(one.number) for one in before] == before
    assert {key: outcomes(there)[key] for key in runs} == runs
    # the same trials one after another in this process
    here = create(there.definition().model_copy(update={"name": "here"}), tmp_path / "studies")
    with Writer(here.folder) as writer:
        for one in there.trials():
            writer.begin(one.number, one.values)
    run(here, Serial())
    assert outcomes(here) == outcomes(there)
    assert [one.objectives for one in here.trials()] == [one.objectives for one in there.trials()]


def test_a_recording_goes_where_it_cannot_be_read(
    tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    """On a worker whose cache is another one, and where the recording is not."""
    place = recording(tmp_path / "recording", frames=23)  # this process has opened no other such
    (_, job), *_ = open_recordings(definition(tmp_path)).jobs({})
    data = transfer.packed(place)
    request.getfixturevalue("own_cache")  # only now: the recording was read with another one
    place.rename(tmp_path / "elsewhere")
    assert worker.work(job).became == "unreadable"
    transfer.unpack(job.content, data)
    assert worker.work(job).became == "done"


def test_the_command_of_a_trial_gives_the_same_tracks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = study(tmp_path, trials=4, seeds=1, parameters={
        "fusion.detection_probability": {"low": 0.6, "high": 0.98},
        "fusion.clutter_rate": {"low": 0.1, "high": 10.0, "log": True},
        "fusion.recognition": {},
        "smoothing_method": {},
    })  # fmt: skip
    run(store, Serial())
    monkeypatch.chdir(tmp_path)
    for trial in store.trials():
        (row,) = trial.jobs
        (line,) = track_commands(store.definition(), trial)
        words = shlex.split(line)
        assert words[0] == "multiview-phd"
        assert main([*words[1:], "--keep", "0"]) == 0
        # the run of the study, made again here: its tracks are those that were kept, and their
        # CSV is the one that the command wrote
        sequence = open_sequence(row.recording)
        changes = changes_of(store.definition(), trial, row.recording)
        parameters = with_values(pipeline.default_parameters(sequence), changes)
        again = pipeline.compute(sequence, parameters, seed=row.seed)
        kept = store.outcome(row.key)
        assert kept is not None
        assert tracks_hash(again) == kept.tracks
        file = tmp_path / words[words.index("-o") + 1]
        expected = tmp_path / "expected.csv"
        written = ExportedRun(sequence, again.tracks, parameters, row.seed)
        save(expected, format_of(expected, None), written, Options())
        assert file.read_bytes() == expected.read_bytes()
