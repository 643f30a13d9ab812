"""The empty room as one camera sees it: traced once, with soft shadows and reflected light."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.ndimage import gaussian_filter

from tests.rooms.rays import BOX, Hits, cast
from tests.rooms.walls.interior import Interior, Lamp, Solid
from tests.rooms.walls.paint import paint
from tests.rooms.walls.textures import linear
from tracker.geometry.camera import Camera

FINE = 2
"""The empty room is traced, and people are drawn, this many times finer than the picture."""
AMBIENT = np.array([[0.17, 0.145, 0.115], [0.25, 0.245, 0.235]])
"""Light by colour from below (the floor's glow) and from above, for bodies."""
_GOLDEN = (0.7548776662466927, 0.5698402909980532)


@dataclass(frozen=True, slots=True, eq=False)
class Background:
    """The empty room seen by one camera."""

    room: Float[ndarray, "h w 3"]
    """Linear light."""
    room_fine: Float[ndarray, "2h 2w 3"]
    depth_fine: Float[ndarray, "2h 2w"]
    """Metres along the camera's axis."""
    floor: Float[ndarray, "h w 2"]
    """x and y of the floor's points, NaN elsewhere."""


class Tracer:
    """The solids of a room in the form that the ray caster takes."""

    def __init__(self, interior: Interior) -> None:
        self.solids = interior.solids
        self.lamps = interior.lamps
        self.low, self.high = interior.low, interior.high
        rotations = np.array([solid.rotation() for solid in self.solids])
        self.halves = np.array([solid.half for solid in self.solids])
        centres = np.array([solid.centre for solid in self.solids])
        self.rotations = rotations
        self.kinds = np.array([solid.kind for solid in self.solids], dtype=np.int32)
        left = np.swapaxes(rotations, 1, 2) / self.halves[:, :, None]
        shift = -np.einsum("pij,pj->pi", left, centres)
        self.inverses = np.concatenate([left, shift[:, :, None]], axis=2).astype(np.float32)
        radii = np.linalg.norm(self.halves, axis=1)
        self.bounds = np.column_stack([centres, radii]).astype(np.float32)
        self.reflectance = np.array([linear(s.finish.colour) for s in self.solids], np.float32)

    def nearest(self, origins: ndarray, directions: ndarray) -> Hits:
        """Distance and solid of the first hit of each ray, up to 20 m."""
        limits = np.full(len(origins), 20.0, dtype=np.float32)
        return cast(origins, directions, limits, self.kinds, self.inverses, self.bounds, False)

    def blocked(self, origins: ndarray, directions: ndarray, limits: ndarray) -> ndarray:
        """Whether anything stands on each ray within its limit."""
        hits = cast(origins, directions, limits, self.kinds, self.inverses, self.bounds, True)
        return np.asarray(hits.solids >= 0)

    def surface(self, places: ndarray, solids: ndarray) -> tuple[ndarray, ndarray, ndarray]:
        """Own coordinates in metres, face (axis 0, 1, 2; 3 where round) and world normal."""
        own = np.einsum("nij,nj->ni", self.inverses[solids, :, :3], places)
        own += self.inverses[solids, :, 3]
        face = np.argmax(np.abs(own), axis=1)
        rows = np.arange(len(own))
        flat = np.zeros_like(own)
        flat[rows, face] = np.sign(own[rows, face])
        kinds = self.kinds[solids]
        side = own.copy()
        side[(kinds == 2)] *= np.array([1.0, 1.0, 0.0], np.float32)
        cap = (kinds == 2) & (np.abs(own[:, 2]) > 0.9995)
        side[cap] = flat[cap] = np.array([0.0, 0.0, 1.0]) * np.sign(own[cap, 2:3])
        normal = np.where((kinds == BOX)[:, None], flat, side) / self.halves[solids]
        normal = np.einsum("nij,nj->ni", self.rotations[solids], normal)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        face = np.where(kinds == BOX, face, 3)
        return own * self.halves[solids], face, normal.astype(np.float32)

    def lamp_light(
        self, places: ndarray, normals: ndarray, lamp: Lamp, spread: ndarray
    ) -> tuple[ndarray, ndarray, ndarray]:
        """Unshadowed light of a lamp from one of its points; direction and distance to it."""
        points = (
            np.array(lamp.centre)
            + spread[:, :1] * np.array(lamp.first)
            + spread[:, 1:] * np.array(lamp.second)
        )
        toward = (points - places).astype(np.float32)
        distance = np.sqrt(np.einsum("ni,ni->n", toward, toward))
        toward /= distance[:, None]
        facing = np.maximum(np.einsum("ni,ni->n", normals, toward), 0.0)
        direction = np.array(lamp.direction, np.float32)
        leaving = np.maximum(-np.einsum("ni,i->n", toward, direction), 0.0)
        return facing * leaving / (distance**2 + 0.02), toward, distance


def render_background(
    tracer: Tracer, camera: Camera, *, rounds: int = 4, stride: int = FINE
) -> Background:
    """Trace the empty room through the camera's exact lens model, twice as fine as its picture.

    Args:
        tracer: The room.
        camera: Through which it is seen.
        rounds: Samples of each lamp at each point where light is gathered.
        stride: Rows and columns, of the fine picture, between two such points.
    """
    width, height = camera.image_size
    columns, rows = width * FINE, height * FINE
    grid = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=2).reshape(-1, 2)
    pixels = (grid + 0.5) / FINE - 0.5
    directions = camera.back_project(pixels).astype(np.float32)
    origins = np.broadcast_to(camera.centre.astype(np.float32), directions.shape).copy()
    hits = tracer.nearest(origins, directions)
    distance, solids = hits.distances, hits.solids
    solids = np.maximum(solids, 0)
    places = origins + distance[:, None] * directions
    own, face, normals = tracer.surface(places, solids)
    colour, glow = paint(tracer.solids, solids, own, face, places)
    glow += _mirrored(tracer, solids, places, directions, normals, distance)
    surface = (solids * 8 + face).reshape(rows, columns)

    # light is gathered at some points only; the others take it from their own
    # surface, and what has no such neighbour is gathered after all
    light = np.zeros((rows * columns, 3), np.float32)
    known = (grid % stride == 0).all(axis=1)
    chosen = np.flatnonzero(known)
    for _ in range(2):
        start = places[chosen] + 2e-3 * normals[chosen]
        light[chosen] = _gather(tracer, start, normals[chosen], grid[chosen] // stride, rounds)
        known[chosen] = True
        filled, reached = _smooth(light, known, surface)
        chosen = np.flatnonzero(~reached)
    light = filled
    seen = colour * light + glow

    gloss = np.array([s.finish.gloss for s in tracer.solids], np.float32)[solids]
    shiny = np.flatnonzero(gloss > 0.0)
    cosine = -np.einsum("ni,ni->n", directions[shiny], normals[shiny])
    mirrored = directions[shiny] + 2.0 * cosine[:, None] * normals[shiny]
    share = gloss[shiny] * (0.04 + 0.96 * (1.0 - np.clip(cosine, 0.0, 1.0)) ** 5)
    start = places[shiny] + 2e-3 * normals[shiny]
    hits = tracer.nearest(start, mirrored)
    length, hit = hits.distances, hits.solids
    there = start + length[:, None] * mirrored
    seen_there = _rough_light(tracer, there, np.maximum(hit, 0), glowing=True)
    image = np.zeros((rows * columns, 3), np.float32)
    image[shiny] = seen_there
    blurred, _ = _smooth(image, gloss > 0.0, surface, levels=3)
    seen[shiny] += share[:, None] * (blurred[shiny] - 0.3 * seen[shiny])

    # no lens is quite sharp
    fine = gaussian_filter(seen.reshape(rows, columns, 3).astype(np.float32), (0.75, 0.75, 0.0))
    room = fine.reshape(height, FINE, width, FINE, 3).mean(axis=(1, 3))
    axis = camera.rotation[2].astype(np.float32)
    depth = (
        (distance * np.einsum("ni,i->n", directions, axis))
        .reshape(rows, columns)
        .astype(np.float32)
    )
    low = (places[:, 2:] < 0.02).reshape(height, FINE, width, FINE, 1)
    share = low.mean(axis=(1, 3))
    floor = (places[:, :2].reshape(height, FINE, width, FINE, 2) * low).mean(axis=(1, 3))
    floor = np.where(share >= 0.5, floor / np.maximum(share, 0.5), np.nan)
    return Background(room, fine, depth, floor)


def _mirrored(
    tracer: Tracer,
    solids: ndarray,
    places: ndarray,
    directions: ndarray,
    normals: ndarray,
    distance: ndarray,
) -> Float[ndarray, "N 3"]:
    """What mirrors show, as light of their own; ``distance`` grows by the way behind the glass.

    The image in a plane mirror lies straight on, as far behind the glass as the thing is
    before it: with such depths, people reflected at the glass are drawn like any others.
    """
    seen = np.zeros((len(solids), 3), np.float32)
    glass = np.array([solid.finish.kind == "mirror" for solid in tracer.solids])
    rows = np.flatnonzero(glass[solids])
    if not len(rows):
        return seen
    cosine = np.einsum("ni,ni->n", directions[rows], normals[rows])
    onward = directions[rows] - 2.0 * cosine[:, None] * normals[rows]
    start = places[rows] + 2e-3 * normals[rows]
    hits = tracer.nearest(start, onward)
    hit = np.maximum(hits.solids, 0)
    there = start + hits.distances[:, None] * onward
    own, face, _ = tracer.surface(there, hit)
    colour, glow = paint(tracer.solids, hit, own, face, there)
    plain = np.maximum(tracer.reflectance[hit], 1e-3)
    seen[rows] = 0.9 * (_rough_light(tracer, there, hit) * colour / plain + glow)
    distance[rows] += hits.distances
    return seen


def _gather(
    tracer: Tracer, places: ndarray, normals: ndarray, grid: ndarray, rounds: int
) -> ndarray:
    """Light that reaches each place: from the lamps with soft shadows, and off other surfaces."""
    total = np.zeros((len(places), 3), np.float32)
    side = np.where(np.abs(normals[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    first = np.cross(side, normals)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(normals, first)
    # each of 4 x 4 neighbouring points takes other samples; smoothing brings them together
    cell = (grid[:, 0] % 4) + 4 * (grid[:, 1] % 4)
    scramble = np.random.default_rng(7).permutation(16)[cell]
    for turn in range(rounds):
        index = (scramble + 16 * turn).astype(np.float64)[:, None]
        spread = 2.0 * ((0.5 + index * np.array(_GOLDEN)) % 1.0) - 1.0
        for lamp in tracer.lamps:
            strength, toward, distance = tracer.lamp_light(places, normals, lamp, spread)
            lit = np.flatnonzero(strength * max(lamp.power) > 2e-3)
            free = ~tracer.blocked(places[lit], toward[lit], distance[lit] - 0.05)
            power = np.array(lamp.power, np.float32) / rounds
            total[lit[free]] += strength[lit[free], None] * power
        u = (0.5 + index[:, 0] * _GOLDEN[0] + 0.37) % 1.0
        v = (0.5 + index[:, 0] * _GOLDEN[1] + 0.71) % 1.0
        radius, angle = np.sqrt(u)[:, None], (2.0 * np.pi * v)[:, None]
        outward = radius * (np.cos(angle) * first + np.sin(angle) * second)
        outward = (outward + np.sqrt(1.0 - u)[:, None] * normals).astype(np.float32)
        hits = tracer.nearest(places, outward)
        length, hit = hits.distances, hits.solids
        there = places + length[:, None] * outward
        total += _rough_light(tracer, there, np.maximum(hit, 0)) / rounds
    return total


def _rough_light(
    tracer: Tracer, places: ndarray, solids: ndarray, *, glowing: bool = False
) -> ndarray:
    """What a surface sends back, with its mean colour and without shadows."""
    _, _, normals = tracer.surface(places, solids)
    light = np.broadcast_to(AMBIENT.mean(axis=0), (len(places), 3)).astype(np.float32)
    middle = np.zeros((len(places), 2))
    for lamp in tracer.lamps:
        if lamp.outdoors:
            continue
        strength, _, _ = tracer.lamp_light(places, normals, lamp, middle)
        light = light + np.minimum(strength, 0.6)[:, None] * np.array(lamp.power, np.float32)
    # corridors see little of the room's lamps
    outdoors = np.any((places[:, :2] < tracer.low) | (places[:, :2] > tracer.high), axis=1)
    light = np.where(outdoors[:, None], light * 0.3, light)
    colour = tracer.reflectance[solids] * light
    if glowing:
        glow = np.array([s.finish.glow for s in tracer.solids], np.float32)
        colour = colour + glow[solids, None]
    return np.asarray(colour, dtype=np.float32)


def _smooth(
    image: ndarray, known: ndarray, surface: ndarray, levels: int = 4
) -> tuple[ndarray, ndarray]:
    """Average the known points within each surface, over growing distances.

    Returns:
        The image (N, 3) and where any known point was near enough (N,).
    """
    rows, columns = surface.shape
    total = np.where(known[:, None], image, 0.0).reshape(rows, columns, 3).astype(np.float32)
    weight = known.astype(np.float32).reshape(rows, columns, 1)
    for level in range(levels):
        reach = 2**level
        for axis in (0, 1):
            ahead = [slice(None)] * 2
            behind = [slice(None)] * 2
            ahead[axis], behind[axis] = slice(reach, None), slice(None, -reach)
            a, b = tuple(ahead), tuple(behind)
            same = 0.5 * (surface[a] == surface[b])[..., None].astype(np.float32)
            moved_total, moved_weight = total.copy(), weight.copy()
            moved_total[a] += same * total[b]
            moved_total[b] += same * total[a]
            moved_weight[a] += same * weight[b]
            moved_weight[b] += same * weight[a]
            total, weight = moved_total, moved_weight
    found = weight > 0.0
    return (total / np.where(found, weight, 1.0)).reshape(-1, 3), found.reshape(-1)


def lamp_table(interior: Interior) -> Float[ndarray, "L 9"]:
    """The lamps as points for lighting bodies: position, direction, power by colour."""
    rows = []
    for lamp in interior.lamps:
        for sign in (-0.5, 0.5):
            place = np.array(lamp.centre) + sign * np.array(lamp.first)
            rows.append([*place, *lamp.direction, *(0.5 * np.array(lamp.power))])
    return np.array(rows)


__all__ = ["AMBIENT", "FINE", "Background", "Solid", "Tracer", "lamp_table", "render_background"]
