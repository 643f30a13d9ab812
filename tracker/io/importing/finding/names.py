"""Which file belongs to which camera: by name, by the number in the name, by order."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Literal

from tracker.sequences.pictures.numbering import by_number

How = Literal["name", "number", "order"]


def words_of(text: str) -> list[str]:
    """The parts between separators, numbers without leading zeros: ``cam_01`` → cam, 1."""
    parts = re.findall(r"[a-z]+|\d+", text.lower())
    return [str(int(part)) if part.isdigit() else part for part in parts]


def _joined(text: str) -> list[str]:
    """The same with letters that stand beside each other as one: ``LeftSide``, ``left_side``."""
    return words_of(re.sub(r"(?<=[A-Za-z])[\W_]+(?=[A-Za-z])", "", text))


def short_names(labels: Sequence[str]) -> list[str]:
    """Labels without the whole words that all of them begin or end with."""
    if len(labels) < 2:
        return [label.rsplit("/", 1)[-1] for label in labels]
    split = [re.findall(r"[^/_\-. ]+|[/_\-. ]+", label) for label in labels]
    shortest = min(map(len, split))
    first = 0
    while first < shortest - 1 and len({tuple(parts[: first + 1]) for parts in split}) == 1:
        first += 1
    last = 0
    while last < shortest - first - 1 and len({tuple(p[-1 - last :]) for p in split}) == 1:
        last += 1
    found = ["".join(parts[first : len(parts) - last]).strip("/_-. ") for parts in split]
    return found if len(set(found)) == len(found) and all(found) else list(labels)


def match(
    names: Sequence[str], labels: Sequence[str], *, by_order: bool = True
) -> tuple[dict[int, int], How] | None:
    """Which label belongs to which camera.

    Args:
        names: Of the cameras.
        labels: Paths or names of files, or what these say of the camera.
        by_order: Whether as many labels as cameras may be matched in their order.

    Returns:
        The camera of each label that belongs to one, each camera at most once; and how they
        were matched. None where nothing tells.
    """
    short = short_names(labels)
    ways: tuple[tuple[How, Callable[[], dict[int, int]]], ...] = (
        ("name", lambda: _by(names, labels, lambda n, x: words_of(n) == words_of(x))),
        ("name", lambda: _by(names, short, lambda n, x: words_of(n) == words_of(x))),
        ("name", lambda: _by(names, short, lambda n, x: _joined(n) == _joined(x))),
        ("name", lambda: _by(names, labels, _within)),
        ("name", lambda: _by(short_names(names), short, lambda n, x: words_of(n) == words_of(x))),
        ("number", lambda: _by_number(names, short)),
    )
    best: tuple[dict[int, int], How] | None = None
    for how, way in ways:
        found = way()
        if len(found) == len(labels):
            return found, how
        if found and how == "name" and (best is None or len(found) > len(best[0])):
            best = (found, how)
    if best is not None and len(best[0]) > 1:
        return best
    if by_order and len(names) == len(labels):
        cameras = sorted(range(len(names)), key=lambda n: by_number(names[n].lower()))
        files = sorted(range(len(labels)), key=lambda n: by_number(labels[n].lower()))
        return dict(zip(files, cameras, strict=True)), "order"
    return best


def _within(name: str, label: str) -> bool:
    """Whether the name's words stand beside each other among the label's."""
    own, all_words = words_of(name), words_of(label)
    if not own or own == [w for w in own if w.isdigit() and len(own) == 1]:
        return False  # a number alone is found in many names
    count = len(own)
    return any(all_words[n : n + count] == own for n in range(len(all_words) - count + 1))


def _by(
    names: Sequence[str], labels: Sequence[str], fits: Callable[[str, str], bool]
) -> dict[int, int]:
    """Pairs in which both fit nothing else."""
    table = [[fits(name, label) for name in names] for label in labels]
    found: dict[int, int] = {}
    for place, row in enumerate(table):
        cameras = [camera for camera, fit in enumerate(row) if fit]
        if len(cameras) == 1 and sum(other[cameras[0]] for other in table) == 1:
            found[place] = cameras[0]
    return found


def _by_number(names: Sequence[str], labels: Sequence[str]) -> dict[int, int]:
    """By the only number that differs, as it is, or counted from 0 here and from 1 there."""
    own, others = _numbers(names), _numbers(labels)
    if own is None or others is None:
        return {}
    for shift in (0, min(others) - min(own) if len(own) == len(others) else 0):
        found = {n: own.index(k - shift) for n, k in enumerate(others) if k - shift in own}
        if len(found) == len(others):
            return found
    return {}


def _numbers(texts: Sequence[str]) -> list[int] | None:
    """The number of each that tells it from all others; None where there is not one."""
    rows = [[int(digits) for digits in re.findall(r"\d+", text)] for text in texts]
    if len({len(row) for row in rows}) != 1:
        return None
    for column in zip(*rows, strict=True):
        if len(set(column)) == len(column):
            return list(column)
    return None
