"""What each camera's pictures offered stage 1, and at which gate it was dropped.

A method tells of each step in its ``information`` how many candidates it had and how many of
them fell where; this module adds them up over a run and says so in words.
"""

from __future__ import annotations

from dataclasses import dataclass

from tracker.runs.run import Run
from tracker.single_view.dropped import CANDIDATES, DROPPED
from tracker.single_view.protocol import SHAKE, TRUST, UNCERTAINTY, ViewResult

_HALF = 0.5
"""A foreground that is trusted less than this is not what finds people."""


_EMPTY = (
    "better is a picture, or some steps, of the scene without anybody: background of the camera "
    "in sequence.toml"
)


@dataclass(frozen=True, slots=True)
class Gates:
    """Of one camera, over the pictures that were looked at."""

    camera: str
    pictures: int
    candidates: float
    """A picture."""
    dropped: dict[str, float]
    """By gate, a picture."""
    passed: float
    """To the fusion, a picture."""
    trust: float
    """In the foreground about the people with templates, 0 … 1; 1 where nothing is said."""
    doubt: float
    """That the background was learnt of an empty scene, 0 … 1; 0 where nothing is said."""

    def __str__(self) -> str:
        fell = ", ".join(
            f"{count:.1f} for {gate}" for gate, count in self.dropped.items() if count > 0.0
        )
        dropped = f", dropped {fell}" if fell else ""
        return (
            f'camera "{self.camera}": {self.candidates:.1f} candidates a picture{dropped}, '
            f"{self.passed:.1f} passed on"
        )


def count_gates(run: Run) -> list[Gates]:
    """What fell where in every camera; cameras whose method says nothing of it are left out."""
    gates = []
    for number, view in enumerate(run.sequence.views):
        told = [step[number] for step in run.views if CANDIDATES in step[number].information]
        if not told:
            continue
        names = dict.fromkeys(
            name for result in told for name in result.information if name.startswith(DROPPED)
        )
        gates.append(
            Gates(
                camera=view.camera.name,
                pictures=len(told),
                candidates=_mean(told, CANDIDATES),
                dropped={name.removeprefix(DROPPED): _mean(told, name) for name in names},
                passed=sum(len(result.boxes) for result in told) / len(told),
                trust=_mean(told, TRUST, 1.0),
                doubt=_mean(told, UNCERTAINTY),
            )
        )
    return gates


def _mean(told: list[ViewResult], name: str, otherwise: float = 0.0) -> float:
    return sum(result.information.get(name, otherwise) for result in told) / len(told)


def notices(run: Run) -> list[str]:
    """What somebody should know of how people were looked for: a sentence each.

    Of a run without tracks every camera's gates; else those of cameras that passed nobody on.
    """
    told = []
    gates = count_gates(run)
    given = {v.camera.name for v in run.sequence.views if v.background is not None}
    doubted = [one.camera for one in gates if one.trust < _HALF]
    unsure = [f'"{name}"' for name in doubted if name not in given]
    peopled = [f'"{name}"' for name in doubted if name in given]
    if peopled:
        told.append(
            f"the background given for {', '.join(peopled)} shows what the templates show: nobody "
            "may be in it, and the templates' boxes must be of people; they are looked for by "
            "colour, and by shape where their templates show one"
        )
    if unsure:
        told.append(
            f"the background of {', '.join(unsure)} was learnt from people who stay there, for "
            "their templates lie on it: they are looked for by colour, and by shape where "
            f"their templates show one; {_EMPTY}"
        )
    restless = [f'"{one.camera}"' for one in gates if one.doubt > _HALF]
    if restless:
        told.append(
            f"the background of {', '.join(restless)} was learnt from people who stay there, for "
            "much that moves never leaves: what moved lately counts as foreground; whoever keeps "
            f"still is found with a template; {_EMPTY}"
        )
    for number, view in enumerate(run.sequence.views):
        shake = max((step[number].information.get(SHAKE, 0.0) for step in run.views), default=0.0)
        if shake > 0.0:
            told.append(
                f'camera "{view.camera.name}" shakes by {shake:.1f} pixels: its pictures are held '
                "still"
            )
    nobody = not len(run.tracks.ids)
    told += [str(one) for one in gates if nobody or one.passed == 0.0]
    return told
