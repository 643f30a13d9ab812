"""Every row of the table: by the reader, by the command line, over the API.

Who reads a bad file says in one sentence which file and field it is about, what was expected, what
was found and what to do; nothing half written is left, and what was open still is.
"""

from __future__ import annotations

import shutil
import time
import tracemalloc
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from app.web.dependencies import Settings
from app.web.server import create_app
from tests.app.conftest import ADDRESS, Runs
from tests.app.folders import write_crossing
from tests.bad_input.damage import OF_A_FILE
from tests.bad_input.kinds import KINDS, REFUSALS, Kind
from tests.bad_input.table import Row, rows
from tests.bad_input.test_requests import refused

ROWS = [row for row in rows() if row.sentence]
LONGEST = 600
MOST_MEMORY = 200e6
"""Bytes that reading a bad file may take."""

Places = Callable[[Row], tuple[Path, Path]]


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of recordings of the workbench, in which a bad one lies."""
    folder = tmp_path_factory.mktemp("data")
    write_crossing(folder / "crossing")
    return folder


@pytest.fixture(scope="module")
def desk(data: Path) -> Iterator[TestClient]:
    """The workbench that all rows are sent to, with a good recording open."""
    app = create_app(Settings(sequence="crossing", data=data, with_viser=False))
    with TestClient(app, base_url=ADDRESS) as client:
        deadline = time.monotonic() + 120.0
        while client.get("/api/state").json()["sequence"] is None:  # it opens in the background
            assert time.monotonic() < deadline
            time.sleep(0.02)
        yield client


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Callable[[Kind], Path]:
    """The good folder of a kind, made once."""
    folder = tmp_path_factory.mktemp("good")
    made: dict[Callable[[Path], None], Path] = {}

    def of(kind: Kind) -> Path:
        if kind.make not in made:
            made[kind.make] = folder / str(len(made))
            kind.make(made[kind.make])
        return made[kind.make]

    return of


@pytest.fixture
def damaged(good: Callable[[Kind], Path], data: Path) -> Iterator[Places]:
    """Makes a folder called room of a good one and damages it: folder, and file."""
    place = data / "room"

    def damage(row: Row) -> tuple[Path, Path]:
        shutil.copytree(good(KINDS[row.kind]), place)
        return place, row.apply(place)

    yield damage
    shutil.rmtree(place)


def test_each_kind_of_file_has_each_damage() -> None:
    for kind in KINDS.values():
        listed = {row.damage for row in rows() if row.kind == kind.name}
        if kind.file:
            absent = {"pipe"} if kind.may_be_a_pipe else set()
            assert set(OF_A_FILE) - listed == absent, kind.name


@pytest.mark.parametrize("kind", KINDS.values(), ids=lambda kind: kind.name)
def test_a_good_file_is_read(kind: Kind, good: Callable[[Kind], Path], tmp_path: Path) -> None:
    if kind.file:
        shutil.copytree(good(kind), tmp_path / "room")
        kind.read(tmp_path / "room" / kind.file)


@pytest.mark.parametrize("row", rows(), ids=str)
def test_the_reader_takes_a_file_or_says_what_is_wrong(row: Row, damaged: Places) -> None:
    folder, file = damaged(row)
    expected = REFUSALS if row.kind != "detector" else ValueError
    if not row.sentence and row.kind != "foreign":
        KINDS[row.kind].read(file)
        return
    before = {path: path.lstat().st_mtime_ns for path in folder.rglob("*")}
    with pytest.raises(expected) as told:
        KINDS[row.kind].read(file)
    if row.kind != "presets":  # a spoilt file of theirs is moved aside
        assert before.items() <= {p: p.lstat().st_mtime_ns for p in folder.rglob("*")}.items()
    sentence = str(told.value)
    if not row.sentence:  # a file of no known format, about which nothing is said
        assert not sentence
        return
    assert row.matches(sentence, folder), sentence
    assert sentence.isprintable()
    assert len(sentence.replace(str(folder), "")) < LONGEST
    assert not sentence.endswith(".") or row.kind == "presets"
    assert Path(row.file).stem in sentence or "sequence" in sentence or "calibration" in sentence


@pytest.mark.full
@pytest.mark.parametrize("row", [row for row in rows() if row.kind == "foreign"], ids=str)
def test_a_small_file_takes_little_memory(row: Row, damaged: Places) -> None:
    _, file = damaged(row)
    tracemalloc.start()
    with pytest.raises(REFUSALS):
        KINDS[row.kind].read(file)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < MOST_MEMORY


@pytest.mark.full
@pytest.mark.parametrize(
    "row", [row for row in ROWS if row.damage != "edit" and KINDS[row.kind].command], ids=str
)
def test_the_command_ends_with_the_sentence(
    row: Row, damaged: Places, data: Path, tmp_path: Path, run: Runs
) -> None:
    folder, file = damaged(row)
    names = {"FILE": file, "FOLDER": folder, "OUT": tmp_path, "CROSSING": data / "crossing"}
    words = []
    for word in KINDS[row.kind].command:
        name, slash, rest = word.partition("/")
        words.append(f"{names.get(name, name)}{slash}{rest}")
    status, _, stderr = run(*words)
    assert status == 1
    (line,) = stderr.splitlines()
    begin, sentence = line[:15], line[15:]
    assert begin == "multiview-phd: "
    assert row.is_in(sentence, folder) or not file.is_file(), sentence
    assert not list(tmp_path.iterdir()), "nothing is half written"


@pytest.mark.full
@pytest.mark.parametrize("row", [row for row in ROWS if KINDS[row.kind].request], ids=str)
def test_the_api_answers_with_the_sentence(row: Row, damaged: Places, desk: TestClient) -> None:
    folder, file = damaged(row)
    request = KINDS[row.kind].request
    assert request is not None
    problem = refused(request(desk, file))
    assert problem["status"] == 422
    assert row.is_in(problem["detail"], folder), problem["detail"]
    state = desk.get("/api/state").json()
    assert state["sequence"]["name"] == "crossing"
    assert state["opening"] is None
