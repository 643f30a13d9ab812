"""What a study is: recordings, what is varied and how far, seeds, trials, objectives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from tracker.parameters import PARAMETERS, PRESETS

Search = Literal["auto", "tpe", "nsga2", "random", "grid"]
"""How values are sought; ``auto`` is TPE for one objective and NSGA-II for several."""

MOST_TRIALS = 1_000_000

GRID_STEPS = 5
"""Values of a number on a grid, unless its ``steps`` say otherwise."""


@dataclass(frozen=True, slots=True)
class Varied:
    """One parameter, or choice of a method, that a study varies."""

    key: str
    low: float | None = None
    high: float | None = None
    """Of a number, both included, in its unit."""
    log: bool = False
    """Whether a number is drawn evenly over its logarithm."""
    steps: int = GRID_STEPS
    """Of a number on a grid."""
    choices: tuple[Any, ...] = ()
    """Of anything else."""

    @property
    def is_whole(self) -> bool:
        """Whether it is a whole number."""
        return self.key in PARAMETERS and PARAMETERS[self.key].kind == "int"

    def contains(self, tried: Any) -> bool:
        """Whether a value is among those that are tried."""
        if self.choices:
            return tried in self.choices
        assert self.low is not None
        assert self.high is not None
        return bool(self.low <= tried <= self.high)

    def table(self) -> dict[str, Any]:
        """As a study's file has it."""
        if self.choices:
            return {"choices": list(self.choices)}
        return {"low": self.low, "high": self.high, "log": self.log, "steps": self.steps}


@dataclass(frozen=True, slots=True)
class Definition:
    """A study, checked."""

    name: str
    recordings: tuple[str, ...]
    """Names of rendered rooms, or absolute folders."""
    varied: tuple[Varied, ...]
    trials: int = 100
    minutes: float | None = None
    """No trial begins after so long; None for no such bound."""
    seeds: tuple[int, ...] = (0,)
    search: Search = "auto"
    objectives: tuple[str, ...] = ()
    """Keys of :data:`~tracker.studies.defined.objectives.OBJECTIVES`, the leading one first; where
    there are none they follow the recordings."""
    prune: bool = True
    """Whether hopeless trials are given up after the first recordings."""
    preset: str | None = None
    propose: int = 0
    """On how many seeds that no trial had the best are measured again at the end, and the best
    of them proposed; 0 leaves it out."""
    seed: int = 0
    """Of the sampler."""
    values: Mapping[str, Any] = field(default_factory=dict)
    """What is held, against the recording's defaults and the preset."""
    start: Mapping[str, Any] = field(default_factory=dict)
    """Values of varied parameters that are tried right after the defaults."""

    def held(self) -> dict[str, Any]:
        """The values by key that every trial has: the preset's, then its own."""
        return {**(PRESETS[self.preset] if self.preset else {}), **self.values}

    def to_json(self) -> dict[str, Any]:
        """As a study's file has it."""
        told: dict[str, Any] = {
            "name": self.name,
            "recordings": list(self.recordings),
            "trials": self.trials,
            "seeds": list(self.seeds),
            "search": self.search,
            "objectives": list(self.objectives),
            "prune": self.prune,
            "propose": self.propose,
            "seed": self.seed,
        }
        if self.minutes is not None:
            told["minutes"] = self.minutes
        if self.preset is not None:
            told["preset"] = self.preset
        for name in ("values", "start"):
            if table := dict(getattr(self, name)):
                told[name] = table
        return told | {"parameters": {one.key: one.table() for one in self.varied}}

    @property
    def by_time_alone(self) -> bool:
        """Whether there are as many trials as the time allows."""
        return self.minutes is not None and self.trials >= MOST_TRIALS

    def within(self) -> str:
        """The bound on its trials, in words after their number."""
        return f"in {self.minutes:g} minutes" if self.by_time_alone else f"of {self.trials}"

    def to_toml(self) -> str:
        """The text of its file."""
        import tomlkit

        return tomlkit.dumps(self.to_json())
