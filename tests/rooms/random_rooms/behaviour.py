"""What the people of a random room do: waypoints, seats and beds, apart from each other."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tests.rooms.cast.paths import Facing
from tests.rooms.random_rooms.choices import Behaviour, Choices, generator
from tests.rooms.random_rooms.shell import Bed, Doorway, Furnished, Seat

_APART = 0.5
"""Metres that people keep between them, where they can."""
_TRIES = 40
_SAMPLES = 5.0
"""Places a second at which two people are held apart."""


@dataclass(slots=True)
class Script:
    """What one person does; times in seconds."""

    behaviour: Behaviour
    waypoints: list[tuple[float, float, float]] = field(default_factory=list)
    """Time, x and y, in ascending times."""
    facings: list[Facing] = field(default_factory=list)
    """With times in place of steps."""
    sitting: tuple[float, float, Seat] | None = None
    """From when to when somebody sits, and where; the times may lie outside the film."""
    bed: Bed | None = None

    def place_at(self, times: Float[ndarray, " N"]) -> Float[ndarray, "N 2"]:
        """Where the person is, roughly, NaN while not there."""
        table = np.array(self.waypoints)
        known = (times >= table[0, 0]) & (times <= table[-1, 0])
        known |= self.behaviour != "comes and goes"
        places = np.stack([np.interp(times, table[:, 0], table[:, axis]) for axis in (1, 2)], 1)
        return np.where(known[:, None], places, np.nan)


def direct(choices: Choices, room: Furnished) -> list[Script]:
    """A script for everybody, the ones who stay in place first so that others walk around them."""
    rng = generator(choices.seed, 4)
    times = np.arange(0.0, choices.duration + 1e-9, 1.0 / _SAMPLES)
    seats, beds = list(room.seats), list(room.beds)
    rng.shuffle(seats)
    order = sorted(
        range(choices.people),
        key=lambda n: ("lies", "sits", "rises", "stands", "walks", "comes and goes").index(
            choices.behaviours[n]
        ),
    )
    scripts: dict[int, Script] = {}
    taken: list[ndarray] = []
    for number in order:
        behaviour = choices.behaviours[number]
        best, room_left = None, -1.0
        seat = seats.pop() if behaviour in ("sits", "rises") and seats else None
        bed = beds.pop() if behaviour == "lies" and beds else None
        for _ in range(_TRIES):
            script = _script(behaviour, choices.duration, room, seat, bed, rng)
            places = script.place_at(times)
            gap = _gap(places, taken)
            if gap > room_left:
                best, room_left = script, gap
            if gap >= _APART or bed is not None:
                break
        assert best is not None
        scripts[number] = best
        taken.append(best.place_at(times))
    return [scripts[number] for number in range(choices.people)]


def _gap(places: ndarray, others: Sequence[ndarray]) -> float:
    if not others:
        return math.inf
    distances = np.linalg.norm(np.stack(others) - places, axis=2)
    return float(np.min(np.where(np.isnan(distances), np.inf, distances)))


def _script(
    behaviour: Behaviour, duration: float, room: Furnished, seat: Seat | None, bed: Bed | None,
    rng: np.random.Generator,
) -> Script:  # fmt: skip
    if bed is not None:
        x, y, _ = bed.middle
        return Script(behaviour, [(0.0, x, y), (1.0, x, y)], bed=bed)
    if seat is not None:
        return _seated(behaviour, duration, room, seat, rng)
    if behaviour == "comes and goes" and room.doorways:
        return _passing(duration, room, rng)
    start = _spot(room, rng)
    if behaviour in ("walks", "comes and goes"):
        return Script("walks", _wander(start, 0.0, duration, room, rng))
    script = Script("stands", [(0.0, *start), (1.0, *start)])
    # who stands for long shifts about now and then
    time, place = float(rng.uniform(1.5, 6.0)), start
    while time < duration:
        near = start[0] + rng.normal(0.0, 0.08), start[1] + rng.normal(0.0, 0.08)
        script.waypoints += [(time, *place), (time + 0.9, *near)]
        place, time = near, time + 0.9 + float(rng.uniform(2.0, 7.0))
    middle = rng.uniform(-0.4, 0.4, 2) * room.half
    script.facings.append(Facing(-10.0, duration + 10.0, float(middle[0]), float(middle[1])))
    script.waypoints = sorted(set(script.waypoints))
    return script


def _seated(
    behaviour: Behaviour, duration: float, room: Furnished, seat: Seat, rng: np.random.Generator
) -> Script:
    x, y = seat.feet
    look = (x + 2.0 * math.cos(seat.heading), y + 2.0 * math.sin(seat.heading))
    ahead = (x + 0.32 * math.cos(seat.heading), y + 0.32 * math.sin(seat.heading))
    first, last = -100.0, duration + 100.0
    if behaviour == "sits":
        return Script(
            behaviour, [(0.0, x, y), (1.0, x, y)], [Facing(first, last, *look)], (first, last, seat)
        )
    turn = float(rng.uniform(0.25, 0.6)) * duration
    if rng.random() < 0.5:  # gets up and walks about
        walk = _wander(ahead, turn + 1.6, duration, room, rng)
        return Script(
            behaviour,
            [(0.0, x, y), (turn + 1.0, x, y), *walk],
            [Facing(first, turn + 1.4, *look)],
            (first, turn, seat),
        )
    walk = [(time, wx, wy) for time, wx, wy in _wander(ahead, 0.0, turn, room, rng)]
    reverse = [(turn - time, wx, wy) for time, wx, wy in reversed(walk)]
    reverse = [point for point in reverse if point[0] < turn - 0.05]
    return Script(
        behaviour,
        [*reverse, (turn, *ahead), (turn + 1.0, x, y), (turn + 2.0, x, y)],
        [Facing(turn + 0.2, last, *look)],
        (turn + 1.6, last, seat),
    )


def _passing(duration: float, room: Furnished, rng: np.random.Generator) -> Script:
    """Along the corridor, in through a doorway, about the room, and perhaps out again."""
    way_in = room.doorways[int(rng.integers(len(room.doorways)))]
    pace = float(rng.uniform(0.9, 1.25))
    aside = float(rng.choice([-1.0, 1.0])) * 2.0
    before = [way_in.at(0.7, aside), way_in.at(0.62, 0.1 * aside), way_in.at(-0.75)]
    arrival = float(rng.uniform(0.0, 0.45)) * duration  # when the doorway is passed
    lengths = [math.dist(before[0], before[1]) / pace, math.dist(before[1], before[2]) / pace]
    entry = arrival - lengths[0] - 0.45 * lengths[1]
    points = [
        (entry, *before[0]),
        (entry + lengths[0], *before[1]),
        (entry + sum(lengths), *before[2]),
    ]
    leaves = rng.random() < 0.55
    until = duration
    if leaves:
        until = max(points[-1][0] + 1.0, float(rng.uniform(0.6, 0.95)) * duration)
    walk = _wander(before[2], points[-1][0], until, room, rng)
    points += walk[1:]
    if leaves:
        way_out = min(room.doorways, key=lambda door: _blocked(points[-1][1:], door, room))
        after = [way_out.at(-0.75), way_out.at(0.62, 0.1 * aside), way_out.at(0.7, aside)]
        for place in after:
            step = math.dist(points[-1][1:], place) / pace
            if step > 0.05:
                points.append((points[-1][0] + step, *place))
        return Script("comes and goes", points)
    points.append((max(points[-1][0] + 1.0, duration + 5.0), *points[-1][1:]))
    return Script("comes and goes", points)


def _blocked(place: tuple[float, float], door: Doorway, room: Furnished) -> float:
    inner = door.at(-0.75)
    return math.dist(place, inner) + (0.0 if _clear(place, inner, room) else 100.0)


def _clear(first: tuple[float, float], second: tuple[float, float], room: Furnished) -> bool:
    shares = np.linspace(0.0, 1.0, 1 + max(2, int(math.dist(first, second) / 0.15)))[:, None]
    way = np.array(first) + shares * (np.array(second) - np.array(first))
    # the way from furniture that one has just risen from begins too near it
    far = np.linalg.norm(way - np.array(first), axis=1) > 0.5
    return bool(room.free(way[far], 0.28).all())


def _spot(room: Furnished, rng: np.random.Generator) -> tuple[float, float]:
    for _ in range(200):
        place = rng.uniform(-1.0, 1.0, 2) * (np.array(room.half) - 0.55)
        if room.free(place[None], 0.32)[0]:
            break
    return float(place[0]), float(place[1])


def _wander(
    start: tuple[float, float], first: float, last: float, room: Furnished,
    rng: np.random.Generator,
) -> list[tuple[float, float, float]]:  # fmt: skip
    """From spot to spot with pauses, around the furniture."""
    points = [(first, *start)]
    place, time = start, first
    while time < last:
        spot = None
        for _ in range(30):
            candidate = _spot(room, rng)
            if math.dist(place, candidate) > 0.7 and _clear(place, candidate, room):
                spot = candidate
                break
        if spot is None:
            points.append((last + 1.0, *place))
            break
        time += max(0.7, math.dist(place, spot) / float(rng.uniform(0.65, 1.2)))
        place = spot
        points.append((time, *place))
        if rng.random() < 0.35:
            time += float(rng.uniform(0.6, 3.0))
            points.append((time, *place))
    return points
