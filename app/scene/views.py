"""Where each browser looks from: the overview of the volume, or through one of the cameras."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable

import numpy as np
import viser
import viser.transforms as tf

from app.scene.framing import Pose

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
