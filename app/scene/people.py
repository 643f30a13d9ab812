"""What the run says in the 3D scene: components, estimates and trails of the shown step."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import viser
from jaxtyping import Float, Int
from numpy import ndarray

from app.colours import PALETTES, Palette, mix
from app.scene import geometry
from app.scene.geometry import FUTURE_SECONDS
from app.scene.nodes import Lines, Meshes, Tag, Tags, Targets
from app.state.snapshot import Trail
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.fusion.trajectories import Trajectories
from tracker.runs.pipeline import Run
from tracker.sequences.sequence import Room, Sequence

TAGS = 16
"""Made at once; a step with more people adds some for good."""
NAME_ABOVE = 0.12
"""Metres of a number above its box."""
CALLED_ABOVE = 0.2
"""Metres of a name above the number."""
LONGEST_NAME = 16
"""Letters of a name that are written, as in the pictures."""
FOOT = 1.35
"""How much wider than a person the disc is that he stands on."""
BODIES, DISCS = (0.6, 0.8), (0.34, 0.55)
"""Opacities of bodies and of the discs under them: of all, and of the selected one."""
OPACITY_STEP = 0.05
"""Opacities of ellipsoids are rounded to these: of weights that hardly change they stay as they
are, and the client need not make the ellipsoids anew with every step."""
UNREPORTED_WEIGHT = 0.02
"""Below this a component without a track is not drawn: its ellipsoid would be large and mean
next to nothing."""


class PeopleNodes:
    """Everything of the run that changes with the step."""

    def __init__(self, server: viser.ViserServer, on_pick: Callable[[int], None]) -> None:
        """Make the nodes, hidden.

        Args:
            server: Where they live.
            on_pick: Called with the id of the track whose box or ellipsoid was clicked.
        """
        self._on_pick = on_pick
        self._palette = PALETTES["dark"]
        self._alone: tuple[Trajectories, int | None, Trajectories] | None = None
        """All tracks, one of them, and its rows, which every step would have to look for."""
        self._reach: Float[ndarray, "N 3"] = np.zeros((0, 3))
        self._box_ids: Int[ndarray, " N"] = np.zeros(0, dtype=np.int64)
        self._component_ids: Int[ndarray, " J"] = np.zeros(0, dtype=np.int64)
        self._future = Lines(server, "/people/future", 1.0)
        self._trails = Lines(server, "/people/trails", 1.75)
        self._selected_trail = Lines(server, "/people/selected_trail", 2.5)
        self._rays = Lines(server, "/people/rays", 1.0)
        self._boxes = Lines(server, "/people/boxes", 1.5)
        self._selected_box = Lines(server, "/people/selected_box", 2.25)
        cube, sphere = geometry.unit_cube(), geometry.icosphere(2)
        self._feet = [
            Meshes(server, f"/people/{name}", *geometry.disc(), opacity=opacity)
            for name, opacity in zip(("feet", "selected_feet"), DISCS, strict=True)
        ]
        self._figures = [
            Meshes(server, f"/people/{name}", *geometry.figure(), side="back", opacity=opacity)
            for name, opacity in zip(("figures", "selected_figure"), BODIES, strict=True)
        ]
        self._bodies = Targets(server, "/people/bodies", *cube, self._pick_box)
        self._ellipsoids = Meshes(
            server, "/people/ellipsoids", *sphere, on_click=self._pick_component
        )
        self._tags = Tags(server, "/labels/people", TAGS, 1.0)
        self._called = Tags(server, "/labels/names", 0, 0.85)
        self.points: Float[ndarray, "N 3"] = np.zeros((0, 3))
        """How far what is drawn reaches: boxes, bodies, feet, names and ellipsoids, metres."""

    def _pick_box(self, index: int) -> None:
        if index < len(self._box_ids):
            self._on_pick(int(self._box_ids[index]))

    def _pick_component(self, index: int) -> None:
        if index < len(self._component_ids) and self._component_ids[index] > 0:
            self._on_pick(int(self._component_ids[index]))

    def show(
        self,
        sequence: Sequence,
        run: Run | None,
        step: int,
        selected: int | None,
        layers: Mapping[str, bool],
        palette: Palette,
        trail: Trail,
        names: Mapping[int, str],
    ) -> None:
        """Draw one step.

        Args:
            sequence: Gives a person's size.
            run: Has the step; None where it is not computed: nothing is drawn then.
            step: 0-based.
            selected: The track that is drawn stronger.
            layers: Which of boxes, ellipsoids and trails are on, and whether tracks other
                than the selected one are.
            palette: The colours of the theme.
            trail: How long trails are.
            names: What tracks were called by hand, by id.
        """
        self._palette = palette
        tracks = run.tracks if run is not None else Trajectories.empty(len(sequence.views))
        alone = selected is not None and not layers["others"]
        if alone:
            if self._alone is None or self._alone[0] is not tracks or self._alone[1] != selected:
                self._alone = tracks, selected, tracks.take(tracks.ids == selected)
            tracks = self._alone[2]
        now = tracks.at(step)
        ids, positions = tracks.ids[now], tracks.positions[now]
        half = sequence.target_half_extents
        boxes = layers["boxes"]
        drawn = slice(None if boxes else 0)
        self._show_boxes(ids[drawn], positions[drawn], half, selected)
        standing = slice(None if layers["bodies"] else 0)
        self._show_figures(ids[standing], positions[standing], half, sequence.room, selected)
        self._show_rays(sequence, tracks, now, selected if boxes else None)
        self._show_trails(
            tracks if layers["trails"] else Trajectories.empty(len(sequence.views)),
            step,
            sequence.fps,
            float(sequence.room.minimum[2]),
            selected,
            trail,
        )
        posterior = GaussianMixture.empty(3)
        if run is not None and not run.only_tracks:
            posterior = _reported(run, step)
        recent = slice(
            int(np.searchsorted(tracks.frames, step - round(trail.seconds * sequence.fps))),
            now.stop,
        )
        known = dict(zip(tracks.labels[recent].tolist(), tracks.ids[recent].tolist(), strict=True))
        if alone:
            kept = [known.get(label) == selected for label in posterior.labels.tolist()]
            posterior = posterior.take(np.array(kept, dtype=bool))
        self._show_components(
            posterior if layers["ellipsoids"] else GaussianMixture.empty(3),
            known,
            selected,
            middle_of(sequence.room),
        )
        named = boxes or layers["ellipsoids"] or layers["bodies"]
        self.points = np.concatenate(
            [self._reach, room_taken(positions[: None if named else 0], half, sequence.room)]
        )
        shades = self._palette.of(ids)
        above = np.array([0.0, 0.0, half[2] + NAME_ABOVE])
        self._tags.show(
            [
                Tag(
                    tuple((position + above).tolist()),
                    f"{track}",
                    (int(shade[0]), int(shade[1]), int(shade[2])),
                )
                for track, position, shade in zip(ids, positions, shades, strict=True)
                if named
            ]
        )
        higher = above + np.array([0.0, 0.0, CALLED_ABOVE])
        self._called.show(
            [
                Tag(tuple((position + higher).tolist()), names[track][:LONGEST_NAME])
                for track, position in zip(ids.tolist(), positions, strict=True)
                if named and track in names
            ]
        )

    def _show_boxes(
        self,
        ids: Int[ndarray, " N"],
        positions: Float[ndarray, "N 3"],
        half: Float[ndarray, " 3"],
        selected: int | None,
    ) -> None:
        edges = geometry.box_edges(positions, half)
        shades = self._palette.of(ids)
        chosen = ids == (selected if selected is not None else -1)
        for node, rows in ((self._boxes, ~chosen), (self._selected_box, chosen)):
            node.show(edges[rows].reshape(-1, 2, 3), np.repeat(shades[rows], 12, axis=0)[:, None])
        sizes = np.broadcast_to(half, positions.shape)
        self._box_ids = ids
        self._bodies.show(positions, sizes)

    def _show_figures(
        self,
        ids: Int[ndarray, " N"],
        positions: Float[ndarray, "N 3"],
        half: Float[ndarray, " 3"],
        room: Room,
        selected: int | None,
    ) -> None:
        """A soft body from the top of each box to the floor, and a disc where it stands."""
        floor = float(room.minimum[2])
        shades = self._palette.of(ids)
        chosen = ids == (selected if selected is not None else -1)
        feet = positions.copy()
        feet[:, 2] = floor
        tall = np.maximum(0.1, positions[:, 2] + half[2] - floor)
        wide = np.broadcast_to(half[:2] * 0.9, (len(ids), 2))
        sizes = np.concatenate([wide, tall[:, None]], axis=1)
        above = feet + np.array([0.0, 0.0, 0.006])  # in front of the floor
        round_ = np.broadcast_to(np.array([*half[:2] * FOOT, 1.0]), positions.shape)
        for body, disc, rows in zip(self._figures, self._feet, (~chosen, chosen), strict=True):
            body.show(feet[rows], sizes[rows], shades[rows], about=middle_of(room))
            disc.show(above[rows], round_[rows], shades[rows])

    def _show_rays(
        self, sequence: Sequence, tracks: Trajectories, now: slice, selected: int | None
    ) -> None:
        """From each camera that saw the selected one to where it was put."""
        row = np.flatnonzero(tracks.ids[now] == (selected if selected is not None else -1))
        if not len(row):
            self._rays.show(np.zeros((0, 2, 3)), self._palette.line)
            return
        position = tracks.positions[now][row[0]]
        eyes = [
            camera.centre
            for camera, seen in zip(sequence.cameras, tracks.seen[now][row[0]], strict=True)
            if seen
        ]
        segments = np.array([[eye, position] for eye in eyes]).reshape(-1, 2, 3)
        shade = self._palette.fade(self._palette.of(tracks.ids[now][row]), 0.5)
        self._rays.show(segments, shade[None])

    def _show_trails(
        self,
        tracks: Trajectories,
        step: int,
        fps: float,
        floor: float,
        selected: int | None,
        trail: Trail,
    ) -> None:
        """Where people walked, on the floor."""
        way = geometry.trails(tracks, step, trail.seconds, fps, ahead=FUTURE_SECONDS)
        way.segments[..., 2] = floor + 0.012
        past = way.ages[:, 1] >= 0.0
        span = np.where(past, trail.seconds, -FUTURE_SECONDS)[:, None]
        full = np.where(past, 0.92, 0.5)[:, None]
        fading = np.where(past, trail.fades, True)[:, None]
        strength = full - fading * (full - 0.12) * way.ages / span
        shades = self._palette.of(way.ids)[:, None].repeat(2, axis=1)
        shades = mix(np.asarray(self._palette.ground), shades, strength)
        chosen = way.ids == (selected if selected is not None else -1)
        for node, rows in (
            (self._future, ~past),
            (self._trails, past & ~chosen),
            (self._selected_trail, past & chosen),
        ):
            node.show(way.segments[rows], shades[rows])

    def _show_components(
        self,
        mixture: GaussianMixture,
        ids: Mapping[int, int],
        selected: int | None,
        middle: Float[ndarray, " 3"],
    ) -> None:
        """Draw Gaussian components as the ellipsoids that hold a stated share of each.

        Opacity grows with the weight; the colour is that of the component's track, grey
        where it has none. Of those without a track the very light ones are left out.

        Args:
            mixture: The first three entries of its states are x, y, z in metres.
            ids: Of the labels that are tracks.
            selected: The track that is drawn stronger.
            middle: Of the room, world metres.
        """
        numbers = np.array([ids.get(label, 0) for label in mixture.labels.tolist()], np.int64)
        drawn = (numbers > 0) | (mixture.weights > UNREPORTED_WEIGHT)
        mixture, numbers = mixture.take(drawn), numbers[drawn]
        wxyzs, axes = geometry.ellipsoids(mixture.covariances[:, :3, :3])
        shades = np.where(
            (numbers > 0)[:, None],
            self._palette.of(numbers),
            np.array(self._palette.line, dtype=np.uint8),
        )
        weights = np.clip(mixture.weights, 0.0, 1.0)
        opacities = np.where(numbers > 0, 0.06 + 0.44 * weights, 0.04 + 0.3 * weights)
        if selected is not None:
            opacities = opacities + 0.15 * (numbers == selected)
        opacities = OPACITY_STEP * np.ceil(opacities / OPACITY_STEP)  # the faintest is still seen
        self._component_ids = numbers
        self._reach = geometry.surfaces(mixture.means[:, :3], wxyzs, axes)
        self._ellipsoids.show(mixture.means[:, :3], axes, shades, opacities, wxyzs, about=middle)


def _reported(run: Run, step: int) -> GaussianMixture:
    """The posterior of a step, with the covariance of what all cameras err alike added."""
    posterior: GaussianMixture = run.fused[step].posterior
    if run.smoothed is None or not run.smoothed.common:
        return posterior
    covariances = posterior.covariances.copy()
    covariances[:, [0, 1], [0, 1]] += run.smoothed.common
    return replace(posterior, covariances=covariances)


def middle_of(room: Room) -> Float[ndarray, " 3"]:
    """The middle of the volume: bodies, and ellipsoids after them, are drawn when the pictures of
    the cameras behind them are, and before those in front."""
    return np.asarray((room.minimum + room.maximum) / 2.0)


def room_taken(
    positions: Float[ndarray, "N 3"], half: Float[ndarray, " 3"], room: Room
) -> Float[ndarray, "M 3"]:
    """How far people reach who are at these positions: from their feet to the names above."""
    low = np.stack([positions[:, 0], positions[:, 1], np.full(len(positions), room.minimum[2])], 1)
    high = positions + np.array([0.0, 0.0, half[2] + 2.0 * NAME_ABOVE])
    beside = FOOT * np.array([[x * half[0], y * half[1], 0.0] for x in (-1, 1) for y in (-1, 1)])
    return np.concatenate([(ends[:, None] + beside).reshape(-1, 3) for ends in (low, high)])
