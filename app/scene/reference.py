"""What the run is held against in 3D: the truth, the pinned run, tracks as they would be."""

from __future__ import annotations

import numpy as np
import viser
from jaxtyping import Float
from numpy import ndarray

from app.colours import Palette
from app.scene import geometry
from app.scene.nodes import Lines, Tag, Tags
from app.state.pairs import GATE, pairs_at
from app.state.snapshot import Trail
from tracker.fusion.trajectories import Trajectories
from tracker.sequences.sequence import Sequence

DASH = 0.18
"""Of the largest half extent of a person: dashed is what this run did not see here."""
NO_LINES = np.zeros((0, 2, 3))


class ReferenceNodes:
    """Dashed boxes of the truth and of the pinned run, and a line for each error."""

    def __init__(self, server: viser.ViserServer) -> None:
        """Make the nodes, hidden."""
        self._truth = Lines(server, "/people/truth", 1.0)
        self._errors = Lines(server, "/people/errors", 3.0)
        self._pinned = Lines(server, "/people/pinned", 1.25)
        self._pinned_trails = Lines(server, "/people/pinned_trails", 1.0)

    def show_truth(
        self, sequence: Sequence, tracks: Trajectories, step: int | None, palette: Palette
    ) -> None:
        """Draw where people really are, and how far from there they were put.

        Args:
            sequence: Gives the truth and a person's size.
            tracks: Of the run; what it does not have at the step gets no line.
            step: 0-based; None draws nothing.
            palette: The colours of the theme.
        """
        truth = sequence.ground_truth
        if truth is None or step is None:
            self._truth.show(NO_LINES, palette.truth)
            self._errors.show(NO_LINES, palette.truth)
            return
        now = truth.at(step)
        strength = np.where(truth.valid[now], 0.75, 0.35)
        segments, owners = _dashed(truth.positions[now], sequence.target_half_extents)
        shade = np.broadcast_to(np.array(palette.truth, dtype=np.uint8), (len(segments), 3))
        self._truth.show(segments, palette.fade(shade, strength[owners])[:, None])
        pairs = pairs_at(truth, tracks, step)
        ends = (truth.positions[now][pairs.people], tracks.positions[tracks.at(step)])
        lines = np.stack([ends[0], ends[1][pairs.estimates]], axis=1).reshape(-1, 2, 3)
        self._errors.show(lines, palette.error(pairs.errors / GATE)[:, None])

    def show_pinned(
        self,
        sequence: Sequence,
        tracks: Trajectories | None,
        step: int,
        palette: Palette,
        trail: Trail,
    ) -> None:
        """Draw the pinned run's people and the way they came; None draws nothing."""
        if tracks is None:
            tracks = Trajectories.empty(len(sequence.views))
        half = sequence.target_half_extents
        segments, _ = _dashed(tracks.positions[tracks.at(step)], half)
        shade = np.array(palette.pinned, dtype=np.uint8)
        self._pinned.show(
            segments, palette.fade(np.broadcast_to(shade, (len(segments), 1, 3)), 0.7)
        )
        way = geometry.trails(tracks, step, trail.seconds, sequence.fps, float(half[2]))
        ages = way.ages / trail.seconds * trail.fades
        shades = np.broadcast_to(shade, (len(way.segments), 2, 3))
        # every second segment: dashed, like all that is not of this run
        kept = np.arange(len(way.segments)) % 4 < 2
        self._pinned_trails.show(
            way.segments[kept], palette.fade(shades[kept], 0.6 - 0.5 * ages[kept])
        )


def _dashed(
    centres: Float[ndarray, "N 3"], half: Float[ndarray, " 3"]
) -> tuple[Float[ndarray, "S 2 3"], ndarray]:
    """Dashed boxes, and whose each segment is."""
    edges = geometry.box_edges(centres, half)
    parts = [geometry.dashes(box, DASH * float(half.max())) for box in edges]
    owners = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
    return np.concatenate([NO_LINES, *parts]), owners


WIDE = 7.0
"""Pixels of the way that they would have gone: broader than a trail, which lies in it."""
NAMES = 4
"""Made at once."""


class GhostNodes:
    """Broad ways on the floor with their numbers at their ends, and a box at the shown step."""

    def __init__(self, server: viser.ViserServer) -> None:
        """Make the nodes, hidden."""
        self._ways = Lines(server, "/people/ghost_ways", WIDE)
        self._boxes = Lines(server, "/people/ghost_boxes", 1.75)
        self._names = Tags(server, "/labels/ghosts", NAMES, 0.85)

    def show(
        self, sequence: Sequence, ghosts: Trajectories | None, step: int, palette: Palette
    ) -> None:
        """Draw them; None draws nothing.

        Args:
            sequence: Gives the floor and a person's size.
            ghosts: Tracks as they would be, around the place.
            step: The step that is shown, from 0.
            palette: The colours of the theme.
        """
        tracks = Trajectories.empty(len(sequence.views)) if ghosts is None else ghosts
        order = np.lexsort((tracks.frames, tracks.ids))
        ids, places = tracks.ids[order], tracks.positions[order].copy()
        places[:, 2] = sequence.room.minimum[2] + 0.01
        ways = np.stack([places[:-1], places[1:]], axis=1).reshape(-1, 2, 3)
        # of one track, and without the gap where it is not there
        joined = (ids[1:] == ids[:-1]) & (np.diff(tracks.frames[order]) <= 2)
        shades = palette.of(ids)
        self._ways.show(ways[joined], palette.fade(shades[1:][joined], 0.6)[:, None])
        now = tracks.at(step)
        half = sequence.target_half_extents
        edges = geometry.box_edges(tracks.positions[now], half * 1.06)
        self._boxes.show(
            edges.reshape(-1, 2, 3), np.repeat(palette.of(tracks.ids[now]), 12, axis=0)[:, None]
        )
        ends = np.flatnonzero(np.append(ids[1:] != ids[:-1], len(ids) > 0))
        self._names.show(
            [
                Tag(
                    (float(places[k, 0]), float(places[k, 1]), float(places[k, 2]) + 0.05),
                    f"{ids[k]}",
                    (int(shades[k, 0]), int(shades[k, 1]), int(shades[k, 2])),
                )
                for k in ends
            ]
        )
