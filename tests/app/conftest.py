"""A data folder with two small sequences, and an application that has one of them open."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient

from app.command import main as cli
from app.web.dependencies import Settings
from app.web.server import create_app
from tests.app.folders import write_crossing
from tests.synthetic import write_sequence

Runs = Callable[..., tuple[int, str, str]]
"""Runs a command: status, standard output, standard error."""

ADDRESS = "http://127.0.0.1:8000"


def wait_until(holds: Callable[[], bool], seconds: float = 120.0) -> None:
    """Wait for something that another thread brings about; it may compile kernels first."""
    deadline = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < deadline, "it did not come about in time"
        time.sleep(0.05)


def run_is(client: TestClient, phase: str) -> Callable[[], bool]:
    """Whether the run of an application is in a phase."""
    return lambda: client.get("/api/state").json()["run"]["state"] == phase


def is_evaluated(client: TestClient) -> Callable[[], bool]:
    """Whether the run that the parameters ask for is there, and scored to its end."""

    def holds() -> bool:
        answer = client.get("/api/evaluation").json()
        key = client.get("/api/state").json()["run"]["key"]
        return "code" not in answer and answer["run"] == key and not answer["partial"]

    return holds


def command(client: TestClient, name: str, **fields: Any) -> Any:
    """The answer to a command."""
    return client.post("/api/commands", json={"name": name, **fields})


def connect(client: TestClient, path: str = "/api/stream", **headers: str) -> Any:
    """A socket as a page of ours opens it; the test client knows its host for requests only."""
    return client.websocket_connect(path, headers={"host": "127.0.0.1:8000", **headers})


@pytest.fixture(scope="session")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the sequences ``crossing`` (boxes) and ``numbers`` (pictures)."""
    folder = tmp_path_factory.mktemp("data")
    write_crossing(folder / "crossing")
    write_sequence(folder / "numbers", frames=30, container="mp4")
    return folder


@pytest.fixture(scope="session")
def crossing(data: Path) -> Path:
    """The folder of the sequence with boxes."""
    return data / "crossing"


@contextmanager
def opened(data: Path) -> Iterator[TestClient]:
    """The application with ``crossing`` open, computed and scored, at the first step."""
    app = create_app(Settings(sequence="crossing", data=data, with_viser=False))
    with TestClient(app, base_url=ADDRESS) as client:
        wait_until(run_is(client, "done"))
        wait_until(is_evaluated(client))
        client.post("/api/seek", json={"step": 0})  # it was where something happens
        yield client


@pytest.fixture(scope="module")
def shared(data: Path) -> Iterator[TestClient]:
    """One application for all tests of a module, for those that ask for what it refuses."""
    with opened(data) as client:
        yield client


@pytest.fixture
def client(shared: TestClient) -> TestClient:
    """The application of the module: ``crossing`` computed and scored with the defaults, nothing
    pinned, nothing selected, at the first step."""
    if (shared.get("/api/state").json()["sequence"] or {"name": ""})["name"] != "crossing":
        shared.post("/api/sequence", json={"name": "crossing"})
        wait_until(run_is(shared, "done"))
    shared.delete("/api/run/pin")
    command(shared, "reset_parameters")
    shared.post("/api/select", json={"id": None})
    wait_until(run_is(shared, "done"))
    wait_until(is_evaluated(shared))
    shared.post("/api/seek", json={"step": 0})
    return shared


@pytest.fixture
def own_client(data: Path) -> Iterator[TestClient]:
    """An application that a test has for itself: it has seen nothing yet but one run."""
    with opened(data) as client:
        yield client


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Runs:
    """Run a command in this process: status, standard output, standard error."""

    def run(*arguments: object) -> tuple[int, str, str]:
        try:
            status = cli.main([str(argument) for argument in arguments])
        except SystemExit as stop:
            status = int(stop.code or 0)
        captured = capsys.readouterr()
        return status, captured.out, captured.err

    return run
