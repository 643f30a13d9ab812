"""The candidates of stage 1 in each camera's pictures, and the gates that rejected them.

A method reports in the ``information`` of each step how many candidates it had and how many
each gate rejected; this module averages the counts over a run and describes them in words.
"""

from __future__ import annotations

from dataclasses import dataclass

from tracker.runs.run import Run
from tracker.single_view.dropped import CANDIDATES, DROPPED
from tracker.single_view.protocol import SHAKE, TRUST, UNCERTAINTY

_HALF = 0.5
"""Trust in the foreground below which people are not detected by it; uncertainty of the
background above which a notice is given."""


_EMPTY = (
    "better is a picture, or some steps, of the scene without anybody: background of the camera "
    "in sequence.toml"
)


@dataclass(frozen=True, slots=True)
class Gates:
    """The counts of one camera, as means over the pictures that were processed."""

    camera: str
    """The name of the camera."""
    pictures: int
    """The number of pictures that were processed."""
    candidates: float
    """Number of candidates in a picture."""
    dropped: dict[str, float]
    """Number of candidates in a picture that each gate rejected, by gate."""
    passed: float
    """Boxes in a picture that were passed on to the fusion."""
    trust: float
    """Trust in the foreground at the people with templates, 0 … 1; 1 if the method reports
    none."""
    uncertainty: float
    """Uncertainty whether the background was learnt from an empty scene, 0 … 1; 0 if the method
    reports none."""

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
    """Average the counts of every camera; cameras whose method reports none are left out."""
    gates = []
    for number, view in enumerate(run.sequence.views):
        boxes = run.views.column("boxes", number).counts.tolist()
        counted = [
            (information, count)
            for information, count in zip(
                run.views.values("information", number), boxes, strict=True
            )
            if CANDIDATES in information
        ]
        if not counted:
            continue
        counts = [information for information, _ in counted]
        names = dict.fromkeys(name for one in counts for name in one if name.startswith(DROPPED))
        gates.append(
            Gates(
                camera=view.camera.name,
                pictures=len(counted),
                candidates=_mean(counts, CANDIDATES),
                dropped={name.removeprefix(DROPPED): _mean(counts, name) for name in names},
                passed=sum(count for _, count in counted) / len(counted),
                trust=_mean(counts, TRUST, 1.0),
                uncertainty=_mean(counts, UNCERTAINTY),
            )
        )
    return gates


def _mean(counts: list[dict[str, float]], name: str, otherwise: float = 0.0) -> float:
    return sum(one.get(name, otherwise) for one in counts) / len(counts)


def notices(run: Run) -> list[str]:
    """Describe in sentences how people were detected where that needs attention.

    The counts of all cameras are described if the run has no tracks, else those of cameras that
    passed no box on.
    """
    found = []
    gates = count_gates(run)
    given = {v.camera.name for v in run.sequence.views if v.background is not None}
    doubted = [one.camera for one in gates if one.trust < _HALF]
    unsure = [f'"{name}"' for name in doubted if name not in given]
    peopled = [f'"{name}"' for name in doubted if name in given]
    if peopled:
        found.append(
            f"the background given for {', '.join(peopled)} shows what the templates show: nobody "
            "may be in it, and the templates' boxes must be of people; they are looked for by "
            "colour, and by shape where their templates show one"
        )
    if unsure:
        found.append(
            f"the background of {', '.join(unsure)} was learnt from people who stay there, for "
            "their templates lie on it: they are looked for by colour, and by shape where "
            f"their templates show one; {_EMPTY}"
        )
    restless = [f'"{one.camera}"' for one in gates if one.uncertainty > _HALF]
    if restless:
        found.append(
            f"the background of {', '.join(restless)} was learnt from people who stay there, for "
            "much that moves never leaves: what moved lately counts as foreground; whoever keeps "
            f"still is found with a template; {_EMPTY}"
        )
    for number, view in enumerate(run.sequence.views):
        every = run.views.values("information", number)
        shake = max((information.get(SHAKE, 0.0) for information in every), default=0.0)
        if shake > 0.0:
            found.append(
                f'camera "{view.camera.name}" shakes by {shake:.1f} pixels: its pictures are held '
                "still"
            )
    untracked = not len(run.tracks.ids)
    found += [str(one) for one in gates if untracked or one.passed == 0.0]
    return found
