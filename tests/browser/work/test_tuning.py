"""Tuning: a pinned run against the engine's own figures, presets by name, undo."""

from __future__ import annotations

from urllib.parse import urlsplit

from playwright.sync_api import Page, expect

from tests.browser.looking import as_at_first, ask, until
from tests.browser.serving import Server
from tests.browser.work.test_panels import number
from tracker.evaluation import compare, evaluate_sequence
from tracker.parameters.catalogue import PARAMETERS
from tracker.parameters.values import with_values
from tracker.runs import pipeline
from tracker.sequences.library import open_sequence

P_D = "fusion.detection_probability"


def test_a_pinned_run_is_compared_with_the_engines_figures(flat_page: Page, server: Server) -> None:
    page = flat_page
    as_at_first(server)
    page.get_by_role("tab", name="Compare").click()
    pin = page.get_by_role("button", name="Pin as A")
    expect(pin).to_be_enabled(timeout=20_000)
    pin.click()
    server.wait(lambda state: state["pinned"] is not None)
    ask(server, "PATCH", "parameters", {"changes": {P_D: 0.15}})
    server.wait_for_run()
    differing = page.get_by_role("table", name="Parameters that differ")
    expect(differing.locator("tbody tr")).to_have_count(1)
    expect(differing).to_contain_text("0.15")
    page.get_by_role("button", name="All figures").click()

    sequence = open_sequence(str(server.folder))
    defaults = pipeline.default_parameters(sequence)
    runs = [
        pipeline.compute(sequence, parameters, seed=0)
        for parameters in (defaults, with_values(defaults, {P_D: 0.15}))
    ]
    assert runs[0].tracks.positions.tolist() != runs[1].tracks.positions.tolist()
    rows = compare(*(evaluate_sequence(sequence, run.tracks) for run in runs))
    body = page.get_by_role("table", name="Figures").locator("tbody tr")
    expect(body).to_have_count(len(rows))
    verdicts = set()
    for wanted, row in zip(rows, body.all(), strict=True):
        name, a, b, difference, verdict = (cell.inner_text() for cell in row.locator("td").all())
        digits = wanted.definition.digits
        assert name.startswith(wanted.definition.name)
        assert (a, b) == (number(wanted.a, digits), number(wanted.b, digits))
        assert difference == number(wanted.difference, digits, signed=True)
        assert verdict.endswith(wanted.verdict) or wanted.verdict == "undefined"
        if a == b:
            assert "worse" not in verdict
            assert "better" not in verdict
        verdicts.add(wanted.verdict)
    assert {"worse", "same"} <= verdicts, "the change makes a difference"
    expect(page.get_by_role("button", name="run A")).to_be_visible()  # its layer in 3D
    as_at_first(server)


MOST_AT_FIRST = 60
"""Requests that open a recording whose run is there: the page, its style sheets and modules, 3D,
the step that is shown in all cameras, lanes, figures and what is in doubt."""


def test_a_computed_recording_is_opened_by_few_requests(page: Page, server: Server) -> None:
    as_at_first(server)
    server.wait_for_run()
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.goto(server.address)
    page.locator(".cam canvas").first.wait_for()
    page.frame_locator("iframe").locator("canvas").first.wait_for()
    last = "/api/corrections/queue"  # once a run is there Check asks what is in doubt
    until(page, lambda: any(url.endswith(last) for url in asked), last)
    page.wait_for_timeout(2_000)  # nothing comes after it
    paths = [urlsplit(url).path for url in asked if url.startswith("http")]
    assert len(paths) <= MOST_AT_FIRST, paths
    own = [url for url in asked if "/api/" in url]
    assert sorted(own) == sorted(set(own)), "nothing is asked for twice"


MOST_ASKED = 12
"""Requests that follow a moved slider: the steps around the shown one, lanes and figures while the
run goes on and at its end, who corrected what, which places are in doubt."""


def test_after_a_move_of_a_slider_the_page_asks_for_nothing_twice(
    flat_page: Page, server: Server
) -> None:
    page = flat_page
    as_at_first(server)
    server.wait_for_run()
    page.wait_for_timeout(2_000)  # what was begun before is there
    asked: list[str] = []
    page.on("request", lambda request: asked.append(urlsplit(request.url).path))
    page.evaluate(
        """(changes) => fetch("/api/parameters", {
            method: "PATCH",
            headers: { "Content-Type": "application/json" },
            body: JSON.stringify({ changes }),
        })""",
        {P_D: 0.6},
    )
    server.wait_for_run()
    page.wait_for_timeout(3_000)
    assert {"/api/steps", "/api/timeline", "/api/evaluation/curves"} <= set(asked)
    own = [path for path in asked if path.startswith("/api/")]  # 3D is kept away, and asked again
    assert len(own) <= MOST_ASKED, own
    as_at_first(server)


def test_presets_of_ones_own_by_keyboard(flat_page: Page, server: Server) -> None:
    page = flat_page
    as_at_first(server)
    ask(server, "PATCH", "parameters", {"changes": {P_D: 0.6}})
    page.get_by_role("tab", name="Changes").click()
    preset = page.get_by_role("combobox", name="Preset")
    expect(preset).to_have_value("")  # own values
    page.get_by_role("button", name="Save as").focus()
    page.keyboard.press("Enter")
    page.keyboard.type("published")
    page.keyboard.press("Enter")
    expect(page.get_by_text("expected a name of your own")).to_be_visible()
    page.get_by_role("textbox", name="Name of the preset").fill("quick <b>look</b>")
    page.keyboard.press("Enter")
    expect(preset).to_have_value("quick <b>look</b>")
    expect(preset).to_be_focused()
    page.get_by_role("button", name="Rename").focus()
    page.keyboard.press("Enter")
    page.keyboard.type("quick")
    page.keyboard.press("Enter")
    expect(preset).to_have_value("quick")

    preset.focus()
    preset.select_option("robust")
    server.wait(lambda state: state["changed"] == [])
    preset.select_option("quick")
    server.wait(lambda state: state["parameters"][P_D] == 0.6)
    # the page takes back what it knows of
    expect(page.locator("#panel-changes")).to_contain_text("0.6")
    page.keyboard.press("Control+z")
    state = server.wait(lambda state: state["parameters"][P_D] != 0.6)
    assert state["parameters"][P_D] == PARAMETERS[P_D].default
    page.keyboard.press("Control+Shift+z")
    server.wait(lambda state: state["preset"] == "quick")
    page.reload()
    expect(preset).to_have_value("quick")
    page.get_by_role("button", name="Remove").click()
    server.wait(lambda state: state["presets"] == [])
    assert server.get("/api/state").json()["parameters"][P_D] == 0.6, "the values stay"
    as_at_first(server)
