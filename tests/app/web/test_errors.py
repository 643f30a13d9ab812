"""What goes wrong is said in words of the page; a page that leaves meanwhile is no failure."""

from __future__ import annotations

import ast
import logging
import re
from pathlib import Path

import pytest
from fastapi import FastAPI, WebSocket
from starlette.testclient import TestClient

import app as package
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


def test_what_a_page_shows_has_no_words_of_the_api() -> None:
    """Hints and messages reach the notes of the page: none of them names a route."""
    route = re.compile(r"\b(GET|POST|PUT|PATCH|DELETE)\b [/a-z]|\bby (GET|POST)\b|/api/[a-z]")
    told, seen = [], 0
    for path in sorted(Path(package.__file__).parent.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.Call):
                continue
            name = getattr(node.func, "id", getattr(node.func, "attr", ""))
            if not name.endswith(("Error", "Detail", "Notice", "notify", "in_the_answer")):
                continue
            words = [
                one.value
                for argument in [*node.args, *(keyword.value for keyword in node.keywords)]
                for one in ast.walk(argument)
                if isinstance(one, ast.Constant) and isinstance(one.value, str)
            ]
            seen += len(words)
            told += [f"{path}: {text}" for text in words if route.search(text)]
    assert seen > 100
    assert told == []
