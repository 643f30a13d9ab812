"""The kinds of corrections, and the fields that each must have."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from tracker.corrections.constraints import Constraints

Kind = Literal[
    "same", "different", "exchanged", "here", "nobody", "came", "left", "name", "checked"
]

REACH = 1.0
"""Distance on the ground within which a place refers to the nearest track, metres."""

LEEWAY = 1.0
"""Time by which a track may miss the step of a place that refers to it, seconds."""


def leeway(step_time: float) -> int:
    """:data:`LEEWAY` as a number of steps of ``step_time`` seconds, at least 1."""
    return max(round(LEEWAY / step_time), 1)


class CorrectionError(ValueError):
    """A correction or a log of corrections is invalid."""


class Place(NamedTuple):
    """A position at a step, by which a correction refers to a track."""

    step: int
    """Index of the step, from 0."""
    x: float
    """World metres."""
    y: float
    """World metres."""
    z: float
    """Height of the centre of the target, world metres."""

    @property
    def point(self) -> Float[ndarray, " 3"]:
        """The position, world metres."""
        return np.array(self[1:])

    @property
    def words(self) -> str:
        """The place in the form of messages."""
        return f"({self.x:.2f}, {self.y:.2f}) at step {self.step}"


@dataclass(frozen=True, slots=True)
class KindDefinition:
    """The meaning and the fields of a kind of correction."""

    word: str
    """Name of the kind as the page shows it."""
    places: tuple[int, int | None]
    """Smallest and largest number of places; None for no upper bound."""
    means: str
    """Meaning of the kind, in one sentence."""
    accuracy: float | None = None
    """Default accuracy, metres; None for a kind without one."""


KINDS: dict[Kind, KindDefinition] = {
    "same": KindDefinition("same person", (2, 2), "the tracks at both places are of one person"),
    "different": KindDefinition(
        "not the same", (2, 2), "the tracks at the two places are of different people"
    ),
    "exchanged": KindDefinition(
        "exchanged from here",
        (4, 4),
        "the people at the first and the second place are at the third and the fourth one later",
    ),
    "here": KindDefinition(
        "is here",
        (1, 2),
        "a person is at the first place; if given, the second is where the run has that person",
        0.1,
    ),
    "nobody": KindDefinition(
        "was nobody", (1, None), "no person is near the path through these places", 0.5
    ),
    "came": KindDefinition("came in here", (1, 1), "the person at this place came in at this step"),
    "left": KindDefinition("left here", (1, 1), "the person at this place left at this step"),
    "name": KindDefinition("name", (1, 1), "the person at this place has this name"),
    "checked": KindDefinition(
        "checked", (0, 0), "the user has checked these steps, and the tracks are right"
    ),
}
"""The kinds by name. The places of a correction are in the order of time."""


class Correction(BaseModel):
    """One correction by a user."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", use_attribute_docstrings=True, allow_inf_nan=False
    )

    kind: Kind
    id: str = Field(default="", max_length=40, pattern=r"^[A-Za-z0-9_-]*$")
    """Identifier, by which copies of a log are compared; a hash of the content by default."""
    time: datetime = Field(default_factory=lambda: datetime.now(UTC).replace(microsecond=0))
    """Time at which the correction was made."""
    note: str = Field(default="", max_length=1000)
    """Free text of the user."""
    places: tuple[Place, ...] = ()
    """Places ``[step, x, y, z]``: the step, from 0, and the position, world metres."""
    accuracy: Annotated[float, Field(ge=0.01, le=5.0)] | None = None
    """Accuracy, metres: for *here* the standard deviation of the place, for *nobody* the radius
    around the places within which there is no person."""
    name: str | None = Field(default=None, min_length=1, max_length=80)
    """Name of the person, for *name*."""
    first: int | None = Field(default=None, ge=0)
    """First step, for *checked*."""
    last: int | None = Field(default=None, ge=0)
    """Last step, included, for *checked*."""

    @model_validator(mode="before")
    @classmethod
    def _with_defaults(cls, values: Any) -> Any:
        """Fill in accuracy and id by default, and round the places."""
        if isinstance(values, dict) and values.get("kind") in list(KINDS):
            known = KINDS[values["kind"]]
            values = dict(values)
            if known.accuracy is not None and values.get("accuracy") is None:
                values["accuracy"] = known.accuracy
            values["places"] = _rounded(values.get("places", ()))
            if not values.get("id"):
                values["id"] = _id_of(values)
        return values

    @model_validator(mode="after")
    def _complete(self) -> Correction:
        """Check that the places and fields are those of the kind."""
        known, count = KINDS[self.kind], len(self.places)
        fewest, most = known.places
        if count < fewest or (most is not None and count > most):
            wanted = {fewest: f"{fewest}", None: f"{fewest} or more"}.get(
                most, f"{fewest} to {most}"
            )
            raise ValueError(f"places: {self.kind} has {wanted}, found {count}")
        if any(place.step < 0 for place in self.places):
            raise ValueError("places: a step is a whole number from 0 on")
        steps = [place.step for place in self.places]
        if self.kind in ("same", "different") and not steps[0] < steps[1]:
            raise ValueError(
                f"places: {self.kind} goes forward in time, found steps {steps[0]} and {steps[1]}"
            )
        if self.kind == "exchanged" and not max(steps[:2]) < min(steps[2:]):
            raise ValueError(
                "places: exchanged has two before and then two after, found steps "
                + ", ".join(map(str, steps))
            )
        if self.kind == "here" and len(set(steps)) > 1:
            raise ValueError(
                "places: here says of one step where who is at the second place is, found steps "
                f"{steps[0]} and {steps[1]}"
            )
        if self.kind == "nobody" and steps != sorted(set(steps)):
            raise ValueError("places: nobody has one place a step, in the order of time")
        for field, kinds in _ONLY.items():
            there = getattr(self, field) is not None
            if there and self.kind not in kinds:
                raise ValueError(f"{field}: {self.kind} has none")
            if not there and self.kind in kinds:
                raise ValueError(f"{field}: {self.kind} needs it")
        if self.first is not None and self.last is not None and self.last < self.first:
            raise ValueError(f"last: expected a step from {self.first} on, found {self.last}")
        return self

    @property
    def steps(self) -> tuple[int, int]:
        """The first and the last step that the correction refers to."""
        if self.kind == "checked":
            return self.first or 0, self.last or 0
        steps = [place.step for place in self.places]
        return min(steps), max(steps)

    @property
    def constraints(self) -> Constraints[Place]:
        """The constraints that the correction states of its places."""
        one = frozenset(self.places[:1])
        match self.kind:
            case "same":
                return Constraints(must_link=((self.places[0], self.places[1]),))
            case "different":
                return Constraints(cannot_link=((self.places[0], self.places[1]),))
            case "exchanged":
                first, second, third, fourth = self.places
                return Constraints(
                    must_link=((first, third), (second, fourth)),
                    cannot_link=((first, fourth), (second, third)),
                )
            case "here":
                return Constraints(targets=one)
            case "nobody":
                return Constraints(clutter=frozenset(self.places))
            case "came":
                return Constraints(firsts=one)
            case "left":
                return Constraints(lasts=one)
            case _:
                return Constraints()

    @property
    def words(self) -> str:
        """The correction in a few words."""
        first, last = self.steps
        span = f"step {first}" if first == last else f"steps {first} – {last}"
        if self.kind == "checked":
            return f"steps {first} – {last} checked"
        if self.kind == "name":
            return f"{self.name}, {span}"
        return f"{KINDS[self.kind].word}, {span}"


_ONLY = {
    "accuracy": ("here", "nobody"), "name": ("name",), "first": ("checked",), "last": ("checked",),
}  # fmt: skip

IN_THE_FUSION: tuple[Kind, ...] = ("here", "nobody")
"""The kinds that the fusion applies; the others are about identity."""

OF_PEOPLE: tuple[Kind, ...] = (
    "same", "different", "exchanged", "here", "nobody", "came", "left", "name",
)  # fmt: skip
"""The kinds that a run can meet or not: all but *checked*."""


def _rounded(places: Any) -> Any:
    """Round places to the decimals of the log, so that a log that is read again gives the same
    run."""
    if not isinstance(places, list | tuple):
        return places
    return tuple(
        (one[0], *(round(v, 4) if isinstance(v, float) else v for v in one[1:]))
        if isinstance(one, list | tuple) and one
        else one
        for one in places
    )


def _id_of(values: dict[str, Any]) -> str:
    """A hash of the values of a correction, as its id."""
    content = {key: str(value) for key, value in values.items() if key != "id"}
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:12]


def make(**values: Any) -> Correction:
    """Make a correction from the values of its fields.

    Raises:
        CorrectionError: If a value is invalid; the message has field, expected and found value.
    """
    try:
        return Correction.model_validate(values)
    except ValidationError as error:
        raise CorrectionError(sentence_of(error)) from None


def sentence_of(error: ValidationError) -> str:
    """The message of the first error: field, expected and found value."""
    first = error.errors()[0]
    place = ".".join(str(part) for part in first["loc"])
    message = first["msg"].removeprefix("Value error, ")
    given = first.get("input")
    found = "" if isinstance(given, dict) else f", found {given!r}"
    return f"{place}: {message}{found}" if place else message


def digest(corrections: Iterable[Correction], kinds: Iterable[Kind]) -> str:
    """Hash the corrections of some kinds, in their order; empty where there is none.

    Note, time and id are left out, for they have no effect on a run.
    """
    chosen = set(kinds)
    contents = [_content(one) for one in corrections if one.kind in chosen]
    if not contents:
        return ""
    return hashlib.sha256(json.dumps(contents, sort_keys=True).encode()).hexdigest()[:16]


def content_of(correction: Correction) -> str:
    """The content of a correction as text, without note, time and id."""
    return json.dumps(_content(correction), sort_keys=True)


def _content(one: Correction) -> dict[str, Any]:
    """The fields of a correction that have an effect on a run."""
    return one.model_dump(mode="json", exclude={"id", "time", "note"}, exclude_none=True)
