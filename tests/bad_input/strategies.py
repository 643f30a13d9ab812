"""Hypothesis strategies: damaged folders, tables and TOML, that shrink to what is needed."""

from __future__ import annotations

from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from tests.bad_input.drawing import CONTENTS, KINDS, NUMBERS, WORDS, Damage

BASES = ("boxes", "videos", "images", "bare")


def damages() -> SearchStrategy[list[Damage]]:
    """What is done to a folder."""
    part = st.floats(0.0, 1.0, exclude_max=True)
    what = st.integers(0, max(len(NUMBERS), len(WORDS), len(CONTENTS), 64) * 8)
    return st.lists(
        st.builds(Damage, kind=st.sampled_from(list(KINDS)), file=part, place=part, what=what),
        min_size=1,
        max_size=4,
    )


def folders() -> SearchStrategy[tuple[str, list[Damage]]]:
    """A good folder by its name, and what is done to it."""
    return st.tuples(st.sampled_from(BASES), damages())


def cells() -> SearchStrategy[str]:
    """A cell of a table: mostly a number, in any notation."""
    numbers = st.one_of(
        st.floats().map(repr), st.integers().map(str), st.sampled_from(NUMBERS[:-3])
    )
    return st.one_of(numbers, numbers, st.text(max_size=12), st.just(""))


def tables(*columns: str) -> SearchStrategy[str]:
    """A CSV file with about these columns."""
    header = st.lists(st.sampled_from((*columns, "id", "other")), min_size=1, max_size=8)
    whole = st.one_of(st.just(list(columns)), header)
    rows = st.lists(st.lists(cells(), min_size=0, max_size=8), max_size=12)
    ends = st.sampled_from(("\n", "\r\n", "\n\n"))

    def text(parts: tuple[list[str], list[list[str]], str]) -> str:
        names, lines, end = parts
        return end.join([",".join(names), *(",".join(line) for line in lines)])

    return st.tuples(whole, rows, ends).map(text)


def toml_values() -> SearchStrategy[str]:
    """A value as TOML has it, of any type and depth."""
    leaves = st.one_of(
        st.sampled_from((*NUMBERS, *WORDS)),
        st.floats(allow_nan=False, allow_infinity=False).map(repr),
        st.integers().map(str),
        st.text(max_size=20).map(lambda text: '"' + text.replace('"', "").replace("\\", "") + '"'),
    )
    return st.recursive(
        leaves,
        lambda inner: st.lists(inner, max_size=4).map(lambda some: f"[{', '.join(some)}]"),
        max_leaves=12,
    )
