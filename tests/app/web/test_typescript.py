"""The page's types of what the server sends."""

from __future__ import annotations

from app.paths import static_folder
from app.web import typescript


def test_the_pages_types_are_those_of_the_answers() -> None:
    kept = (static_folder() / "js" / "types" / "server.d.ts").read_text(encoding="utf-8")
    assert kept == typescript.declarations(), "make it anew: python -m app.web.typescript"


def test_an_answer_has_all_of_its_fields_and_each_its_type() -> None:
    text = typescript.declarations()
    assert "?:" not in text
    assert "interface State {" in text
    assert '"idle" | "computing"' in text
    assert "\t\tbox: [number, number, number, number] | null;" in text
    assert "\t\tpresets: Record<string, Record<string, any>>;" in text
    assert "(number | null)[]" in text


def test_no_line_is_too_long_but_for_a_single_type() -> None:
    lines = typescript.declarations().splitlines()
    long = [line for line in lines if len(line.expandtabs(2)) > typescript.LINE]
    assert all(line.endswith(";") for line in long)
