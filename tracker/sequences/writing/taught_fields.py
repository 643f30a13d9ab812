"""The fields of a ``sequence.toml`` that users change on the page: room, target and templates.

Their errors are the same whether they come from a file, or from the page, where they are drawn on a
picture or dragged in the 3D view.
"""

from __future__ import annotations

from jaxtyping import Float
from numpy import ndarray

from tracker.files.text import shown
from tracker.sequences.fields import Fields, did_you_mean, listed
from tracker.sequences.sequence import Entrance, Room, Template, View

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
