"""Which picture stands for one that is missing, where somebody asks for it."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
import pytest
from starlette.testclient import TestClient

from app.web import pictures
from app.web.dependencies import Settings
from app.web.server import create_app
from tests.app.conftest import ADDRESS, run_is, wait_until
from tests.synthetic import number_in, write_sequence

GONE = (4, 5, 6, 19)


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    folder = write_sequence(
        tmp_path_factory.mktemp("data") / "gaps", frames=20, container="images", detections=True
    )
    for step in GONE:
        (folder / "cam2" / f"{step:05d}.jpg").write_bytes(b"broken")
    app = create_app(Settings(sequence=str(folder), with_viser=False))
    with TestClient(app, base_url=ADDRESS) as client:
        wait_until(run_is(client, "done"))
        yield client


def address(client: TestClient, step: int) -> str:
    key = client.get("/api/state").json()["sequence"]["key"]
    return f"/api/picture/{key}/1/{step}.jpg"


@pytest.mark.parametrize(("step", "stands"), [(3, 3), (4, 3), (5, 3), (6, 7), (19, 18)])
def test_the_nearest_in_time_and_the_earlier_of_two(
    client: TestClient, step: int, stands: int
) -> None:
    answer = client.get(address(client, step), params={"nearest": True})
    assert answer.headers["x-step"] == str(stands)
    picture = cv2.imdecode(np.frombuffer(answer.content, np.uint8), cv2.IMREAD_COLOR)
    assert picture is not None
    assert number_in(np.asarray(picture)) == stands


def test_nobody_gets_another_picture_unasked(client: TestClient) -> None:
    assert client.get(address(client, 5)).status_code == 404
    assert client.get(address(client, 3)).headers["x-step"] == "3"


def test_it_is_not_sought_for_ever(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pictures, "REACH", 1)
    answer = client.get(address(client, 5), params={"nearest": True})
    assert answer.status_code == 404
    assert answer.json()["code"] == "no_picture"
