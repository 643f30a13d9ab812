"""The kinds of files that are read: a good one of each, its reader, its command, its API call.

Of a kind's folder one file is damaged; whoever reads it must refuse it with the table's sentence.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import httpx
import numpy as np
from starlette.testclient import TestClient

from app.state.edits import Edits
from app.state.presets import OwnPresets
from app.state.snapshot import Event, Notice
from app.state.workbench import Workbench
from tests.corrections.test_log import LOG
from tests.io.read.recorded import detections, settled_of, toml
from tests.library.runs import filled, tracks
from tests.library.runs import run as kept_run
from tests.single_view.networks import answering
from tests.studies.small import recording
from tests.synthetic import write_sequence
from tests.test_export import PARAMETERS_OF_RUN, SEQUENCE, TRACKS
from tracker.corrections import CorrectionError
from tracker.corrections.log import read_log
from tracker.export import tracks_csv
from tracker.export.reading import read_tracks
from tracker.io.importing.gathering import gather
from tracker.io.read.pieces import FormatError
from tracker.library.bundle import unpack_bundle, write_bundle
from tracker.library.errors import LibraryError
from tracker.library.keeping import record_of_recording
from tracker.library.store import Library
from tracker.sequences.errors import SequenceError
from tracker.sequences.reader import read_sequence
from tracker.single_view.onnx.network import Network
from tracker.studies.definition import read_definition
from tracker.studies.errors import StudyError


class Refused(ValueError):
    """What a reader reports where it raises nothing itself."""


REFUSALS = (SequenceError, FormatError, CorrectionError, StudyError, LibraryError, Refused)
"""What a reader may raise: all are a sentence for people. A detector's are plain ValueErrors."""

FRAMES = 8

STUDY = """name = "small"
recordings = ["recording"]
trials = 6
objectives = ["score"]
parameters.fusion.clutter_rate = { low = 1.0, high = 5.0 }
"""


# the good folders


def room(folder: Path) -> None:
    """Two cameras with videos and boxes, a template, the truth."""
    write_sequence(folder, frames=FRAMES, detections=True)


def boxes_alone(folder: Path) -> None:
    """Two cameras with boxes, appearance vectors and a picture file a step; a log."""
    write_sequence(folder, frames=FRAMES, container="images", detections=True)
    text = (folder / "sequence.toml").read_text(encoding="utf-8")
    for name in ("cam1", "cam2"):
        np.save(folder / f"{name}.npy", np.ones((FRAMES, 4)))
        line = f'detections = "{name}.csv"'
        text = text.replace(line, f'{line}\nappearance = "{name}.npy"')
    (folder / "sequence.toml").write_text(text, encoding="utf-8")
    (folder / "corrections.toml").write_text(LOG, encoding="utf-8")


def track_file(folder: Path) -> None:
    folder.mkdir(parents=True)
    tracks_csv.save_tracks_csv(folder / "tracks.csv", SEQUENCE, TRACKS, PARAMETERS_OF_RUN, 5)


def study(folder: Path) -> None:
    recording(folder / "recording")
    (folder / "study.toml").write_text(STUDY, encoding="utf-8")


def presets(folder: Path) -> None:
    folder.mkdir(parents=True)
    OwnPresets((bench := Workbench()), Edits(bench), folder / "presets.json").keep(
        "mine", {"fusion.clutter_rate": 0.5}
    )


def library(folder: Path) -> None:
    folder.mkdir(parents=True)
    filled(folder / "library.sqlite3", 2).close()


def bundle(folder: Path) -> None:
    write_sequence(folder, frames=FRAMES, container=None, detections=True)
    sequence = read_sequence(folder)
    kept = kept_run(1, kept=tracks(FRAMES, 2, cameras=2))
    with Library(folder / "library.sqlite3") as opened:
        number = opened.keep(record_of_recording(sequence, str(folder)), kept)
        write_bundle(folder / "run.zip", opened.result(number), sequence)


def detector(folder: Path) -> None:
    folder.mkdir(parents=True)
    table = np.zeros((1, 7, 84), np.float32)
    answering(folder / "people.onnx", {"output0": table})


def session(folder: Path) -> None:
    """A calibration and boxes of other programs."""
    folder.mkdir(parents=True)
    toml(folder)
    detections(folder)
    for name in ("cam2.csv", "cam3.csv", "cam4.csv"):
        (folder / name).unlink()


# the readers


def read_presets(path: Path) -> None:
    """Presets are read at a start, which goes on without them and says so."""
    workbench = Workbench()
    heard: list[Event] = []
    workbench.subscribe_events(heard.append)
    OwnPresets(workbench, Edits(workbench), path)
    for one in heard:
        if isinstance(one, Notice):
            raise Refused(f"{one.message} {one.hint}")


def read_library(path: Path) -> None:
    with Library(path) as opened:
        for one in opened.runs():
            opened.result(one.id)


def read_foreign(path: Path) -> None:
    """A file of another program that lies in a folder alone."""
    (one,) = gather([path.parent])
    for piece in one.pieces:
        found = getattr(piece, "boxes", np.zeros(0))
        assert not getattr(piece, "cameras", ())
        assert not len(found) or not np.isfinite(found).all(axis=1).any()
    raise Refused(one.complaint)


# the calls


def opened(client: TestClient, path: Path) -> httpx.Response:
    """The answer to who opens the folder of a file."""
    return client.post("/api/sequence", json={"name": str(_sequence_of(path))})


def _sequence_of(path: Path) -> Path:
    return path.parent if path.parent.name not in ("cam1", "cam2") else path.parent.parent


def detected(client: TestClient, path: Path) -> httpx.Response:
    return client.put("/api/teach/detector", json={"model": str(path)})


def imported(client: TestClient, path: Path) -> httpx.Response:
    """The answer to who imports a folder, looks at what was found, and has it written."""
    begun = client.post("/api/import/path", json={"path": str(path.parent)})
    if begun.status_code >= 400:
        return begun
    address = f"/api/import/{begun.json()['draft']['key']}"
    while client.get(address).json()["phase"] not in ("settled", "failed"):
        time.sleep(0.01)
    answer = client.post(f"{address}/write", json={})
    client.delete(address)
    return answer


@dataclass(frozen=True, slots=True)
class Kind:
    """One kind of file."""

    name: str
    file: str
    """The file that is damaged, in its folder; empty where the damage names it."""
    make: Callable[[Path], None]
    """Writes the folder."""
    read: Callable[[Path], object]
    """Reads the file; raises one of :data:`REFUSALS`."""
    command: tuple[str, ...] = ()
    """Words after ``multiview-phd``, with FILE, FOLDER, OUT and CROSSING for paths; none where no
    command reads such a file."""
    request: Callable[[TestClient, Path], httpx.Response] | None = None
    """Has the API read it; None where none of its calls does."""
    may_be_a_pipe: bool = False
    """Whether a pipe is as good as a file, as a shell makes one; who reads it waits."""


TRACK = ("track", "FOLDER", "-o", "OUT/tracks.csv")
CHECK = ("check", "FOLDER")


def _in_folder(path: Path) -> object:
    return read_sequence(_sequence_of(path))


def _imported(path: Path) -> object:
    return settled_of(path.parent)


KINDS = {
    kind.name: kind
    for kind in (
        Kind("sequence", "sequence.toml", room, _in_folder, TRACK, opened),
        Kind("detections", "cam1.csv", room, _in_folder, TRACK, opened),
        Kind("truth", "ground_truth.csv", room, _in_folder, CHECK, opened),
        Kind("video", "cam1.mp4", room, _in_folder, CHECK, opened),
        Kind("picture", "cam1/00000.jpg", boxes_alone, _in_folder, CHECK, opened),
        Kind("appearance", "cam1.npy", boxes_alone, _in_folder, CHECK, opened),
        Kind(
            "corrections",
            "corrections.toml",
            boxes_alone,
            read_log,
            ("corrections", "list", "FILE"),
        ),
        Kind(
            "tracks",
            "tracks.csv",
            track_file,
            read_tracks,
            ("evaluate", "CROSSING", "FILE"),
            may_be_a_pipe=True,
        ),
        Kind(
            "study",
            "study.toml",
            study,
            read_definition,
            ("study", "run", "FILE", "--studies", "OUT/studies"),
            may_be_a_pipe=True,
        ),
        Kind("presets", "presets.json", presets, read_presets),
        Kind(
            "library",
            "library.sqlite3",
            library,
            read_library,
            ("runs", "list", "--library", "FILE"),
        ),
        Kind(
            "bundle",
            "run.zip",
            bundle,
            lambda path: unpack_bundle(path, path.parent / "unpacked"),
            ("serve", "FILE", "--no-open"),
        ),
        Kind(
            "detector",
            "people.onnx",
            detector,
            Network.tried,
            ("track", "CROSSING", "--detector", "FILE", "-o", "OUT/tracks.csv"),
            detected,
        ),
        Kind(
            "calibration",
            "calibration.toml",
            session,
            _imported,
            ("import", "FOLDER", "-o", "OUT/room"),
            imported,
        ),
        Kind(
            "foreign boxes",
            "cam1.csv",
            session,
            _imported,
            ("import", "FOLDER", "-o", "OUT/room"),
            imported,
        ),
        Kind(
            "foreign",
            "",
            lambda folder: folder.mkdir(parents=True),
            read_foreign,
            ("import", "FOLDER", "-o", "OUT/room"),
            imported,
        ),
    )
}
"""By name."""
