"""A page of another origin in the same browser reads and changes nothing; nobody enters without
the token; what a name says never runs."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest
import viser
from playwright.sync_api import Browser, Page, expect

from app.web.access.gateway import Entrance, start_viser
from tests.browser.conftest import opened
from tests.browser.looking import viser as room
from tests.browser.serving import Server
from tests.browser.walkers import write_walkers

TOKEN = "the-token-of-this-test"


class Answers(BaseHTTPRequestHandler):
    """A page that may do what it likes, and pictures and forms of its own."""

    def do_GET(self) -> None:
        self.send_response(200)
        self.send_header("content-type", "text/html")
        self.end_headers()
        self.wfile.write(self.server.page.encode())  # type: ignore[attr-defined]

    def log_message(self, *_: object) -> None: ...


@pytest.fixture
def foreign() -> Iterator[ThreadingHTTPServer]:
    """A server on another port: of 127.0.0.1 it is another origin, of localhost another site."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), Answers)
    server.page = "<!doctype html><title>foreign</title>"  # type: ignore[attr-defined]
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield server
    server.shutdown()
    server.server_close()
    thread.join()


HOSTS = ["127.0.0.1", "evil.localhost"]
"""Where the foreign page is: of our own site and of another."""


@contextmanager
def on(browser: Browser, foreign: ThreadingHTTPServer, host: str) -> Iterator[Page]:
    context = browser.new_context()
    page = context.new_page()
    page.goto(f"http://{host}:{foreign.server_port}/")
    yield page
    context.close()


READS = """async (own) => {
  const got = [];
  const tell = (how) => (value) => got.push(`${how}: ${value}`);
  const places = ['', 'api/state', 'viser/', 'openapi.json', 'api/export/tracks.csv', 'manual/'];
  for (const place of places)
    for (const options of [{}, { credentials: 'include' }])
      await fetch(own + place, options).then((a) => a.text()).then(tell(place), () => {});
  for (const place of ['static/js/main.js', 'static/js/theme.js', 'static/icon.svg'])
    for (const [kind, name] of [['script', 'src'], ['img', 'src'], ['link', 'href']])
      await new Promise((done) => {
        const element = document.createElement(kind);
        if (kind === 'link') element.rel = 'stylesheet';
        element[name] = own + place;
        element.onload = () => done(got.push(`${kind} ${place}`));
        element.onerror = done;
        document.head.append(element);
      });
  return got;
}"""

SOCKETS = """(ends) => Promise.all(ends.map(([address, protocol]) => new Promise((done) => {
  const socket = new WebSocket(address, protocol);
  socket.onopen = () => done(`open ${address}`);
  socket.onmessage = () => done(`message ${address}`);
  socket.onclose = socket.onerror = () => done('');
})))"""

WRITES = """async (own) => {
  const body = JSON.stringify({ id: 1 });
  for (const type of ['text/plain', 'application/json', 'application/x-www-form-urlencoded'])
    for (const mode of ['no-cors', 'cors'])
      await fetch(own + 'api/select', {
        method: 'POST', mode, body, credentials: 'include', headers: { 'content-type': type },
      }).catch(() => {});
  navigator.sendBeacon(own + 'api/select', body);
  await fetch(own + 'api/layers', { method: 'PATCH', mode: 'cors', body: '{}' }).catch(() => {});
  const frame = document.createElement('iframe');
  frame.name = 'hidden';
  const form = document.createElement('form');
  Object.assign(form, { method: 'post', action: own + 'api/run/cancel', target: 'hidden' });
  form.enctype = 'text/plain';
  document.body.append(frame, form);
  form.submit();
  new Image().src = own + 'api/select?id=1';
}"""


@pytest.mark.parametrize("host", HOSTS)
def test_a_foreign_page_reads_and_changes_nothing(
    browser: Browser, server: Server, foreign: ThreadingHTTPServer, host: str
) -> None:
    own = server.address
    before = server.wait_for_run()
    with on(browser, foreign, host) as page:
        assert page.evaluate(READS, own) == []
        place, protocol = own.removeprefix("http://"), f"viser-v{viser.__version__}"
        ends = [[f"ws://{place}{path}", protocol] for path in ("api/stream", "viser", "viser/")]
        assert set(page.evaluate(SOCKETS, ends)) == {""}
        page.evaluate(WRITES, own)
        page.wait_for_timeout(500)
    after = server.get("/api/state").json()
    for part in ("selection", "layers", "run", "sequence", "parameters"):
        assert after[part] == before[part], part


@pytest.mark.parametrize("host", HOSTS)
def test_a_foreign_page_finds_no_way_into_the_3d_view(
    browser: Browser, foreign: ThreadingHTTPServer, host: str
) -> None:
    entrance = Entrance(port=True)  # as where the system has no address without a port
    inside = start_viser(entrance)
    try:
        with on(browser, foreign, host) as page:
            ends = [
                [f"ws://{name}:{entrance.port}/", protocol]
                for name in ("127.0.0.1", "localhost")
                for protocol in (f"viser-v{viser.__version__}", "viser-v", [])
            ]
            assert set(page.evaluate(SOCKETS, ends)) == {""}
            assert page.evaluate(READS, f"http://127.0.0.1:{entrance.port}/") == []
        assert not inside._websock_server._client_state_from_id
    finally:
        inside.stop()


def test_a_foreign_page_cannot_frame_ours_nor_reach_into_its_window(
    browser: Browser, server: Server, foreign: ThreadingHTTPServer
) -> None:
    with on(browser, foreign, HOSTS[0]) as page:
        for place in ("", "viser/", "manual/", "docs"):
            page.evaluate(
                "(own) => new Promise((done) => { const f = document.createElement('iframe');"
                "f.src = own; f.onload = f.onerror = done; document.body.append(f); })",
                server.address + place,
            )
        page.wait_for_timeout(300)
        for frame in page.frames[1:]:
            assert frame.query_selector(".app, #root, .md-header, #swagger-ui") is None
        with page.context.expect_page() as other:
            page.evaluate("(own) => { window.other = open(own); }", server.address)
        other.value.locator(".cam canvas").first.wait_for()
        assert page.evaluate("other.closed")  # to the page that opened it, it is gone
        other.value.close()


def test_the_token_opens_all_of_it_and_a_new_one_closes_it(
    browser: Browser, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = write_walkers(tmp_path_factory.mktemp("data") / "walkers")
    running = Server(folder, tmp_path_factory.mktemp("cache"), token=TOKEN)
    context = browser.new_context()
    context.set_default_timeout(60_000)
    page = context.new_page()
    try:
        page.goto(running.address)
        expect(page.get_by_role("heading", name="This workbench wants its token")).to_be_visible()
        page.get_by_label("Token").fill("another one")
        page.get_by_role("button", name="Open").click()
        expect(page.locator("body")).to_contain_text("no longer, the one of this workbench")
        page.goto(f"{running.address}?step=3&token={TOKEN}")
        page.locator(".cam canvas").first.wait_for()
        assert "token" not in page.url
        assert "step=3" in page.url
        room(page)  # its socket too
        context.route("**/viser/**", lambda route: route.abort())  # the rest without 3D
        assert page.evaluate("document.cookie") == ""
        page.reload()
        page.locator(".cam canvas").first.wait_for()
        another = context.new_page()  # a bookmark
        another.goto(running.address)
        another.locator(".cam canvas").first.wait_for()
        another.close()
        running.stop()
        running.use("another-token-of-this-test")
        running.start()
        expect(page.get_by_role("heading", name="This workbench wants its token")).to_be_visible()
        page.get_by_label("Token").fill("another-token-of-this-test")
        page.get_by_role("button", name="Open").click()
        page.locator(".cam canvas").first.wait_for()
    finally:
        context.close()
        running.stop()


def test_policies_let_through_all_that_the_pages_need(browser: Browser, server: Server) -> None:
    with opened(browser, server, flat=True) as page:  # which fails where one is broken
        for place in ("docs", "manual/", "manual/methods/"):
            page.goto(server.address + place)
            page.wait_for_timeout(500)


def test_what_gets_into_the_page_does_not_run(browser: Browser, server: Server) -> None:
    page = browser.new_page()  # of its own: the policy is to be broken, and says so
    page.route("**/viser/**", lambda route: route.abort())
    page.goto(server.address)
    page.locator(".cam canvas").first.wait_for()
    ran, refused = page.evaluate(
        """async () => {
          window.ran = [];
          const refused = [];
          const place = document.createElement('div');
          const script = document.createElement('script');
          const far = document.createElement('script');
          const inside = `<img src=x onerror="ran.push('handler')">
            <svg onload="ran.push('svg')"></svg><style>body { color: red }</style>
            <iframe srcdoc="<script>parent.ran.push('srcdoc')</script>"></iframe>`;
          const ways = {
            html: () => (place.innerHTML = inside),
            inline: () => (script.textContent = "ran.push('inline')"),
            data: () => (far.src = "data:text/javascript,ran.push('data')"),
            timer: () => setTimeout("ran.push('timer')"),
            name: () => script.append("ran.push('name')"),
          };
          for (const [name, way] of Object.entries(ways)) {
            try { way(); } catch (error) { refused.push(name); }
          }
          document.body.append(place, script, far);
          await new Promise((done) => setTimeout(done, 500));
          if (getComputedStyle(document.body).color === 'rgb(255, 0, 0)') ran.push('style');
          return [ran, refused];
        }"""
    )
    page.close()
    assert ran == []
    assert refused == ["html", "inline", "data", "timer"]
