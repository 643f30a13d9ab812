"""What a method is to everybody else: its name, what it uses, and how it is made.

A method of stage 1, 2 or 3 is described once, by a :class:`Method`. From the descriptions
come the choices of the command line and of the page, the parameters that are shown and
that a result depends on, and whether a method can work on a recording. Those of this
project and those of other packages are registered alike: see
:mod:`tracker.parameters.registry`.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

from tracker.parameters.definition import Params

if TYPE_CHECKING:
    from tracker.parameters.run import RunParameters

MethodKey = Literal["single_view", "fusion_method", "smoothing_method"]
"""The parameter that chooses the method of stage 1, of stage 2, or of stage 3."""


@dataclass(frozen=True, slots=True)
class Reads:
    """A group of parameters that a method reads, or a part of it."""

    group: str
    only: type[Params] | None = None
    """The part: those of the group's numbers that this class defines; None for all."""
    without: frozenset[str] = frozenset()
    """Names in the group that have no effect all the same."""

    def reads(self, group: str, name: str) -> bool:
        """Whether a number is read."""
        part = self.only is None or name in self.only.model_fields
        return group == self.group and part and name not in self.without


@dataclass(frozen=True, slots=True)
class Uses:
    """What a method uses of a recording and of the parameters, with the values chosen."""

    pictures: bool = False
    """Whether every camera must have pictures."""
    detections: bool = False
    """Whether every camera must have an outside detector's boxes."""
    detector: bool = False
    """Whether a detection network must be named, which it runs by itself."""
    templates: Literal["no", "if there", "needed"] = "no"
    """Whether it looks at the colour templates, and whether it can do without any."""
    reads: tuple[Reads, ...] = ()
    """Groups of parameters, its own included."""

    @property
    def finds_people(self) -> bool:
        """Whether it finds people in pictures by itself, and so may draw several boxes around one;
        an outside detector and a network keep one of those that overlap."""
        return self.pictures and not self.detector

    def reads_number(self, group: str, name: str) -> bool:
        """Whether a number is read."""
        return any(part.reads(group, name) for part in self.reads)


@dataclass(frozen=True, slots=True)
class Method:
    """One method of stage 1, 2 or 3.

    Args:
        name: By which it is chosen; a word in snake_case.
        help: What it is, in one sentence.
        made_by: A class or function, or where it stands as ``module:name``, which is
            imported when the method is first made; None for a method of this project,
            which the package of its stage imports by its name. Stage 1 calls it with ``(sequence,
            camera_index, parameters, reader)`` and takes a
            :class:`~tracker.single_view.protocol.SingleViewMethod`; stage 2 with
            ``(sequence, parameters)`` and takes a
            :class:`~tracker.fusion.protocol.FusionMethod`; stage 3 with the same and takes a
            :class:`~tracker.smoothing.protocol.SmoothingMethod`. ``parameters`` are those of the
            run, where its own are found by :meth:`RunParameters.of`.
        uses: What it uses, or a function that tells it of the values chosen. Whatever is
            left out here is shown to nobody and must change no result.
        parameters: Its own numbers; None where it brings none.
        group: Name of the group of these; its own name where empty.
    """

    name: str
    help: str
    made_by: str | Callable[..., Any] | None = None
    uses: Uses | Callable[[RunParameters], Uses] = field(default_factory=Uses)
    parameters: type[Params] | None = None
    group: str = ""
    settles_who: bool = False
    """Of stage 3: whether it settles who is who, and obeys what a person said of that."""

    @property
    def own_group(self) -> str:
        """The group of its own numbers."""
        return self.group or self.name

    def used(self, parameters: RunParameters) -> Uses:
        """What it uses with these values."""
        return self.uses if isinstance(self.uses, Uses) else self.uses(parameters)

    def load(self) -> Callable[..., Any]:
        """The class or function that another package's method is made by, imported now.

        Raises:
            ValueError: If nothing is named, and the method is none of this project's.
        """
        if self.made_by is None:
            raise ValueError(f"{self.name}: made_by names nothing; name a class or function")
        if not isinstance(self.made_by, str):
            return self.made_by
        module, _, name = self.made_by.partition(":")
        found: Callable[..., Any] = getattr(importlib.import_module(module), name)
        return found
