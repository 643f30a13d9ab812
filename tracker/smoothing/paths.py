"""Paths: the states of tracks at every step of their existence; all boxes, and links to them."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence as Many
from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.fusion.target_model import TargetModel
from tracker.kernels.kalman import Measurements
from tracker.single_view.protocol import ViewResult
from tracker.steps import Steps
from tracker.steps.table import Table


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
class Links(Table):
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
    def none() -> Links:
        """Make an empty set of pairs."""
        nothing = np.zeros(0, dtype=np.int64)
        return Links(nothing, nothing, nothing, np.zeros(0))


def contested_shares(paths: Paths, links: Links) -> Float[ndarray, " N"]:
    """Compute the share of each row's boxes that may belong to another path as well.

        Σ_z min(a_i(z), max_{j≠i} a_j(z)) / Σ_z a_i(z)

    over the boxes z of all cameras with association probabilities a: 0 where they belong to no
    other path, 1 where another path is at least as likely.
    """
    rows = len(paths.states)
    own = np.bincount(links.rows, links.shares, rows)
    if not len(links.rows):
        return np.zeros(rows)
    order = np.lexsort((-links.shares, links.boxes, links.cameras))
    camera, box, share = links.cameras[order], links.boxes[order], links.shares[order]
    first = np.ones(len(order), dtype=bool)
    first[1:] = (np.diff(camera) != 0) | (np.diff(box) != 0)
    leader = np.maximum.accumulate(np.where(first, np.arange(len(order)), 0))
    follows = np.zeros(len(order))
    second = np.flatnonzero(~first & (leader == np.arange(len(order)) - 1))
    follows[leader[second]] = share[second]
    rival = np.where(first, follows[leader], share[leader])
    lost = np.bincount(links.rows[order], np.minimum(share, rival), rows)
    return np.asarray(lost / np.maximum(own, 1e-12))


def split_paths(
    paths: Paths, clear: Bool[ndarray, " N"], breaks: Bool[ndarray, " N"]
) -> tuple[Paths, Int[ndarray, " M"]]:
    """Split paths into the runs of clear rows.

    Args:
        paths: The paths, with N rows.
        clear: The rows that remain.
        breaks: The rows before which a path is split even where both sides are clear.

    Returns:
        The runs as paths with M rows, and the index of each of these rows in ``paths``.
    """
    source_rows = np.flatnonzero(clear)
    owners = paths.owners[source_rows]
    begins = np.ones(len(source_rows), dtype=bool)
    begins[1:] = (np.diff(source_rows) > 1) | (np.diff(owners) != 0) | breaks[source_rows[1:]]
    firsts = np.flatnonzero(begins)
    starts = np.append(firsts, len(source_rows)).astype(np.int64)
    return (
        Paths(
            paths.labels[owners[firsts]],
            paths.steps[source_rows[firsts]],
            starts,
            paths.states[source_rows],
            paths.covariances[source_rows],
        ),
        source_rows,
    )


def select_rows(links: Links, source_rows: Int[ndarray, " M"], rows: int) -> Links:
    """Select the links of M of N rows, and renumber the rows.

    Args:
        links: Links of N rows.
        source_rows: Index of each of the M rows among the N.
        rows: N, the number of rows before the selection.
    """
    place = np.full(rows, -1, dtype=np.int64)
    place[source_rows] = np.arange(len(source_rows))
    return renumber_rows(links, place)


def renumber_rows(links: Links, place: Int[ndarray, " N"]) -> Links:
    """Renumber the links by the new index of each row, -1 for rows whose links are removed."""
    new = place[links.rows]
    chosen = links.take(new >= 0)
    return Links(chosen.cameras, new[new >= 0], chosen.boxes, chosen.shares)


def same_label(paths: Paths) -> list[tuple[int, int]]:
    """List the pairs of each tracklet and the next one in time with the same label of the
    filter."""
    order = np.lexsort((paths.firsts, paths.labels))
    one, other = order[:-1], order[1:]
    same = (paths.labels[one] == paths.labels[other]) & (paths.lasts[one] < paths.firsts[other])
    return list(zip(one[same].tolist(), other[same].tolist(), strict=True))


def join_chains(
    tracklets: Paths, chains: list[list[int]], labels: list[int]
) -> tuple[Paths, Int[ndarray, " M"]]:
    """Join the tracklets of each chain to one path, by linear interpolation in the gaps.

    Args:
        tracklets: The tracklets, with M rows.
        chains: The tracklets of each chain, in the order of time.
        labels: Label of each chain.

    Returns:
        The paths, and the index of each of the M rows in these, -1 for tracklets in no chain.
    """
    dimension = tracklets.states.shape[1]
    steps, place = tracklets.steps, np.full(len(tracklets.states), -1, dtype=np.int64)
    firsts = [int(tracklets.firsts[chain[0]]) for chain in chains]
    lasts = [int(tracklets.lasts[chain[-1]]) for chain in chains]
    lengths = [last + 1 - first for first, last in zip(firsts, lasts, strict=True)]
    found = Paths.blank(labels, firsts, lengths, dimension)
    for path, chain in enumerate(chains):
        rows = np.concatenate(
            [np.arange(tracklets.starts[k], tracklets.starts[k + 1]) for k in chain]
        )
        own, within = steps[rows], found.rows_of(path)
        every = np.arange(own[0], own[-1] + 1)
        for axis in range(dimension):
            found.states[within, axis] = np.interp(every, own, tracklets.states[rows, axis])
        found.covariances[within] = np.eye(dimension)
        place[rows] = within.start + own - own[0]
        found.covariances[place[rows]] = tracklets.covariances[rows]
    return found, place


@dataclass(frozen=True, slots=True, eq=False)
class CameraBoxes:
    """The B boxes of one camera over T steps, step after step."""

    starts: Int[ndarray, " T1"]
    """Index of the first box of each step, and B at the end."""
    blind: Bool[ndarray, " T"]
    """Whether the camera had no frame at each step."""
    boxes: Float[ndarray, "B 4"]
    """Centre and half sizes, pixels."""
    sigmas: Float[ndarray, "B 4"]
    """Standard deviations of the same, pixels."""
    clutter_factors: Float[ndarray, " B"]
    """Factor on κ, :attr:`tracker.single_view.protocol.ViewResult.clutter_factors`."""
    measured: Callable[[ndarray, ndarray], Measurements]
    """Converts boxes and their standard deviations to measurements of the target model."""

    def measurements(self, chosen: ndarray | slice) -> Measurements:
        """Some of the boxes as measurements, pixels and squared pixels.

        Their noises take as much memory as all else of a box, so that only those of a few boxes
        are made at a time.
        """
        return self.measured(self.boxes[chosen], self.sigmas[chosen])

    @staticmethod
    def of(
        views: Steps[tuple[ViewResult, ...]], camera: int, model: TargetModel, factor: float
    ) -> CameraBoxes:
        """Collect the boxes of all steps of one camera.

        Args:
            views: The results of stage 1 for each step.
            camera: Index of the camera.
            model: The measurement model of a target.
            factor: Factor on the standard deviations of the boxes.
        """
        found, sigmas = views.column("boxes", camera), views.column("sigmas", camera)
        boxes = found.values.reshape(-1, 4)
        blind = np.fromiter(views.values("blind", camera), bool, len(views))
        factors = np.ones(len(boxes))
        ratios = views.column("log_ratios", camera)
        factors[np.repeat(ratios.counts > 0, found.counts)] = np.exp(-ratios.values)
        measured = partial(model.measured, factor=factor)
        return CameraBoxes(
            found.starts, blind, boxes, sigmas.values.reshape(-1, 4), factors, measured
        )
