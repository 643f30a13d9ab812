"""Where each browser looks from: a pose with all in the picture, or through one of the cameras."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import viser
import viser.transforms as tf
from jaxtyping import Float
from numpy import ndarray

BREADTH = 0.4
"""Of a picture's true breadth, from which on it is well seen."""


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """Where to look from, at what, and how wide."""

    position: Float[ndarray, " 3"]
    look_at: Float[ndarray, " 3"]
    up: Float[ndarray, " 3"]
    fov: float
    """Vertical field of view, radians."""


def overview(
    points: Float[ndarray, "N 3"],
    eyes: Float[ndarray, "C 3"],
    centre: Float[ndarray, " 3"],
    aspect: float,
    fov: float = 0.72,
    elevation: float = 0.56,
    pictures: tuple[Float[ndarray, "C 3"], Float[ndarray, "C 3"]] | None = None,
) -> Pose:
    """A pose outside and above that has all points in the picture.

    Of the directions around, the one is taken that lets it come nearest, where a camera in
    front of the volume counts as if it were a quarter farther, and so does a camera's picture
    that is seen from its edge: of that nothing is to be seen.

    Args:
        points: What must be seen: corners of the volume, the cameras.
        eyes: The cameras' positions.
        centre: The centre of the volume.
        aspect: Width over height of the picture.
        fov: Vertical field of view, radians.
        elevation: Angle above the floor, radians.
        pictures: Middles of the cameras' pictures and the directions that these face, of length 1.
    """
    around = np.arctan2(eyes[:, 1] - centre[1], eyes[:, 0] - centre[0])
    best: tuple[float, Pose] | None = None
    for azimuth in np.deg2rad(-52.0) + np.arange(24) * np.pi / 12.0:
        pose = _framed(points, centre, aspect, fov, elevation, float(azimuth))
        near = np.max(np.cos(around - azimuth), initial=0.0)
        cost = float(np.linalg.norm(pose.position - pose.look_at)) * (1.0 + 0.25 * near)
        if pictures is not None:
            cost *= 1.0 + 0.25 * edge_on(pose.position, *pictures)
        if best is None or cost < best[0] - 1e-9:
            best = cost, pose
    assert best is not None
    return best[1]


def edge_on(
    position: Float[ndarray, " 3"], middles: Float[ndarray, "C 3"], normals: Float[ndarray, "C 3"]
) -> float:
    """How much the picture that is seen worst is seen from its edge: 1 where it is a line.

    0 where every picture keeps two fifths of its breadth, whether it is seen from before or from
    behind.
    """
    rays = middles - position
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    breadth = np.abs((rays * normals).sum(axis=1))
    return float(np.max(1.0 - breadth / BREADTH, initial=0.0))


def _framed(
    points: Float[ndarray, "N 3"],
    centre: Float[ndarray, " 3"],
    aspect: float,
    fov: float,
    elevation: float,
    azimuth: float,
) -> Pose:
    """The nearest pose in a direction that has all points in the picture."""
    away = np.array(
        [
            np.cos(azimuth) * np.cos(elevation),
            np.sin(azimuth) * np.cos(elevation),
            np.sin(elevation),
        ]
    )
    right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    up = np.cross(away, right)
    tangent = np.tan(fov / 2.0) * 0.94  # a margin at the edges
    across, above, nearer = ((points - centre) @ np.stack([right, up, away], axis=1)).T
    shift_x = shift_y = 0.0
    distance = 1.0
    for _ in range(8):
        wide = np.abs(across - shift_x) / (tangent * aspect) + nearer
        tall = np.abs(above - shift_y) / tangent + nearer
        distance = float(max(wide.max(), tall.max()))
        depth = distance - nearer
        sideways, upright = (across - shift_x) / depth, (above - shift_y) / depth
        shift_x += float(sideways.max() + sideways.min()) * distance / 2.0
        shift_y += float(upright.max() + upright.min()) * distance / 2.0
    target = centre + shift_x * right + shift_y * up
    return Pose(target + distance * away, target, np.array([0.0, 0.0, 1.0]), fov)


def from_above(points: Float[ndarray, "N 3"], aspect: float, fov: float = 0.3) -> Pose:
    """A pose high above that has all points in the picture: nearly a plan, x to the right.

    Args:
        points: What must be seen.
        aspect: Width over height of the picture.
        fov: Vertical field of view, radians; small, so that little is drawn askew.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    centre = (low + high) / 2.0
    wide, tall = (high - low)[:2] / 2.0 * 1.08  # a margin at the edges
    distance = max(tall, wide / aspect) / np.tan(fov / 2.0)
    eye = np.array([centre[0], centre[1], high[2] + distance])
    return Pose(eye, centre, np.array([0.0, 1.0, 0.0]), fov)


FLIGHT_SECONDS = 0.25
FRAMES_A_SECOND = 60.0


class Views:
    """Moves the viewpoint of every browser, each by itself."""

    def __init__(self, server: viser.ViserServer, pose_for: Callable[[float], Pose | None]) -> None:
        """Take over the viewpoints of the browsers that are there and of those that come.

        Args:
            server: Whose browsers.
            pose_for: The overview for an aspect (width over height); None while
                there is nothing to look at.
        """
        self._server = server
        self._pose_for = pose_for
        self._lock = threading.Lock()
        self._free: dict[int, Pose] = {}
        """Where each browser was before it looked through a camera."""
        self._followers: dict[int, _Follower] = {}
        self._through: Callable[[float], Pose] | None = None
        self._flight = 0
        self._closed = False
        server.on_client_connect(self._welcome)
        server.on_client_disconnect(self._forget)

    def home(self) -> None:
        """Put every browser at its overview, at once: another sequence is shown."""
        with self._lock:
            self._through = None
            self._flight += 1
            self._free.clear()
            followers = list(self._followers.values())
        for follower in followers:
            follower.place_again()

    def again(self) -> None:
        """Place every browser whose person has not moved: the overview is another by now."""
        with self._lock:
            followers = list(self._followers.values()) if self._through is None else []
        for follower in followers:
            follower.renew()

    def look(self, through: Callable[[float], Pose] | None, *, flies: bool = True) -> None:
        """Fly every browser to a camera's place, or back to where it was.

        Returns at once; a later call takes over from a flight under way.

        Args:
            through: The camera's pose for an aspect; None is the free view.
            flies: Whether the way there is animated; otherwise it is there at once.
        """
        clients = self._server.get_clients()
        with self._lock:
            if through is None and self._through is None:
                return
            flights: list[tuple[viser.ClientHandle, Pose]] = []
            for number, client in clients.items():
                aspect = client.camera.aspect
                if through is None:
                    goal = self._free.pop(number, None) or self._pose_for(aspect)
                else:
                    if self._through is None:
                        self._free[number] = _pose_of(client)
                    goal = through(aspect)
                if goal is not None:
                    flights.append((client, goal))
                    if number in self._followers:
                        self._followers[number].sent(goal, back=through is None)
            self._through = through
            self._flight += 1
            flight = self._flight
        threading.Thread(
            target=self._fly, args=(flight, flights, flies), name="scene-flight", daemon=True
        ).start()

    def close(self) -> None:
        """Stop flights and leave all browsers alone."""
        with self._lock:
            self._closed = True
            self._flight += 1
            self._followers.clear()

    def _welcome(self, client: viser.ClientHandle) -> None:
        follower = _Follower(client, self._goal)
        with self._lock:
            if self._closed:
                return
            self._followers[client.client_id] = follower
        follower.follow(client.camera)
        client.camera.on_update(follower.follow)

    def _goal(self, aspect: float) -> Pose | None:
        through = self._through
        if self._closed:
            return None
        return through(aspect) if through is not None else self._pose_for(aspect)

    def _forget(self, client: viser.ClientHandle) -> None:
        with self._lock:
            self._free.pop(client.client_id, None)
            self._followers.pop(client.client_id, None)

    def _fly(
        self, flight: int, flights: list[tuple[viser.ClientHandle, Pose]], flies: bool
    ) -> None:
        paths = [(client, _pose_of(client), goal) for client, goal in flights]
        begin = time.monotonic()
        share = 0.0
        while share < 1.0 and flight == self._flight:
            share = min(1.0, (time.monotonic() - begin) / FLIGHT_SECONDS) if flies else 1.0
            eased = share * share * (3.0 - 2.0 * share)
            for client, start, goal in paths:
                _place(client, between(start, goal, eased))
            time.sleep(1.0 / FRAMES_A_SECOND)


class _Follower:
    """Keeps one browser at its pose until its person moves.

    The pose depends on the window's shape, which changes shortly after the start when
    the panel takes its room, and whenever somebody drags an edge.
    """

    def __init__(self, client: viser.ClientHandle, goal: Callable[[float], Pose | None]) -> None:
        self._client = client
        self._goal = goal
        # viser tells of a browser from several threads at once
        self._lock = threading.RLock()
        self._pose: Pose | None = None
        self._aspect = 0.0
        self._arrived = False
        self._moved = False
        self._had_moved = False

    def place_again(self) -> None:
        """Place it whatever happened before."""
        with self._lock:
            self._moved = self._had_moved = False
            self._aspect = 0.0
            self.follow(self._client.camera)

    def renew(self) -> None:
        """Place it where it belongs by now, unless its person has moved."""
        with self._lock:
            if not self._moved:
                self._aspect = 0.0
                self.follow(self._client.camera)

    def sent(self, pose: Pose, *, back: bool) -> None:
        """Somebody else moves it to a pose: away from where it is, or back there.

        Away, it keeps to that pose whatever its window's shape; back, a person who
        had moved before is left alone again.
        """
        with self._lock:
            if back:
                self._moved = self._had_moved
            else:
                self._had_moved, self._moved = self._moved, False
            self._pose, self._aspect, self._arrived = pose, self._client.camera.aspect, False

    def follow(self, camera: viser.CameraHandle) -> None:
        """The browser said where it is and what shape its window has."""
        with self._lock:
            if self._pose is not None:
                here = bool(np.allclose(camera.position, self._pose.position, atol=1e-2))
                if math.isclose(camera.aspect, self._aspect, rel_tol=0.01):
                    # an answer from before it was placed does not count as moving
                    self._moved |= self._arrived and not here
                    self._arrived |= here
                    return
            pose = self._goal(camera.aspect)
            if pose is None or self._moved:
                return
            self._pose, self._aspect, self._arrived = pose, camera.aspect, False
            _place(self._client, pose)


def between(start: Pose, goal: Pose, share: float) -> Pose:
    """A pose on the way: the place in a straight line, the turn along the shortest arc."""
    if share >= 1.0:
        return goal
    first, last = _turn(start), _turn(goal)
    turn = first @ tf.SO3.exp(share * (first.inverse() @ last).log())
    position = start.position + share * (goal.position - start.position)
    reach = [float(np.linalg.norm(p.look_at - p.position)) for p in (start, goal)]
    ahead = turn.as_matrix()[:, 2]
    return Pose(
        position=position,
        look_at=position + ahead * (reach[0] + share * (reach[1] - reach[0])),
        up=-turn.as_matrix()[:, 1],
        fov=start.fov + share * (goal.fov - start.fov),
    )


def _turn(pose: Pose) -> tf.SO3:
    ahead = pose.look_at - pose.position
    ahead = ahead / np.linalg.norm(ahead)
    right = np.cross(ahead, pose.up)
    right = right / np.linalg.norm(right)
    return tf.SO3.from_matrix(np.stack([right, np.cross(ahead, right), ahead], axis=1))


def _pose_of(client: viser.ClientHandle) -> Pose:
    camera = client.camera
    return Pose(
        np.array(camera.position),
        np.array(camera.look_at),
        np.array(camera.up_direction),
        float(camera.fov),
    )


def _place(client: viser.ClientHandle, pose: Pose) -> None:
    with client.atomic():
        client.camera.up_direction = pose.up
        client.camera.position = pose.position
        client.camera.look_at = pose.look_at
        client.camera.fov = pose.fov
    client.flush()
