"""How version 0.1.0 of 2026-11-25 wrote the examples beside this file: ``make.py WORK``.

It is a record, and is run by hand only to add the examples of a *new* version beside these: those
that are there stand for files that people have, and are never made again.

Three examples are written by hand: ``crossing`` without its corrections (two people and a coat
stand, as the boxes of three cameras), ``fields`` (a ``sequence.toml`` with every field) and
``addresses.json``. All else is what the program writes. Where a file names a folder of WORK it has
``/recordings`` or ``/cache`` instead, which a test replaces in turn; files that are named after a
folder's hash have its name. ``cache`` holds three rendered rooms without pictures and boxes: they
open at once, with as many steps and cameras as the runs of the library have.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import re
import shutil
import sqlite3
import sys
import time
import zipfile
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
ROOMS = ("random/random-3", "room44-3p-2-cameras", "room24-2p-3-cameras")
MACHINE = b"Linux x86_64, example"
STUDY = """name = "half"
recordings = ["recordings/crossing"]
trials = 6
objectives = ["score", "id_switches"]
search = "tpe"
prune = false
seed = 5
[values]
"fusion.survival_probability" = 0.98
[start]
"fusion.detection_probability" = 0.9
[parameters]
"fusion.detection_probability" = { low = 0.6, high = 0.98 }
"fusion.clutter_rate" = { low = 0.1, high = 10.0, log = true }
"smoothing_method" = { choices = ["identities", "positions"] }
"""


def command(*words: object) -> None:
    """Run a command, which must succeed."""
    from app.command.main import main

    assert main([str(word) for word in words]) == 0, words


def until(holds: Callable[[], bool]) -> None:
    """Wait for something that another thread brings about."""
    while not holds():
        time.sleep(0.02)


def page(work: Path, do: Callable[[Any], None], library: Path | None = None) -> None:
    """Do something on the page with ``crossing`` open and computed."""
    from starlette.testclient import TestClient

    from app.web.dependencies import Settings
    from app.web.server import create_app

    place = str(work / "recordings" / "crossing")
    settings = Settings(sequence=place, with_viser=False, keep_on_disk=True, library=library)
    with TestClient(create_app(settings), base_url="http://127.0.0.1:8000") as client:

        def send(name: str, **fields: Any) -> None:
            answer = client.post("/api/commands", json={"name": name, **fields})
            assert answer.is_success, answer.text
            until(lambda: client.get("/api/state").json()["run"]["state"] == "done")
            time.sleep(3.0)  # long enough for a run to be kept

        client.post("/api/seek", json={"step": 0})
        do(send)


def runs(work: Path) -> None:
    """The library, presets, the corrections and what of them can be taken back, tracks, bundle."""
    from tracker.library.store import open_library

    library, crossing = work / "library.sqlite3", work / "recordings" / "crossing"

    def worked(send: Callable[..., Any]) -> None:
        checked = {"kind": "checked", "first": 70, "last": 119}
        send("correct", corrections=[checked], note="all of the end")
        send(
            "POST", "commands", name="set_parameters", changes={"fusion.detection_probability": 0.8}
        )
        send("save_preset", preset="Dim room")
        changes = {"fusion_method": "sequential_phd", "fusion.clutter_rate": 1.5}
        send(
            "POST",
            "commands",
            name="set_parameters",
            changes={**changes, "colour_phd.spread_starts": False},
        )
        send("save_preset", preset="Zoë's café, late")

    page(work, worked, library)
    csv = work / "tracks.csv"
    command("track", crossing, "-o", work / "plain.csv", "--no-corrections")
    command("track", crossing, "-o", csv)
    command("track", crossing, "-o", work / "other.csv", "--fusion", "sequential_phd", "--seed", 3,
            "--smoothing", "positions", "--set", "fusion.clutter_rate=1.5",
            "--set", "fusion.detection_probability=0.85")  # fmt: skip
    command("batch", crossing, "--preset", "published", "--workers", 1)
    command("track", crossing, "-o", work / "gone.csv", "--seed", 9)
    for place in ("random-3", "room44-3p", work / "cache/rooms/version-4/room24-2p-3-cameras"):
        command("track", place, "-o", work / "room.csv")
    with open_library(library) as opened:
        listed = opened.runs()
        chosen = next(run for run in listed if run.seed == 3)
        opened.rename(chosen.id, "the café's rival")
        opened.star(chosen.id)
        opened.note(chosen.id, "steadier where Zoë sits;\nlook at step 104")
        opened.tag(chosen.id, ["café", "for Ben"])
        opened.delete([run.id for run in listed if run.seed == 9])
        bundled = next(
            run for run in listed if run.corrected and (run.seed, run.changes) == (0, {})
        )
    command("bundle", bundled.id, "-o", work / "bundle.zip")


def draft(work: Path) -> None:
    """What was taught and not saved; the recording is among the recent ones by that, too."""

    def taught(send: Callable[..., Any]) -> None:
        send("set_room_face", side="max", axis=2, value=2.25)
        send("set_target", half_extents=[0.1, 0.11, 0.125])
        send("add_entrance", position=[0.0, -1.2, 1.0])

    page(work, taught)


def corrections(work: Path) -> None:
    """The log of a recording beside it, and of a rendered room in the settings."""
    from tracker.corrections.kinds import make
    from tracker.corrections.log import own_place, read_log, write_log

    known = read_log(HERE / "crossing" / "corrections.toml")
    write_log(work / "recordings" / "crossing" / "corrections.toml", known[:11])
    room = own_place(work / "cache/rooms/version-4/random/random-3")
    named = make(kind="name", id="room-1", places=[[60, 0.5, -1.0, 0.86]], name="Ada")
    write_log(room, [named, make(kind="checked", id="room-2", first=50, last=90)])
    room.rename(room.with_name("random-3.toml"))


def study(work: Path) -> None:
    """A study of six trials that was stopped after three."""
    from tests.studies.small import Serial
    from tracker.studies.definition import read_definition
    from tracker.studies.runner import run_study
    from tracker.studies.store import create

    (work / "half.toml").write_text(STUDY, encoding="utf-8")
    store = create(read_definition(work / "half.toml"), work / "studies")
    with store.running() as writer:
        run_study(store, writer, lambda tell: Serial(), stopped=lambda: len(store.trials()) >= 3)


def rooms(work: Path) -> None:
    """The room of three cameras, whose first steps are enough, and each room without its files."""
    from tests.rooms import render
    from tests.rooms.writing import seal

    three = work / "cache/rooms/version-4/room24-2p-3-cameras"
    if not three.is_dir():
        render("room24-2p", three, cameras=3, frames=150)
    for name in ROOMS:
        place = HERE / "cache/rooms/version-4" / name
        place.mkdir(parents=True)
        text = (work / "cache/rooms/version-4" / name / "sequence.toml").read_text("utf-8")
        text = text[: re.search(r"^\[\[template|^\[ground_truth", text, re.M).start()]
        text = re.sub(r"^detections = .*\n", "", text, flags=re.M)
        text = re.sub(r"^video = .*", 'detections = "boxes.csv"', text, flags=re.M)
        (place / "sequence.toml").write_text(text, encoding="utf-8")
        (place / "boxes.csv").write_text("frame,left,top,width,height\n", encoding="utf-8")
        seal(place)


def bundle(made: Path, taken: Path) -> None:
    """A bundle without its report, which is not read back and holds 4 MB of plotly's script."""
    with zipfile.ZipFile(made) as old, zipfile.ZipFile(taken, "w", zipfile.ZIP_DEFLATED) as new:
        for entry in old.infolist():
            if entry.filename != "report.html":
                content = old.read(entry)
                if entry.filename == "run.json":
                    content = re.sub(rb'"machine": "[^"]*"', b'"machine": "%s"' % MACHINE, content)
                new.writestr(entry, content, zipfile.ZIP_DEFLATED, 9)


def taken(work: Path) -> None:
    """Put all of it beside this file, without a word of where it was made."""
    words = {str(work / "recordings"): "/recordings", str(work / "cache"): "/cache"}
    own = hashlib.sha256(str(work / "recordings/crossing").encode()).hexdigest()[:16]
    shutil.copyfile(work / "tracks.csv", HERE / "tracks.csv")
    with closing(sqlite3.connect(work / "library.sqlite3")) as file:
        file.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    shutil.copyfile(work / "library.sqlite3", HERE / "library.sqlite3")
    bundle(work / "bundle.zip", HERE / "bundle.zip")
    shutil.copyfile(
        work / "recordings/crossing/corrections.toml", HERE / "crossing/corrections.toml"
    )
    for name in ("settings", "studies"):
        skipped = shutil.ignore_patterns("*.lock", "starts", "turn.txt")
        shutil.copytree(work / name, HERE / name, ignore=skipped, dirs_exist_ok=True)
    for path in [*HERE.glob("settings/**/*.json"), *HERE.glob("studies/*/*.toml")]:
        text = made = path.read_text(encoding="utf-8")
        for place, word in words.items():
            text = text.replace(place, word)
        if text != made:  # what is edited by hand has no sum
            text = re.sub(r'\s*"sha256": "\w+",', "", text)
        path.write_text(text, encoding="utf-8")
        path.rename(path.with_name(path.name.replace(own, "crossing")))
    study = "studies/half/results.sqlite3"
    for name, table, column in (
        ("library.sqlite3", "recordings", "place"), (study, "told", "value"),
        (study, "trials", "told"), (study, "jobs", "outcome"),
    ):  # fmt: skip
        with closing(sqlite3.connect(HERE / name, isolation_level=None)) as file:
            file.execute("PRAGMA journal_mode = DELETE")
            for pair in words.items():
                file.execute(f"UPDATE {table} SET {column} = replace({column}, ?, ?)", pair)
            if table == "jobs":
                named = f'"machine": "{platform.node()}"'
                file.execute("UPDATE jobs SET outcome = replace(outcome, ?, ?)",
                             (named, '"machine": "example"'))  # fmt: skip
            if table == "recordings":
                file.execute("UPDATE runs SET machine = ?", (MACHINE.decode(),))
            file.execute("VACUUM")


def expected() -> dict[str, Any]:
    """What the library holds, as it is listed and by the content of its tracks."""
    from tests.compatibility.test_compatibility import facts_of
    from tracker.library.store import Library

    with Library(HERE / "library.sqlite3", read_only=True) as library:
        return {str(run.id): facts_of(library.result(run.id)) for run in library.runs()}


def main(work: Path) -> None:
    """All of it."""
    for name in ("CACHE", "SETTINGS", "STUDIES"):
        os.environ[f"MULTIVIEW_PHD_{name}"] = str(work / name.lower())
    os.environ["MULTIVIEW_PHD_LIBRARY"] = str(work / "library.sqlite3")
    shutil.copytree(HERE / "crossing", work / "recordings" / "crossing")
    for make in (corrections, rooms, runs, draft, study, taken):
        make(work)
    text = json.dumps(expected(), indent=1, ensure_ascii=False, sort_keys=True)
    (HERE / "library.json").write_text(f"{text}\n", encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve())
