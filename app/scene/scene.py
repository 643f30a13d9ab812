"""The 3D view: the room, the cameras with their pictures, and what the run says of a step.

The scene is a fixed set of named nodes that are updated in place by one thread, which
always draws the newest state; see :mod:`app.scene.worker`. All that belongs to a step
reaches the browsers together, the written step included.
"""

from __future__ import annotations

from collections.abc import Callable, Set
from functools import partial

import numpy as np
import viser
from jaxtyping import Float, UInt8

from app.colours import PALETTES, Theme
from app.scene import geometry, views
from app.scene.people import PeopleNodes, room_taken
from app.scene.reference import GhostNodes, ReferenceNodes
from app.scene.standing import FrustumNodes, RoomNodes, entrance_edges, pose_through
from app.scene.views import Pose, Views
from app.scene.worker import Follower
from app.state import opening_step
from app.state.snapshot import Change, Snapshot, View
from app.state.workbench import Workbench
from tracker.fusion.trajectories import Trajectories
from tracker.runs.pipeline import Run
from tracker.runs.run import given_names
from tracker.sequences.sequence import Room

Rgb = UInt8[np.ndarray, "H W 3"]

BELOW = 1e9
"""Place of the written step in the panel: after all inputs, which viser counts from 1 on."""

PICTURE_SECONDS = 20.0
"""A browser without a graphics card takes a while to draw."""


class Scene(Follower):
    """viser's scene, kept equal to the workbench's state."""

    def __init__(self, server: viser.ViserServer, workbench: Workbench) -> None:
        """Make all nodes and follow the workbench from now on.

        Args:
            server: Its scene, theme and viewpoints belong to this object.
            workbench: What to show.
        """
        super().__init__("scene", workbench)
        self._server = server
        self._shown = Snapshot()
        self._drawn: tuple[object, ...] = ()
        self._looking: View = None
        self._sight = 0
        self._walked: Float[np.ndarray, "N 3"] = np.zeros((0, 3))
        """How far the people of the run reach, wherever they are."""
        self._theme: Theme | None = None
        server.scene.set_up_direction("+z")
        server.scene.world_axes.visible = False
        # below the sliders: inside the page its transport says the same
        self._status = server.gui.add_html(status_html(self._shown, None), order=BELOW)
        self._room = RoomNodes(server)
        self._frusta = FrustumNodes(server, self._look_through)
        self._reference = ReferenceNodes(server)
        self._people = PeopleNodes(server, self._pick)
        self._ghosts = GhostNodes(server)
        self._views = Views(server, self._overview)
        self.follow()

    def picture(self, width: int, height: int) -> Rgb:
        """What the browser that came last shows, on the ground of the theme.

        Args:
            width: Pixels.
            height: As well.

        Raises:
            LookupError: If no browser looks at the view, or it does not answer.
        """
        clients = self._server.get_clients()
        if not clients:
            raise LookupError("no browser shows the 3D view")
        client = clients[max(clients)]
        try:
            drawn = client.get_render(
                height, width, transport_format="png", timeout=PICTURE_SECONDS
            )
        except (TimeoutError, RuntimeError) as error:
            raise LookupError("the browser did not draw the 3D view") from error
        ground = np.asarray(PALETTES[self._shown.theme].canvas, dtype=float)
        share = drawn[..., 3:4] / 255.0
        mixed: Rgb = (drawn[..., :3] * share + ground * (1.0 - share)).round().astype(np.uint8)
        return mixed

    def close(self) -> None:
        """Stop following, and flying as well."""
        super().close()
        self._views.close()

    # what happens elsewhere: these return at once

    def _note(self, change: Change) -> None:
        if change not in ("parameters", "opening"):
            self._worker.ask(change)

    def _pick(self, track: int) -> None:
        selected = self._workbench.snapshot().selection
        self._workbench.select(None if track == selected else track)

    def _look_through(self, camera: int) -> None:
        self._workbench.look(None if camera == self._looking else camera)

    # the worker's thread

    def _work(self, topics: Set[str]) -> None:
        snapshot = self._workbench.snapshot()
        themed = snapshot.theme != self._theme
        if themed:
            self._theme = snapshot.theme
            self._server.gui.configure_theme(
                dark_mode=snapshot.theme == "dark", show_logo=False, show_share_button=False
            )
        sequence = snapshot.sequence
        if sequence is None:
            return
        before = self._shown.sequence
        another = before is None or sequence.views is not before.views
        taught = sequence is not before
        turned = snapshot.view != self._looking
        self._looking = snapshot.view
        if taught or turned or themed or "layers" in topics:
            palette, through = PALETTES[snapshot.theme], self._through
            with self._server.atomic():
                self._room.show(
                    sequence.room,
                    palette,
                    volume=snapshot.layers["volume"],
                    floor=through is None,
                )
                self._frusta.place(sequence.cameras, sequence.room, through, palette)
        self._shown = snapshot  # from here on a browser that comes asks for the overview of it
        self._draw_step(snapshot, shown_run(snapshot))
        self._frame(snapshot, shown_run(snapshot), another=another)
        if another:
            self._set_home(snapshot)
            self._views.home()
        if turned or another:
            self._views.look(self._pose_of(snapshot), flies=snapshot.flies and not another)

    @property
    def _through(self) -> int | None:
        """The camera that is looked through."""
        return self._looking if isinstance(self._looking, int) else None

    def _draw_step(self, snapshot: Snapshot, run: Run | None) -> None:
        sequence = snapshot.sequence
        assert sequence is not None
        step = snapshot.playhead
        drawing = (
            sequence, run, step, snapshot.selection, dict(snapshot.layers), self._looking,
            snapshot.run_state.state, snapshot.theme, snapshot.scores.pinned, snapshot.trail,
            snapshot.ghosts,
        )  # fmt: skip
        if drawing == self._drawn:
            return
        self._drawn = ()
        pictures = [self._picture(snapshot, run, camera) for camera in range(len(sequence.views))]
        with self._server.atomic():
            layers, palette = snapshot.layers, PALETTES[snapshot.theme]
            self._people.show(
                sequence, run, step, snapshot.selection, layers, palette, snapshot.trail,
                given_names(run) if run is not None else {},
            )  # fmt: skip
            tracks = run.tracks if run is not None else Trajectories.empty(len(sequence.views))
            self._reference.show_truth(sequence, tracks, step if layers["truth"] else None, palette)
            self._reference.show_pinned(
                sequence, pinned_tracks(snapshot), step, palette, snapshot.trail
            )
            self._ghosts.show(sequence, ghost_tracks(snapshot), step, palette)
            for camera, picture in enumerate(pictures):
                self._frusta.show_picture(camera, picture)
            self._status.content = status_html(snapshot, run)
        self._server.flush()
        self._drawn = drawing

    def _picture(self, snapshot: Snapshot, run: Run | None, camera: int) -> np.ndarray:
        """A camera's picture of the shown step with the targets in it."""
        sequence, step = snapshot.sequence, snapshot.playhead
        assert sequence is not None
        view = self._frusta.view(camera)
        source = snapshot.reader.picture(camera, step) if snapshot.reader is not None else None
        picture = view.picture(source)
        if source is None and sequence.views[camera].has_pictures:
            view.draw_note(picture, f"{view.camera.name}: no frame {step}")
        if run is not None and snapshot.layers["boxes"] and camera != self._through:
            now = run.tracks.at(step)
            view.draw_boxes(
                picture,
                run.tracks.positions[now],
                sequence.target_half_extents,
                run.tracks.ids[now],
                snapshot.selection,
            )
        return picture

    def _overview(self, aspect: float) -> Pose | None:
        sequence = self._shown.sequence
        if sequence is None:
            return None
        room = sequence.room
        eyes = np.array([camera.centre for camera in sequence.cameras]).reshape(-1, 3)
        corners = geometry.box_corners(room.minimum, room.maximum)
        centre = (room.minimum + room.maximum) / 2.0
        # with their pictures and names, but for those so far away that the room would be small
        reach = np.linalg.norm(room.maximum - room.minimum)
        near = np.linalg.norm(eyes - centre, axis=1) <= 1.2 * reach
        rims = self._frusta.corners(near)
        seen = [corners, rims, entrance_edges(room), self._people.points, self._walked]
        pictures = self._frusta.pictures(near)
        return views.overview(np.concatenate(seen), eyes[near], centre, aspect, pictures=pictures)

    def _frame(self, snapshot: Snapshot, run: Run | None, *, another: bool) -> None:
        """Place anew who has not moved, once there is more to be seen than there was.

        That is when the first people are drawn, when the run is finished, and where the recording
        is opened; afterwards the view stands still, whatever is played.
        """
        sequence = snapshot.sequence
        assert sequence is not None
        if another:
            self._sight, self._walked = 0, np.zeros((0, 3))
        sight = 0
        if run is not None:
            opened = snapshot.playhead_origin == opening_step.ORIGIN
            sight = 3 if opened else 2 if run.complete else 1
        if sight > self._sight:
            self._sight = sight
            assert run is not None
            self._walked = room_taken(
                places_of(run.tracks.positions), sequence.target_half_extents, sequence.room
            )
            self._views.again()

    def _set_home(self, snapshot: Snapshot) -> None:
        """Where viser's own "reset view" goes."""
        pose = self._overview(1.0)
        if pose is not None:
            home = self._server.initial_camera
            home.position, home.look_at, home.fov = pose.position, pose.look_at, pose.fov

    def _pose_of(self, snapshot: Snapshot) -> Callable[[float], Pose] | None:
        """The pose of the view that is chosen, for an aspect; None is the free view."""
        assert snapshot.sequence is not None
        room = snapshot.sequence.room
        if snapshot.view is None:
            return None
        if snapshot.view == "top":
            return partial(views.from_above, _margin_around(room))
        view = self._frusta.view(snapshot.view)
        middle = (room.minimum + room.maximum)[None] / 2.0
        distance = max(0.5, float(view.camera.to_camera(middle)[0, 2]))
        return partial(pose_through, view, distance)


def places_of(positions: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "M 3"]:
    """Where people are in a run, to half a metre: few places, however long it is."""
    return np.asarray(np.unique(np.round(2.0 * positions), axis=0) / 2.0)


def _margin_around(room: Room) -> np.ndarray:
    """The corners of a room and a little of the floor around it."""
    beside = np.array([0.25, 0.25, 0.0])
    return geometry.box_corners(room.minimum - beside, room.maximum + beside)


def pinned_tracks(snapshot: Snapshot) -> Trajectories | None:
    """What is drawn of the pinned run; nothing where it is the shown run itself."""
    pinned = snapshot.scores.pinned
    if pinned is None or not snapshot.layers["pinned"]:
        return None
    if snapshot.run is not None and pinned.key == snapshot.run.key:
        return None
    return pinned.tracks


def ghost_tracks(snapshot: Snapshot) -> Trajectories | None:
    """How tracks would be; nothing where the run is another by now."""
    ghosts, run = snapshot.ghosts, snapshot.run
    if ghosts is None or run is None or ghosts.run != run.key:
        return None
    return ghosts.tracks


def shown_run(snapshot: Snapshot) -> Run | None:
    """The run whose step may be drawn: the one that is asked for, once it has the step.

    After a failure it is the last good one, which the page says too.
    """
    run = snapshot.run
    if run is None or not snapshot.step_is_computed or snapshot.sequence is None:
        return None
    if run.sequence.digest != snapshot.sequence.digest:
        return None
    if run.key != snapshot.run_state.key and snapshot.run_state.state != "failed":
        return None
    return run


STATUS_STYLE = "padding: 4px 12px; font-size: 11px; line-height: 15px"


def status_html(snapshot: Snapshot, run: Run | None) -> str:
    """The shown step in words, for the foot of the panel."""
    sequence, step = snapshot.sequence, snapshot.playhead
    if sequence is None:
        return f'<div style="{STATUS_STYLE}" data-state="empty">No sequence is open</div>'
    if run is not None:
        now = run.tracks.at(step)
        count = now.stop - now.start
        state, words = "computed", f"{count} {'person' if count == 1 else 'people'}"
    elif snapshot.run_state.state == "computing":
        state, words = "computing", "computing …"
    else:
        state, words = "missing", "not computed"
    size = " × ".join(f"{side:.1f}" for side in sequence.room.maximum - sequence.room.minimum)
    mass = round(100 * geometry.DEFAULT_MASS)
    return (
        f'<div style="{STATUS_STYLE}" data-step="{step}" data-state="{state}">'
        f"{step} / {sequence.frames - 1} · {step / sequence.fps:.2f} s · {words}<br>"
        f"grid {geometry.grid_cell(sequence.room):g} m · {size} m · ellipsoids {mass}\u00a0%</div>"
    )
