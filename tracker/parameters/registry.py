"""Which methods there are: those of this project, a line each, and those of other packages.

A package adds a method by an entry point that names a
:class:`~tracker.parameters.methods.Method`, in its ``pyproject.toml``::

    [project.entry-points."multiview_phd.single_view"]
    my_tracker = "my_package.my_module:METHOD"

``multiview_phd.fusion`` for a method of stage 2 or ``multiview_phd.smoothing`` for one of
stage 3. Its own parameters, a subclass of
:class:`~tracker.parameters.definition.Params`, then have sliders and flags like all others.
"""

from __future__ import annotations

import importlib
import warnings
from collections.abc import Iterator
from importlib.metadata import EntryPoint, entry_points

from tracker.parameters.methods import Method, MethodKey

ENTRY_POINTS: dict[MethodKey, str] = {
    "single_view": "multiview_phd.single_view",
    "fusion_method": "multiview_phd.fusion",
    "smoothing_method": "multiview_phd.smoothing",
}
"""The groups of entry points of other packages."""

BUILT_IN: dict[MethodKey, tuple[str, ...]] = {
    "single_view": (
        "tracker.parameters.groups.colour_phd:METHOD",
        "tracker.parameters.groups.shapes:METHOD",
        "tracker.parameters.groups.jpda:METHOD",
        "tracker.parameters.groups.pseudo_particle:METHOD",
        "tracker.parameters.groups.association_matrix:METHOD",
        "tracker.parameters.groups.onnx_detector:METHOD",
        "tracker.parameters.groups.detections:FILTERED",
        "tracker.parameters.groups.detections:AS_THEY_ARE",
    ),
    "fusion_method": (
        "tracker.parameters.groups.fusion:SEQUENTIAL_PHD",
        "tracker.parameters.groups.fusion:MULTI_BERNOULLI",
    ),
    "smoothing_method": (
        "tracker.parameters.groups.smoothing:NONE",
        "tracker.parameters.groups.smoothing:POSITIONS",
        "tracker.parameters.groups.smoothing:IDENTITIES",
    ),
}
"""Where the descriptions of this project's methods stand, in the order of their lists."""

SHARED_GROUPS = ("pictures", "foreground", "fusion", "smoothing")
"""Groups of parameters that are no single method's."""

FOLLOWING = ("colour_phd", "none", "shapes")
"""What ``single_view`` is by default follows the recording: the first of these that it has all
for."""

FOLLOWS = (
    "follows the recording: onnx_detector where a detector is named, else colour_phd with "
    "pictures and templates, else none with detections, else shapes"
)
"""The same in words."""


class PluginWarning(UserWarning):
    """A method of another package cannot be used; all others can."""


def _built_in(place: str) -> Method:
    module, _, name = place.partition(":")
    method: Method = getattr(importlib.import_module(module), name)
    return method


def _of_others(group: str, taken: set[str]) -> Iterator[tuple[Method, str]]:
    """The methods of a group of entry points, and the distribution of each."""
    found = sorted(entry_points(group=group), key=lambda point: (point.name, point.value))
    for point in dict.fromkeys(found):
        try:
            method = point.load()
        except Exception as error:
            _warn(point, f"cannot be imported: {type(error).__name__}: {error}")
            continue
        if not isinstance(method, Method):
            _warn(point, f"expected a tracker.parameters.Method, found {type(method).__name__}")
        elif not method.name.isidentifier():
            _warn(point, f'a method\'s name is a word like my_tracker, found "{method.name}"')
        elif method.name in taken:
            _warn(point, f'there is a method "{method.name}" already; give it another name')
        elif method.parameters is not None and method.own_group in taken:
            _warn(point, f'there is a group of parameters "{method.own_group}" already')
        else:
            taken |= {method.name, method.own_group}
            yield method, f"{point.dist.name} {point.dist.version}" if point.dist else point.value


def _warn(point: EntryPoint, words: str) -> None:
    package = f" of {point.dist.name} {point.dist.version}" if point.dist else ""
    warnings.warn(
        f'entry point {point.name} = "{point.value}" in {point.group}{package}: {words}. '
        "The method is left out.",
        PluginWarning,
        stacklevel=2,
    )


def _registered() -> tuple[dict[MethodKey, dict[str, Method]], dict[str, str]]:
    methods: dict[MethodKey, dict[str, Method]] = {}
    origins: dict[str, str] = {}
    for key, places in BUILT_IN.items():
        methods[key] = {method.name: method for method in map(_built_in, places)}
    own = [method for of_stage in methods.values() for method in of_stage.values()]
    taken = {*BUILT_IN, *SHARED_GROUPS, *(name for m in own for name in (m.name, m.own_group))}
    for key, group in ENTRY_POINTS.items():
        for method, origin in _of_others(group, taken):
            methods[key][method.name] = method
            origins[method.name] = origin
    return methods, origins


REGISTERED, ORIGINS = _registered()
"""Every method by the parameter that chooses it and by its name; and of those of other packages
the distribution with its version."""
