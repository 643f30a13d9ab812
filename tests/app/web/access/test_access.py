"""Who has the token is let in, who is led here by another page is asked, nobody else gets more
than a sentence."""

from __future__ import annotations

import html
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from starlette.testclient import TestClient
from starlette.websockets import WebSocketDisconnect

from app.web.access.tokens import Keys, cookie_name, new_token, own_token
from app.web.dependencies import Settings
from app.web.server import create_app
from tests.app.conftest import ADDRESS, connect

TOKEN = "a-token-of-my-own_1.~"
PAGE = {"sec-fetch-mode": "navigate", "sec-fetch-dest": "document", "accept": "text/html"}
TYPED = {**PAGE, "sec-fetch-site": "none"}
ELSEWHERE = {**PAGE, "sec-fetch-site": "cross-site"}
COOKIE = {"cookie": f"multiview-phd-8000={TOKEN}"}


@pytest.fixture(scope="module")
def keys() -> Keys:
    return Keys(TOKEN)


@pytest.fixture(scope="module")
def entered(data: Path, keys: Keys) -> Iterator[TestClient]:
    """The application behind a token, with nothing open."""
    app = create_app(Settings(data=data, with_viser=False, keys=keys))
    with TestClient(app, base_url=ADDRESS, follow_redirects=False) as client:
        yield client


@pytest.fixture
def closed(entered: TestClient) -> TestClient:
    """The same for somebody who has not been here."""
    entered.cookies.clear()
    return entered


def routes(client: TestClient) -> list[tuple[str, str]]:
    described = client.get("/openapi.json", headers=COOKIE).json()["paths"]
    return [
        (method.upper(), re.sub(r"\{[^}]+\}", "1", path))
        for path, methods in described.items()
        for method in methods
    ]


@pytest.mark.full
def test_without_a_token_every_route_answers_with_what_to_do(closed: TestClient) -> None:
    places = routes(closed)
    assert len(places) > 30
    others = [("GET", path) for path in ("/static/js/main.js", "/viser/", "/openapi.json", "/no")]
    for method, path in places + others:
        answer = closed.request(method, path)
        assert answer.status_code == 401, path
        assert answer.headers["www-authenticate"] == "Bearer"
        assert answer.json()["code"] == "no_token"


@pytest.mark.parametrize("path", ["/", "/?sequence=crossing", "/manual/", "/docs", "/viser/"])
def test_without_a_token_a_person_reads_where_it_is(closed: TestClient, path: str) -> None:
    answer = closed.get(path, headers=TYPED)
    assert answer.status_code == 401
    assert answer.headers["content-type"] == "text/html; charset=utf-8"
    assert "printed in its terminal" in answer.text
    assert "default-src 'none'" in answer.headers["content-security-policy"]
    assert "<script" not in answer.text


@pytest.mark.parametrize("path", ["/api/stream", "/viser", "/viser/"])
def test_without_a_token_there_is_no_socket(closed: TestClient, path: str) -> None:
    for cookie in ("", "multiview-phd-8000=wrong", f"multiview-phd-8001={TOKEN}", "=;=;;,"):
        with pytest.raises(WebSocketDisconnect) as refusal, connect(closed, path, cookie=cookie):
            pass
        assert refusal.value.code == 1008


def test_the_link_gives_a_cookie_that_holds_for_all_of_it(closed: TestClient) -> None:
    answer = closed.get(f"/?step=3&token={TOKEN}&sequence=a%26b", headers=TYPED)
    assert answer.status_code == 200
    given = answer.headers["set-cookie"]
    assert given.startswith(f"multiview-phd-8000={TOKEN};")
    assert {"HttpOnly", "SameSite=strict", "Path=/"} <= set(given.split("; "))
    assert "max-age" not in given.lower()
    found = re.search(r'http-equiv="refresh" content="0;url=([^"]+)"', answer.text)
    assert found
    assert html.unescape(found[1]) == "/?step=3&sequence=a%26b"
    here = {**PAGE, "sec-fetch-site": "same-origin"}
    for path in ("/", "/?sequence=crossing", "/static/js/main.js", "/api/state", "/docs"):
        assert closed.get(path, headers=here).status_code == 200
    with connect(closed, cookie=COOKIE["cookie"]) as socket:
        assert socket.receive_json()["type"] in ("state", "playhead")


def test_a_program_sends_it_in_a_header(closed: TestClient) -> None:
    for words, status in [
        (f"Bearer {TOKEN}", 200),
        (f"bearer  {TOKEN}", 200),
        (f"Basic {TOKEN}", 401),
        ("Bearer", 401),
        (f"Bearer {TOKEN}x", 401),
        (f"Bearer {TOKEN[:-1]}", 401),
    ]:
        assert closed.get("/api/state", headers={"authorization": words}).status_code == status


def test_a_wrong_or_old_token_is_said_and_opens_nothing(closed: TestClient) -> None:
    for token in ("", "wrong", TOKEN.upper(), TOKEN + "%00", "%ED%B2%80", "x" * 5000):
        answer = closed.get(f"/?token={token}", headers=TYPED)
        assert answer.status_code == 401
        assert "no longer, the one of this workbench" in answer.text
        assert "set-cookie" not in answer.headers
    # an old bookmark of somebody who is in already
    answer = closed.get("/?token=old", headers={**TYPED, **COOKIE})
    assert answer.status_code == 200
    assert 'content="0;url=/"' in answer.text


def test_what_starts_the_browser_shows_a_key_that_opens_once(
    closed: TestClient, keys: Keys
) -> None:
    ticket = keys.ticket()
    assert closed.get(f"/?token={ticket}", headers=TYPED).status_code == 200
    closed.cookies.clear()
    assert closed.get(f"/?token={ticket}", headers=TYPED).status_code == 401
    cookie = {"cookie": f"multiview-phd-8000={ticket}"}
    assert closed.get("/api/state", headers=cookie).status_code == 401


@pytest.mark.full
@pytest.mark.parametrize("site", ["cross-site", "same-site"])
@pytest.mark.parametrize("with_token", [True, False])
def test_a_link_on_another_page_asks_before_it_opens_something(
    data: Path, closed: TestClient, site: str, with_token: bool
) -> None:
    led = {**PAGE, **(COOKIE if with_token else {}), "sec-fetch-site": site}

    def look(client: TestClient) -> None:
        answer = client.get("/?sequence=<b>x</b>&fusion.clutter_rate=9", headers=led)
        assert answer.status_code == 403
        assert "A link on another page led here" in answer.text
        assert "&lt;b&gt;x&lt;/b&gt;" in answer.text
        (link,) = re.findall(r'class="go" href="([^"]+)"', answer.text)
        own = {**led, "sec-fetch-site": "same-origin"}
        went = client.get(html.unescape(link), headers=own)
        assert (went.status_code == 200) == (with_token or client is not closed)

    look(closed)
    with TestClient(
        create_app(Settings(data=data, with_viser=False)), base_url=ADDRESS
    ) as without_keys:
        look(without_keys)
        # what opens nothing is not asked about, and an old browser names the page
        assert without_keys.get("/", headers=led).status_code == 200
        named = {"accept": "text/html", "referer": "http://evil.example/page"}
        assert without_keys.get("/?sequence=x", headers=named).status_code == 403


def test_no_way_leads_to_another_host(closed: TestClient) -> None:
    for path in ("//evil.example/", "/\\evil.example/", "///evil.example", "/%2F/evil.example"):
        for headers, query in ((ELSEWHERE, "?a=1"), (TYPED, f"?token={TOKEN}")):
            answer = closed.get(f"{ADDRESS}{path}{query}", headers=headers)
            for link in re.findall(r'(?:href="|url=)([^"]+)"', answer.text):
                assert re.match(r"/(?![/\\])", link), link


def test_names_cannot_write_into_the_page(closed: TestClient) -> None:
    evil = '"><script>alert(1)</script><meta http-equiv="refresh" content="0;url=//evil.example">'
    for headers in (ELSEWHERE, TYPED):
        answer = closed.get("/", params={"sequence": evil, evil: evil}, headers=headers)
        assert "<script" not in answer.text
        assert "<meta http-equiv" not in answer.text
    answer = closed.get("/", params={"token": TOKEN, "sequence": evil}, headers=TYPED)
    assert "<script" not in answer.text
    assert answer.text.count("<meta http-equiv") == 1


def test_two_workbenches_of_one_machine_do_not_disturb_each_other() -> None:
    assert cookie_name("127.0.0.1:8000") != cookie_name("127.0.0.1:8001")
    assert cookie_name("[::1]:8001") == cookie_name("localhost:8001")
    assert cookie_name("workstation") == "multiview-phd-80"


def test_tokens_are_never_the_same_and_own_ones_are_long() -> None:
    assert len({new_token() for _ in range(100)}) == 100
    assert own_token({}) is None
    assert own_token({"MULTIVIEW_PHD_TOKEN": TOKEN}) == TOKEN
    for token in ("", "short", "x" * 15, "x" * 20 + "&", "with a space and more", "é" * 20):
        with pytest.raises(ValueError, match="expected 16 or more"):
            own_token({"MULTIVIEW_PHD_TOKEN": token})
