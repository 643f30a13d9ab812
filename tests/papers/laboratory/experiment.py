"""What an experiment is: a claim, the run that tests it, and what it gives back."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from tracker.runs.processes import WorkerControl, map_in_processes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Item = TypeVar("Item")
Answer = TypeVar("Answer")

Verdict = Literal["better", "worse"]
"""Whether what was found is at least as good as what is claimed."""

Told = Callable[[str, int, int], None]
"""Called with what is being done, how much of it is done, and how much there is."""


class Unavailable(Exception):
    """An experiment cannot be run here; the message says what is missing and how to get it."""


@dataclass(frozen=True, slots=True)
class RandomRooms:
    """Which random rooms an experiment goes through."""

    count: int = 20
    first: int = 0
    """Seed of the first; the others follow."""
    methods: tuple[str, ...] = ()
    """Only these single-view methods; all, if none is named."""
    keep: bool = False
    """Whether they stay in the output folder."""


@dataclass(frozen=True, slots=True)
class Context:
    """What an experiment is run with."""

    quick: bool = False
    """Shortened to what shows the direction of each claim."""
    seeds: int | None = None
    """How many seeds each case is run with; None for the experiment's own number."""
    data: Path | None = None
    """Folder of real recordings; None where there are none."""
    output: Path | None = None
    """Folder where an experiment of many parts keeps those that are done; None to keep none."""
    rooms: RandomRooms = RandomRooms()
    """Of the experiment that draws its own rooms."""
    processes: int = 1
    """At most this many at once."""
    told: Told = lambda words, done, total: None
    cancelled: Callable[[], bool] = lambda: False
    """Asked now and then; an experiment that hears yes raises
    ``tracker.runs.pipeline.Cancelled``."""
    shared: dict[str, Any] = field(default_factory=dict, compare=False)
    """Runs that several experiments use."""

    def seeds_of(self, whole: int, quick: int) -> int:
        """How many seeds each case is run with.

        Args:
            whole: The experiment's own number.
            quick: The same where it is shortened.
        """
        return self.seeds or (quick if self.quick else whole)

    def spread(
        self,
        work: Callable[[Item, WorkerControl], Answer],
        items: Sequence[Item],
        *,
        words: str,
        steps: int,
    ) -> list[Answer]:
        """Do a piece of work for every item in processes; the answers in the items' order.

        Args:
            work: A function of a module, so that another process can import it.
            items: Values that can be pickled.
            words: What is being done.
            steps: Sum of the steps by which all items advance.

        Raises:
            tracker.runs.pipeline.Cancelled: If the context is cancelled.
        """
        return map_in_processes(
            work,
            items,
            steps=steps,
            processes=self.processes,
            on_progress=lambda done, total: self.told(words, done, total),
            cancelled=self.cancelled,
        )


@dataclass(frozen=True, slots=True)
class Finding:
    """A claim and what became of it."""

    claim: str
    """What the paper says, in a few words."""
    found: str
    """What was measured, with the value."""
    verdict: Verdict


@dataclass(frozen=True, slots=True)
class Result:
    """What an experiment found."""

    head: tuple[str, ...]
    """Names of the table's columns, with units."""
    rows: tuple[tuple[str, ...], ...]
    numbers: dict[str, Any]
    """Everything that was measured, as JSON takes it, with what it was measured with."""
    findings: tuple[Finding, ...]
    figure: Callable[[], Figure] | None = None
    """Draws the figure; called once, where a figure is wanted."""
    notes: tuple[str, ...] = field(default=())
    """What a reader of the table must know."""


@dataclass(frozen=True, slots=True)
class Experiment:
    """One claim that can be tested with one command."""

    name: str
    claim: str
    """What the paper says, in one line."""
    run: Callable[[Context], Result]
    """Raises ``Unavailable`` where something it needs is not there."""
