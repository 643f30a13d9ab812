"""The registered methods: those of this project, a line each, and those of plugins.

A plugin adds a method by an entry point that names a
:class:`~tracker.parameters.methods.Method`, in its ``pyproject.toml``::

    [project.entry-points."multiview_phd.single_view"]
    my_tracker = "my_package.my_module:METHOD"

``multiview_phd.fusion`` for a method of stage 2 or ``multiview_phd.smoothing`` for one of
stage 3. Its own parameters, a subclass of
:class:`~tracker.parameters.definition.Params`, then have sliders and flags like all others.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from importlib.metadata import EntryPoint, entry_points

from tracker.parameters.groups import (
    association_matrix,
    colour_phd,
    detections,
    fusion,
    jpda,
    onnx_detector,
    pseudo_particle,
    shapes,
    smoothing,
)
from tracker.parameters.methods import Method, MethodKey

ENTRY_POINTS: dict[MethodKey, str] = {
    "single_view": "multiview_phd.single_view",
    "fusion_method": "multiview_phd.fusion",
    "smoothing_method": "multiview_phd.smoothing",
}
"""The group of entry points of each stage, by which plugins add methods."""

BUILT_IN: dict[MethodKey, tuple[Method, ...]] = {
    "single_view": (
        colour_phd.METHOD,
        shapes.METHOD,
        jpda.METHOD,
        pseudo_particle.METHOD,
        association_matrix.METHOD,
        onnx_detector.METHOD,
        detections.FILTERED,
        detections.AS_THEY_ARE,
    ),
    "fusion_method": (fusion.SEQUENTIAL_PHD, fusion.MULTI_BERNOULLI),
    "smoothing_method": (smoothing.NONE, smoothing.POSITIONS, smoothing.IDENTITIES),
}
"""This project's methods of each stage, in the order in which they are listed."""

SHARED_GROUPS = ("pictures", "foreground", "fusion", "smoothing")
"""Groups of parameters that belong to no single method."""

FOLLOWING = ("colour_phd", "none", "shapes")
"""Candidates for the default of ``single_view``: the first whose requirements the recording
meets is chosen."""

FOLLOWS = (
    "follows the recording: onnx_detector where a detector is named, else colour_phd with "
    "pictures and templates, else none with detections, else shapes"
)
"""The same rule as text for help messages."""


class PluginWarning(UserWarning):
    """A plugin's method cannot be used; all other methods can."""


def _of_plugins(group: str, names: set[str]) -> Iterator[tuple[Method, str]]:
    """Yield the methods of a group of entry points, each with its distribution and version.

    Args:
        group: The group of entry points.
        names: The names of methods and groups that are in use; those of the methods are added.
    """
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
        elif method.name in names:
            _warn(point, f'there is a method "{method.name}" already; give it another name')
        elif method.parameters is not None and method.own_group in names:
            _warn(point, f'there is a group of parameters "{method.own_group}" already')
        else:
            names |= {method.name, method.own_group}
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
    """Return the methods of each kind by name, and the packages of the methods of plugins."""
    methods: dict[MethodKey, dict[str, Method]] = {}
    origins: dict[str, str] = {}
    for key, built_in in BUILT_IN.items():
        methods[key] = {method.name: method for method in built_in}
    own = [method for of_stage in methods.values() for method in of_stage.values()]
    names = {*BUILT_IN, *SHARED_GROUPS, *(name for m in own for name in (m.name, m.own_group))}
    for key, group in ENTRY_POINTS.items():
        for method, origin in _of_plugins(group, names):
            methods[key][method.name] = method
            origins[method.name] = origin
    return methods, origins


REGISTERED, ORIGINS = _registered()
"""All methods by the parameter that chooses them and by name; and the distribution and version of
each plugin's method, by name."""
