"""What the workbench holds, as values that can be read from any thread, and its passing events."""

from __future__ import annotations

import math
import secrets
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, Literal

from pydantic import ConfigDict

from app.colours import Theme
from app.messages import Model
from app.state.scores import Scores
from tracker.corrections import Correction
from tracker.fusion.trajectories import Trajectories
from tracker.parameters import MethodKey
from tracker.parameters.catalogue import METHODS, PARAMETERS, PRESETS, RunParameters
from tracker.parameters.values import changed_values, value_of, with_current_keys
from tracker.review.template_suggestions import Suggestion
from tracker.runs.fitting import unfit_methods
from tracker.runs.pipeline import Run
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence

Change = Literal[
    "sequence", "opening", "parameters", "playhead", "selection", "layers", "view", "theme",
    "run", "progress", "evaluation", "pinned", "presets", "taught", "editing", "corrections",
    "ghosts", "offers", "fetching", "edits", "marks", "tasks",
]  # fmt: skip
"""What is another now: ``run`` is a run's beginning and its end, ``progress`` its new steps,
``taught`` another room or other templates of the same recording."""

RunPhase = Literal["idle", "computing", "done", "failed", "cancelled"]

Level = Literal["info", "warn", "error"]

LAYERS = ("boxes", "bodies", "ellipsoids", "trails", "truth", "volume", "pinned", "others")
"""The layers of the 3D view that can be switched; ``others`` are the tracks that are not
selected, while one is."""

View = int | Literal["top"] | None
"""What the 3D view looks through: a camera by its index, from above, or freely."""

Presets = Mapping[str, Mapping[str, Any]]
"""A person's own presets: by name, the values by key that were not at their defaults."""

CLAMPED_ORIGIN = "viser"
"""Whose numbers are moved into their range rather than refused: viser clamps nothing itself."""

PRESET_ORIGIN = "preset "
"""What the origin of parameters begins with where a preset was applied; its name follows."""

DRAG_SECONDS = 3.0
"""A number that changes again within this time after its last change, or after the last news of the
run with it, is still being dragged: one edit, one row of runs and one kept run. viser does not say
when a slider is let go, and a browser that draws slowly moves one only between two results."""


class Trail(Model):
    """How trails are drawn, in 3D and in pictures."""

    model_config = ConfigDict(frozen=True)

    seconds: float = 4.0
    """How far back they go."""
    fades: bool = True
    """Whether they are fainter the older they are."""


@dataclass(frozen=True, slots=True, eq=False)
class Ghosts:
    """How tracks would be if something were otherwise, shown beside how they are."""

    run: str
    """Key of the run that they are another form of."""
    tracks: Trajectories
    """Around the place that is looked at."""


@dataclass(frozen=True, slots=True)
class RunState:
    """How far the run is that the parameters ask for."""

    key: str = ""
    """Of the run that is asked for; what is shown is of this run where its key is the same."""
    state: RunPhase = "idle"
    done: int = 0
    total: int = 0
    steps_per_second: float = 0.0
    seconds_left: float | None = None
    message: str = ""
    error: str | None = None
    kept: int | None = None
    """Its number in the library that it was taken from; what the cameras found is not there."""
    stands_for: str = ""
    """The key that a computation with these values would have, where older code made this one."""
    warnings: tuple[str, ...] = ()
    """What its result is not: pictures that were missing, files that changed; a sentence each."""


class Task(Model):
    """Work in the background: an export, a check of identities, an import, parameters' effects."""

    model_config = ConfigDict(frozen=True)

    of: str
    """The number of an export, the key of a run, that of an import, or that of a recording."""
    state: str
    done: int = 0
    """What is done of :attr:`total`; of an import it is the version that can be read."""
    total: int = 0
    """Steps or bytes; 0 while it is not known."""
    words: str = ""
    """What it makes: the name of a file."""
    error: str | None = None


@dataclass(frozen=True, slots=True)
class Opening:
    """A sequence that is being read."""

    name: str


@dataclass(frozen=True, slots=True)
class Command:
    """A key was pressed inside a 3D view in a window of its own."""

    name: str


@dataclass(frozen=True, slots=True)
class Notice:
    """A sentence for the person in front of the page."""

    level: Level
    message: str
    hint: str | None = None
    report: str | None = None
    """What somebody may copy and pass on."""


@dataclass(frozen=True, slots=True)
class StudyNews:
    """A study has another state, or more trials that ended."""

    told: Mapping[str, Any]
    """What the list of studies says of it."""


Event = Command | Notice | StudyNews


@dataclass(frozen=True, slots=True, eq=False)
class Snapshot:
    """The whole state at one moment; a value that can be read from any thread."""

    version: int = 0
    """Grows with every change."""
    sequence: Sequence | None = None
    """That is open, with what it was taught since."""
    saved: Sequence | None = None
    """The same as its file has it."""
    editing_room: bool = False
    """Whether the 3D view has handles on the room."""
    opened_as: str = ""
    """The name or folder that opens the sequence again."""
    sequence_key: str = ""
    """Changes with the content, so that browsers may cache pictures for ever."""
    reader: FrameReader | None = None
    opening: Opening | None = None
    parameters: RunParameters = field(default_factory=RunParameters)
    defaults: RunParameters = field(default_factory=RunParameters)
    """The values that a reset returns to: of methods, those that fit the sequence."""
    parameters_origin: str = ""
    """Who changed the parameters last, so that a client is not sent its own change."""
    session: str = field(default_factory=lambda: secrets.token_hex(4))
    """Another for every start of the program."""
    presets: Presets = field(default_factory=lambda: MappingProxyType({}))
    corrections: tuple[Correction, ...] = ()
    """What was put right by hand in the open sequence."""
    undo_words: str | None = None
    """What would be undone; None for nothing."""
    redo_words: str | None = None
    """What would be redone; None for nothing."""
    marks: int = 0
    """Grows when kept runs are named, marked, deleted or restored."""
    tasks: Mapping[str, Task] = field(default_factory=lambda: MappingProxyType({}))
    """The newest of each kind: ``export``, ``identity``, ``effects``, ``import`` with its key."""
    playhead: int = 0
    playhead_origin: str = ""
    sought: bool = False
    """Whether the playhead was moved since the sequence was opened."""
    selection: int | None = None
    run: Run | None = None
    """What is shown; steps below its ``done`` are there."""
    run_state: RunState = RunState()
    scores: Scores = field(default_factory=Scores)
    """Runs against the truth, where there is one."""
    ghosts: Ghosts | None = None
    offers: tuple[Suggestion, ...] | None = None
    """Templates cut from a run's tracks, once somebody asked for them."""
    fetching: int | None = None
    """Percentage of a detection network that is fetched; None while none is being fetched."""
    layers: Mapping[str, bool] = field(
        # the truth is in the pictures at first: in 3D twice as many boxes hide the people
        default_factory=lambda: MappingProxyType({name: name != "truth" for name in LAYERS})
    )
    trail: Trail = field(default_factory=Trail)
    view: View = None
    flies: bool = True
    """Whether changes of the 3D view are animated; false once a page asks for reduced motion."""
    theme: Theme = "dark"
    """Of the 3D view."""

    @property
    def preset(self) -> str | None:
        """The preset, built in or saved, whose values the parameters have."""
        own = changed_values(self.parameters, self.defaults)
        single_view = {"single_view": self.parameters.single_view}
        for name, values in {**PRESETS, **self.presets}.items():
            meant = {**single_view, **with_current_keys(values)}
            if not meant.keys() <= _KEYS:  # saved by another version
                continue
            if own == {k: v for k, v in meant.items() if v != value_of(self.defaults, k)}:
                return name
        return None

    @property
    def unfit(self) -> dict[MethodKey, dict[str, str]]:
        """The methods that cannot work on the open sequence, each with the reason."""
        if self.sequence is None:
            return {key: {} for key in METHODS}
        return unfit_methods(self.sequence, self.parameters)

    def named(self, sequence: Sequence) -> Sequence:
        """The sequence of a run under its present name, which saving a copy changes."""
        return sequence if self.sequence is None else replace(sequence, name=self.sequence.name)

    @property
    def step_is_computed(self) -> bool:
        """Whether the shown run has the playhead's step."""
        return self.run is not None and self.playhead < self.run.done


_KEYS = {*METHODS, *PARAMETERS}


def clamp(key: str, value: Any) -> Any:
    """A number moved into the range of its parameter; what is no number is left to the check."""
    parameter = PARAMETERS.get(key)
    if parameter is None or parameter.kind not in ("float", "int"):
        return value
    try:
        number = float(value)
    except (TypeError, ValueError):
        return value
    if not math.isfinite(number):
        return value
    if parameter.minimum is not None:
        number = max(number, parameter.minimum)
    if parameter.maximum is not None:
        number = min(number, parameter.maximum)
    return round(number) if parameter.kind == "int" else number
