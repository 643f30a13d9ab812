"""Paths: the states of tracks at every step of their existence, and their links to boxes."""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Paths:
    """n paths without gaps, N rows together: one row for each step, path after path."""

    labels: Int[ndarray, " n"]
    """Label of each path."""
    firsts: Int[ndarray, " n"]
    """First step of each path."""
    starts: Int[ndarray, " n1"]
    """Index of each path's first row, and N at the end."""
    states: Float[ndarray, "N d"]
    """Position in metres, world frame; then velocity, where the motion model has one."""
    covariances: Float[ndarray, "N d d"]
    """Covariance of each state, metres and seconds."""

    @property
    def lasts(self) -> Int[ndarray, " n"]:
        """Last step of each path."""
        return np.asarray(self.firsts + np.diff(self.starts) - 1)

    @property
    def owners(self) -> Int[ndarray, " N"]:
        """Index of the path of each row."""
        return np.asarray(np.repeat(np.arange(len(self.labels)), np.diff(self.starts)))

    @property
    def steps(self) -> Int[ndarray, " N"]:
        """Step of each row."""
        lengths = np.diff(self.starts)
        offsets = np.repeat(self.firsts - self.starts[:-1], lengths)
        return np.asarray(np.arange(self.starts[-1]) + offsets)

    def with_states(
        self, states: Float[ndarray, "N d"], covariances: Float[ndarray, "N d d"]
    ) -> Paths:
        """The same paths with other states and covariances."""
        return Paths(self.labels, self.firsts, self.starts, states, covariances)

    @staticmethod
    def of(
        labels: Many[int],
        firsts: Many[int],
        states: Many[Float[ndarray, "K d"]],
        covariances: Many[Float[ndarray, "K d d"]],
        dimension: int,
    ) -> Paths:
        """Make paths from the rows of each.

        Args:
            labels: Label of each path.
            firsts: First step of each path.
            states: The K states of each path.
            covariances: The K covariances of each path.
            dimension: d, the size of the state.
        """
        lengths = [len(one) for one in states]
        return Paths(
            np.array(labels, dtype=np.int64),
            np.array(firsts, dtype=np.int64),
            np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64),
            np.concatenate([np.zeros((0, dimension)), *states]),
            np.concatenate([np.zeros((0, dimension, dimension)), *covariances]),
        )


@dataclass(frozen=True, slots=True, eq=False)
class Links:
    """L pairs of a row of a path and a box, with their association probabilities."""

    cameras: Int[ndarray, " L"]
    """Index of the camera of each box."""
    rows: Int[ndarray, " L"]
    """Index of the row."""
    boxes: Int[ndarray, " L"]
    """Index among all boxes of the camera over the whole recording."""
    shares: Float[ndarray, " L"]
    """Association probability, 0 … 1."""

    @staticmethod
    def joined(parts: Many[Links]) -> Links:
        """Concatenate the pairs of several cameras."""
        nothing = np.zeros(0, dtype=np.int64)
        every = [Links(nothing, nothing, nothing, np.zeros(0)), *parts]
        return Links(
            np.concatenate([one.cameras for one in every]),
            np.concatenate([one.rows for one in every]),
            np.concatenate([one.boxes for one in every]),
            np.concatenate([one.shares for one in every]),
        )

    def take(self, chosen: ndarray) -> Links:
        """Select some of the pairs, by mask or index."""
        return Links(
            self.cameras[chosen], self.rows[chosen], self.boxes[chosen], self.shares[chosen]
        )
