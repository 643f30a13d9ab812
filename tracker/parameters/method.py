"""The description of a method: its name, what it uses, and the class that implements it.

A method of stage 1, 2 or 3 is described once, by a :class:`Method`. The descriptions give
the choices of the command line and of the page, the parameters that are shown and
that a result depends on, and whether a method can work on a recording. Methods of this project and
of other packages are listed alike: see :mod:`tracker.parameters.catalogue`.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol, TypeVar

from tracker.parameters.definition import Params

P = TypeVar("P", bound=Params)

MethodKey = Literal["single_view", "fusion_method", "smoothing_method"]
"""The parameter that chooses the method of stage 1, of stage 2, or of stage 3."""


class Values(Protocol):
    """The values of a run, as far as the description of a method depends on them."""

    def of(self, kind: type[P]) -> P:
        """Return the values of one group, by the class that defines it."""


@dataclass(frozen=True, slots=True)
class Reads:
    """A group of parameters that a method reads, or a part of it."""

    group: str
    """The name of the group."""
    only: type[Params] | None = None
    """The class whose parameters alone are read, a base class of the group's; None for all."""
    without: frozenset[str] = frozenset()
    """Names of parameters in the group that the method does not read."""

    def reads(self, group: str, name: str) -> bool:
        """Whether the method reads the parameter ``group.name``."""
        part = self.only is None or name in self.only.model_fields
        return group == self.group and part and name not in self.without


@dataclass(frozen=True, slots=True)
class Uses:
    """What a method uses of a recording and of the parameters, given the chosen values."""

    pictures: bool = False
    """Whether every camera must have pictures."""
    detections: bool = False
    """Whether every camera must have an outside detector's boxes."""
    detector: bool = False
    """Whether a detection network must be named, which the method runs itself."""
    every: int = 1
    """The method sees every n-th step; the steps between are without a frame."""
    templates: Literal["no", "if there", "needed"] = "no"
    """Whether the method uses the colour templates, and whether it needs at least one."""
    reads: tuple[Reads, ...] = ()
    """The groups of parameters that the method reads, its own included."""

    @property
    def finds_people(self) -> bool:
        """Whether the method detects people in pictures itself, and so may give several boxes for
        one person; outside detectors and networks suppress boxes that overlap."""
        return self.pictures and not self.detector

    def reads_parameter(self, group: str, name: str) -> bool:
        """Whether the method reads the parameter ``group.name``."""
        return any(part.reads(group, name) for part in self.reads)


@dataclass(frozen=True, slots=True)
class Method:
    """One method of stage 1, 2 or 3.

    Args:
        name: The name by which the method is chosen; a word in snake_case.
        help: What the method is, in one sentence.
        made_by: The class or function that makes the method, or its place as ``module:name``,
            which is imported when the method is first made; None for a method of this project,
            which the package of its stage imports by its name. Stage 1 calls it with ``(sequence,
            camera_index, parameters, reader)`` and expects a
            :class:`~tracker.single_view.protocol.SingleViewMethod`; stage 2 calls it with
            ``(sequence, parameters)`` and expects a
            :class:`~tracker.fusion.protocol.FusionMethod`; stage 3 calls it with the same and
            expects a :class:`~tracker.smoothing.protocol.SmoothingMethod`. ``parameters`` are those
            of the run; :meth:`Values.of` returns the method's own group.
        uses: What the method uses, or a function that returns it for the chosen values. A
            parameter that is left out here is not shown and must not change any result.
        parameters: The class of the method's own parameters; None if it has none.
        group: The name of the group of these parameters; the method's name if empty.
    """

    name: str
    help: str
    made_by: str | Callable[..., Any] | None = None
    uses: Uses | Callable[[Values], Uses] = field(default_factory=Uses)
    parameters: type[Params] | None = None
    group: str = ""
    resolves_identities: bool = False
    """Whether a method of stage 3 resolves identities over the whole recording, and so applies
    corrections of identity."""

    @property
    def own_group(self) -> str:
        """The name of the group of the method's own parameters."""
        return self.group or self.name

    def used(self, parameters: Values) -> Uses:
        """Return what the method uses with the values of these parameters."""
        return self.uses if isinstance(self.uses, Uses) else self.uses(parameters)

    def load(self) -> Callable[..., Any]:
        """Import the class or function that makes the method of another package.

        Raises:
            ValueError: If ``made_by`` is None.
        """
        if self.made_by is None:
            raise ValueError(f"{self.name}: made_by names nothing; name a class or function")
        if not isinstance(self.made_by, str):
            return self.made_by
        module, _, name = self.made_by.partition(":")
        found: Callable[..., Any] = getattr(importlib.import_module(module), name)
        return found
