"""A sequence with another room, target or templates than its file has.

The changes are plain values in the notation of ``sequence.toml``::

    {"room": {"min": […], "max": […], "entrances": [{"position": […], "sigma": […]}, …]},
     "target": {"half_extents": […]},
     "template": [{"name": …, "camera": …, "frame": …, "box": […]}, …]}

in metres in the world, and in pixels in a picture. They are validated like those of a
file: errors are the same whether values come from there, or from the page, where they are drawn on
a picture or dragged in the 3D view.
"""

from __future__ import annotations

import copy
import hashlib
import json
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from jaxtyping import Float
from numpy import ndarray

from tracker.files.text import shown
from tracker.sequences.fields import Fields, did_you_mean, listed
from tracker.sequences.sequence import Entrance, Room, Sequence, Template, View

LEAST_TEMPLATE = 2.0
"""Least width and height of a template's box, pixels."""


def read_room(fields: Fields) -> Room:
    """Read the table ``[room]``.

    Raises:
        SequenceError: If the table is missing, or a field is not valid.
    """
    room = fields.table("room", ("min", "max", "entrances"))
    assert room is not None
    minimum = room.vector("min", 3, "x, y, z in metres")
    maximum = room.vector("max", 3, "x, y, z in metres")
    for axis, low, high in zip("xyz", minimum, maximum, strict=True):
        if low >= high:
            raise room.error(
                "max", f"expected {axis} above that of min, {low:g}, found {high:g}; swap them"
            )
    entrances = tuple(
        Entrance(
            entrance.vector("position", 3, "x, y, z in metres"),
            entrance.vector("sigma", 3, "standard deviations in metres", positive=True),
        )
        for entrance in room.tables("entrances", ("position", "sigma"))
    )
    return Room(minimum, maximum, entrances)


def read_target(fields: Fields) -> Float[ndarray, " 3"] | None:
    """Read half width, depth and height from the table ``[target]``, metres; None without it.

    Raises:
        SequenceError: If a field is not valid.
    """
    target = fields.table("target", ("half_extents",), needed=False)
    if target is None:
        return None
    return target.vector("half_extents", 3, "half width, depth and height in metres", positive=True)


def read_templates(fields: Fields, views: tuple[View, ...], frames: int) -> tuple[Template, ...]:
    """Read the tables ``[[template]]``.

    Args:
        fields: The fields of the file.
        views: The cameras, in whose pictures the boxes lie.
        frames: The number of steps.

    Raises:
        SequenceError: If a field is not valid.
    """
    tables = fields.tables("template", ("name", "camera", "frame", "box"), "[[template]]")
    return tuple(_template(table, views, frames) for table in tables)


def _template(fields: Fields, views: tuple[View, ...], frames: int) -> Template:
    """Read and check a template."""
    name, camera = fields.text("name"), fields.text("camera")
    by_name = {view.camera.name: view for view in views}
    if camera not in by_name:
        hint = did_you_mean(camera, by_name)
        raise fields.error(
            "camera", f"expected one of {listed(by_name)}, found {shown(camera)}{hint}"
        )
    if not by_name[camera].has_pictures:
        raise fields.error(
            "camera", f'camera "{camera}" has neither video nor images to take it from'
        )
    box = fields.vector("box", 4, "left, top, width, height in pixels")
    left, top, width, height = box
    if width <= 0.0 or height <= 0.0:
        raise fields.error(
            "box", f"expected width and height above 0, found {width:g} × {height:g}"
        )
    if min(width, height) < LEAST_TEMPLATE:
        raise fields.error(
            "box",
            f"expected at least {LEAST_TEMPLATE:g} pixels a side, found {width:g} × {height:g}; a "
            "smaller one has no colours to tell apart",
        )
    full_width, full_height = by_name[camera].camera.image_size
    slack = 1.0  # a box drawn by hand may end on the border's outer edge
    if (
        min(left, top) < -slack
        or left + width > full_width + slack
        or top + height > full_height + slack
    ):
        raise fields.error(
            "box",
            f"expected a box inside the {full_width}×{full_height} picture, found x from {left:g} "
            f"to {left + width:g} and y from {top:g} to {top + height:g}",
        )
    frame = fields.integer("frame", minimum=0, maximum=frames - 1)
    return Template(name, camera, frame, box)


Values = dict[str, Any]

FACES = tuple((side, axis) for side in ("min", "max") for axis in range(3))
"""The six faces of the room, each by the corner and the axis of its coordinate."""

AXES = "xyz"

Pairs = list[tuple[int | None, int | None]]
"""Pairs of indices in an old and a new list; None for an element that was removed or added."""


def taught_values(sequence: Sequence) -> Values:
    """Return room, target and templates of a sequence as plain values."""
    room = sequence.room
    return {
        "room": {
            "min": _numbers(room.minimum),
            "max": _numbers(room.maximum),
            "entrances": [
                {"position": _numbers(entrance.position), "sigma": _numbers(entrance.sigma)}
                for entrance in room.entrances
            ],
        },
        "target": {"half_extents": _numbers(sequence.target_half_extents)},
        "template": [template_values(template) for template in sequence.templates],
    }


def template_values(template: Template) -> Values:
    """Return a template as plain values of a table ``[[template]]``."""
    return {
        "name": template.name,
        "camera": template.camera,
        "frame": template.frame,
        "box": _numbers(template.box),
    }


def _numbers(vector: ndarray) -> list[float]:
    return [float(value) for value in vector]


def with_taught(opened: Sequence, values: Values, where: str) -> Sequence:
    """Return a sequence with another room, target and templates.

    The digest is made from that of the opened sequence and the values, so that cached results for
    the same values are found again.

    Args:
        opened: The sequence as its file was read.
        values: Room, target and templates.
        where: The file's name, for messages.

    Raises:
        SequenceError: If a value is not valid, with file and field.
    """
    fields = Fields(where, values, ("room", "target", "template"))
    room, half_extents = read_room(fields), read_target(fields)
    assert half_extents is not None
    templates = read_templates(fields, opened.views, opened.frames)
    digest = opened.digest
    if values != taught_values(opened):
        text = digest + json.dumps(values, sort_keys=True)
        digest = hashlib.sha256(text.encode()).hexdigest()[:16]
    return replace(
        opened, room=room, target_half_extents=half_extents, templates=templates, digest=digest
    )


def carried_over(before: Values, after: Values, now: Values, steps: int) -> Values:
    """Apply changes that were made on another rendering of the same scene to this one.

    Changes of room and target are applied, and templates that were added if their step exists.
    Other changes of templates are left out, since this rendering may not have their boxes.

    Args:
        before: The values in the other rendering's file.
        after: The values after the user's changes.
        now: The values in this rendering's file.
        steps: The number of steps of this rendering.
    """
    values = copy.deepcopy(now)
    for part in ("room", "target"):
        if after[part] != before[part]:
            values[part] = copy.deepcopy(after[part])
    values["template"] += [
        after["template"][new]
        for old, new in paired_templates(before["template"], after["template"])
        if old is None and new is not None and after["template"][new]["frame"] < steps
    ]
    return values


def changes(before: Values, after: Values) -> list[str]:
    """Describe the differences of two sets of values, in a short sentence each."""
    words: list[str] = []
    for old, new in paired_templates(before["template"], after["template"]):
        if old is None and new is not None:
            words.append(f"template {after['template'][new]['name']} added")
        elif old is not None and new is None:
            words.append(f"template {before['template'][old]['name']} removed")
        elif old is not None and new is not None:
            was, now = before["template"][old]["name"], after["template"][new]["name"]
            if was != now:
                words.append(f"template {was} renamed {now}")
    for side, axis in FACES:
        low, high = before["room"][side][axis], after["room"][side][axis]
        if low != high:
            words.append(f"room, {side} {AXES[axis]}: {low:g} to {high:g} m")
    old_size, new_size = before["target"]["half_extents"], after["target"]["half_extents"]
    if old_size != new_size:
        sides = " × ".join(f"{2.0 * half:g}" for half in new_size)
        words.append(f"target: {sides} m")
    old_places, new_places = before["room"]["entrances"], after["room"]["entrances"]
    for old, new in paired_entrances(old_places, new_places):
        if old is None and new is not None:
            words.append(f"entrance {new + 1} added")
        elif new is None and old is not None:
            words.append(f"entrance {old + 1} removed")
        elif old is not None and new is not None and old_places[old] != new_places[new]:
            words.append(f"entrance {new + 1} moved")
    return words


def paired_templates(before: list[Values], after: list[Values]) -> Pairs:
    """Pair old and new templates that have the same box, whatever their names."""

    def place(template: Values) -> Any:
        return template["camera"], template["frame"], template["box"]

    return _paired(before, after, lambda old, new: place(old) == place(new))


def paired_entrances(before: list[Values], after: list[Values]) -> Pairs:
    """Pair old and new entrances: equal ones first, then the remaining ones in their order."""
    pairs = _paired(before, after, lambda old, new: old == new)
    gone = [old for old, new in pairs if new is None]
    come = [new for old, new in pairs if old is None]
    moved: Pairs = list(zip(gone, come, strict=False))
    kept: Pairs = [pair for pair in pairs if None not in pair]
    removed: Pairs = [(old, None) for old in gone[len(moved) :]]
    added: Pairs = [(None, new) for new in come[len(moved) :]]
    return sorted([*kept, *moved, *added], key=lambda pair: pair[1] or 0) + removed


def _paired(before: list[Values], after: list[Values], same: Callable[[Any, Any], bool]) -> Pairs:
    left = list(range(len(before)))
    pairs: Pairs = []
    for new, value in enumerate(after):
        old = next((index for index in left if same(before[index], value)), None)
        if old is not None:
            left.remove(old)
        pairs.append((old, new))
    return [*pairs, *((old, None) for old in left)]
