"""What is run on a piece: every method that can work on it, both fusions, the presets."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from tracker.parameters.catalogue import METHODS, PARAMETERS, PRESETS, RunParameters
from tracker.parameters.groups.colour_phd import ColourBoxParams
from tracker.parameters.values import with_values
from tracker.runs import pipeline
from tracker.runs.pipeline import Run
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence

_BOXES = ("none", "detection_phd")
"""The single-view methods that start from boxes; ``jpda`` can, and all others need pictures."""


_LATER = ("fusion.", "smoothing")
"""What the keys of values begin with that stage 1 does not depend on."""


@dataclass(frozen=True, slots=True)
class Combination:
    """One way to run: a single-view method with its values, then a fusion with its own."""

    preset: str
    single_view: str
    fusion_method: str
    changes: tuple[tuple[str, Any], ...] = ()
    """Values against the preset."""

    @property
    def parameters(self) -> RunParameters:
        """All values."""
        return with_values(
            RunParameters(),
            {
                **PRESETS[self.preset],
                "single_view": self.single_view,
                "fusion_method": self.fusion_method,
                **dict(self.changes),
            },
        )

    @property
    def view_name(self) -> str:
        """What stage 1 is called: combinations of the same name share it."""
        own = [f"{key}={new}" for key, new in self.changes if not key.startswith(_LATER)]
        return " ".join([self.preset, self.single_view, *own])

    @property
    def name(self) -> str:
        """What the whole is called."""
        own = [f"{key}={new}" for key, new in self.changes if key.startswith(_LATER)]
        return " ".join([self.view_name, self.fusion_method, *own])


def combinations(sequence: Sequence) -> list[Combination]:
    """Every preset, single-view method and fusion that can work on a sequence."""
    return [
        Combination(preset, single_view, fusion_method, changes)
        for preset in PRESETS
        for single_view, changes in _single_views(sequence)
        for fusion_method in _fusions(preset)
    ]


def alternatives(sequence: Sequence) -> list[Combination]:
    """Every value of every choice that the defaults do not take, one at a time."""
    found = [
        Combination("robust", single_view, fusion_method, (*changes, ("smoothing_method", method)))
        for single_view, changes in _reading(sequence, "smoothing")
        for fusion_method in METHODS["fusion_method"]
        for method in METHODS["smoothing_method"]
        if method != "none"
    ]
    for key, parameter in PARAMETERS.items():
        values: tuple[Any, ...] = parameter.choices if parameter.kind == "choice" else ()
        if parameter.kind == "bool":
            values = (not parameter.default,)
        for new in values:
            if new != parameter.default and _possible(sequence, key, new):
                for single_view, changes in _reading(sequence, parameter.group, parameter.name):
                    for fusion_method in _asking(parameter.group):
                        own = dict(changes)
                        if parameter.group == "smoothing":
                            own["smoothing_method"] = "identities"
                        found.append(
                            Combination(
                                "robust",
                                single_view,
                                fusion_method,
                                tuple({**own, key: new}.items()),
                            )
                        )
    return list(dict.fromkeys(found))


def _possible(sequence: Sequence, key: str, new: Any) -> bool:
    """Whether the sequence has what a method is then given."""
    if key != "jpda.measurements":
        return True
    return sequence.has_detections if new == "detections" else sequence.has_pictures


def _single_views(
    sequence: Sequence,
) -> Iterator[tuple[str, tuple[tuple[str, Any], ...]]]:
    for method in METHODS["single_view"]:
        if method in _BOXES:
            if sequence.has_detections:
                yield method, ()
        elif method == "onnx_detector":
            continue  # it is somebody's own network
        elif sequence.has_pictures:
            yield method, ()
        elif method == "jpda":
            yield method, (("jpda.measurements", "detections"),)


def _fusions(preset: str) -> tuple[str, ...]:
    chosen = PRESETS[preset].get("fusion_method")
    return METHODS["fusion_method"] if chosen is None else (chosen,)


def _reading(
    sequence: Sequence, group: str, name: str = ""
) -> Iterator[tuple[str, tuple[tuple[str, Any], ...]]]:
    """The single-view methods that a parameter of a group matters to."""
    possible = dict(_single_views(sequence))
    if group in ("fusion", "smoothing"):
        names = ("none",) if sequence.has_detections else ("colour_phd",)
    elif group == "foreground":
        names = ("colour_phd", "jpda", "association_matrix")
    elif group == "colour_phd" and name in ColourBoxParams.model_fields:
        names = ("colour_phd", "pseudo_particle")
    else:
        names = ("none" if group == "detection_boxes" else group,)
    for method in names:
        if method in possible:
            yield method, possible[method]


def _asking(group: str) -> tuple[str, ...]:
    return METHODS["fusion_method"] if group == "fusion" else ("multi_bernoulli",)


def runs(
    sequence: Sequence, steps: int, chosen: list[Combination]
) -> Iterator[tuple[Combination, Run]]:
    """Run them all over the first steps; those that share stage 1 compute it once.

    As in the workbench one reader serves all of them, and what depends on the pictures alone, such
    as the background, is made once.
    """
    previous: dict[str, Run] = {}
    with FrameReader(sequence) as reader:
        for combination in chosen:
            run = pipeline.compute(
                sequence,
                combination.parameters,
                steps=steps,
                reader=reader,
                previous=previous.get(combination.view_name),
            )
            previous[combination.view_name] = run
            yield combination, run
