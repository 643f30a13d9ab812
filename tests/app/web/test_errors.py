"""Errors as the page gets them, and none where a page that leaves is told something."""

from __future__ import annotations

import logging

import pytest
from fastapi import FastAPI, WebSocket
from starlette.testclient import TestClient

from app import errors


def test_nothing_is_said_of_a_page_that_leaves(caplog: pytest.LogCaptureFixture) -> None:
    app = FastAPI()
    errors.install(app)

    @app.websocket("/stream")
    async def stream(socket: WebSocket) -> None:
        await socket.accept()
        await socket.send_text("here")
        raise BrokenPipeError("gone")

    with (
        caplog.at_level(logging.ERROR),
        TestClient(app) as client,
        client.websocket_connect("/stream") as socket,
    ):
        assert socket.receive_text() == "here"
    assert not caplog.records


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("the files are not understood yet", "The files are not understood yet."),
        ("cam2: has no lens", "cam2: has no lens."),
        ("left: has no lens", "left: has no lens."),
        ("hall/door.csv came after the others", "hall/door.csv came after the others."),
        ("sequence.toml, fps: expected a number", "sequence.toml, fps: expected a number."),
        ("iPhone has no lens", "iPhone has no lens."),
    ],
)
def test_a_sentence_begins_with_a_capital_letter_unless_with_a_name(words: str, told: str) -> None:
    assert errors.as_sentence(words) == told
