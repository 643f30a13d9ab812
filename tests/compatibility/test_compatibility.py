"""What earlier versions wrote still opens, and says what it said.

The examples beside this file are never made again; ``make.py`` tells how they were made. Whatever
today's program makes of a rendered room that an example names, it opens it or says in a sentence
why it cannot. Scores are left out: they are computed again where they cannot be trusted.
"""

from __future__ import annotations

import csv
import hashlib
import json
import shutil
import sqlite3
import time
import tomllib
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from itertools import compress
from pathlib import Path
from typing import Any
from urllib.parse import parse_qsl

import numpy as np
import pytest
from starlette.testclient import TestClient

from app.command.main import main
from app.web.dependencies import Settings
from app.web.server import create_app
from tests.app import conftest
from tests.studies.small import Serial, run
from tracker.export import read_tracks_csv
from tracker.kernels.compilation import kernel_folder
from tracker.library.bundle import unpack_bundle
from tracker.library.store import Library
from tracker.parameters.catalogue import REMOVED
from tracker.parameters.values import removed_notes
from tracker.sequences.library import open_sequence
from tracker.studies.jobs import figures_version
from tracker.studies.store import find

HERE = Path(__file__).resolve().parent
ADDRESSES = json.loads((HERE / "addresses.json").read_text(encoding="utf-8"))
RUNS = json.loads((HERE / "library.json").read_text(encoding="utf-8"))
SAID = tomllib.loads((HERE / "crossing" / "corrections.toml").read_text(encoding="utf-8"))
NOT_IN_THE_CACHE = ("room24-2p", "room35-2p", "random-771")
"""Rooms that addresses name and that would have to be rendered first."""
ALL_KINDS = {
    "same", "different", "exchanged", "here", "nobody", "came", "left", "name", "checked"
}  # fmt: skip
HELD, CORRECTED = "4", "1"
"""Runs of ``crossing`` in the library: without corrections and with them."""
OF_ROOMS = ("8", "9", "10")
"""Of ``random-3``, ``room44-3p`` and ``room24-2p`` with three cameras, as rendered then."""


@dataclass(frozen=True)
class Home:
    """A person's files in folders of a test."""

    folder: Path
    library: Path
    studies: Path
    recordings: Path
    crossing: Path

    def place(self, text: str) -> str:
        """A place as an example names it, where it lies now."""
        for word in ("recordings", "cache"):
            text = text.replace(f"/{word}/", f"{self.folder}/{word}/")
        return text


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Home:
    """The examples where the program looks for a person's files."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(kernel_folder()))
    for name in ("CACHE", "SETTINGS", "STUDIES"):
        monkeypatch.setenv(f"MULTIVIEW_PHD_{name}", str(tmp_path / name.lower()))
    recordings = tmp_path / "recordings"
    made = Home(
        tmp_path, tmp_path / "library.sqlite3", tmp_path / "studies", recordings,
        recordings / "crossing",
    )  # fmt: skip
    monkeypatch.setenv("MULTIVIEW_PHD_LIBRARY", str(made.library))
    for name in ("cache", "settings", "studies"):
        shutil.copytree(HERE / name, tmp_path / name)
    shutil.copytree(HERE / "crossing", made.crossing)
    shutil.copyfile(HERE / "library.sqlite3", made.library)
    results = "studies/half/results.sqlite3"
    for name, table, column in (
        ("library.sqlite3", "recordings", "place"), (results, "told", "value"),
        (results, "trials", "told"),
    ):  # fmt: skip
        with closing(sqlite3.connect(tmp_path / name, isolation_level=None)) as file:
            for word in ("recordings", "cache"):
                file.execute(
                    f"UPDATE {table} SET {column} = replace({column}, ?, ?)",
                    (f"/{word}/", made.place(f"/{word}/")),
                )
    rooms = tmp_path / "cache" / "rooms" / "version-4"
    named = {"crossing": made.crossing, "random-3": rooms / "random" / "random-3"}
    for path in [*tmp_path.glob("settings/**/*.*"), tmp_path / "studies/half/study.toml"]:
        text = path.read_text(encoding="utf-8")
        path.write_text(made.place(text), encoding="utf-8")
        own, dot, rest = path.name.partition(".")
        if own in named:
            path.rename(path.with_name(f"{digest_of(str(named[own]).encode())}{dot}{rest}"))
    return made


def digest_of(content: bytes) -> str:
    """Of some bytes, short."""
    return hashlib.sha256(content).hexdigest()[:16]


def facts_of(result: Any) -> dict[str, Any]:
    """What a run of the library is, but for its scores; its tracks and parameters by a digest."""
    run, kept = result.run, result.kept
    tracks = kept.tracks
    columns = {
        "frames": tracks.frames.astype("<i8"),
        "ids": tracks.ids.astype("<i8"),
        "positions": tracks.positions.astype("<f8"),
        "existences": tracks.existences.astype("<f4"),
        "sigmas": tracks.sigmas.astype("<f4"),
        "seen": tracks.seen.astype("u1"),
        "detection_probabilities": np.rint(1000.0 * kept.detection_probabilities).astype("<i4"),
    }
    parameters = json.dumps(result.values, sort_keys=True).encode()
    return {
        "place": result.place,
        "recording": run.recording_name,
        "began": run.began,
        "steps": run.steps,
        "methods": [run.single_view, run.fusion_method],
        "changes": run.changes,
        "seed": run.seed,
        "version": run.version,
        "source": run.source,
        "targets": run.targets,
        "name": run.name,
        "star": run.star,
        "note": run.note,
        "tags": run.tags,
        "corrected": run.corrected,
        "corrections": [one["id"] for one in result.corrections],
        "rows": len(tracks),
        "tracks": {name: digest_of(column.tobytes()) for name, column in columns.items()},
        "parameters": digest_of(parameters),
    }


def command(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[int, str, str]:
    """Run a command in this process: status, standard output, standard error."""
    capsys.readouterr()
    status = main([str(word) for word in words])
    told = capsys.readouterr()
    return status, told.out, told.err


def rows_of(text: str) -> list[list[str]]:
    """The table of a track file, its header first."""
    return list(csv.reader(line for line in text.splitlines() if not line.startswith("#")))


def settings_of(text: str) -> dict[str, str]:
    """The comments ``# key = value`` of a track file."""
    lines = (line[1:].partition("=") for line in text.splitlines() if line.startswith("#"))
    return {key.strip(): value.strip() for key, equals, value in lines if equals}


@contextmanager
def page(home: Home, sequence: str | None = None, draft: bool = False) -> Iterator[TestClient]:
    """The workbench with the person's files, a sequence open in it.

    Args:
        home: Where they are.
        sequence: Its name; None opens none.
        draft: Whether there is what was taught and not saved: it makes a run of its own.
    """
    if not draft:
        shutil.rmtree(home.folder / "settings" / "unsaved")
    settings = Settings(
        sequence=sequence, data=home.recordings, with_viser=False, keep_on_disk=True,
        library=home.library, keep=0,
    )  # fmt: skip
    with TestClient(create_app(settings), base_url="http://127.0.0.1:8000") as client:
        if sequence is not None:
            until(lambda: state_of(client)["sequence"] is not None)
        yield client


def state_of(client: TestClient) -> dict[str, Any]:
    state: dict[str, Any] = client.get("/api/state").json()
    return state


def value_in(state: dict[str, Any], key: str) -> Any:
    """The value that a parameter, or the choice of a method, has."""
    found = {**state["methods"], **state["parameters"]}
    return found[key]


def opened_as(client: TestClient) -> str | None:
    """What opened the sequence that is open."""
    sequence = state_of(client)["sequence"]
    return sequence and str(sequence["opened_as"])


def until(holds: Callable[[], bool], seconds: float = 120.0) -> None:
    """Wait for something that another thread brings about; it may compile kernels first."""
    deadline = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < deadline, "it did not come about in time"
        time.sleep(0.01)


def assert_refused(answer: Any) -> None:
    """Refused in a sentence that says what to do."""
    assert answer.status_code in (404, 409, 422), answer.text
    told = answer.json()
    assert len(told["detail"]) > 20
    assert "Traceback" not in told["detail"]
    assert "\n" not in told["detail"]
    assert told["hint"]


def assert_told(error: str) -> None:
    """A command that failed says so in a sentence."""
    last = error.strip().splitlines()[-1]
    assert len(last) > 30
    assert "Traceback" not in error
    assert "unexpected" not in last


# the library


def test_the_library_lists_each_run_with_its_tracks_and_what_a_person_wrote(home: Home) -> None:
    with Library(home.library) as library:
        found = {str(run.id): facts_of(library.result(run.id)) for run in library.runs()}
        for run in library.runs():
            result = library.result(run.id)
            plain = result.parameters.model_dump()
            for key, value in run.changes.items():
                group, _, name = key.rpartition(".")
                taken = plain[group][name] if group else plain[name]
                assert taken == value or key in result.unknown
            notes = {str(run.id): run.removed for run in library.runs()}
    wanted = {}
    for number, run in RUNS.items():
        # a parameter that no longer exists is no change of now, and named in a note
        changes = {key: value for key, value in run["changes"].items() if key not in REMOVED}
        wanted[number] = {**run, "place": home.place(run["place"]), "changes": changes}
        assert sorted(notes[number]) == sorted(removed_notes(run["changes"]))
    assert found == wanted  # the deleted run is not among them


def test_what_a_person_deleted_can_be_listed_no_more_and_new_runs_are_kept_beside(
    home: Home, capsys: pytest.CaptureFixture[str]
) -> None:
    status, _, _ = command(
        capsys, "track", home.crossing, "-o", home.folder / "new.csv", "--seed", 4
    )
    assert status == 0
    status, listed, _ = command(capsys, "runs", "list")
    assert status == 0
    lines = listed.strip().splitlines()[1:]
    assert len(lines) == len(RUNS) + 1
    assert any("the café's rival" in line and "steadier where Zoë sits" in line for line in lines)


@pytest.mark.parametrize("number", RUNS)
def test_a_kept_run_is_exported_or_told_of(
    home: Home, capsys: pytest.CaptureFixture[str], number: str
) -> None:
    out = home.folder / "out.csv"
    status, _, error = command(capsys, "runs", "export", number, "-o", out)
    if status != 0:
        assert RUNS[number]["recording"] != "crossing", error
        assert_told(error)
        return
    tracks = read_tracks_csv(out)
    with Library(home.library) as library:
        kept = library.result(int(number)).kept.tracks
    assert len(tracks) == RUNS[number]["rows"]
    np.testing.assert_array_equal(tracks.frames, kept.frames)
    np.testing.assert_array_equal(tracks.ids, kept.ids)
    np.testing.assert_allclose(tracks.positions, kept.positions, atol=6e-5)


@pytest.mark.full
def test_kept_runs_are_shown_on_the_page_or_told_of(home: Home) -> None:
    # without corrections: what obeys other ones than the recording has now is computed anew
    (home.crossing / "corrections.toml").unlink()
    shutil.rmtree(home.folder / "settings" / "corrections")
    with Library(home.library) as library, page(home) as client:
        for number in (HELD, CORRECTED, *OF_ROOMS):
            answer = client.post(f"/api/library/runs/{number}/open")
            if answer.status_code != 200:
                assert number in OF_ROOMS, answer.text
                assert_refused(answer)
                continue
            until(lambda number=number: state_of(client)["run"]["kept"] == int(number))
            shown = rows_of(client.get("/api/export/tracks.csv").text)[1:]
            kept, state = library.result(int(number)).kept.tracks, state_of(client)
            if (frames := state["sequence"]["frames"]) < RUNS[number]["steps"]:
                assert number in OF_ROOMS
                (warning,) = state["run"]["warnings"]
                assert f"{RUNS[number]['steps']} steps" in warning
                kept = kept.take(kept.frames < frames)
            assert [(int(row[0]), int(row[2])) for row in shown] == list(
                zip(kept.frames.tolist(), kept.ids.tolist(), strict=True)
            )


# corrections


def test_a_log_has_every_kind_of_correction_and_all_that_it_says_is_read(
    home: Home, capsys: pytest.CaptureFixture[str]
) -> None:
    status, told, _ = command(capsys, "corrections", "list", home.crossing, "--json")
    assert status == 0
    read = json.loads(told)
    assert {one["kind"] for one in read} == ALL_KINDS
    written = SAID["correction"]
    assert [one["id"] for one in read] == [one["id"] for one in written]
    for one, other in zip(read, written, strict=True):
        time = other["time"].isoformat().replace("+00:00", "Z")
        assert {**other, "time": time} == {key: one[key] for key in other}


def test_corrections_give_the_track_file_that_they_gave(
    home: Home, capsys: pytest.CaptureFixture[str]
) -> None:
    out = home.folder / "again.csv"
    status, _, error = command(capsys, "track", home.crossing, "-o", out, "--keep", 0)
    assert status == 0, error
    kept = (HERE / "tracks.csv").read_text(encoding="utf-8")
    found, given = rows_of(out.read_text(encoding="utf-8")), rows_of(kept)
    # how sure a position is was estimated from the recording only later
    sure = [name.startswith("sigma") for name in given[0]]
    assert sum(sure) == 3
    without = [[[*compress(row, np.logical_not(sure))] for row in rows] for rows in (found, given)]
    assert without[0] == without[1]


@pytest.mark.parametrize(
    ("number", "words"),
    [
        (HELD, ["--no-corrections"]),
        (CORRECTED, []),
        ("5", [
            "--fusion", "sequential_phd", "--smoothing", "positions", "--seed", "3",
            "--set", "fusion.clutter_rate=1.5", "--set", "fusion.detection_probability=0.85",
        ]),
        ("6", ["--preset", "published"]),
    ],
)  # fmt: skip
def test_corrections_give_the_tracks_that_they_gave(
    home: Home, capsys: pytest.CaptureFixture[str], number: str, words: list[str]
) -> None:
    library = home.folder / "again.sqlite3"
    places = ("-o", home.folder / "again.csv", "--library", library)
    status, _, error = command(capsys, "track", home.crossing, *places, *words)
    assert status == 0, error
    with Library(library) as again, Library(home.library) as before:
        found, given = again.result(1).kept, before.result(int(number)).kept
    for name in ("frames", "ids", "seen"):
        np.testing.assert_array_equal(getattr(found.tracks, name), getattr(given.tracks, name))
    # the examples were made on another machine, and linear algebra rounds by the processor; how
    # sure a position is was estimated from the recording only later
    np.testing.assert_allclose(found.tracks.positions, given.tracks.positions, atol=1e-9)
    np.testing.assert_allclose(found.tracks.existences, given.tracks.existences, atol=1e-6)
    probabilities = found.detection_probabilities, given.detection_probabilities
    np.testing.assert_allclose(*probabilities, atol=0.0011)  # stored in thousandths


def test_what_was_said_last_can_be_taken_back_after_a_start(home: Home) -> None:
    with page(home, "crossing") as client:
        ids = [one["id"] for one in SAID["correction"]]
        until(lambda: state_of(client)["edits"]["undo"] is not None)
        answer = conftest.command(client, "undo")
        assert answer.status_code == 200, answer.text
        log = tomllib.loads((home.crossing / "corrections.toml").read_text(encoding="utf-8"))
        assert [one["id"] for one in log["correction"]] == ids[:-1]
        assert conftest.command(client, "redo").status_code == 200
        log = tomllib.loads((home.crossing / "corrections.toml").read_text(encoding="utf-8"))
        assert log == SAID


def test_corrections_of_a_rendered_room_are_in_the_settings(
    home: Home, capsys: pytest.CaptureFixture[str]
) -> None:
    status, told, error = command(capsys, "corrections", "list", "random-3")
    if status == 0:
        assert "Ada" in told
        assert "room-2" in told
    else:
        assert_told(error)


# settings


def test_presets_of_ones_own_are_listed_and_applied(home: Home) -> None:
    with page(home, "crossing") as client:
        known = state_of(client)
        assert known["presets"] == ["Dim room", "Zoë's café, late"]
        for name, values in (
            ("Dim room", {"fusion.detection_probability": 0.8}),
            (
                "Zoë's café, late",
                {
                    "fusion_method": "sequential_phd",
                    "colour_phd.spread_starts": False,
                    "fusion.detection_probability": 0.8,
                    "fusion.clutter_rate": 1.5,
                },
            ),
        ):
            answer = conftest.command(client, "apply_preset", preset=name)
            assert answer.status_code == 200, answer.text
            now = answer.json()
            assert {key: value_in(now, key) for key in now["changed"]} == values
            assert now["preset"] == name


def test_what_was_taught_and_not_saved_is_taken_up_again(home: Home) -> None:
    with page(home, "crossing", draft=True) as client:
        state = state_of(client)
        assert state["teaching"]["unsaved"] > 0
        copied = conftest.command(client, "copy_taught", folder=str(home.folder / "taught"))
        assert copied.status_code == 204, copied.text
    taught = open_sequence(home.folder / "taught")
    assert taught.room.maximum.tolist() == [1.5, 1.5, 2.25]
    assert taught.target_half_extents.tolist() == [0.1, 0.11, 0.125]
    assert [place.position.tolist() for place in taught.room.entrances] == [
        [-1.2, 0.0, 1.0], [1.2, 0.0, 1.0], [0.0, -1.2, 1.0],
    ]  # fmt: skip


def test_recordings_that_were_open_are_among_the_recent_ones(home: Home) -> None:
    with page(home) as client:
        listed = client.get("/api/recordings").json()["recordings"]
    (recent,) = [one for one in listed if one["kind"] == "recent"]
    assert (recent["name"], recent["opens"]) == ("crossing", str(home.crossing))
    assert (recent["cameras"], recent["frames"], recent["fps"]) == (3, 120, 25.0)


# a study


def test_a_study_that_was_stopped_is_shown_with_its_trials(
    home: Home, capsys: pytest.CaptureFixture[str]
) -> None:
    out = home.folder / "half.json"
    status, listed, _ = command(capsys, "study", "list")
    assert status == 0
    assert listed.split()[-1] != "running"
    assert any(line.split()[:4] == ["half", "stopped", "3", "6"] for line in listed.splitlines())
    assert command(capsys, "study", "export", "half", "-o", out)[0] == 0
    with closing(sqlite3.connect(HERE / "studies/half/results.sqlite3")) as file:
        written = [json.loads(text) for (text,) in file.execute("SELECT told FROM trials")]
    assert len(written) == 3
    status, shown, _ = command(capsys, "study", "show", "half", 2, "--json")
    assert status == 0
    trial = json.loads(shown)
    assert trial["values"] == written[2]["values"]
    assert trial["objectives"] == written[2]["objectives"]
    assert len(trial["runs"]) == 1
    text = out.read_text(encoding="utf-8")
    for one in written:
        assert json.dumps(one["values"]["fusion.clutter_rate"]) in text


def test_a_study_of_another_version_is_refused_in_a_sentence_and_stays_as_it_is(
    home: Home, capsys: pytest.CaptureFixture[str]
) -> None:
    store = find("half", home.studies)
    before = store.trials()
    with closing(sqlite3.connect(store.folder / "results.sqlite3", isolation_level=None)) as file:
        file.execute("""UPDATE told SET value = '"another"' WHERE name = 'code'""")
    status, _, error = command(capsys, "study", "resume", "half", "--workers", 1)
    assert status == 1
    assert_told(error)
    assert store.trials() == before


def test_a_study_that_was_stopped_goes_on_with_its_next_trial(home: Home) -> None:
    store = find("half", home.studies)
    before = store.trials()
    # only the version that began a study goes on with it: let it be this one
    with closing(sqlite3.connect(store.folder / "results.sqlite3", isolation_level=None)) as file:
        own = (json.dumps(figures_version()),)
        file.execute("UPDATE told SET value = ? WHERE name = 'code'", own)
    crew = Serial()
    status = run(store, crew, stopped=lambda: len(store.trials()) > len(before))
    first, second, third, *new = store.trials()
    assert [first, second, third] == before, "what had ended is as it was"
    assert new[0].state == "complete", new
    assert new[0].number == 3
    assert 0.1 <= new[0].values["fusion.clutter_rate"] <= 10.0
    assert len(crew.done) == 1, "nothing that had ended is computed again"
    assert status.state == "stopped"


# files that leave the program


def test_a_bundle_opens_with_its_recording_its_corrections_and_its_tracks(home: Home) -> None:
    result = unpack_bundle(HERE / "bundle.zip", home.folder / "bundle")
    kept, held = facts_of(result), RUNS[CORRECTED]
    kept.pop("place")
    assert kept == {key: value for key, value in held.items() if key != "place"}
    recording, own = open_sequence(result.place), open_sequence(home.crossing)
    assert (recording.name, recording.frames, recording.fps) == ("crossing", 120, 25.0)
    for view, other in zip(recording.views, own.views, strict=True):
        assert view.camera.name == other.camera.name
        assert view.detections is not None
        assert other.detections is not None
        np.testing.assert_array_equal(view.detections.frames, other.detections.frames)
        np.testing.assert_allclose(view.detections.boxes, other.detections.boxes, rtol=1e-8)
    assert recording.ground_truth is not None
    assert own.ground_truth is not None
    np.testing.assert_array_equal(recording.ground_truth.ids, own.ground_truth.ids)
    settings = Settings(run=result, with_viser=False, sequence=result.place)
    with TestClient(create_app(settings), base_url="http://127.0.0.1:8000") as client:
        until(lambda: state_of(client)["run"]["kept"] is not None)
        shown = rows_of(client.get("/api/export/tracks.csv").text)
    assert len(shown) - 1 == held["rows"]


def test_a_track_file_is_read_back_row_for_row(
    home: Home, capsys: pytest.CaptureFixture[str]
) -> None:
    file = HERE / "tracks.csv"
    text = file.read_text(encoding="utf-8")
    head, *rows = rows_of(text)
    cameras = ("left", "right", "back")
    boxes = [
        f"{camera}_{side}" for camera in cameras for side in ("left", "top", "width", "height")
    ]
    assert head == [
        "frame", "time", "id", "x", "y", "z", "existence", "sigma_x", "sigma_y", "sigma_z",
        "name", "correction", *boxes,
    ]  # fmt: skip
    read = read_tracks_csv(file)
    assert len(read) == len(rows) == RUNS[CORRECTED]["rows"]
    assert read.covariances_xy is None  # which a later version added, as heights
    assert read.heights is read.sigma_heights is None
    numbers = np.array([[float(cell or "nan") for cell in row[:10] + row[12:]] for row in rows])
    columns = [
        read.frames, read.times, read.ids, *read.positions.T, read.existences, *read.sigmas.T,
        *(side for camera in cameras for side in read.boxes[camera].T),
    ]  # fmt: skip
    np.testing.assert_array_equal(np.column_stack(columns), numbers)
    settings = settings_of(text)
    assert dict(read.settings) == settings
    assert settings["sequence"] == "crossing"
    assert settings["fusion_method"] == "multi_bernoulli"
    status, told, error = command(capsys, "evaluate", home.crossing, file)
    assert status == 0, error
    assert "IDF1" in told


def test_every_field_of_a_sequence_is_read() -> None:
    folder = HERE / "fields"
    one = open_sequence(folder)
    assert (one.name, one.description) == ("every field", "as it stands in the manual")
    assert (one.fps, one.frames) == (20.0, 8)
    assert one.room.minimum.tolist() == [-2.0, -1.5, 0.0]
    assert one.room.maximum.tolist() == [2.0, 1.75, 2.5]
    assert [(e.position.tolist(), e.sigma.tolist()) for e in one.room.entrances] == [
        ([-1.8, 0.25, 0.9], [0.2, 0.3, 0.1]),
        ([1.8, -0.5, 0.85], [0.25, 0.35, 0.15]),
    ]
    assert one.target_half_extents.tolist() == [0.25, 0.3, 0.85]
    assert [(t.name, t.camera, t.frame, t.box.tolist()) for t in one.templates] == [
        ("Ann", "door1", 3, [20.5, 10.0, 10.0, 24.0]),
        ("Ben", "near2", 5, [26.0, 10.0, 10.0, 24.25]),
    ]
    truth = one.ground_truth
    assert truth is not None
    assert truth.known is not None
    assert truth.known.tolist() == [True, True, True, True, False, True, True, True]
    assert truth.frames.tolist() == [0, 0, 1, 1, 2, 2, 3, 3, 5, 5, 6, 6, 7, 7]
    assert truth.ids.tolist() == [1, 4] * 7
    assert truth.positions[5].tolist() == [0.4, 0.25, 0.9]
    assert np.flatnonzero(~truth.valid).tolist() == [5]
    assert one.warnings == ()


def test_every_field_of_a_camera_is_read() -> None:
    folder = HERE / "fields"
    door, near, above = open_sequence(folder).views
    cameras = [view.camera for view in (door, near, above)]
    assert [camera.name for camera in cameras] == ["door1", "near2", "above3"]
    assert [camera.image_size for camera in cameras] == [(64, 48)] * 3
    assert [camera.fisheye for camera in cameras] == [False, True, False]
    assert cameras[0].intrinsics.tolist() == [[50, 0, 31.5], [0, 52, 23.5], [0, 0, 1]]
    assert cameras[0].distortion.tolist() == [-0.1, 0.02, 0.001, -0.002, 0.003]
    assert cameras[0].rotation.tolist() == [[0, 1, 0], [0, 0, -1], [-1, 0, 0]]
    assert cameras[0].translation.tolist() == [0, 1, 4]
    assert cameras[1].distortion.tolist() == [0.01, -0.02, 0.003, -0.004]
    np.testing.assert_allclose(
        cameras[2].intrinsics, [[50, 0, 31.5], [0, 50, 23.5], [0, 0, 1]], atol=1e-9
    )
    np.testing.assert_allclose(cameras[2].rotation, [[0, -1, 0], [0, 0, -1], [1, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(cameras[2].translation, [0, 1, 4], atol=1e-12)
    assert (door.video, near.video, above.video) == (folder / "door1.avi", None, None)
    assert near.images == tuple(folder / "near" / f"{k:03d}.png" for k in range(9))
    assert (door.background, near.background) == (folder / "empty.png", range(2))
    # first_frame = 2, fps = 25, time_offset = -0.05: step k shows frame 2 + 25 (k / 20 + 0.05)
    assert [door.frame_at(step) for step in range(8)] == [3, 5, 6, 7, 8, 9, 11, 12]
    assert [near.frame_at(step) for step in range(8)] == list(range(8))
    assert near.clock is not None, "it has time stamps"
    boxes = [view.detections for view in (door, near, above)]
    found = [(d.frames.tolist(), d.boxes.tolist(), d.scores.tolist()) for d in boxes if d]
    assert found == [
        ([0, 2], [[12.5, 10, 10, 24], [24.5, 10, 10, 24]], [0.5, 1.0]),
        ([0, 4], [[7, 9.5, 11, 25], [20, 9.5, 11, 25]], [1.0, 1.0]),
        ([0, 7], [[20, 20, 8, 8], [30, 22, 8, 8]], [0.25, 0.125]),
    ]
    looks = [detections.embeddings for detections in boxes if detections]
    np.testing.assert_allclose(looks[0], [[0, 1, 0], [0.6, 0.8, 0]], atol=1e-3)
    np.testing.assert_allclose(looks[1], [[0, 0, 1], [0, 1, 0]], atol=1e-3)
    looked_at = [door.detector_ran_at(step) for step in range(8)]
    assert looked_at == [True, False, True, False, False, False, False, False]


# addresses; what each part of them means to the page, tests/page/addresses.test.mjs asks


def test_an_address_is_as_it_is_told() -> None:
    assert len(ADDRESSES) >= 20
    for one in ADDRESSES:
        parts = dict(parse_qsl(one["address"].lstrip("?")))
        assert parts.get("seq") == one.get("sequence", parts.get("seq"))
        for head, values in (("p.", one.get("values")), ("a.", one.get("pinned"))):
            named = {key[2:]: text for key, text in parts.items() if key.startswith(head)}
            assert set(named) == set(values or {})


def test_the_values_of_every_address_are_taken(home: Home) -> None:
    with page(home, "crossing") as client:
        for one in ADDRESSES:
            parts = dict(parse_qsl(one["address"].lstrip("?")))
            for head, values in (("p.", one.get("values")), ("a.", one.get("pinned"))):
                conftest.command(client, "reset_parameters")
                texts = {key[2:]: text for key, text in parts.items() if key.startswith(head)}
                if not texts:
                    continue
                answer = conftest.command(client, "set_parameters", changes=texts)
                assert answer.status_code == 200, answer.text
                now = answer.json()
                assert {key: value_in(now, key) for key in values} == values


def test_the_recordings_of_addresses_open_or_are_told_of(home: Home) -> None:
    named = dict.fromkeys(one["sequence"] for one in ADDRESSES if "sequence" in one)
    with page(home) as client:
        for name in named:
            if name in NOT_IN_THE_CACHE:
                continue
            place = home.place(name)
            answer = client.post("/api/sequence", json={"name": place})
            if answer.status_code != 200:
                assert "crossing" not in name, answer.text
                assert_refused(answer)
                continue
            until(lambda place=place: opened_as(client) == place)
            assert state_of(client)["sequence"]["name"] in name


def test_the_built_in_rooms_that_addresses_name_are_listed(
    home: Home, capsys: pytest.CaptureFixture[str]
) -> None:
    status, listed, _ = command(capsys, "sequences", "--data", home.recordings)
    assert status == 0
    for one in ADDRESSES:
        name = one.get("sequence") or "crossing"
        if not name.startswith(("/", "random-")):
            assert name in listed
