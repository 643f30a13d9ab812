"""What one check found: a sentence, and what mends it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal

Status = Literal["good", "warning", "absent"]
"""As it should be; odd; or nothing there that could be checked."""


@dataclass(frozen=True, slots=True)
class Remedy:
    """What mends it, as a flag of ``multiview-phd import`` or a field of ``sequence.toml``."""

    flag: str
    """``--pose``, ``--axes``, …; or the field, for instance ``camera.time_offset``."""
    value: str
    camera: str = ""
    """Whose field it is."""

    def __str__(self) -> str:
        return (
            f"{self.flag} {self.value}"
            if self.flag.startswith("-")
            else (f"{self.flag} = {self.value}")
        )


@dataclass(frozen=True, slots=True)
class Check:
    """What one check found."""

    name: str
    status: Status
    sentence: str
    remedies: tuple[Remedy, ...] = ()
    """All of them together mend it."""
    numbers: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    """What the sentence is made of, by name."""

    def __str__(self) -> str:
        mended = " ".join(str(remedy) for remedy in self.remedies)
        return f"{self.sentence}: {mended}" if mended else self.sentence


def good(name: str, sentence: str, **numbers: float) -> Check:
    """All is as it should be."""
    return Check(name, "good", sentence, numbers=MappingProxyType(numbers))


def warning(name: str, sentence: str, *remedies: Remedy, **numbers: float) -> Check:
    """Something is odd."""
    return Check(name, "warning", sentence, remedies, MappingProxyType(numbers))


def absent(name: str, sentence: str) -> Check:
    """There is nothing that could be checked."""
    return Check(name, "absent", sentence)


def percent(share: float) -> str:
    """A share as a sentence has it."""
    return f"{100.0 * share:.0f} %"
