"""Teaching over HTTP: the run follows, undo brings back, and what is saved reopens alike."""

from __future__ import annotations

import copy
import re
import threading
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from starlette.testclient import TestClient

from app.state import correcting
from app.state.edits import Edits
from app.state.snapshot import Event
from app.state.teaching import Drafts, Teaching
from app.state.workbench import Workbench
from app.web import results
from app.web.dependencies import Settings
from app.web.server import create_app
from tests.app.conftest import ADDRESS, command, connect, run_is, wait_until
from tests.browser.walkers import write_walkers
from tests.single_view.networks import Npm, answering, files, giving, package, pooling, source_of
from tracker.corrections.log import read_log
from tracker.runs import pipeline
from tracker.sequences.library import open_sequence
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.reader import FILE, WHERE_NOW, read_sequence
from tracker.sequences.writing.teaching import taught_values

BOX = {"camera": "cam1", "step": 5, "left": 40, "top": 30, "width": 24, "height": 48}


@pytest.fixture
def walkers(tmp_path: Path) -> Path:
    """A recording with pictures, boxes and truth, and without a template."""
    return write_walkers(tmp_path / "data" / "walkers")


@pytest.fixture
def client(walkers: Path) -> Iterator[TestClient]:
    """The application with it open and computed."""
    settings = Settings(sequence=str(walkers), data=walkers.parent, with_viser=False)
    with TestClient(create_app(settings), base_url=ADDRESS) as client:
        wait_until(run_is(client, "done"))
        yield client


def state(client: TestClient) -> dict[str, Any]:
    return client.get("/api/state").json()


def changed(client: TestClient, name: str, **fields: Any) -> dict[str, Any]:
    """The state after a command."""
    assert command(client, name, **fields).status_code == 204
    return state(client)


def done(client: TestClient) -> dict[str, Any]:
    """The state with the run that the sequence and the parameters ask for."""
    wait_until(run_is(client, "done"))
    return state(client)


def panel(client: TestClient) -> dict[str, Any]:
    """What the page's panel of teaching draws."""
    return client.get("/api/teach").json()


def picture_of(client: TestClient, template: dict[str, Any], what: str) -> str:
    """Where the page has a template's box from, or its colours."""
    sequence = state(client)["sequence"]
    camera = [one["name"] for one in sequence["cameras"]].index(template["camera"])
    box = ",".join(f"{side:g}" for side in template["box"])
    ending = {"swatch": "png", "histogram": "svg"}[what]
    return f"/api/teach/{what}/{sequence['key']}/{camera}/{template['step']}/{box}.{ending}"


def tracks(client: TestClient) -> str:
    text = client.get("/api/export/tracks.csv").text
    return "\n".join(line for line in text.splitlines() if not line.startswith("#"))


def complaint(answer: Any) -> str:
    assert answer.status_code == 422, answer.text
    error = answer.json()
    assert error["hint"] == "Nothing was changed, and nothing is lost."
    return str(error["detail"])


@pytest.mark.full
def test_the_first_template_makes_the_colour_methods_usable(client: TestClient) -> None:
    before = state(client)
    assert before["teaching"] == {
        "key": before["teaching"]["key"], "unsaved": 0, "editing_room": False
    }  # fmt: skip
    command(client, "set_parameters", changes={"single_view": "colour_phd"})
    wait_until(run_is(client, "failed"))
    assert "no template" in state(client)["run"]["error"]
    answer = command(client, "add_template", **BOX)
    assert answer.status_code == 204, answer.text
    now = done(client)
    assert now["sequence"]["templates"] == 1
    assert now["sequence"]["key"] == before["sequence"]["key"]  # pictures stay in the browser
    assert now["teaching"]["unsaved"] == 1
    for method in ("pseudo_particle", "jpda"):
        changes = {"single_view": method, "jpda.measurements": "colour"}
        command(client, "set_parameters", changes=changes)
        done(client)


@pytest.mark.full
def test_a_run_used_again_brings_its_templates_back(client: TestClient) -> None:
    before, first = state(client), tracks(client)
    command(client, "set_parameters", changes={"single_view": "colour_phd"})
    command(client, "add_template", **BOX)
    taught = done(client)
    assert tracks(client) != first
    bench: Workbench = client.app.state.workbench  # type: ignore[attr-defined]
    told = []
    end = bench.subscribe(lambda _: told.append(results.state_of(bench.snapshot())))
    command(client, "use_again", run=1)
    end()
    both = {(now.teaching.key, now.methods.single_view) for now in told}
    assert len(both) == 1, "one change, so that one undo takes it back"
    again = done(client)
    assert again["teaching"]["key"] == before["teaching"]["key"] != taught["teaching"]["key"]
    assert again["sequence"]["templates"] == 0
    assert again["parameters"] == before["parameters"]
    assert tracks(client) == first
    command(client, "undo")
    assert done(client)["run"]["key"] == taught["run"]["key"]


def test_a_template_is_named_renamed_removed_and_brought_back(client: TestClient) -> None:
    for body in (BOX, {**BOX, "step": 6}, {**BOX, "step": 7, "person": "Bob"}):
        command(client, "add_template", **body)
    command(client, "rename_template", index=0, person="Anna")

    def names() -> list[str]:
        return [str(template["name"]) for template in panel(client)["templates"]]

    assert names() == ["Anna", "person2", "Bob"]
    command(client, "remove_template", index=1)
    assert names() == ["Anna", "Bob"]
    for _ in range(2):  # the removal, then the name
        command(client, "undo")
    assert names() == ["person1", "person2", "Bob"]
    for _ in range(3):
        answer = command(client, "undo")
    assert answer.json()["teaching"]["unsaved"] == 0
    assert answer.json()["edits"] == {"undo": None, "redo": "template person1 added"}
    assert names() == []
    answer = command(client, "undo")
    assert answer.status_code == 409
    assert answer.json()["detail"] == "There is nothing to undo."


def test_the_room_changes_the_run_and_undo_brings_it_back_at_once(client: TestClient) -> None:
    before, first = state(client), tracks(client)
    command(client, "set_room_face", side="max", axis=0, value="0.2")
    command(client, "set_entrance", index=0, part="position", axis=0, value=-1.0)
    changed = done(client)
    assert changed["sequence"]["room"]["max"][0] == 0.2
    assert changed["run"]["key"] != before["run"]["key"]
    assert tracks(client) != first
    for _ in range(2):
        command(client, "undo")
    assert done(client)["run"]["key"] == before["run"]["key"]
    assert tracks(client) == first


def test_what_does_not_fit_says_so_and_changes_nothing(client: TestClient) -> None:
    before = state(client)["teaching"]
    small = {**BOX, "width": 2, "height": 2}
    assert complaint(command(client, "add_template", **small)) == (
        "walkers/sequence.toml, new template, box: expected at least 4 pixels a side inside the "
        "picture, found 2 × 2; drag a larger one."
    )
    words = complaint(command(client, "add_template", **{**BOX, "camera": "cam7"}))
    assert 'camera: expected one of cam1 and cam2, found "cam7"' in words
    words = complaint(command(client, "add_template", **{**BOX, "step": 60}))
    assert "frame: expected a whole number from 0 to 59, found 60" in words
    words = complaint(command(client, "set_room_face", side="min", axis=2, value=5))
    assert "[room], max: expected z above that of min, 5, found 2" in words
    words = complaint(command(client, "set_entrance", index=4, part="sigma", axis=0, value=1))
    assert words == "entrances: expected one of 1, found number 5."
    assert complaint(command(client, "remove_entrance", index=4)) == words
    words = complaint(command(client, "set_entrance", index=0, part="sigma", axis=0, value=0))
    assert "sigma: expected 3 positive numbers" in words
    assert command(client, "set_room_face", side="max", axis=0, value="NaN").status_code == 422
    assert command(client, "set_room_face", side="up", axis=0, value=1).status_code == 422
    assert state(client)["teaching"] == before


def test_another_page_may_not_teach(client: TestClient) -> None:
    headers = {"origin": "http://elsewhere.example"}
    for method, path in (("POST", "commands"), ("PUT", "teach/detector")):
        answer = client.request(method, f"/api/{path}", json={}, headers=headers)
        assert answer.status_code == 403


def test_a_box_that_sticks_out_is_cut_at_the_border(client: TestClient) -> None:
    command(client, "add_template", **{**BOX, "left": -10, "top": 120})
    command(client, "save_taught")
    folder = Path(str(client.app.state.workbench.snapshot().sequence.folder))  # type: ignore[attr-defined]
    (template,) = read_sequence(folder).templates
    assert template.box.tolist() == [0.0, 120.0, 14.0, 24.0]


@pytest.mark.full
def test_entrances_are_suggested_by_the_tracks(client: TestClient) -> None:
    entrance = state(client)["sequence"]["room"]["entrances"][0]
    words = complaint(command(client, "suggest_entrances"))
    assert words.startswith("The tracks begin and end together at no other place")
    command(client, "remove_entrance", index=0)
    done(client)
    answer = command(client, "suggest_entrances")
    assert answer.status_code == 204, answer.text
    (found,) = state(client)["sequence"]["room"]["entrances"]
    assert found["position"][:2] == pytest.approx(entrance["position"][:2], abs=0.4)


@pytest.mark.full
def test_templates_that_the_tracks_offer_are_taken_and_taken_back(client: TestClient) -> None:
    done(client)
    assert panel(client)["offers"] is None
    answer = command(client, "offer_templates")
    assert answer.status_code == 204, answer.text
    assert state(client)["sequence"]["templates"] == 0  # nothing is added by itself
    offers = panel(client)["offers"]
    offered = len(offers)
    assert offered >= 2
    assert "2 cameras agree" in offers[0]["reason"]
    assert client.get(picture_of(client, offers[0]["template"], "swatch")).status_code == 200

    taken = command(client, "take_offers", index=0)
    assert taken.status_code == 204, taken.text
    now = done(client)
    assert now["sequence"]["templates"] == now["teaching"]["unsaved"] == 1
    assert panel(client)["offers"] == offers[1:]
    command(client, "undo")
    assert done(client)["sequence"]["templates"] == 0
    assert panel(client)["offers"] == offers

    command(client, "take_offers")
    assert done(client)["sequence"]["templates"] == offered
    assert panel(client)["offers"] == []
    command(client, "save_taught")
    folder = Path(str(client.app.state.workbench.snapshot().sequence.folder))  # type: ignore[attr-defined]
    assert len(read_sequence(folder).templates) == offered
    for _ in range(offered):  # and each can be removed like any other
        assert command(client, "remove_template", index=0).status_code == 204
    assert state(client)["sequence"]["templates"] == 0
    command(client, "forget_offers")
    assert panel(client)["offers"] is None


def test_an_offer_that_is_none_any_more_is_refused(client: TestClient) -> None:
    done(client)
    assert complaint(command(client, "take_offers", index=0)) == (
        "That template is offered no more."
    )
    command(client, "offer_templates")
    client.post("/api/sequence", json={"name": "walkers"})
    wait_until(run_is(client, "done"))
    assert panel(client)["offers"] is None
    command(client, "take_offers")  # of nothing, which changes nothing
    assert state(client)["teaching"]["unsaved"] == 0


def test_tracks_that_offer_nothing_say_why(client: TestClient) -> None:
    command(client, "set_parameters", changes={"fusion.extraction_threshold": 0.99})
    command(client, "set_room_face", side="max", axis=0, value=-1.2)  # nobody is in what is left
    done(client)
    assert complaint(command(client, "offer_templates")).startswith(
        "The tracks offer no further template: nobody is seen whole, apart from others"
    )


@pytest.mark.full
def test_saving_keeps_a_backup_and_reopens_to_the_same_run(
    client: TestClient, walkers: Path
) -> None:
    text = (walkers / FILE).read_bytes()
    command(client, "add_template", **BOX)
    command(client, "set_room_face", side="max", axis=0, value=1.3)
    command(client, "add_entrance")
    use = {"single_view": "colour_phd"}
    command(client, "set_parameters", changes=use)
    key = done(client)["run"]["key"]
    assert state(client)["teaching"]["unsaved"] == 3
    saved = changed(client, "save_taught")
    assert saved["teaching"]["unsaved"] == 0
    assert saved["run"]["key"] == key  # nothing is computed anew
    assert (walkers / "sequence.toml.bak").read_bytes() == text
    shown = tracks(client)
    client.post("/api/sequence", json={"name": "walkers"})
    wait_until(run_is(client, "done"))
    command(client, "set_parameters", changes=use)
    again = done(client)
    assert again["sequence"]["room"]["max"][0] == 1.3
    assert len(again["sequence"]["room"]["entrances"]) == 2
    assert tracks(client) == shown


@pytest.mark.full
def test_a_copy_leaves_the_original_and_goes_on_in_the_copy(
    client: TestClient, walkers: Path
) -> None:
    text = (walkers / FILE).read_bytes()
    command(client, "add_template", **BOX)
    shown = done(client)
    answer = changed(client, "copy_taught", folder="mine")
    assert answer["sequence"]["name"] == "mine"
    assert answer["sequence"]["opened_as"] == str(walkers.parent / "mine")
    assert answer["teaching"]["unsaved"] == 0
    assert (answer["run"]["key"], answer["run"]["state"]) == (shown["run"]["key"], "done")
    exported = client.get("/api/export/tracks.csv")  # of the run before, by the name of the copy
    assert 'filename="mine-tracks.csv"' in exported.headers["content-disposition"]
    assert "# sequence = mine\n" in exported.text
    assert all(run["same_recording"] for run in client.get("/api/runs").json()["runs"])
    assert (walkers / FILE).read_bytes() == text
    assert client.get("/api/step/3").json()["computed"]
    command(client, "remove_template", index=0)
    command(client, "save_taught")
    assert "template" not in tomllib.loads((walkers.parent / "mine" / FILE).read_text("utf-8"))
    words = complaint(command(client, "copy_taught", folder=str(walkers)))
    assert "expected a new or an empty folder" in words


def test_a_copy_has_the_corrections(client: TestClient, walkers: Path) -> None:
    """They count when the copy is opened again; each recording goes on with its own log."""
    command(client, "correct", corrections=[{"kind": "checked", "first": 0, "last": 9}])
    command(client, "copy_taught", folder="mine")
    copied = walkers.parent / "mine"
    (first,) = read_log(copied / "corrections.toml")
    assert (first.first, first.last) == (0, 9)
    command(client, "correct", corrections=[{"kind": "checked", "first": 20, "last": 29}])
    assert len(read_log(copied / "corrections.toml")) == 2
    assert read_log(walkers / "corrections.toml") == (first,)
    command(client, "undo")
    assert read_log(copied / "corrections.toml") == (first,)


def test_a_copy_whose_corrections_cannot_be_written_says_so(
    client: TestClient, walkers: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    command(client, "correct", corrections=[{"kind": "checked", "first": 0, "last": 9}])

    def full(path: Path, corrections: object) -> None:
        raise OSError(28, "No space left on device", str(path))

    said: list[str] = []
    with monkeypatch.context() as patch:
        patch.setattr(correcting, "write_log", full)
        patch.setattr(Workbench, "notify", lambda _, level, words, hint="": said.append(words))
        command(client, "copy_taught", folder="mine")
    (words,) = [words for words in said if words.startswith("The copy has no corrections")]
    assert "No space left on device" in words
    assert len(read_log(walkers / "corrections.toml")) == 1


def test_a_file_that_another_program_changed_is_told(client: TestClient, walkers: Path) -> None:
    file = walkers / FILE
    assert panel(client)["remark"] is None
    command(client, "set_room_face", side="max", axis=0, value=1.3)
    command(client, "save_taught")
    command(client, "set_room_face", side="max", axis=0, value=1.4)
    assert panel(client)["remark"] is None, "the page itself has saved it"
    assert done(client)["run"]["warnings"] == []
    file.write_text(file.read_text("utf-8") + "# by hand\n", "utf-8")
    assert "was changed by another program: open the" in panel(client)["remark"]
    command(client, "set_room_face", side="max", axis=0, value=1.5)
    assert "sequence.toml changed or vanished" in done(client)["run"]["warnings"][0]
    file.rename(walkers / "away")
    words = f"There is no sequence.toml in {walkers} any more; {WHERE_NOW}."
    assert panel(client)["remark"] == words


def test_a_rendered_room_is_offered_as_a_copy(
    client: TestClient, walkers: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MULTIVIEW_PHD_CACHE", str(walkers.parent))
    command(client, "add_entrance")
    assert panel(client)["built_in"]
    assert panel(client)["read_only"].startswith("walkers lies in the cache, ")
    words = complaint(command(client, "save_taught"))
    assert words.startswith("walkers/sequence.toml: cannot be saved, since walkers lies in the ")
    assert state(client)["teaching"]["unsaved"] == 1


def test_discard_is_the_file_again_and_undo_knows_what_was_discarded(client: TestClient) -> None:
    command(client, "add_template", **BOX)
    assert changed(client, "discard_taught")["teaching"]["unsaved"] == 0
    assert command(client, "undo").json()["teaching"]["unsaved"] == 1


def test_what_is_not_saved_is_there_again_after_another_sequence(
    client: TestClient, walkers: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_walkers(walkers.parent / "others")
    command(client, "add_template", **BOX)
    client.post("/api/sequence", json={"name": "others"})
    wait_until(lambda: state(client)["opening"] is None)
    assert state(client)["teaching"]["unsaved"] == 0
    done(client)
    begun: list[str] = []
    begins = Workbench.run_begins

    def noted(bench: Workbench, key: str, message: str = "") -> None:
        begun.append(key)
        begins(bench, key, message)

    monkeypatch.setattr(Workbench, "run_begins", noted)
    client.post("/api/sequence", json={"name": "walkers"})
    wait_until(lambda: state(client)["teaching"]["unsaved"] == 1)
    assert state(client)["sequence"]["templates"] == 1
    assert begun == [done(client)["run"]["key"]], (
        "the first run is of what was taught, and begins once"
    )


@pytest.mark.full
def test_what_is_not_saved_outlives_the_server(
    walkers: Path, tmp_path: Path, own_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MULTIVIEW_PHD_SETTINGS", str(tmp_path / "settings"))
    settings = Settings(sequence=str(walkers), with_viser=False, keep_on_disk=True)

    @contextmanager
    def started() -> Iterator[tuple[TestClient, str]]:
        """A server of its own, and what its first page is told."""
        with TestClient(create_app(settings), base_url=ADDRESS) as client:
            wait_until(lambda: state(client)["sequence"] is not None)
            # what was not saved is taken up, or is not, before the thread that opens ends
            wait_until(lambda: all(one.name != "opening" for one in threading.enumerate()))
            with connect(client) as socket:
                heard = socket.receive_json()
                while heard["type"] == "playhead":  # the step that the recording opens at
                    heard = socket.receive_json()
            yield client, str(heard)

    with started() as (client, _):
        command(client, "add_template", **BOX)
        taught = done(client)
    with started() as (client, heard):
        assert "1 change of numbers not saved, as you left it" in heard
        again = done(client)
        assert again["teaching"] == taught["teaching"]
        assert again["run"]["key"] == taught["run"]["key"]
        command(client, "discard_taught")
        assert list((tmp_path / "settings" / "unsaved").iterdir()) == []
        command(client, "undo")
    text = (walkers / FILE).read_text("utf-8")
    (walkers / FILE).write_text(
        text.replace("min = [", "min = [-9.0, ", 1).replace(", 0.0]", "]", 1)
    )
    with started() as (client, heard):
        assert "cannot be taken up" in heard
        assert "template person1 added" in heard
        assert state(client)["teaching"]["unsaved"] == 0
    with started() as (client, heard):
        assert "taken up" not in heard


@pytest.mark.full
def test_what_was_taught_on_a_room_as_it_was_rendered_before_is_taken_up_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MULTIVIEW_PHD_CACHE", str(tmp_path / "cache"))
    room = open_sequence("room24-2p")
    saved = taught_values(room)
    taught = copy.deepcopy(saved)
    taught["room"]["max"][2] = 2.5
    one = {**saved["template"][0], "name": "Anna", "frame": 300}
    taught["template"] += [one, {**one, "name": "late", "frame": 900}]
    before = {**saved, "template": saved["template"][1:]}  # of more steps, others were chosen
    rendered = tmp_path / "cache" / "rooms" / "version-4" / "room24-2p-2-cameras"
    drafts = tmp_path / "drafts"
    Drafts(drafts).keep(rendered, before, {**taught, "template": taught["template"][1:]})
    (kept,) = drafts.iterdir()
    draft = kept.read_bytes()

    def opened() -> tuple[Workbench, list[Event]]:
        bench, heard = Workbench(), list[Event]()
        bench.subscribe_events(heard.append)
        Teaching(bench, Edits(bench), drafts=drafts)
        bench.open(room, "key", FrameReader(room), pipeline.default_parameters(room))
        return bench, heard

    bench, heard = opened()
    now = bench.snapshot().sequence
    assert now is not None
    assert now.room.maximum[2] == 2.5
    assert [t.name for t in now.templates] == [*(t.name for t in room.templates), "Anna"]
    assert "as it was rendered before" in str(heard)
    assert "Left out: template late added" in str(heard)
    assert sorted(path.name for path in drafts.iterdir()) == sorted(
        [f"{kept.stem}.taken-up.json", "room24-2p.json"]
    )
    assert kept.with_suffix(".taken-up.json").read_bytes() == draft
    again, heard = opened()
    assert again.snapshot().sequence.digest == now.digest  # type: ignore[union-attr]
    assert "as you left it" in str(heard)


def test_a_draft_that_cannot_be_read_is_left_alone(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    drafts = Drafts(tmp_path)
    values = {"room": {}, "template": []}
    drafts.keep(tmp_path, values, {**values, "template": [1]})
    assert Drafts(tmp_path).read(tmp_path) is None
    assert "cannot be read and is now" in caplog.text
    assert len(list(tmp_path.iterdir())) == 1


def test_a_template_shows_its_box_and_its_colours(client: TestClient) -> None:
    command(client, "add_template", **BOX)
    (template,) = panel(client)["templates"]
    crop, bars = (picture_of(client, template, what) for what in ("swatch", "histogram"))
    assert client.get(crop).content.startswith(b"\x89PNG")
    svg = client.get(bars).text
    assert svg.startswith("<svg")
    assert 1 <= svg.count("<rect") <= 32
    for wrong in (
        crop.replace("/0/5/", "/9/5/"),
        crop.replace("/0/5/", "/0/99/"),
        re.sub(r"[^/]+\.png", "1,2,3.png", crop),
        re.sub(r"[^/]+\.png", "900,900,20,20.png", crop),
        crop.replace("swatch/", "swatch/other"),
    ):
        assert client.get(wrong).status_code == 404


def test_defaults_follow_what_the_sequence_has_become(client: TestClient) -> None:
    command(client, "add_template", **BOX)
    workbench = client.app.state.workbench  # type: ignore[attr-defined]
    snapshot = workbench.snapshot()
    assert snapshot.defaults == pipeline.default_parameters(snapshot.sequence)
    assert state(client)["methods"]["single_view"] == "none"  # nobody's choice is taken away
    assert (panel(client)["method"], panel(client)["looking"]) == ("none", "colour_phd")


def test_the_first_template_is_looked_at_where_nobody_chose_a_method(
    client: TestClient, walkers: Path
) -> None:
    text = (walkers / "sequence.toml").read_text()
    (walkers / "sequence.toml").write_text(re.sub(r"detections = .*\n", "", text))
    client.post("/api/sequence", json={"name": str(walkers)})
    wait_until(lambda: state(client)["methods"]["single_view"] == "shapes")
    taught = changed(client, "add_template", **BOX)
    assert taught["methods"]["single_view"] == "colour_phd"
    back = command(client, "undo").json()
    assert back["methods"]["single_view"] == "shapes", "and so it is without it"
    command(client, "set_parameters", changes={"single_view": "jpda"})
    taught = changed(client, "add_template", **BOX)
    assert taught["methods"]["single_view"] == "jpda", "nobody's choice is taken away"


def test_the_size_of_people_is_taught_saved_and_taken_back(
    client: TestClient, walkers: Path
) -> None:
    before = state(client)
    half = before["sequence"]["target"]["half_extents"]
    answer = changed(client, "set_target_side", axis=2, value=1.5)
    assert answer["sequence"]["target"]["half_extents"] == [*half[:2], 0.75]
    assert answer["teaching"]["unsaved"] == 1
    assert [words.partition(" ")[0] for words in panel(client)["unsaved"]] == ["target:"]
    back = command(client, "undo").json()
    assert back["sequence"]["target"]["half_extents"] == half
    command(client, "set_target", half_extents=[0.3, 0.3, 0.65])
    command(client, "save_taught")
    assert read_sequence(walkers).target_half_extents.tolist() == [0.3, 0.3, 0.65]
    for wrong in (0.0, -1.0):
        assert "positive numbers" in complaint(
            command(client, "set_target_side", axis=0, value=wrong)
        )


@pytest.mark.full
def test_a_detector_is_fetched_by_a_click(
    client: TestClient, npm: Npm, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Progress stands in the panel; a failure changes nothing; where people are marked, they are
    found by their colours as before."""
    from tracker.single_view.onnx import fetching

    def fetched() -> tuple[int | None, str | None]:
        now = panel(client)
        return now["fetching"], now["detector"] and now["detector"]["name"]

    content = files()
    monkeypatch.setattr(fetching, "NANODET", source_of(content))
    before = done(client)["methods"]["single_view"]
    assert fetched() == (None, None)
    npm("sys.exit(3)")
    client.post("/api/teach/detector/fetched")
    wait_until(lambda: fetched() == (None, None))
    assert state(client)["methods"]["single_view"] == before
    npm("time.sleep(600)")
    client.post("/api/teach/detector/fetched")
    assert fetched() == (0, None)
    client.delete("/api/teach/detector/fetched")
    assert fetched() == (None, None)
    npm(giving(package(tmp_path / "package.tgz", content)))
    client.post("/api/teach/detector/fetched")
    wait_until(lambda: fetched() == (None, "tiny"))
    assert panel(client)["detector"]["path"] is None
    assert state(client)["methods"]["single_view"] == before
    command(client, "set_parameters", changes={"single_view": "onnx_detector"})
    assert done(client)["methods"]["single_view"] == "onnx_detector"


@pytest.mark.full
def test_a_detector_is_chosen_by_its_path_and_taken_away(
    client: TestClient, walkers: Path, tmp_path: Path
) -> None:
    before = state(client)
    change = {"fusion.survival_probability": 0.9}
    command(client, "set_parameters", changes=change)
    model = pooling(tmp_path / "red.onnx")
    client.put("/api/teach/detector", json={"model": str(model)})
    wait_until(lambda: state(client)["methods"]["single_view"] == "onnx_detector")
    shown = done(client)
    assert shown["methods"]["single_view"] == "onnx_detector"
    assert shown["parameters"]["fusion.survival_probability"] == 0.9
    assert panel(client)["detector"] == {"name": "", "path": str(model)}
    (tmp_path / "text.onnx").write_text("no network")
    answering(tmp_path / "kinds.onnx", {"kinds": np.zeros((1, 3), np.float32)})
    for wrong, words in (
        ("none.onnx", "cannot be read"),
        ("text.onnx", "cannot be used"),
        ("kinds.onnx", "of no known layout"),
    ):
        answer = client.put("/api/teach/detector", json={"model": str(tmp_path / wrong)})
        assert answer.status_code == 422
        assert wrong in answer.json()["detail"]
        assert words in answer.json()["detail"]
    assert state(client)["methods"]["single_view"] == "onnx_detector", "nothing was changed"
    # it is this recording's alone
    other = write_walkers(tmp_path / "other")
    client.post("/api/sequence", json={"name": str(other)})
    assert state(client)["methods"]["single_view"] == before["methods"]["single_view"]
    client.post("/api/sequence", json={"name": str(walkers)})
    command(client, "set_parameters", changes=change)
    assert state(client)["methods"]["single_view"] == "onnx_detector"
    client.put("/api/teach/detector", json={"model": None})
    wait_until(lambda: state(client)["methods"]["single_view"] != "onnx_detector")
    shown = done(client)
    assert shown["methods"]["single_view"] == before["methods"]["single_view"]
    assert shown["parameters"]["fusion.survival_probability"] == 0.9
    assert panel(client)["detector"] is None
