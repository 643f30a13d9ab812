"""The 3D view: its nodes are a fixed set, and nothing stale is shown."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import viser
import viser.transforms as tf

from app.colours import PALETTES
from app.scene import scene
from app.scene.geometry import mass_radius
from app.scene.nodes import DISC, crowded, linear
from app.scene.scene import Scene
from app.scene.worker import LatestWorker
from app.state.snapshot import Ghosts
from app.state.workbench import Workbench
from tests.app.scene import scene_case
from tracker.runs.pipeline import Progress, Run
from tracker.sequences.sequence import Sequence

SECONDS = 20.0


@dataclass
class View:
    """The 3D view of a workbench, and what it has in viser."""

    server: viser.ViserServer
    workbench: Workbench
    scene: Scene

    @property
    def nodes(self) -> dict[str, Any]:
        """All nodes by their names, once everything is drawn."""
        assert self.scene.wait(SECONDS)
        return dict(self.server.scene._handle_from_node_name)

    def visible(self, prefix: str) -> set[str]:
        return {n for n, h in self.nodes.items() if n.startswith(prefix + "/") and h.visible}

    def progress(self, run: Run, done: int) -> None:
        """Have the workbench hear of a run."""
        self.workbench.run_begins(run.key)
        frames = run.sequence.frames
        self.workbench.run_progresses(run, Progress("tracks", done, frames, 1.0, done))


@pytest.fixture
def of() -> Sequence:
    return scene_case.sequence()


@pytest.fixture
def run(of: Sequence) -> Run:
    return scene_case.run(of)


@pytest.fixture
def looking(server: viser.ViserServer) -> Iterator[Callable[[Workbench], View]]:
    """Makes the view of a workbench, and ends it after the test."""
    made: list[Scene] = []

    def look(workbench: Workbench) -> View:
        made.append(Scene(server, workbench))
        return View(server, workbench, made[0])

    yield look
    for one in made:
        one.close()


@pytest.fixture
def view(of: Sequence, run: Run, looking: Callable[[Workbench], View]) -> View:
    """The view of two walkers and a finished run, at step 30, where every layer is on."""
    workbench = scene_case.opened(of, run)
    workbench.seek(30)
    return looking(workbench)


def another(of: Sequence) -> Run:
    """A run that found somebody more."""
    run = scene_case.run(of, walkers=3)
    run.keys = {**run.keys, "tracks": "another"}
    return run


# the worker


def test_the_worker_does_what_came_meanwhile_once() -> None:
    entered, go = threading.Event(), threading.Event()
    done: list[set[str]] = []

    def work(topics: Any) -> None:
        done.append(set(topics))
        entered.set()
        go.wait(SECONDS)

    worker = LatestWorker("test", work)
    worker.ask("a")
    assert entered.wait(SECONDS)
    for _ in range(50):
        worker.ask("b")
        worker.ask("c")
    assert not worker.wait(0.01)
    go.set()
    assert worker.wait(SECONDS)
    assert done == [{"a"}, {"b", "c"}]
    worker.close()
    worker.ask("d")
    assert worker.wait(0.0)


def test_a_failure_is_told_and_the_worker_goes_on(caplog: pytest.LogCaptureFixture) -> None:
    done: list[str] = []

    def work(topics: Any) -> None:
        done.extend(topics)
        if "bad" in topics:
            raise RuntimeError("no")

    worker = LatestWorker("test", work)
    worker.ask("bad")
    with pytest.raises(RuntimeError, match="no"):
        worker.wait(SECONDS)
    assert "bad failed" in caplog.text
    worker.ask("good")
    assert worker.wait(SECONDS)
    assert done == ["bad", "good"]
    worker.close()


# the scene


def test_the_nodes_are_a_fixed_set(view: View) -> None:
    before = {name: id(handle) for name, handle in view.nodes.items()}
    for step in range(1, 50):
        view.workbench.seek(step)
        view.workbench.select(step % 3 or None)
        assert view.scene.wait(SECONDS)
    view.workbench.look(1)
    view.workbench.set_theme("light")
    view.workbench.set_layers({"trails": False})
    second = scene_case.sequence(2, name="other")
    scene_case.show(view.workbench, second, scene_case.run(second))
    assert {name: id(handle) for name, handle in view.nodes.items()} == before
    assert view.visible("/cameras") == {"/cameras/00", "/cameras/01"}


def test_a_camera_chosen_before_the_first_drawing_is_looked_through(
    of: Sequence, run: Run, looking: Callable[[Workbench], View]
) -> None:
    workbench = scene_case.opened(of, run)
    workbench.look(1)  # as a page does that was there before the server started again
    view = looking(workbench)
    assert view.scene.wait(SECONDS)
    pose = view.scene._views._goal(1.5)  # where a browser is placed that comes now
    assert pose is not None
    np.testing.assert_allclose(pose.position, of.cameras[1].centre, atol=1e-6)


def test_pools_grow_to_the_need_and_stay(looking: Callable[[Workbench], View]) -> None:
    few, many = scene_case.sequence(2), scene_case.sequence(6, frames=3, name="many")
    view = looking(scene_case.opened(few))
    assert view.scene.wait(SECONDS)
    scene_case.show(view.workbench, many, scene_case.run(many, walkers=24))
    grown = view.nodes
    assert len(view.visible("/cameras")) == 6
    assert len(view.visible("/labels/people")) == 24
    # in a crowd labels are smaller
    assert [crowded(count) for count in (0, 1, 14)] == [1.0, 1.0, 1.0]
    assert 0.6 == crowded(400) < crowded(24) < 0.9
    assert grown["/labels/people/00"].font_screen_scale == pytest.approx(crowded(24))
    assert grown["/labels/people_discs"].thickness == pytest.approx(DISC * crowded(24))
    scene_case.show(view.workbench, few)
    assert set(view.nodes) == set(grown)
    assert len(view.visible("/cameras")) == 2
    assert not view.visible("/labels/people")


def test_a_step_is_drawn_as_the_run_has_it(view: View, of: Sequence, run: Run) -> None:
    drawn = view.nodes
    assert drawn["/people/boxes"].points.shape == (24, 2, 3)
    assert not drawn["/people/selected_box"].visible
    assert drawn["/people/truth"].visible
    posterior = run.fused[30].posterior
    ball = drawn["/people/ellipsoids"]
    middle = (of.room.minimum + of.room.maximum) / 2.0
    np.testing.assert_allclose(ball.batched_positions + middle, posterior.means, atol=1e-6)
    assert (np.diff(ball.batched_opacities[1:3]) < 0.0).all()
    # the drawn surface is the one of the whole covariance
    turn = tf.SO3(np.asarray(ball.batched_wxyzs[0], dtype=float)).as_matrix()
    rebuilt = turn @ np.diag((ball.batched_scales[0] / mass_radius(0.9)) ** 2) @ turn.T
    np.testing.assert_allclose(rebuilt, posterior.covariances[0], rtol=1e-4, atol=1e-6)
    assert {drawn[n].text for n in view.visible("/labels/people")} == {"1", "2"}
    status = view.scene._status.content
    assert 'data-step="30" data-state="computed"' in status
    assert "2 people" in status
    # lines from truth to estimate
    now, truth = run.tracks.at(30), of.ground_truth
    assert truth is not None
    lines = drawn["/people/errors"].points
    np.testing.assert_allclose(lines[:, 0], truth.positions[truth.at(30)], rtol=1e-6)
    np.testing.assert_allclose(lines[:, 1], run.tracks.positions[now], rtol=1e-6)
    # a person stands on the floor, in the colour of the label
    body = drawn["/people/figures"]
    low = body.batched_positions[:, 2] + body.position[2]
    np.testing.assert_allclose(low, scene_case.ROOM.minimum[2], atol=1e-6)
    top = run.tracks.positions[now][:, 2] + scene_case.HALF[2]
    np.testing.assert_allclose(body.batched_scales[:, 2], top, rtol=1e-6)
    colours = linear(PALETTES["dark"].of(run.tracks.ids[now]))
    np.testing.assert_array_equal(drawn["/labels/people_discs"].colors[:, 0], colours)
    assert "/labels/entrances_discs" not in view.visible("/labels")
    height = drawn["/labels/height/00"]
    assert height.text == "2 m"
    np.testing.assert_allclose(height.position, (1.5, -1.5, 2.0))


def test_layers_and_the_selection_decide_what_is_drawn(view: View) -> None:
    workbench, drawn = view.workbench, view.nodes
    workbench.set_layers({"others": False})
    assert view.nodes["/people/boxes"].points.shape == (24, 2, 3)  # nobody is selected
    workbench.select(2)
    assert not view.nodes["/people/boxes"].visible
    assert drawn["/people/selected_box"].points.shape == (12, 2, 3)
    assert len(drawn["/people/ellipsoids"].batched_positions) == 1
    assert len(view.visible("/labels/people")) == 1
    workbench.set_layers({"others": True})
    assert view.nodes["/people/boxes"].points.shape == (12, 2, 3)
    assert drawn["/people/rays"].visible
    for layers, gone in (
        ({"truth": False}, {"errors", "truth"}),
        ({"bodies": False}, {"figures", "feet"}),
    ):
        workbench.set_layers(layers)
        assert not {f"/people/{name}" for name in gone} & view.visible("/people")
    workbench.set_layers(dict.fromkeys(workbench.layers, False))
    assert not view.visible("/people")
    assert not drawn["/room/volume"].visible


def test_a_click_selects_and_the_next_one_clears(view: View) -> None:
    assert view.scene.wait(SECONDS)
    people, workbench = view.scene._people, view.workbench
    people._pick_box(1)
    assert workbench.snapshot().selection == 2
    people._pick_component(1)
    assert workbench.snapshot().selection is None
    people._pick_component(3)  # belongs to no track
    people._pick_box(99)  # was drawn before the click arrived
    assert workbench.snapshot().selection is None


def test_what_takes_the_clicks_on_a_person_hides_nothing(view: View) -> None:
    for bodies in (True, False):
        view.workbench.set_layers({"bodies": bodies})
        target = view.nodes["/people/bodies"]
        assert target.visible
        assert len(target.batched_positions) == 2
        # a plain mesh of viser's writes depth at any opacity; three.js has the blending
        # materials of a glTF not do so
        assert isinstance(target, viser.BatchedGlbHandle)
        length = int.from_bytes(target.glb_data[12:16], "little")
        (material,) = json.loads(target.glb_data[20 : 20 + length])["materials"]
        assert material["alphaMode"] == "BLEND"
        assert material["pbrMetallicRoughness"]["baseColorFactor"][3] == 0.0
        assert view.nodes["/people/ellipsoids"].visible
    # bodies write no depth either, as long as their backs alone are drawn
    assert view.nodes["/people/figures"].side == "back"


def test_the_client_makes_bodies_once_and_draws_their_ellipsoids_after_them(view: View) -> None:
    faint = set()
    once = ("figures", "selected_figure", "feet", "selected_feet")
    for step, selected in ((10, None), (30, None), (31, 2), (32, 2)):
        view.workbench.seek(step)
        view.workbench.select(selected)
        drawn = view.nodes
        # other opacities make the client's copies new, and what is newer is drawn later
        for name in (*(f"/people/{name}" for name in once), "/room/entrances", "/room/ground"):
            assert drawn[name].batched_opacities is None
        assert drawn["/people/selected_figure"].visible == (selected is not None)
        shades = drawn["/people/ellipsoids"].batched_opacities
        np.testing.assert_allclose(shades * 20.0, np.rint(shades * 20.0), atol=1e-5)
        faint.add(shades.min())
    assert min(faint) > 0.0
    # of nodes at one place the older is drawn first
    np.testing.assert_array_equal(
        drawn["/people/figures"].position, drawn["/people/ellipsoids"].position
    )


def test_how_it_would_be_is_drawn_until_the_run_is_another(
    view: View, of: Sequence, run: Run
) -> None:
    near = run.tracks.take((run.tracks.frames > 20) & (run.tracks.frames < 40))
    view.workbench.show_ghosts(Ghosts(run.key, near))
    ways = view.nodes["/people/ghost_ways"]
    assert ways.visible
    # a piece of way between each two steps of a track, and none from one track to another
    assert len(ways.points) == len(near) - len(np.unique(near.ids))
    assert len(view.nodes["/people/ghost_boxes"].points) == 12 * len(np.unique(near.ids))
    view.progress(another(of), of.frames)
    assert not view.nodes["/people/ghost_ways"].visible


def test_the_pinned_run_is_drawn_beside_another(view: View, of: Sequence) -> None:
    pinned = {"/people/pinned", "/people/pinned_trails"}
    assert view.workbench.pin()
    assert not view.nodes["/people/pinned"].visible  # it is the shown one
    view.progress(another(of), of.frames)
    assert pinned <= view.visible("/people")
    view.workbench.set_layers({"pinned": False})
    assert not pinned & view.visible("/people")


def test_the_theme_reaches_every_line(view: View) -> None:
    names = ("/room/volume", "/people/boxes")
    dark = {name: np.array(view.nodes[name].colors) for name in names}
    view.workbench.set_theme("light")
    for name, before in dark.items():
        assert (view.nodes[name].colors != before).any(), name


def test_nothing_of_another_run_is_shown(view: View) -> None:
    assert view.visible("/people") > {"/people/truth", "/people/errors", "/people/future"}
    view.workbench.run_begins("another")
    assert view.visible("/people") == {"/people/truth"}
    assert not view.visible("/labels/people")
    assert 'data-state="computing"' in view.scene._status.content


def test_a_step_appears_as_soon_as_it_is_computed(
    of: Sequence, run: Run, looking: Callable[[Workbench], View]
) -> None:
    view = looking(scene_case.opened(of))
    view.workbench.seek(40)
    partial = scene_case.run(of, done=20)
    view.progress(partial, 20)
    assert view.visible("/people") == {"/people/truth"}
    partial.fused, partial.tracks, partial.done = run.fused, run.tracks, run.done
    view.workbench.run_progresses(partial, Progress("fusion", 60, 60, 1.0, 60))
    assert view.nodes["/people/boxes"].visible


def test_an_empty_workbench_shows_nothing(looking: Callable[[Workbench], View]) -> None:
    view = looking(scene_case.Workbench())
    for prefix in ("/people", "/room", "/cameras"):
        assert not view.visible(prefix)
    assert "No sequence" in view.scene._status.content
    view.scene.close()
    snapshot = scene_case.opened(scene_case.sequence()).snapshot()
    assert 'data-state="missing"' in scene.status_html(snapshot, None)
