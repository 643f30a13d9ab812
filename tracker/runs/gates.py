"""The candidates of stage 1 in each camera's pictures, and the gates that rejected them.

A method reports in the ``information`` of each step how many candidates it had and how many
each gate rejected; this module averages the counts over a run and describes them in words.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy import ndarray

from tracker.runs.run import Run
from tracker.single_view.protocol import CANDIDATES, DROPPED, OUTSIDE, SHAKE, TRUST, UNCERTAINTY

_HALF = 0.5
"""Trust in the foreground below which people are not detected by it; uncertainty of the
background above which a notice is given."""

_SLIDERS = {
    ("colour_phd", "colour"): "raise colour_phd.acceptance_distance, or add a template",
    ("colour_phd", "foreground"): "lower colour_phd.acceptance_foreground",
    ("colour_phd", "surroundings"): "lower colour_phd.surroundings_weight",
    ("colour_phd", "shape"): "lower colour_phd.shape_odds",
    ("shapes", "shape"): "lower shapes.passed_odds",
    ("jpda", "colour"): "raise colour_phd.acceptance_distance, or add a template",
    ("jpda", "foreground"): "lower jpda.least_inside",
    ("jpda", "surroundings"): "raise jpda.most_above or jpda.most_beside",
    ("jpda", "another's shoulders"): "lower jpda.shoulder_across",
    ("jpda", OUTSIDE): "raise detection_boxes.room_tolerance",
    ("association_matrix", "foreground"): "lower association_matrix.least_inside",
    ("association_matrix", "outline"): "lower association_matrix.acceptance",
    ("onnx_detector", OUTSIDE): "raise detection_boxes.room_tolerance",
    ("detection_phd", OUTSIDE): "raise detection_boxes.room_tolerance",
    ("none", OUTSIDE): "raise detection_boxes.room_tolerance",
}
"""What lets more candidates through, by method and gate; at other gates it is no single value."""

_NO_CANDIDATES = {
    "colour_phd": "raise colour_phd.samples, or add a template",
    "shapes": "lower shapes.passed_odds",
    "jpda": "lower foreground.threshold",
    "association_matrix": "lower foreground.threshold",
    "onnx_detector": "lower onnx_detector.score_threshold",
    "detection_phd": "lower detection_boxes.score_threshold",
    "none": "lower detection_boxes.score_threshold",
}
"""What gives more candidates, by method."""

_RARE = 0.05
"""Candidates in a picture, on average, below which there are too few for any gate to matter."""

_MOST = 0.5
"""Share of the candidates that a gate rejects from which it is named."""

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
        numbers = run.views.numbers("information", number)
        if CANDIDATES not in numbers:
            continue
        counted = ~np.isnan(numbers[CANDIDATES])
        mean = partial(_mean, {name: values[counted] for name, values in numbers.items()})
        gates.append(
            Gates(
                camera=view.camera.name,
                pictures=int(counted.sum()),
                candidates=mean(CANDIDATES),
                dropped={
                    name.removeprefix(DROPPED): mean(name)
                    for name in numbers
                    if name.startswith(DROPPED)
                },
                passed=float(run.views.column("boxes", number).counts[counted].mean()),
                trust=mean(TRUST, 1.0),
                uncertainty=mean(UNCERTAINTY),
            )
        )
    return gates


def _mean(numbers: dict[str, ndarray], name: str, otherwise: float = 0.0) -> float:
    values = numbers.get(name, np.array([otherwise]))
    return float(np.where(np.isnan(values), otherwise, values).mean())


def decisive_gate(run: Run) -> str | None:
    """Describe the gate that rejected most of a run's candidates, and the value that it depends on.

    Returns:
        A clause with the counts, the gate and the parameter's key; None if no gate rejected half of
        the candidates, or the method reports none.
    """
    cameras = count_gates(run)
    method = run.parameters.single_view
    if not cameras:
        return None
    candidates = sum(one.candidates for one in cameras) / len(cameras)
    if candidates < _RARE:
        more = _NO_CANDIDATES.get(method)
        return f"{candidates:.2f} candidates a picture" + (f": {more}" if more else "")
    totals: Counter[str] = Counter()
    for one in cameras:
        totals.update({gate: count / len(cameras) for gate, count in one.dropped.items()})
    gate, count = max(totals.items(), key=lambda item: item[1], default=("", 0.0))
    if count < _MOST * candidates:
        return None
    more = _SLIDERS.get((method, gate))
    return f"{count:.1f} of {candidates:.1f} candidates a picture fell for {gate}" + (
        f": {more}" if more else ""
    )


def notices(run: Run) -> list[str]:
    """Describe in sentences how people were detected where that needs attention.

    The counts of all cameras are described if the run has no tracks, else those of cameras that
    passed no box on; none where no camera had a candidate.
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
        every = run.views.numbers("information", number).get(SHAKE, np.zeros(1))
        shake = np.nanmax(every)
        if shake > 0.0:
            found.append(
                f'camera "{view.camera.name}" shakes by {shake:.1f} pixels: its pictures are held '
                "still"
            )
    untracked = not len(run.tracks.ids)
    if any(one.candidates for one in gates):
        found += [str(one) for one in gates if untracked or one.passed == 0.0]
    return found
