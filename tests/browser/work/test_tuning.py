"""Tuning: a pinned run against the engine's own figures, presets by name, undo."""

from __future__ import annotations

from urllib.parse import urlsplit

from playwright.sync_api import Page, expect

from tests.browser.looking import as_at_first, by_palette, still, until, viser
from tests.browser.serving import Server
from tests.browser.work.test_main_job import essential
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
    server.command("set_parameters", changes={P_D: 0.15})
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


def test_what_was_entered_is_undone_in_its_field(flat_page: Page, server: Server) -> None:
    page = flat_page
    as_at_first(server)
    page.get_by_role("tab", name="Parameters").click()
    field = page.locator(f'[id="value-{P_D}"]')
    before = field.input_value()
    field.fill("0.8")
    page.keyboard.press("Enter")
    server.wait(lambda state: state["parameters"][P_D] == 0.8)
    page.keyboard.press("Control+z")
    server.wait(lambda state: state["parameters"][P_D] == float(before))
    expect(field).to_have_value(before)
    expect(field).to_be_focused()
    page.keyboard.press("Control+Shift+z")
    server.wait(lambda state: state["parameters"][P_D] == 0.8)
    as_at_first(server)


MOST_AT_FIRST = 60
"""Requests that open a recording whose run is there: the page, its style sheets and modules, 3D,
the step that is shown in all cameras, lanes, figures and what is in doubt."""


def test_a_computed_recording_is_opened_by_few_requests(page: Page, server: Server) -> None:
    as_at_first(server)
    server.wait_for_run()
    asked: list[str] = []
    page.goto("about:blank")  # what the page before still asks is not counted
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
        """(changes) => fetch("/api/commands", {
            method: "POST",
            headers: { "Content-Type": "application/json" },
            body: JSON.stringify({ name: "set_parameters", changes }),
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
    server.command("set_parameters", changes={P_D: 0.6})
    page.get_by_role("tab", name="Parameters").click()
    preset = page.get_by_role("combobox", name="Preset")
    # a list without entries has no value either, and takes no key
    expect(preset.locator("option:checked")).to_have_text("own values")
    page.set_viewport_size({"width": 1280, "height": 720})
    page.get_by_role("button", name="Save as").press("Enter")
    name = still(page.get_by_role("textbox", name="Name of the preset"))
    assert name["width"] > 100.0, "there is room for a name"
    assert name["x"] + name["width"] < 1280.0
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
    field = page.locator(f'#panel-parameters tr[data-key="{P_D}"] .num')
    expect(field).to_have_value("0.6")
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


def test_one_value_on_the_page_beside_the_3d_view_and_back(page: Page, server: Server) -> None:
    as_at_first(server)
    scene = viser(page)
    expect(scene.get_by_text("Essential parameters")).to_be_visible()
    page.get_by_role("tab", name="Parameters").click()
    row = page.locator(f'#panel-parameters tr[data-key="{P_D}"]')
    field, slider = row.locator(".num"), row.get_by_role("slider")
    field.fill("0,6")
    page.keyboard.press("Enter")
    server.wait(lambda state: state["parameters"][P_D] == 0.6)
    beside = essential(scene, P_D).get_by_role("slider")
    expect(beside).to_have_attribute("aria-valuenow", "0.6")
    beside.focus()
    beside.press("ArrowRight")
    server.wait(lambda state: state["parameters"][P_D] == 0.61)
    expect(field).to_have_value("0.61")
    slider.focus()
    for _ in range(3):
        slider.press("ArrowLeft")
    server.wait(lambda state: state["parameters"][P_D] == 0.58)
    expect(field).to_have_value("0.58")
    expect(beside).to_have_attribute("aria-valuenow", "0.58")
    as_at_first(server)


def test_who_holds_a_slider_or_types_is_not_written_over(flat_page: Page, server: Server) -> None:
    page = flat_page
    as_at_first(server)
    page.get_by_role("tab", name="Parameters").click()
    row = page.locator(f'#panel-parameters tr[data-key="{P_D}"]')
    field, slider = row.locator(".num"), row.get_by_role("slider")
    slider.scroll_into_view_if_needed()
    box = still(slider)
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    held = server.wait(lambda state: state["parameters"][P_D] < 0.9)["parameters"][P_D]
    where = slider.input_value()
    server.command("set_parameters", changes={P_D: 0.2, "fusion.memory": 9.0})
    memory = page.locator('#panel-parameters tr[data-key="fusion.memory"] .num')
    expect(memory).to_have_value("9")  # the page knows of both
    assert (slider.input_value(), field.input_value()) == (where, f"{held:g}")
    page.mouse.up()
    expect(field).to_have_value("0.2")
    field.fill("0.7")
    server.command("set_parameters", changes={P_D: 0.3, "fusion.memory": 8.0})
    expect(memory).to_have_value("8")
    expect(field).to_have_value("0.7")
    page.keyboard.press("Escape")
    expect(field).to_have_value("0.3")
    as_at_first(server)


def test_a_parameter_is_found_explained_and_its_effect_measured(
    flat_page: Page, server: Server
) -> None:
    page = flat_page
    as_at_first(server)
    server.wait_for_run()
    by_palette(page, "extraction threshold")
    page.get_by_role("option", name="Show Extraction threshold among the parameters").click()
    panel = page.locator("#panel-parameters")
    find = panel.get_by_label("Find a parameter")
    expect(find).to_have_value("fusion.extraction_threshold")
    rows = panel.locator("tr[data-key]:visible")
    expect(rows).to_have_count(1)
    find.fill("clutter rate fusion")
    expect(rows).to_have_count(1)
    rows.get_by_role("button", name="Clutter rate").click()
    parameter = PARAMETERS["fusion.clutter_rate"]
    help_line = panel.locator("tr.more:visible")
    expect(help_line).to_contain_text(parameter.help)
    expect(help_line).to_contain_text(f"as published {parameter.published:g}")
    manual = help_line.get_by_role("link", name="In the manual")
    expect(manual).to_have_attribute("href", "/manual/tuning/#fusion.clutter_rate")
    find.fill("threshold fusion extraction")
    panel.locator("[data-ref=effects]").click()
    curve = rows.first.locator(".curve")
    expect(curve).to_be_visible(timeout=60_000)
    server.wait(lambda state: state["tasks"]["effects"]["state"] == "done")
    told = server.get("/api/changes").json()["curves"]
    assert [one["key"] for one in told][:1] == ["fusion.extraction_threshold"]
    assert all(one["whole"] for one in told)
    find.fill("no such words")
    expect(panel.get_by_text("No parameter has “no such words”.")).to_be_visible()
    find.press("Escape")
    expect(rows.nth(20)).to_be_visible()
    as_at_first(server)
