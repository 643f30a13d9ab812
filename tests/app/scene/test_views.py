"""A browser keeps to its pose whatever shape its window takes, until its person moves."""

from __future__ import annotations

import threading
from contextlib import nullcontext
from dataclasses import replace
from typing import Any

import numpy as np

from app.scene.views import Pose, _Follower


class Camera:
    """What viser knows of a browser's camera; a slow reader lets another thread come between."""

    def __init__(self) -> None:
        self.shape = 2.0
        self.at = np.zeros(3)
        self.between: Any = None

    @property
    def position(self) -> np.ndarray:
        return self.at

    @position.setter
    def position(self, value: np.ndarray) -> None:
        """Asked for; the browser is there only when it says so."""

    @property
    def aspect(self) -> float:
        if self.between is not None:
            between, self.between = self.between, None
            between()
        return self.shape


class Client:
    def __init__(self) -> None:
        self.camera = Camera()

    def atomic(self) -> Any:
        return nullcontext()

    def flush(self) -> None:
        """Nothing waits."""


def pose_for(aspect: float) -> Pose:
    return Pose(np.full(3, aspect), np.zeros(3), np.array([0.0, 0.0, 1.0]), 0.7)


def test_two_answers_at_once_do_not_count_as_moving() -> None:
    client = Client()
    follower = _Follower(client, pose_for)  # type: ignore[arg-type]
    camera = client.camera
    follower.follow(camera)  # type: ignore[arg-type]
    camera.at = np.full(3, 2.0)  # it has arrived
    threads = []

    def resized_meanwhile() -> None:
        camera.shape = 1.5
        thread = threading.Thread(target=follower.follow, args=(camera,))
        threads.append(thread)
        thread.start()
        thread.join(timeout=0.3)

    camera.between = resized_meanwhile
    follower.follow(camera)  # type: ignore[arg-type]
    threads[0].join()
    follower.follow(camera)  # type: ignore[arg-type]  # still where it was
    assert follower._pose is not None
    np.testing.assert_allclose(follower._pose.position, 1.5)
    camera.shape = 1.2
    follower.follow(camera)  # type: ignore[arg-type]
    np.testing.assert_allclose(follower._pose.position, 1.2)


def test_who_has_moved_is_left_alone_whatever_comes() -> None:
    client = Client()
    scale = [1.0]

    def overview(aspect: float) -> Pose:
        return replace(pose_for(aspect), position=np.full(3, scale[0]))

    follower = _Follower(client, overview)  # type: ignore[arg-type]
    follower.follow(client.camera)  # type: ignore[arg-type]
    client.camera.at = np.full(3, 1.0)
    follower.follow(client.camera)  # type: ignore[arg-type]
    scale[0] = 2.0
    follower.renew()
    assert follower._pose is not None
    np.testing.assert_allclose(follower._pose.position, 2.0)
    client.camera.at = np.full(3, 2.0)
    follower.follow(client.camera)  # type: ignore[arg-type]
    client.camera.at = np.array([5.0, 0.0, 0.0])
    follower.follow(client.camera)  # type: ignore[arg-type]
    scale[0] = 3.0
    follower.renew()
    client.camera.shape = 1.2
    follower.follow(client.camera)  # type: ignore[arg-type]
    np.testing.assert_allclose(follower._pose.position, 2.0)
