"""The address of commands: what it takes, and how it refuses what is none."""

from __future__ import annotations

import pytest
from starlette.testclient import TestClient

from app.errors import COMMANDS
from app.messages import Model
from app.web.commands import Command
from tests.app.conftest import command


def kinds(kind: type[Command]) -> list[type[Command]]:
    """Every command that has a name, of a kind."""
    own = [kind] if "name" in kind.model_fields else []
    return own + [one for below in kind.__subclasses__() for one in kinds(below)]


def test_every_command_is_taken_under_its_name_and_says_what_it_does(shared: TestClient) -> None:
    described = shared.get("/openapi.json").json()
    body = described["paths"][COMMANDS]["post"]["requestBody"]["content"]["application/json"]
    taken = body["schema"]["discriminator"]["mapping"]
    names = [one.model_fields["name"].annotation.__args__[0] for one in kinds(Command)]  # type: ignore[union-attr]
    assert sorted(taken) == sorted(names)
    schemas = described["components"]["schemas"]
    for reference in taken.values():
        words = schemas[reference.rpartition("/")[2]]["description"]
        assert words.endswith("."), reference
        assert words != Model.__doc__


@pytest.mark.parametrize(
    ("body", "field", "words"),
    [
        ({"index": 1}, "name", "name"),
        ({"name": "remove"}, "name", "'remove'"),
        ({"name": "remove_template"}, "index", "field required"),
        ({"name": "remove_template", "index": 0, "indx": 1}, "indx", "extra inputs"),
        ({"name": "set_room_face", "side": "up", "axis": 0, "value": 1}, "side", "'min' or 'max'"),
        ({"name": "correct", "corrections": [{"kind": "hier"}]}, "corrections.0.kind", "'same'"),
    ],
)
def test_what_is_no_command_is_refused_by_its_field(
    shared: TestClient, body: dict[str, object], field: str, words: str
) -> None:
    answer = shared.post(COMMANDS, json=body)
    assert answer.status_code == 422
    problem = answer.json()
    assert problem["field"] == field
    assert problem["detail"].startswith(f"{field}: ")
    assert words in problem["detail"]


def test_a_command_answers_nothing_and_everyone_is_told(client: TestClient) -> None:
    answer = command(client, "edit_room", on=True)
    assert (answer.status_code, answer.content) == (204, b"")
    assert client.get("/api/state").json()["teaching"]["editing_room"]
    command(client, "edit_room", on=False)
