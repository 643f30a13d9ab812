"""What the sheet of *Open* is told: in the page's words, with every exchange and every name."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient

from app.web.importing import FIELDS, on_page
from tests.app.conftest import wait_until
from tests.app.web.test_importing import _send, _settled, _wish, client, data, files, toml
from tests.io.importing.test_left_out import BOXES
from tracker.sequences.reader import read_sequence

__all__ = ["client", "data", "files"]

ENGINE = Path(__file__).parents[3] / "tracker" / "io"
PAGE = Path(__file__).parents[3] / "static" / "js" / "opening"


def test_every_flag_that_the_import_names_has_a_field_on_the_page() -> None:
    page = "".join(path.read_text() for path in PAGE.glob("*.js"))
    for field in FIELDS.values():
        assert re.search(rf"\b{re.escape(field)}\b", page), field
    flag = re.compile(r'(?<![\w-])--[a-z][a-z-]+(?: [\w{}.]+=FILE)?[^"]{0,20}')
    for path in (*ENGINE.glob("importing/**/*.py"), *ENGINE.glob("c*/*.py")):
        code = re.sub(r'""".*?"""|#.*', "", path.read_text(), flags=re.DOTALL)
        for words in flag.findall(code):
            assert "--" not in on_page(words.rstrip()) or "--camera" in words, (path.name, words)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("z, since 9 % meet so; --up", "z, since 9 % meet so; “Up” changes it"),
        ("the other way up (--up=-z)", "the other way up (“Up” -z)"),
        ("how is not said: --boxes says it", "how is not said: “Boxes” says it"),
        ("boxes as two corners (--boxes xyxy)", "boxes as two corners (“Boxes” xyxy)"),
        ("x: of none; --camera NAME=FILE",
         "x: of none; choose it in the row of its camera, or name it after its camera"),
        ("say which by --camera cam1=FILE",
         "say which by the name of its camera, with the others left out"),
        ("camera.time_offset = -0.480", "“Starts late by” -0.480"),
        ("cam--up is a camera", "cam--up is a camera"),
        ("cam1 sees nothing of [room]", "cam1 sees nothing of the room"),
        ("give the time of each frame, timestamps in sequence.toml",
         "give the time of each frame, in a file of time stamps"),
    ],
)  # fmt: skip
def test_flags_are_the_fields_of_the_page(words: str, told: str) -> None:
    assert on_page(words) == told


def texts(told: Any) -> list[str]:
    """Every text in an answer but the wishes, whose keys and values are no words."""
    if isinstance(told, dict):
        return [text for key, value in told.items() if key != "wish" for text in texts(value)]
    if isinstance(told, list):
        return [text for value in told for text in texts(value)]
    return [told] if isinstance(told, str) else []


def test_nothing_in_the_sheet_names_a_flag(client: TestClient, files: Path) -> None:
    (files / "hall.csv").write_text(BOXES)
    (files / "broken.csv").write_text("frame,left\n")
    info = _settled(client, _send(client, files))
    assert any("belongs to no camera" in told for told in info["told"])
    assert [text for text in texts(info) if "--" in text or "sequence.toml" in text] == []


def test_an_exchange_is_data_and_can_be_undone(client: TestClient, files: Path) -> None:
    (files / "cam1.csv").rename(files / "kept")
    (files / "cam2.csv").rename(files / "cam1.csv")
    (files / "kept").rename(files / "cam2.csv")
    info = _settled(client, _send(client, files))
    whose = {one["name"]: one["calibration_of"] for one in info["cameras"]}
    assert whose == {"cam1": "cam2", "cam2": "cam1", "cam3": "cam3", "cam4": "cam4"}
    kept = _wish(client, info, as_named=True)
    assert all(one["name"] == one["calibration_of"] for one in kept["cameras"])
    again = _wish(client, info, as_named=False, swap=[["cam1", "cam2"]])
    assert {one["name"]: one["calibration_of"] for one in again["cameras"]} == whose


def test_a_name_is_written_as_it_is_typed_or_refused(
    client: TestClient, files: Path, data: Path
) -> None:
    info = _settled(client, _send(client, files))
    refused = _wish(client, info, names={"cam1": "left side"})
    assert refused["error"].startswith("name of cam1: expected one without blanks")
    assert refused["error"].endswith('found "left side"; "left_side" would do')
    assert refused["cameras"]
    info = _wish(client, info, names={"cam1": "left_side"}, name="a/b?")
    assert (info["error"], info["place"]) == ("", "a-b")
    client.post(f"/api/import/{info['key']}/write", json={"open": False})
    wait_until(lambda: (data / "a-b").is_dir())
    assert read_sequence(data / "a-b").cameras[0].name == "left_side"


def test_a_calibration_is_added_to_a_folder_of_the_disk(
    client: TestClient, files: Path, data: Path, tmp_path: Path
) -> None:
    (files / "calibration.toml").unlink()
    files.rename(data / "session")
    begun = client.post("/api/import/path", json={"path": "session"}).json()["draft"]
    info = _settled(client, begun["key"])
    assert (info["phase"], info["cameras"], info["uploaded"]) == ("failed", [], False)
    toml(tmp_path)
    text = (tmp_path / "calibration.toml").read_bytes()
    more = [{"path": "calibration.toml", "bytes": len(text)}]
    added = client.post(f"/api/import/{info['key']}/files", json={"files": more}).json()
    client.put(f"/api/import/{info['key']}/files/{added['first']}", content=text)
    client.post(f"/api/import/{info['key']}/arrived")
    info = _settled(client, info["key"])
    assert (info["phase"], len(info["cameras"])) == ("settled", 4)
    assert not (data / "session" / "calibration.toml").exists()
