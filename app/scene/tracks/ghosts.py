"""How tracks would be at a doubtful place, in the 3D scene beside how they are."""

from __future__ import annotations

import numpy as np
import viser

from app.colours import Palette
from app.scene import geometry
from app.scene.nodes import Lines, Tag, Tags
from tracker.fusion.trajectories import Trajectories
from tracker.sequences.sequence import Sequence

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
            step: That is shown, 0-based.
            palette: Of the theme.
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
