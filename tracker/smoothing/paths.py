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

    def owners_of(self, rows: Int[ndarray, " K"]) -> Int[ndarray, " K"]:
        """Index of the path of some rows."""
        return np.asarray(np.searchsorted(self.starts, rows, side="right") - 1)

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

    def without_states(self) -> Paths:
        """The same paths without states and covariances, which are estimated anew."""
        dimension = self.states.shape[1]
        return self.with_states(np.zeros((0, dimension)), np.zeros((0, dimension, dimension)))

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
        found = Paths.blank(labels, firsts, lengths, dimension)
        np.concatenate([np.zeros((0, dimension)), *states], out=found.states)
        np.concatenate([np.zeros((0, dimension, dimension)), *covariances], out=found.covariances)
        return found

    @staticmethod
    def blank(labels: Many[int], firsts: Many[int], lengths: Many[int], dimension: int) -> Paths:
        """Make paths whose states and covariances are to be filled in, path after path.

        Args:
            labels: Label of each path.
            firsts: First step of each path.
            lengths: Number of rows of each path.
            dimension: d, the size of the state.
        """
        starts = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)
        return Paths(
            np.array(labels, dtype=np.int64),
            np.array(firsts, dtype=np.int64),
            starts,
            np.empty((starts[-1], dimension)),
            np.empty((starts[-1], dimension, dimension)),
        )

    def rows_of(self, path: int) -> slice:
        """The rows of one path."""
        return slice(int(self.starts[path]), int(self.starts[path + 1]))


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

    def take(self, chosen: ndarray | slice) -> Links:
        """Select some of the pairs, by mask or index."""
        return Links(
            self.cameras[chosen], self.rows[chosen], self.boxes[chosen], self.shares[chosen]
        )
