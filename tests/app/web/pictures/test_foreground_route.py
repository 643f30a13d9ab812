"""The foreground of the shown run as a tinted picture, and the words where there is none."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy import ndarray
from starlette.testclient import TestClient

from app.web.dependencies import Settings
from app.web.server import create_app
from tests.app.conftest import ADDRESS, run_is, wait_until
from tracker.runs import pipeline
from tracker.runs.pipeline import Run
from tracker.sequences.reader import read_sequence
from tracker.single_view.pictures.background import unpack


@pytest.fixture(scope="module")
def numbers(data: Path) -> Iterator[TestClient]:
    """The application with a sequence of pictures open and computed."""
    app = create_app(Settings(sequence="numbers", data=data, with_viser=False))
    with TestClient(app, base_url=ADDRESS) as client:
        wait_until(run_is(client, "done"))
        yield client


@pytest.fixture(scope="module")
def computed(data: Path) -> Run:
    sequence = read_sequence(data / "numbers")
    return pipeline.compute(sequence, pipeline.default_parameters(sequence), steps=12)


def key_of(client: TestClient) -> str:
    return str(client.get("/api/state").json()["sequence"]["key"])


def decoded(content: bytes) -> ndarray:
    picture = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED)
    assert picture is not None
    return picture


def test_the_mask_is_the_engines(numbers: TestClient, computed: Run) -> None:
    some = 0
    for camera, step in ((0, 3), (1, 11)):
        wanted = computed.views[step][camera].foreground
        assert wanted is not None
        mask = unpack(wanted)
        answer = numbers.get(f"/api/foreground/{key_of(numbers)}/{camera}/{step}.png")
        assert answer.status_code == 200
        assert answer.headers["content-type"] == "image/png"
        assert answer.headers["cache-control"] == "no-cache"
        shown = decoded(answer.content)
        assert shown.shape == (*mask.shape, 4)
        np.testing.assert_array_equal(shown[:, :, 3] > 0, mask > 0)
        some += int(mask.sum())
    assert some > 0


def test_the_address_with_the_run_is_kept_for_ever(numbers: TestClient, computed: Run) -> None:
    told = numbers.get("/api/step/3").json()["cameras"][0]["foreground"]
    assert told == computed.keys["single_view"]
    address = f"/api/foreground/{key_of(numbers)}/0/3.png"
    answer = numbers.get(address, params={"run": told})
    assert answer.status_code == 200
    assert "immutable" in answer.headers["cache-control"]
    other = numbers.get(address, params={"run": "0" * 16})
    assert other.status_code == 404
    assert other.json()["detail"] == "That run is not shown any more."


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("KEY/7/0", "There is no camera 7: numbers has 0 … 1."),
        ("KEY/0/400", "There is no step 400: numbers has 0 … 29."),
        ("other/0/0", "That sequence is not open any more."),
    ],
)
def test_what_is_not_there_is_told(numbers: TestClient, path: str, words: str) -> None:
    answer = numbers.get(f"/api/foreground/{path.replace('KEY', key_of(numbers))}.png")
    assert answer.status_code == 404
    assert answer.json()["code"] == "no_foreground"
    assert answer.json()["detail"] == words


def test_a_method_without_foreground_is_told(client: TestClient) -> None:
    answer = client.get(f"/api/foreground/{key_of(client)}/0/0.png")
    assert answer.status_code == 404
    error = answer.json()
    assert "none had no picture there, or looks at none" in error["detail"]
    assert "that looks at pictures" in error["hint"]
    assert client.get("/api/step/0").json()["cameras"][0]["foreground"] is None
