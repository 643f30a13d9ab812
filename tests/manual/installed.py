"""The sizes of the packages that an installation of this project has, without their bytecode.

``python -m tests.manual.installed`` prints them, the largest first.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path

from packaging.requirements import Requirement

PROJECT = "multiview-phd"


def sizes() -> dict[str, int]:
    """The bytes of each package that the project needs without extras, the largest first."""
    found = {one.name: _size(one) for one in _needed()}
    return dict(sorted(found.items(), key=lambda item: -item[1]))


def _needed() -> Iterator[Distribution]:
    """What the project requires, what that requires, and so on."""
    left, seen = [(PROJECT, frozenset[str]())], set[tuple[str, frozenset[str]]]()
    names = {_plain(PROJECT)}
    while left:
        name, extras = one = left.pop()
        if one in seen:
            continue
        seen.add(one)
        try:
            found = distribution(name)
        except PackageNotFoundError:  # it is for other systems
            continue
        if _plain(name) not in names:
            names.add(_plain(name))
            yield found
        for text in found.requires or []:
            needs = Requirement(text)
            chosen = extras or {""}
            if needs.marker is None or any(needs.marker.evaluate({"extra": e}) for e in chosen):
                left.append((needs.name, frozenset(needs.extras)))


def _size(one: Distribution) -> int:
    files = (Path(str(one.locate_file(file))) for file in one.files or () if file.suffix != ".pyc")
    return sum(file.stat().st_size for file in files if file.is_file())


def _plain(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


if __name__ == "__main__":
    known = sizes()
    for package, size in known.items():
        sys.stdout.write(f"{size / 1e6:8.1f} MB  {package}\n")
    sys.stdout.write(f"{sum(known.values()) / 1e6:8.1f} MB  in {len(known)} packages\n")
