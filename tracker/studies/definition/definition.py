"""The definition of a study: recordings, varied parameters, seeds, trials and objectives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from tracker.parameters.catalogue import PARAMETERS, PRESETS

Search = Literal["auto", "tpe", "nsga2", "random", "grid"]
"""The search method; ``auto`` is TPE for one objective and NSGA-II for several."""

MOST_TRIALS = 1_000_000
"""Largest number of trials; with it and a limit of time, the time alone limits a study."""

GRID_STEPS = 5
"""The default number of a parameter's values on a grid."""


@dataclass(frozen=True, slots=True)
class Varied:
    """A parameter, or the choice of a method, that a study varies."""

    key: str
    """The key of the parameter."""
    low: float | None = None
    """Smallest value in the parameter's unit; None if there are choices."""
    high: float | None = None
    """Largest value in the parameter's unit, included; None if there are choices."""
    log: bool = False
    """Whether the logarithm of the value is drawn uniformly, rather than the value."""
    steps: int = GRID_STEPS
    """The number of values on a grid."""
    choices: tuple[Any, ...] = ()
    """The values of a parameter that is not varied over a range."""

    @property
    def is_whole(self) -> bool:
        """Whether the parameter is an integer."""
        return self.key in PARAMETERS and PARAMETERS[self.key].kind == "int"

    def contains(self, tried: Any) -> bool:
        """Whether a value lies in the range, or is one of the choices."""
        if self.choices:
            return tried in self.choices
        assert self.low is not None
        assert self.high is not None
        return bool(self.low <= tried <= self.high)

    def table(self) -> dict[str, Any]:
        """Return the parameter's table in a study's file."""
        if self.choices:
            return {"choices": list(self.choices)}
        return {"low": self.low, "high": self.high, "log": self.log, "steps": self.steps}


@dataclass(frozen=True, slots=True)
class Definition:
    """A validated definition of a study."""

    name: str
    """The name of the study and of its folder."""
    recordings: tuple[str, ...]
    """Names of built-in recordings, or absolute folders."""
    varied: tuple[Varied, ...]
    """The varied parameters."""
    trials: int = 100
    """Largest number of trials."""
    minutes: float | None = None
    """Time after which no trial begins, minutes; None for no limit."""
    seeds: tuple[int, ...] = (0,)
    """The seeds of the runs on each recording."""
    search: Search = "auto"
    """The search method."""
    objectives: tuple[str, ...] = ()
    """Keys of :data:`~tracker.studies.definition.objectives.OBJECTIVES`, the most important one
    first; if empty, they are chosen by whether the recordings have ground truth."""
    prune: bool = True
    """Whether trials are pruned if they are worse than the median after their first runs."""
    preset: str | None = None
    """The preset whose values all trials have; None for none."""
    propose: int = 0
    """The number of further seeds on which the best trials are evaluated again at the end, so that
    the best of them can be proposed; 0 for no proposal."""
    seed: int = 0
    """The seed of the sampler."""
    values: Mapping[str, Any] = field(default_factory=dict)
    """Fixed values of all trials, which override the recording's defaults and the preset."""
    start: Mapping[str, Any] = field(default_factory=dict)
    """Values of varied parameters that are tried right after the defaults."""

    def held(self) -> dict[str, Any]:
        """Return the fixed values of all trials by key: the preset's, overridden by
        :attr:`values`."""
        return {**(PRESETS[self.preset] if self.preset else {}), **self.values}

    def to_json(self) -> dict[str, Any]:
        """Return the content of the study's file as plain values."""
        content: dict[str, Any] = {
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
            content["minutes"] = self.minutes
        if self.preset is not None:
            content["preset"] = self.preset
        for name in ("values", "start"):
            if table := dict(getattr(self, name)):
                content[name] = table
        return content | {"parameters": {one.key: one.table() for one in self.varied}}

    @property
    def by_time_alone(self) -> bool:
        """Whether the number of trials is limited by the time alone."""
        return self.minutes is not None and self.trials >= MOST_TRIALS

    def within(self) -> str:
        """Return the limit of trials in words, to be put after the number of trials done."""
        return f"in {self.minutes:g} minutes" if self.by_time_alone else f"of {self.trials}"

    def to_toml(self) -> str:
        """Return the text of the study's file."""
        import tomlkit

        return tomlkit.dumps(self.to_json())
