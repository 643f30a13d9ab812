"""What a method says of itself is so: it is made by it, and what is hidden has no effect."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.single_view.networks import answering
from tracker.geometry.camera import Camera
from tracker.parameters.catalogue import (
    DEFAULT_CANDIDATES,
    METHODS,
    ORIGINS,
    PARAMETERS,
    PRESETS,
    REGISTERED,
    Parameter,
    RunParameters,
    method_of,
)
from tracker.parameters.values import (
    changed_values,
    shown_keys,
    stage_values,
    value_of,
    with_values,
)
from tracker.runs import pipeline, warm_up
from tracker.runs.fitting import advice, default_parameters, unfit_methods
from tracker.runs.run import Run
from tracker.runs.warm_up import MAKERS
from tracker.sequences.library import with_detector
from tracker.sequences.sequence import Sequence

STAGES = ("single_view", "fusion", "smoothing", "tracks")
CONDITIONS = sorted({key for p in PARAMETERS.values() for key in p.when})
"""The parameters on which it depends whether others have an effect."""


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Sequence:
    """Two people before two cameras, as pictures and as boxes, with templates and a detector
    that finds each of them, or nobody, wherever they are."""
    folder = tmp_path_factory.mktemp("people")
    boxes = np.zeros((1, 6, 84), np.float32)
    boxes[0, :, 5], boxes[0, :, 7] = (30, 32, 6, 20, 0.9, 0.1), (50, 32, 6, 20, 0.8, 0.3)
    model = answering(folder / "model.onnx", {"output0": boxes})
    return with_detector(warm_up._recording(folder), model)


def every_choice() -> Iterator[dict[str, Any]]:
    """Each pair of methods with the defaults and as published, and with every other value of
    what decides on others."""
    pairs = product(METHODS["single_view"], METHODS["fusion_method"])
    for single_view, fusion_method in pairs:
        chosen = {"single_view": single_view, "fusion_method": fusion_method}
        yield chosen
        yield {**PRESETS["published"], **chosen}
        if single_view == "none":
            for smoothing in METHODS["smoothing_method"]:
                yield {**chosen, "smoothing_method": smoothing}
        for key in CONDITIONS:
            parameter = PARAMETERS[key]
            others = parameter.choices or (True, False)
            if key.startswith("fusion.") == (single_view == "none"):
                yield from ({**chosen, key: one} for one in others if one != parameter.default)


CHOICES = [
    each
    for each in {repr(sorted(one.items())): one for one in every_choice()}.values()
    if all(
        not key.startswith(tuple(f"{group}." for group in METHODS["single_view"]))
        or key.startswith(f"{each['single_view']}.")
        or len(each) > 4
        for key in each
    )
]


def named(choice: dict[str, Any]) -> str:
    """For the list of tests."""
    own = [f"{k}={v}" for k, v in choice.items() if k not in METHODS]
    words = own if len(own) < 3 else ["published"]
    methods = [choice[key] for key in METHODS if key in choice]
    return " ".join([*methods, *words])


@pytest.mark.parametrize("choice", CHOICES, ids=named)
def test_what_is_shown_is_read_and_has_its_condition(choice: dict[str, Any]) -> None:
    parameters = with_values(RunParameters(), choice)
    read = {key for stage in STAGES for key in stage_values(parameters, stage)}  # type: ignore[arg-type]
    shown = shown_keys(parameters)
    assert len(shown) == len(set(shown))
    assert set(METHODS) <= set(shown) <= read
    for key in read - set(shown):
        conditions = PARAMETERS[key].when
        assert any(value_of(parameters, other) not in ok for other, ok in conditions.items())
    used = [method_of(key, value_of(parameters, key)).used(parameters) for key in METHODS]
    groups = {part.group for uses in used for part in uses.reads}
    assert {PARAMETERS[key].group for key in shown if key in PARAMETERS} <= groups


def test_every_condition_names_a_value_that_there_is() -> None:
    assert CONDITIONS
    for parameter in PARAMETERS.values():
        for other, values in parameter.when.items():
            decides = PARAMETERS[other]
            assert other != parameter.key
            assert set(values) < set(decides.choices or (True, False))
            assert decides.group == parameter.group


def moved(parameter: Parameter) -> Any:
    """Another value than the default, as far off as there is."""
    if parameter.kind == "choice":
        return next(one for one in parameter.choices if one != parameter.default)
    if parameter.kind == "bool":
        return not parameter.default
    assert parameter.minimum is not None
    assert parameter.maximum is not None
    middle = (parameter.minimum + parameter.maximum) / 2.0
    return parameter.maximum if parameter.default < middle else parameter.minimum


def numbers(run: Run) -> list[np.ndarray]:
    """All that a run found."""
    found = [run.tracks.frames, run.tracks.ids, run.tracks.positions, run.tracks.existences]
    for views, fused in zip(run.views, run.fused, strict=True):
        for view in views:
            found += [view.boxes, view.weights, view.sigmas, view.labels, view.estimates]
        found += [fused.posterior.weights, fused.posterior.means, fused.sources]
    return found


def effects(choice: dict[str, Any]) -> bool:
    """Whether the short form runs a choice: one pair of methods has it already."""
    return choice["fusion_method"] == "multi_bernoulli" or choice["single_view"] == "none"


@pytest.mark.full
@pytest.mark.parametrize("choice", [c for c in CHOICES if effects(c)], ids=named)
def test_what_is_not_shown_changes_no_result(choice: dict[str, Any], recording: Sequence) -> None:
    parameters = with_values(RunParameters(), choice)
    some = replace(recording, frames=warm_up.EMPTY + 10)
    shown = set(shown_keys(parameters))
    hidden = {key: moved(p) for key, p in PARAMETERS.items() if key not in shown}
    assert hidden
    other = with_values(parameters, hidden)
    assert set(shown_keys(other)) == shown
    first, second = pipeline.compute(some, parameters), pipeline.compute(some, other)
    assert any(len(view.boxes) for views in first.views for view in views), "no box on two people"
    for a, b in zip(numbers(first), numbers(second), strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("model", ["learnt", "adaptive"])
@pytest.mark.parametrize("name", ["colour_phd", "pseudo_particle", "jpda", "association_matrix"])
def test_the_memory_of_motion_is_for_methods_without_colours(name: str, model: str) -> None:
    """It is no part of the cache key of a method that does not read it, and is not shown for it."""
    parameters = with_values(RunParameters(), {"single_view": name, "foreground.model": model})
    motion = {
        f"foreground.{each}"
        for each in ("restless_from", "restless_to", "motion_memory", "motion_threshold")
    }
    by_colours = name in ("colour_phd", "pseudo_particle")
    assert motion & set(stage_values(parameters, "single_view")) == (
        set() if by_colours else motion
    )
    assert motion & set(shown_keys(parameters)) == (
        motion if not by_colours and model == "learnt" else set()
    )
    assert "foreground.darkest_shadow" in shown_keys(parameters)


@pytest.mark.parametrize("measurement", ["centre", "box", "box_and_width"])
def test_noise_of_widths_counts_where_widths_are_measured(
    recording: Sequence, measurement: str
) -> None:
    some = replace(recording, frames=warm_up.EMPTY + 6)
    own = {"single_view": "none", "fusion.measurement": measurement}
    reference = pipeline.compute(some, with_values(RunParameters(), own))
    assert len(reference.tracks.positions)
    key = "detection_boxes.width_sigma"
    changes = {**own, key: moved(PARAMETERS[key])}
    other = pipeline.compute(some, with_values(RunParameters(), changes))
    same = np.array_equal(reference.tracks.positions, other.tracks.positions)
    assert same == (measurement != "box_and_width")
    assert key in shown_keys(reference.parameters)


@pytest.mark.parametrize("key", METHODS)
def test_every_method_is_registered_once_and_made(key: Any, recording: Sequence) -> None:
    assert not ORIGINS, "a method of another package is installed: these tests are of our own"
    for name, method in REGISTERED[key].items():
        assert method.name == name
        assert method.help.endswith(".")
        assert callable(MAKERS[key](method))
        parameters = with_values(RunParameters(), {key: name})
        assert parameters.method(key) is method
        used = method.used(parameters)
        assert {part.group for part in used.reads} <= {p.group for p in PARAMETERS.values()}
        if method.parameters is not None:
            assert parameters.of(method.parameters) == method.parameters()
    with pytest.raises(ValueError, match=rf"^{key}: expected one of {next(iter(REGISTERED[key]))}"):
        method_of(key, "magic")


def test_every_file_of_a_method_is_registered() -> None:
    """A class that has a method's steps and is in no list would be forgotten code."""
    loaded = {
        maker(method).__module__
        for key, maker in MAKERS.items()
        for method in REGISTERED[key].values()
    }
    root = Path(pipeline.__file__).parents[1]
    found = set()
    for folder in ("single_view", "fusion"):
        for path in (root / folder).rglob("*.py"):
            if "pictures" in path.parts:  # a model of pictures has steps too
                continue
            text = path.read_text()
            if "def start(self)" in text and "def step(" in text and "Protocol" not in text:
                found.add(".".join(path.relative_to(root.parent).with_suffix("").parts))
    for path in (root / "smoothing").rglob("*.py"):
        if "    def smooth(\n" in path.read_text():
            found.add(".".join(path.relative_to(root.parent).with_suffix("").parts))
    measures_for_another = {"tracker.single_view.shape.method"}  # jpda takes its steps
    assert found | measures_for_another == loaded


def without(recording: Sequence, what: str) -> Sequence:
    """The same recording with less."""
    if what == "templates":
        return replace(recording, templates=())
    if what == "detector":
        return replace(recording, detector=None)
    gone: dict[str, Any] = {"images": ()} if what == "pictures" else {"detections": None}
    return replace(recording, views=tuple(replace(view, **gone) for view in recording.views))


def test_a_method_that_cannot_work_is_known_with_the_reason(recording: Sequence) -> None:
    defaults = RunParameters()
    assert unfit_methods(recording, defaults) == {key: {} for key in METHODS}
    own = unfit_methods(replace(recording, detector=None), defaults)["single_view"]
    assert own == {
        "onnx_detector": "onnx_detector runs a detection network, and none is at hand; fetch one "
        "under Teach or by `multiview-phd detector get`, or start the program with --detector "
        "model.onnx."
    }
    dark = unfit_methods(without(recording, "pictures"), defaults)["single_view"]
    assert set(dark) >= {"colour_phd", "jpda", "pseudo_particle", "association_matrix"}
    assert set(dark).isdisjoint({"detection_phd", "none"})
    assert dark["jpda"] == (
        'jpda needs pictures of every camera, and camera "left" and 1 more of warm-up has none; '
        "name a video or images in sequence.toml."
    )
    bare = unfit_methods(without(recording, "detections"), defaults)["single_view"]
    assert set(bare) >= {"detection_phd", "none"}
    assert set(bare).isdisjoint(dark)
    assert "needs a detector's boxes of every camera" in bare["none"]
    plain = unfit_methods(without(recording, "templates"), defaults)["single_view"]
    assert set(plain) >= {"colour_phd", "pseudo_particle"}
    assert set(plain).isdisjoint({"jpda", "association_matrix", "detection_phd", "none"})
    boxes = with_values(defaults, {"jpda.measurements": "detections"})
    assert "jpda" not in unfit_methods(without(recording, "pictures"), boxes)["single_view"]
    assert "jpda" in unfit_methods(without(recording, "detections"), boxes)["single_view"]


@pytest.mark.full
@pytest.mark.parametrize("what", ["pictures", "detections", "templates", "detector"])
@pytest.mark.parametrize("name", METHODS["single_view"])
def test_a_method_fails_just_where_it_is_said_to(recording: Sequence, what: str, name: str) -> None:
    less = replace(without(recording, what), frames=warm_up.EMPTY + 2)
    parameters = RunParameters(single_view=name)
    if name in unfit_methods(less, parameters)["single_view"]:
        with pytest.raises(ValueError, match=r"pictures|detections|template|detector"):
            pipeline.compute(less, parameters)
    else:
        assert pipeline.compute(less, parameters).complete


def test_the_default_follows_the_recording_and_nothing_else_does(recording: Sequence) -> None:
    assert default_parameters(recording).single_view == "onnx_detector"
    recording = replace(recording, detector=None)
    first, second, third = DEFAULT_CANDIDATES
    assert RunParameters().single_view == first
    for what, expected in (("detections", first), ("templates", second), ("pictures", second)):
        found = default_parameters(without(recording, what))
        assert found.single_view == expected
        assert set(changed_values(found)) <= {"single_view"}
    untaught = without(without(recording, "templates"), "detections")
    assert default_parameters(untaught) == RunParameters(single_view=third)


def test_a_fetched_network_is_the_default_for_large_standing_people(recording: Sequence) -> None:
    """It is at hand for every recording, and named for none: templates and boxes come first."""
    assert recording.detector is not None
    fetched = replace(recording.detector, named=False)
    large = replace(
        recording,
        detector=fetched,
        target_half_extents=np.array([0.3, 0.3, 0.85]),
        views=tuple(replace(v, camera=scaled(v.camera, 4.0)) for v in recording.views),
    )
    assert default_parameters(large).single_view == "colour_phd"
    assert default_parameters(without(large, "templates")).single_view == "none"
    untaught = without(without(large, "templates"), "detections")
    assert default_parameters(untaught).single_view == "onnx_detector"
    assert default_parameters(replace(untaught, detector=None)).single_view == "shapes"
    # one camera that sees them small is enough, and so are heads
    far = (replace(untaught.views[0], camera=scaled(untaught.views[0].camera, 0.1)),)
    small = replace(untaught, views=(*far, *untaught.views[1:]))
    heads = replace(untaught, target_half_extents=np.array([0.1, 0.1, 0.15]))
    for other in (small, heads):
        assert default_parameters(other).single_view == "shapes"
        assert advice(replace(other, detector=None), RunParameters(single_view="shapes")) is None
    without_any = replace(untaught, detector=None)
    words = advice(without_any, RunParameters(single_view="shapes"))
    assert words is not None
    assert "Teach fetches one, or `multiview-phd detector get`" in words
    assert advice(without_any, RunParameters(single_view="jpda")) is None
    assert advice(untaught, RunParameters(single_view="shapes")) is None


def test_boxes_that_are_not_used_since_a_camera_has_none_are_named(recording: Sequence) -> None:
    first, *others = recording.views
    assert others
    some = replace(recording, views=(replace(first, detections=None), *others))
    words = advice(some, RunParameters(single_view="shapes"))
    assert words == f'no camera\'s boxes are used, since camera "{first.camera.name}" has none'
    assert advice(recording, RunParameters(single_view="colour_phd")) is None


def scaled(camera: Camera, factor: float) -> Camera:
    """The same camera with larger pictures."""
    intrinsics = camera.intrinsics.copy()
    intrinsics[:2] *= factor
    width, height = camera.image_size
    size = (round(width * factor), round(height * factor))
    return replace(camera, intrinsics=intrinsics, image_size=size)
