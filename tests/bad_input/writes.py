"""Every kind of file that the program keeps: how it is written, and what must be in it afterwards.

Of each the number of a write can be read back, so that one that was confirmed is known again.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from app.state.edits import Edits
from app.state.presets import OwnPresets, keep_preset
from app.state.teaching import Drafts
from app.state.workbench import Workbench
from tests.engine import synthetic
from tests.library.runs import RECORDING, run
from tests.rooms.writing import whole_folder
from tests.studies.small import definition
from tests.synthetic import write_sequence
from tests.test_export import PARAMETERS_OF_RUN, SEQUENCE, TRACKS
from tracker.corrections.kinds import make
from tracker.corrections.log import read_log, write_log
from tracker.export import tracks_csv
from tracker.files.atomic import new_folder, write_whole
from tracker.files.validated import read_json, write_json
from tracker.kernels.checked_cache import CheckedFiles
from tracker.library import repair
from tracker.library.store import Library
from tracker.runs.stage_files import StageFiles
from tracker.sequences.reader import read_sequence
from tracker.sequences.sequence import Sequence
from tracker.sequences.writing import saving
from tracker.sequences.writing.teaching import Values, taught_values, with_taught
from tracker.single_view.protocol import ViewResult
from tracker.steps import Steps
from tracker.studies.jobs import Outcome
from tracker.studies.store import Status, Store, Trial, Writer, create

STEP = 2.0**-12
"""Of a number in which the number of a write is told: it is the same when it is read back."""


@dataclass(frozen=True, slots=True)
class Kind:
    """One kind of file."""

    name: str
    make: Callable[[Path], None]
    """What must be there before."""
    write: Callable[[Path, int], object]
    """The write of a number; when it returns, it is confirmed."""
    newest: Callable[[Path], int]
    """The number of the newest write that is there whole, 0 if none is; raises where one is
    spoilt."""


def nothing(folder: Path) -> None:
    """Nothing must be there before."""


# what a person has set


def keep_mine(folder: Path, number: int) -> None:
    keep_preset(folder / "presets.json", "mine", {"fusion.clutter_rate": number * STEP})


def mine(folder: Path) -> int:
    workbench = Workbench()
    OwnPresets(workbench, Edits(workbench), folder / "presets.json")
    assert not list(folder.glob("*.unreadable*"))
    found = workbench.snapshot().presets.get("mine", {"fusion.clutter_rate": 0.0})
    return round(found["fusion.clutter_rate"] / STEP)


def json_value(folder: Path) -> int:
    path = folder / "recent.json"
    return int(read_json(path)) if path.exists() else 0


def room(folder: Path) -> None:
    write_sequence(folder / "room", frames=2, cameras=1, container=None, detections=True)


def widened(sequence: Sequence, number: int) -> Values:
    values = taught_values(sequence)
    values["room"]["max"][0] = 2.0 + number * STEP
    return values


def draft(folder: Path, number: int) -> None:
    sequence = read_sequence(folder / "room")
    Drafts(folder / "unsaved").keep(
        sequence.folder, taught_values(sequence), widened(sequence, number)
    )


def drafted(folder: Path) -> int:
    found = Drafts(folder / "unsaved").read(read_sequence(folder / "room").folder)
    assert not list(folder.glob("unsaved/*.unreadable*"))
    return 0 if found is None else round((found[1]["room"]["max"][0] - 2.0) / STEP)


def save(folder: Path, number: int) -> None:
    saved = read_sequence(folder / "room")
    saving.save(with_taught(saved, widened(saved, number), "room"), saved)


def saved(folder: Path) -> int:
    sequence = read_sequence(folder / "room")
    for backup in (folder / "room").glob(f"{saving.BACKUP}*"):
        assert "format" in backup.read_text(encoding="utf-8")  # none is empty or cut off
    return max(0, round((float(sequence.room.maximum[0]) - 2.0) / STEP))


def correct(folder: Path, number: int) -> None:
    write_log(folder / "corrections.toml", [make(kind="checked", first=0, last=number)])


def corrected(folder: Path) -> int:
    found = read_log(folder / "corrections.toml")
    return int(found[0].last or 0) if found else 0


# results


def keep_run(folder: Path, number: int) -> None:
    with Library(folder / "library.sqlite3") as library:
        library.star(library.keep(RECORDING, run(number, key=f"run-{number}"), budget=10**9))


def kept_runs(folder: Path) -> int:
    path = folder / "library.sqlite3"
    if not path.exists():
        return 0
    assert repair.check(path).complaints == ()
    with Library(path) as library:
        found = library.runs()
        for one in found[:3]:
            library.result(one.id)
        keys = {int(one.key.removeprefix("run-")) for one in found}
    return _without_gap(keys)


def _without_gap(numbers: set[int]) -> int:
    newest = max(numbers, default=0)
    assert numbers == set(range(1, newest + 1)), "one that was confirmed before is lost"
    return newest


def export_tracks(folder: Path, number: int) -> None:
    tracks_csv.save_tracks_csv(folder / "tracks.csv", SEQUENCE, TRACKS, PARAMETERS_OF_RUN, number)


def exported(folder: Path) -> int:
    path = folder / "tracks.csv"
    if not path.exists():
        return 0
    found = tracks_csv.read_tracks_csv(path)
    assert len(found) == len(TRACKS)
    return int(found.settings["seed"])


def copy(folder: Path, number: int) -> None:
    sequence = read_sequence(folder / "room")
    saving.save_copy(sequence, sequence, folder / f"copy-{number}")


def copies(folder: Path) -> int:
    found = list(folder.glob("copy-*"))
    return _without_gap({int(read_sequence(one).folder.name.split("-")[1]) for one in found})


# studies


def study(folder: Path) -> None:
    create(definition(folder), folder / "studies")


def end_trial(folder: Path, number: int) -> None:
    with Writer(folder / "studies" / "small") as writer:
        if number not in Store(folder / "studies" / "small").running_trials():
            writer.begin(number, {"fusion.clutter_rate": 1.0 + number})
        writer.keep(Outcome(f"key-{number}", "done", figures={"score": 0.5}))
        writer.end(Trial(number, "complete", {}, (0.5,), (0.0,), {}, False, "", 1.0, ()))
        writer.write_status(Status("running", done=number))


def ended_trials(folder: Path) -> int:
    store = Store(folder / "studies" / "small")
    trials = store.trials()
    for trial in trials[-3:]:
        assert store.outcome(f"key-{trial.number}") is not None
    assert store.status().done <= len(trials)
    assert set(store.running_trials()) <= {len(trials) + 1}
    return _without_gap({trial.number for trial in trials})


# what can be made again, and must never be taken for what it is not


@cache
def _column() -> Steps[tuple[ViewResult, ...]]:
    boxes, ones = np.ones((50, 4)), np.ones(50)
    return Steps.of([(ViewResult.of_boxes(boxes, ones, synthetic.np.ones((50, 4))),)] * 20,
                    ViewResult, 1)  # fmt: skip


def keep_column(folder: Path, number: int) -> None:
    assert StageFiles(folder / "stages").write(f"key-{number}", _column())


def kept_columns(folder: Path) -> int:
    files = StageFiles(folder / "stages")
    found = {int(path.name.split("-")[1]) for path in (folder / "stages").glob("key-*")}
    for number in sorted(found)[-3:]:
        assert files.read(f"key-{number}", frames=20, cameras=1) is not None
    return _without_gap(found)


def _kernel(folder: Path) -> CheckedFiles:
    return CheckedFiles(str(folder), "a_kernel", ("stamp", 1))


def keep_kernel(folder: Path, number: int) -> None:
    _kernel(folder).save("signature", {"number": number, "code": "x" * 5000})


def kept_kernel(folder: Path) -> int:
    found = _kernel(folder).load("signature")
    return 0 if found is None else int(found["number"])


def fill(folder: Path, number: int) -> None:
    with new_folder(folder / f"imported-{number}") as begun:
        for part in range(5):
            (begun / f"{part}.txt").write_text(str(number))


def render(folder: Path, number: int) -> None:
    with whole_folder(folder / f"imported-{number}") as begun:
        write_sequence(begun, frames=2, cameras=1, container=None)
        for part in range(5):
            (begun / f"{part}.txt").write_text(str(number))


def filled(folder: Path) -> int:
    numbers = set()
    for path in folder.glob("imported-*"):
        number = int(path.name.split("-")[1])
        assert [(path / f"{part}.txt").read_text() for part in range(5)] == [str(number)] * 5
        numbers.add(number)
    return _without_gap(numbers)


def whole(folder: Path, number: int) -> None:
    write_whole(folder / "whole.json", json.dumps([number] * 500).encode())


def held(folder: Path) -> int:
    path = folder / "whole.json"
    if not path.exists():
        return 0
    (number,) = set(json.loads(path.read_bytes()))
    return int(number)


KINDS = {
    kind.name: kind
    for kind in (
        Kind("presets", nothing, keep_mine, mine),
        Kind(
            "recent", nothing, lambda folder, n: write_json(folder / "recent.json", n), json_value
        ),
        Kind("draft", room, draft, drafted),
        Kind("sequence", room, save, saved),
        Kind("corrections", nothing, correct, corrected),
        Kind("library", nothing, keep_run, kept_runs),
        Kind("tracks", nothing, export_tracks, exported),
        Kind("copy", room, copy, copies),
        Kind("study", study, end_trial, ended_trials),
        Kind("column", nothing, keep_column, kept_columns),
        Kind("kernel", nothing, keep_kernel, kept_kernel),
        Kind("import", nothing, fill, filled),
        Kind("rendering", nothing, render, filled),
        Kind("whole", nothing, whole, held),
    )
}
"""By name."""
