"""The place Study: defined, run, looked at, used, by somebody at the page."""

from __future__ import annotations

from pathlib import Path

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page, Route, expect

from tests.browser.looking import ask, until
from tests.browser.serving import Server

TRIALS = 4


@pytest.fixture(scope="module", autouse=True)
def ended(server: Server) -> str:
    """A short study of what is open, that has ended."""
    draft = server.get("/api/studies/draft").json()
    ranges = {
        one["key"]: {"low": one["low"], "high": one["high"], "log": one["log"]}
        for one in draft["parameters"]
        if one["key"] in ("fusion.detection_probability", "fusion.clutter_rate")
    }
    ask(
        server,
        "POST",
        "studies",
        {
            "name": "short",
            "parameters": ranges,
            "trials": TRIALS,
            "objectives": ["idf1", "position_error"],
        },
    )
    ask(server, "POST", "studies/short/start", {"workers": 1})
    return "short"


@pytest.fixture
def study(flat_page: Page) -> Page:
    """The place with the study, done."""
    flat_page.get_by_role("link", name="Study").click()
    expect(flat_page.locator(".big")).to_contain_text(f"{TRIALS} of {TRIALS}", timeout=240_000)
    expect(flat_page.locator("tr[data-trial]")).to_have_count(TRIALS)
    return flat_page


def test_trials_stand_against_each_other(study: Page, screenshots: Path | None) -> None:
    expect(study.locator("main")).to_be_hidden()
    expect(study.locator("tr[data-trial]").last).to_contain_text("default")
    figure = study.locator(".scat .chart")
    expect(figure.locator("circle").first).to_be_visible()
    assert "IDF1 against Position error" in (figure.get_attribute("aria-label") or "")
    expect(study.locator(".mp")).to_have_count(2)
    study.get_by_role("button", name="IDF1 · time").click()
    assert study.get_by_role("button", name="IDF1 · time").get_attribute("aria-pressed") == "true"
    found = Axe().run(study, context=".place-study")
    assert found.violations_count == 0, found.generate_report()
    if screenshots:
        for theme in ("dark", "light"):
            study.emulate_media(color_scheme=theme)  # type: ignore[arg-type]
            study.screenshot(path=screenshots / f"study-{theme}.png")


def test_a_point_says_what_it_is_and_a_click_chooses_it(study: Page) -> None:
    for chart in (study.locator(".scat .chart"), study.locator(".mp .chart").first):
        chart.locator("circle").first.wait_for()
        box = chart.locator(".diamond path").bounding_box()
        assert box is not None
        study.locator("tr[data-trial]").first.click()
        expect(study.locator("tr[aria-selected=true]")).not_to_have_attribute("data-trial", "0")
        study.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        expect(chart.locator(".says")).to_contain_text("IDF1 ")
        said = chart.locator(".says").inner_text().splitlines()
        study.mouse.down()
        study.mouse.up()
        chosen = study.locator("tr[aria-selected=true] td").first.inner_text()
        assert said[0].split(",")[0].removeprefix("trial ") == chosen.split()[0], (said, chosen)
        study.mouse.move(0, 0)
        expect(chart.locator(".says")).to_be_hidden()


def test_the_keys_walk_through_the_points_of_a_chart_and_choose_one(study: Page) -> None:
    chart = study.get_by_role("application", name="IDF1 against")
    chart.focus()
    words = []
    for key in ("Home", "ArrowRight", "ArrowRight", "ArrowLeft"):
        study.keyboard.press(key)
        words.append(chart.get_by_role("status").inner_text())
    assert words[1] == words[3], words
    assert len(set(words)) == 3, words
    errors = [float(said.split("Position error ")[1].split()[0]) for said in words[:3]]
    assert errors == sorted(errors), "along the axis"
    study.keyboard.press("Enter")
    number = study.locator("tr[aria-selected=true]").get_attribute("data-trial")
    assert words[3].startswith("default" if number == "0" else f"trial {number}") or (
        words[3].startswith(f"best, trial {number}")
    )
    expect(chart).to_be_focused()


@pytest.mark.parametrize("by", ["pointer", "keys"])
def test_a_range_of_a_parameter_is_narrowed_in_its_chart(
    study: Page, server: Server, by: str
) -> None:
    chart = study.get_by_role("application", name="Clutter rate against")
    chart.locator("circle").first.wait_for()
    if by == "pointer":
        box = chart.bounding_box()
        assert box is not None
        middle = box["x"] + box["width"] / 2
        study.mouse.move(middle, box["y"] + 30)
        study.mouse.down()
        study.mouse.move(middle + 40, box["y"] + 40, steps=3)
        expect(chart.locator(".range")).to_be_visible()
        study.mouse.up()
    else:
        chart.focus()
        for key in ("Home", "Shift+End"):
            study.keyboard.press(key)
        expect(chart.locator(".range")).to_be_visible()
        study.keyboard.press("Enter")
    expect(study.get_by_text("What it will take")).to_be_visible()
    low, high = (
        float(study.get_by_label(f"Clutter rate {end}").input_value()) for end in ("from", "to")
    )
    (tried,) = (
        one
        for one in server.get("/api/studies/short").json()["varied"]
        if one["key"] == "fusion.clutter_rate"
    )
    assert tried["low"] <= low < high <= tried["high"]
    assert (low, high) != (tried["low"], tried["high"])


def test_charts_follow_the_window_and_the_theme(study: Page) -> None:
    chart = study.locator(".scat .chart")

    def drawn() -> tuple[float, str]:
        line = chart.locator("polyline").first
        colour: str = line.evaluate("line => getComputedStyle(line).stroke")
        return float(chart.locator("svg").first.get_attribute("width") or 0), colour

    study.emulate_media(color_scheme="dark")
    width, colour = drawn()
    study.set_viewport_size({"width": 1280, "height": 720})
    study.emulate_media(color_scheme="light")
    until(study, lambda: drawn()[0] < width and drawn()[1] != colour, "the chart is drawn anew")
    box = chart.bounding_box()
    assert box is not None
    assert drawn()[0] == pytest.approx(box["width"], abs=1.0)


def test_keys_walk_through_the_trials_and_use_one(study: Page, server: Server) -> None:
    study.locator("tr[data-trial]").first.click()
    first = study.locator("tr[aria-selected=true]").get_attribute("data-trial")
    study.keyboard.press("ArrowDown")
    row = study.locator("tr[aria-selected=true]")
    expect(row).not_to_have_attribute("data-trial", first or "")
    number = row.get_attribute("data-trial")
    values = server.get(f"/api/studies/short/trials/{number}").json()["trial"]["values"]
    row.get_by_role("button", name=f"Use trial {number}").click()
    expect(study.get_by_text("are on the sliders")).to_be_visible()
    now = server.get("/api/state").json()["parameters"]
    assert {key: now[key] for key in values} == pytest.approx(values)
    study.keyboard.press("Escape")
    expect(study.locator("main")).to_be_visible()


def test_trials_are_sorted_by_a_column(study: Page) -> None:
    def order() -> list[int]:
        return [
            int(row.get_attribute("data-trial") or "")
            for row in study.locator("tr[data-trial]").all()
        ]

    head = study.get_by_role("columnheader", name="Trial")
    assert order()[-1] == 0, "best first, the default last"
    head.get_by_role("button").click()
    expect(head).to_have_attribute("aria-sort", "ascending")
    assert order() == list(range(TRIALS))
    head.get_by_role("button").click()
    expect(head).to_have_attribute("aria-sort", "descending")
    assert order() == list(reversed(range(TRIALS)))


def test_a_copy_is_changed_and_what_is_wrong_is_said(study: Page) -> None:
    study.get_by_role("button", name="Edit a copy").click()
    expect(study.get_by_text("What it will take")).to_be_visible()
    begin = study.get_by_role("button", name="Start", exact=True)
    expect(begin).to_be_enabled()
    study.get_by_label("Clutter rate to").fill("1000")
    expect(begin).to_be_disabled()
    expect(study.locator(".def-foot .why")).to_contain_text("clutter_rate")
    study.get_by_label("Clutter rate to").fill("8")
    expect(begin).to_be_enabled()
    study.get_by_role("button", name="Leave out Clutter rate").click()
    expect(study.locator(".pt tbody tr")).to_have_count(1)


def test_the_estimate_goes_by_the_workers_and_a_new_study_begins_empty(
    study: Page, server: Server
) -> None:
    study.get_by_role("button", name="Edit a copy").click()
    why = study.locator(".def-foot .why")
    for count, words in (("1", "with 1 worker"), ("3", "with 3 workers")):
        study.get_by_label("Workers").fill(count)
        expect(why).to_contain_text(words)
    study.get_by_text("Dask scheduler", exact=True).click()
    expect(why).to_contain_text("expected an address as tcp://")
    study.get_by_text("This machine", exact=True).click()
    study.get_by_label("Name of the study").fill("fresh")
    begin = study.get_by_role("button", name="Start", exact=True)
    expect(begin).to_be_enabled()
    held: list[Route] = []
    study.route("**/api/studies/fresh/start", lambda route: held.append(route))
    begin.click()
    starting = study.get_by_role("button", name="Starting…")
    expect(starting).to_be_disabled()
    expect(study.locator(".big")).to_contain_text(f"0 of {TRIALS}")
    study.wait_for_timeout(600)  # news of the study have come by now
    expect(study.locator("tr[data-trial]")).to_have_count(0)
    assert held[0].request.post_data_json == {"workers": 3}
    held[0].fulfill(status=409, json={"error": "study", "detail": "not now"})
    expect(study.locator(".prog button")).to_have_text("Start")
    ask(server, "DELETE", "studies/fresh")
