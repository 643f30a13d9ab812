"""The likelihood of a person's colours over a picture, as the page lays it over."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy import ndarray
from starlette.testclient import TestClient

from app.web.dependencies import Settings
from app.web.overlays import heat
from app.web.server import create_app
from tests.app.conftest import ADDRESS, run_is, wait_until
from tracker.single_view.colour.templates import COLUMNS


@pytest.fixture(scope="module")
def numbers(data: Path) -> Iterator[TestClient]:
    app = create_app(Settings(sequence="numbers", data=data, with_viser=False))
    with TestClient(app, base_url=ADDRESS) as client:
        wait_until(run_is(client, "done"))
        yield client


def decoded(content: bytes) -> ndarray:
    picture = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED)
    assert picture is not None
    return picture


def test_the_likelier_the_denser() -> None:
    shown = decoded(heat(np.array([[-np.inf, -10.0, -2.0]]), -20.0))
    assert shown.shape == (1, 3, 4)
    assert 0 < shown[0, 0, 3] < shown[0, 1, 3] < shown[0, 2, 3]


@pytest.mark.parametrize("below", [(250, 250, 250), (120, 150, 200), (20, 20, 20)])
def test_what_is_likely_stands_out_of_any_picture(below: tuple[int, int, int]) -> None:
    # white wall, skin, black hair: what looks like nobody is darker and has no hue of its own
    shown = decoded(heat(np.array([[-np.inf, -1.0]]), -20.0)).astype(float)
    opacity = shown[:, :, 3:] / 255.0
    nobody, likely = (opacity * shown[:, :, :3] + (1.0 - opacity) * np.array(below))[0]
    assert np.ptp(nobody) <= np.ptp(below)
    assert nobody.max() < max(below)
    assert likely.mean() - nobody.mean() > 40.0
    assert np.abs(likely - np.array(below)).max() > 60.0


@pytest.mark.full
def test_a_step_names_its_map_which_may_be_kept(numbers: TestClient) -> None:
    key = numbers.get("/api/state").json()["sequence"]["key"]
    step = numbers.get("/api/step/5").json()
    named = step["cameras"][0]["likelihood"]
    path = f"/api/likelihood/{key}/0/5.png"
    answer = numbers.get(path, params={"run": named})
    assert answer.status_code == 200
    assert "immutable" in answer.headers["cache-control"]
    assert decoded(answer.content).shape[1] == COLUMNS
    assert numbers.get(path).headers["cache-control"] == "no-cache"
    assert numbers.get(path).content == answer.content


@pytest.mark.full
def test_what_there_is_no_map_of(numbers: TestClient, client: TestClient) -> None:
    key = numbers.get("/api/state").json()["sequence"]["key"]
    for path in ("nothing/0/5.png", f"{key}/9/5.png", f"{key}/0/999.png", f"{key}/0/5.png?run=x"):
        answer = numbers.get(f"/api/likelihood/{path}")
        assert answer.status_code == 404, path
        assert answer.json()["code"] == "no_likelihood"
    boxes_only = client.get("/api/step/5").json()["cameras"][0]
    assert boxes_only["likelihood"] is None
    key = client.get("/api/state").json()["sequence"]["key"]
    answer = client.get(f"/api/likelihood/{key}/0/5.png")
    assert answer.status_code == 404
    assert "has no picture of step 5" in answer.json()["detail"]
