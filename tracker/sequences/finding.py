"""The result of one check of a recording: a sentence, and remedies."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal

Status = Literal["good", "warning", "absent"]
"""The status of a check; ``absent`` means that there is nothing to check."""


@dataclass(frozen=True, slots=True)
class Remedy:
    """A change that corrects the problem: a flag of ``multiview-phd import`` or a field of
    ``sequence.toml``."""

    flag: str
    """The flag, such as ``--pose`` or ``--axes``, or the field, such as ``camera.time_offset``."""
    value: str
    """The value of the flag or field, as text."""
    camera: str = ""
    """The name of the camera that the field belongs to; empty for other fields."""

    def __str__(self) -> str:
        if self.flag.startswith("-"):
            # "--up -z" would be two flags
            mark = "=" if self.value.startswith("-") else " "
            return f"{self.flag}{mark}{self.value}".rstrip()
        return f"{self.flag} = {self.value}"


@dataclass(frozen=True, slots=True)
class Check:
    """The result of one check."""

    name: str
    """The name of the check."""
    status: Status
    """The result of the check."""
    sentence: str
    """The result in one sentence."""
    remedies: tuple[Remedy, ...] = ()
    """The changes that correct the problem together."""
    numbers: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    """The numbers in the sentence, by name."""
    cameras: tuple[str, ...] = ()
    """The cameras that do not fit the others, where it is about them: without them it is good."""

    def __str__(self) -> str:
        mended = " ".join(str(remedy) for remedy in self.remedies)
        return f"{self.sentence}: {mended}" if mended else self.sentence


def good(name: str, sentence: str, **numbers: float) -> Check:
    """Return the result of a check without problems."""
    return Check(name, "good", sentence, numbers=MappingProxyType(numbers))


def warning(
    name: str, sentence: str, *remedies: Remedy, cameras: Iterable[str] = (), **numbers: float
) -> Check:
    """Return the result of a check that found a problem."""
    return Check(name, "warning", sentence, remedies, MappingProxyType(numbers), tuple(cameras))


def absent(name: str, sentence: str) -> Check:
    """Return the result of a check for which there is nothing to check."""
    return Check(name, "absent", sentence)


def percent(share: float) -> str:
    """Format a share in percent for a sentence."""
    return f"{100.0 * share:.0f} %"
