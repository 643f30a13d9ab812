"""The compiled loop that draws: bodies into the pictures of a room.

Arrays in, arrays out, without the interpreter's lock, so that threads share the
work. Colours are linear red, green, blue until the last step.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tests.rooms.compiling import kernel

NOBODY = 255
"""In an owner map: a pixel that shows the room."""


class Figures(NamedTuple):
    """What moves before one camera, in F frames: O owners, of which the first P are people."""

    points: ndarray
    """(F, V, 3), column and row in the fine picture and depth in metres; NaN where behind the
    lens."""
    light: ndarray
    """(F, V, 3) of the vertices."""
    present: ndarray
    """(F, O), who is drawn."""
    boxes: ndarray
    """(F, P, 4): left, top, right, bottom of each person's target in fine pixels, for the
    visible share."""


class Mesh(NamedTuple):
    """How the figures' T triangles hang together, and what they are covered with."""

    texture_points: ndarray
    """(V, 2)."""
    triangles: ndarray
    """(T, 3), people first, then doors."""
    owners: ndarray
    """(T,), of the triangles."""
    vertex_ranges: ndarray
    """(O, 2), first and last + 1 vertex of each owner."""
    texture: ndarray
    """(H, W, 3)."""


class Backdrop(NamedTuple):
    """The empty room before one camera."""

    room: ndarray
    """(h, w, 3)."""
    room_fine: ndarray
    """(2h, 2w, 3), twice as fine."""
    depth_fine: ndarray
    """(2h, 2w), likewise."""
    floor_points: ndarray
    """(h, w, 2), column and row in the shadow grid, negative off the floor."""
    vignette: ndarray
    """(h, w)."""


class Sensor(NamedTuple):
    """What a camera makes of light."""

    curve: ndarray
    """(K,), picture value 0 … 255 of light from 0 to 1."""
    grain: ndarray
    """(N, M, 3), noise of unit size, larger than a picture."""
    offsets: ndarray
    """(F, 2), row and column of the grain where each picture begins."""
    gains: ndarray
    """(F, h, 3), factors on the light by row and colour: exposure, white balance, flicker."""


class Shots(NamedTuple):
    """Pictures of one camera in F frames."""

    pictures: ndarray
    """(F, h, w, 3), 8 bit, blue-green-red."""
    counts: ndarray
    """(F, P, 2), for every person the number of fine pixels of its silhouette inside its box,
    and how many of those are visible."""


@kernel
def draw(
    figures: Figures, mesh: Mesh, backdrop: Backdrop, shadows: ndarray, sensor: Sensor
) -> Shots:
    """Pictures of one camera with the people in them.

    The people are drawn twice as fine as the picture, with a depth buffer that
    begins with the room's own depths, and averaged; then come the floor's
    shadows, the lens's vignette, the camera's gains, the tone curve and the sensor's noise.

    Args:
        figures: Who moves.
        mesh: Of all of them.
        backdrop: The room.
        shadows: (F, rows, columns), on the floor.
        sensor: The camera's.
    """
    points, light, present, boxes = figures.points, figures.light, figures.present, figures.boxes
    texture_points, triangles, owners = mesh.texture_points, mesh.triangles, mesh.owners
    vertex_ranges, texture = mesh.vertex_ranges, mesh.texture
    room, room_fine, depth_fine = backdrop.room, backdrop.room_fine, backdrop.depth_fine
    floor_points, vignette = backdrop.floor_points, backdrop.vignette
    curve, grain, offsets, gains = sensor.curve, sensor.grain, sensor.offsets, sensor.gains
    frames = points.shape[0]
    height, width = room.shape[:2]
    people = boxes.shape[1]
    pictures = np.empty((frames, height, width, 3), dtype=np.uint8)
    counts = np.zeros((frames, people, 2), dtype=np.int32)
    depth = np.empty((2 * height, 2 * width), dtype=np.float32)
    owner_map = np.empty((2 * height, 2 * width), dtype=np.uint8)
    covered = np.empty((2 * height, 2 * width), dtype=np.uint8)
    colour = np.empty((2 * height, 2 * width, 3), dtype=np.float32)
    fresh = np.empty((height, width), dtype=np.uint8)
    windows = np.empty((vertex_ranges.shape[0], 4), dtype=np.int64)
    top_value = np.float32(curve.shape[0] - 1)
    one, quarter = np.float32(1.0), np.float32(0.25)
    rows, columns = shadows.shape[1:]
    for f in range(frames):
        fresh[:] = 0
        for o in range(vertex_ranges.shape[0]):
            windows[o] = 0
            if not present[f, o]:
                continue
            low_x, low_y, high_x, high_y = 1e9, 1e9, -1e9, -1e9
            for v in range(vertex_ranges[o, 0], vertex_ranges[o, 1]):
                x, y = points[f, v, 0], points[f, v, 1]
                if not x == x:
                    continue
                low_x, high_x = min(low_x, x), max(high_x, x)
                low_y, high_y = min(low_y, y), max(high_y, y)
            if low_x > high_x:
                continue
            windows[o, 0] = max(0, int(low_x) // 2)
            windows[o, 1] = max(0, int(low_y) // 2)
            windows[o, 2] = max(0, min(width, int(max(high_x, -4.0)) // 2 + 2))
            windows[o, 3] = max(0, min(height, int(max(high_y, -4.0)) // 2 + 2))
            for y in range(windows[o, 1], windows[o, 3]):
                for x in range(windows[o, 0], windows[o, 2]):
                    fresh[y, x] = 1
                    for b in range(2 * y, 2 * y + 2):
                        for a in range(2 * x, 2 * x + 2):
                            depth[b, a] = depth_fine[b, a]
                            owner_map[b, a] = NOBODY
                            covered[b, a] = 0
        for t in range(triangles.shape[0]):
            o = owners[t]
            if not present[f, o]:
                continue
            i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
            x0, y0 = points[f, i, 0], points[f, i, 1]
            x1, y1 = points[f, j, 0], points[f, j, 1]
            x2, y2 = points[f, k, 0], points[f, k, 1]
            # counter-clockwise seen from outside is clockwise where rows go down
            area = (x2 - x0) * (y1 - y0) - (x1 - x0) * (y2 - y0)
            if not area > 1e-9:
                continue
            left = max(2 * windows[o, 0], math.ceil(min(x0, x1, x2)))
            right = min(2 * windows[o, 2] - 1, math.floor(max(x0, x1, x2)))
            first = max(2 * windows[o, 1], math.ceil(min(y0, y1, y2)))
            last = min(2 * windows[o, 3] - 1, math.floor(max(y0, y1, y2)))
            z0, z1, z2 = points[f, i, 2], points[f, j, 2], points[f, k, 2]
            for y in range(first, last + 1):
                for x in range(left, right + 1):
                    w0 = ((x2 - x) * (y1 - y) - (x1 - x) * (y2 - y)) / area
                    w1 = ((x0 - x) * (y2 - y) - (x2 - x) * (y0 - y)) / area
                    w2 = 1.0 - w0 - w1
                    if w0 < 0.0 or w1 < 0.0 or w2 < 0.0:
                        continue
                    if o < people:
                        covered[y, x] |= 1 << o
                    z = w0 * z0 + w1 * z1 + w2 * z2
                    if z >= depth[y, x]:
                        continue
                    depth[y, x] = z
                    owner_map[y, x] = o
                    u = (
                        w0 * texture_points[i, 0]
                        + w1 * texture_points[j, 0]
                        + w2 * texture_points[k, 0]
                    )
                    v = (
                        w0 * texture_points[i, 1]
                        + w1 * texture_points[j, 1]
                        + w2 * texture_points[k, 1]
                    )
                    column, row = int(u), int(v)
                    p, q = u - column, v - row
                    for c in range(3):
                        value = (1.0 - q) * (
                            (1.0 - p) * texture[row, column, c] + p * texture[row, column + 1, c]
                        ) + q * (
                            (1.0 - p) * texture[row + 1, column, c]
                            + p * texture[row + 1, column + 1, c]
                        )
                        colour[y, x, c] = value * (
                            w0 * light[f, i, c] + w1 * light[f, j, c] + w2 * light[f, k, c]
                        )
        for o in range(people):
            if not present[f, o] or not boxes[f, o, 0] == boxes[f, o, 0]:
                continue
            first = max(2 * windows[o, 1], math.ceil(boxes[f, o, 1]))
            last = min(2 * windows[o, 3] - 1, math.floor(boxes[f, o, 3]))
            left = max(2 * windows[o, 0], math.ceil(boxes[f, o, 0]))
            right = min(2 * windows[o, 2] - 1, math.floor(boxes[f, o, 2]))
            for y in range(first, last + 1):
                for x in range(left, right + 1):
                    if covered[y, x] >> o & 1:
                        counts[f, o, 0] += 1
                        if owner_map[y, x] == o:
                            counts[f, o, 1] += 1
        for y in range(height):
            for x in range(width):
                factor = one
                u, v = floor_points[y, x, 0], floor_points[y, x, 1]
                if u >= 0.0:
                    column, row = int(u), int(v)
                    if column < columns - 1 and row < rows - 1:
                        p, q = u - np.float32(column), v - np.float32(row)
                        factor = (one - q) * (
                            (one - p) * shadows[f, row, column] + p * shadows[f, row, column + 1]
                        ) + q * (
                            (one - p) * shadows[f, row + 1, column]
                            + p * shadows[f, row + 1, column + 1]
                        )
                for c in range(3):
                    if fresh[y, x]:
                        value = np.float32(0.0)
                        for b in range(2 * y, 2 * y + 2):
                            for a in range(2 * x, 2 * x + 2):
                                if owner_map[b, a] == NOBODY:
                                    value += quarter * factor * room_fine[b, a, c]
                                else:
                                    value += quarter * min(colour[b, a, c], np.float32(1.5))
                    else:
                        value = factor * room[y, x, c]
                    value *= vignette[y, x] * gains[f, y, c]
                    shown = curve[int(min(one, value) * top_value)]
                    speck = grain[y + offsets[f, 0], x + offsets[f, 1], c]
                    # photon noise: largest in the middle greys after the tone curve
                    shown += speck * (
                        np.float32(0.7)
                        + np.float32(0.005) * shown
                        - np.float32(1.6e-5) * shown * shown
                    )
                    shown = min(np.float32(255.0), max(np.float32(0.0), shown + np.float32(0.5)))
                    pictures[f, y, x, 2 - c] = np.uint8(shown)
    return Shots(pictures, counts)
