"""A page that leaves while it is told something is no failure of the server."""

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
