"""The 3D view: its nodes are a fixed set, and nothing stale is shown."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
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
from app.web.access.viewer import start_viser
from tests.app.scene import scene_case
from tracker.runs.pipeline import Progress

SECONDS = 20.0


@pytest.fixture(scope="module")
def shared_server() -> Iterator[viser.ViserServer]:
    server = start_viser()
    yield server
    server.stop()


@pytest.fixture
def server(shared_server: viser.ViserServer) -> viser.ViserServer:
    shared_server.scene.reset()
    shared_server.gui.reset()
    return shared_server


def nodes(server: viser.ViserServer) -> dict[str, Any]:
    return dict(server.scene._handle_from_node_name)


def visible(server: viser.ViserServer, prefix: str) -> set[str]:
    return {n for n, h in nodes(server).items() if n.startswith(prefix + "/") and h.visible}


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

    told: list[Exception] = []
    worker = LatestWorker("test", work, told.append)
    worker.ask("bad")
    with pytest.raises(RuntimeError, match="no"):
        worker.wait(SECONDS)
    assert len(told) == 1
    assert "bad failed" in caplog.text
    worker.ask("good")
    assert worker.wait(SECONDS)
    assert done == ["bad", "good"]
    worker.close()


# the scene


def test_the_nodes_are_a_fixed_set(server: viser.ViserServer) -> None:
    first, second = scene_case.sequence(3), scene_case.sequence(2, name="other")
    workbench = scene_case.opened(first, scene_case.run(first))
    view = Scene(server, workbench)
    assert view.wait(SECONDS)
    before = set(nodes(server))
    handles = {name: id(handle) for name, handle in nodes(server).items()}
    for step in range(1, 50):
        workbench.seek(step)
        workbench.select(step % 3 or None)
        assert view.wait(SECONDS)
    workbench.look(1)
    workbench.set_theme("light")
    workbench.set_layers({"trails": False})
    assert view.wait(SECONDS)
    scene_case.show(workbench, second, scene_case.run(second))
    assert view.wait(SECONDS)
    assert set(nodes(server)) == before
    assert {name: id(handle) for name, handle in nodes(server).items()} == handles
    assert visible(server, "/cameras") == {"/cameras/00", "/cameras/01"}
    view.close()


def test_pools_grow_to_the_need_and_stay(server: viser.ViserServer) -> None:
    few, many = scene_case.sequence(2), scene_case.sequence(6, frames=3, name="many")
    workbench = scene_case.opened(few)
    view = Scene(server, workbench)
    assert view.wait(SECONDS)
    crowd = scene_case.run(many, walkers=24)
    scene_case.show(workbench, many, crowd)
    assert view.wait(SECONDS)
    grown = set(nodes(server))
    assert len(visible(server, "/cameras")) == 6
    assert len(visible(server, "/labels/people")) == 24
    label, discs = nodes(server)["/labels/people/00"], nodes(server)["/labels/people_discs"]
    assert label.font_screen_scale == pytest.approx(crowded(24))
    assert discs.thickness == pytest.approx(DISC * crowded(24))
    scene_case.show(workbench, few)
    assert view.wait(SECONDS)
    assert set(nodes(server)) == grown
    assert len(visible(server, "/cameras")) == 2
    assert not visible(server, "/labels/people")
    view.close()


def test_labels_are_smaller_in_a_crowd() -> None:
    assert [crowded(count) for count in (0, 1, 14)] == [1.0, 1.0, 1.0]
    assert 0.7 <= crowded(24) < 0.9
    assert crowded(400) == 0.6


def test_a_step_is_drawn_as_the_run_has_it(server: viser.ViserServer) -> None:
    of = scene_case.sequence()
    shown = scene_case.run(of)
    workbench = scene_case.opened(of, shown)
    view = Scene(server, workbench)
    workbench.seek(30)
    assert view.wait(SECONDS)
    drawn = nodes(server)
    assert drawn["/people/boxes"].points.shape == (24, 2, 3)
    assert not drawn["/people/selected_box"].visible
    assert drawn["/people/truth"].visible
    posterior = shown.fused[30].posterior
    ball = drawn["/people/ellipsoids"]
    middle = (of.room.minimum + of.room.maximum) / 2.0
    np.testing.assert_allclose(ball.batched_positions + middle, posterior.means, atol=1e-6)
    assert (np.diff(ball.batched_opacities[1:3]) < 0.0).all()
    # the drawn surface is the one of the whole covariance
    turn = tf.SO3(np.asarray(ball.batched_wxyzs[0], dtype=float)).as_matrix()
    rebuilt = turn @ np.diag((ball.batched_scales[0] / mass_radius(0.9)) ** 2) @ turn.T
    np.testing.assert_allclose(rebuilt, posterior.covariances[0], rtol=1e-4, atol=1e-6)
    assert {drawn[n].text for n in visible(server, "/labels/people")} == {"1", "2"}
    assert 'data-step="30" data-state="computed"' in view._status.content
    assert "2 people" in view._status.content

    workbench.select(2)
    assert view.wait(SECONDS)
    assert drawn["/people/selected_box"].points.shape == (12, 2, 3)
    assert drawn["/people/boxes"].points.shape == (12, 2, 3)
    assert drawn["/people/rays"].visible
    workbench.set_layers(dict.fromkeys(workbench.layers, False))
    assert view.wait(SECONDS)
    assert not visible(server, "/people")
    assert not drawn["/room/volume"].visible
    view.close()


def test_a_click_selects_and_the_next_one_clears(server: viser.ViserServer) -> None:
    of = scene_case.sequence()
    workbench = scene_case.opened(of, scene_case.run(of))
    view = Scene(server, workbench)
    assert view.wait(SECONDS)
    people = view._people
    people._pick_box(1)
    assert workbench.snapshot().selection == 2
    people._pick_component(1)
    assert workbench.snapshot().selection is None
    people._pick_component(3)  # belongs to no track
    people._pick_box(99)  # was drawn before the click arrived
    assert workbench.snapshot().selection is None
    view.close()


def test_what_takes_the_clicks_on_a_person_hides_nothing(server: viser.ViserServer) -> None:
    of = scene_case.sequence()
    workbench = scene_case.opened(of, scene_case.run(of))
    view = Scene(server, workbench)
    workbench.seek(30)
    for bodies in (True, False):
        workbench.set_layers({"bodies": bodies})
        assert view.wait(SECONDS)
        target = nodes(server)["/people/bodies"]
        assert target.visible
        assert len(target.batched_positions) == 2
        # a plain mesh of viser's writes depth at any opacity; three.js has the blending
        # materials of a glTF not do so
        assert isinstance(target, viser.BatchedGlbHandle)
        length = int.from_bytes(target.glb_data[12:16], "little")
        (material,) = json.loads(target.glb_data[20 : 20 + length])["materials"]
        assert material["alphaMode"] == "BLEND"
        assert material["pbrMetallicRoughness"]["baseColorFactor"][3] == 0.0
        assert nodes(server)["/people/ellipsoids"].visible
    # bodies write no depth either, as long as their backs alone are drawn
    assert nodes(server)["/people/figures"].side == "back"
    view.close()


def test_the_client_makes_bodies_once_and_draws_their_ellipsoids_after_them(
    server: viser.ViserServer,
) -> None:
    of = scene_case.sequence()
    workbench = scene_case.opened(of, scene_case.run(of))
    view = Scene(server, workbench)
    drawn = nodes(server)
    faint = set()
    once = ("figures", "selected_figure", "feet", "selected_feet")
    for step, selected in ((10, None), (30, None), (31, 2), (32, 2)):
        workbench.seek(step)
        workbench.select(selected)
        assert view.wait(SECONDS)
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
    view.close()


def test_the_selected_track_alone(server: viser.ViserServer) -> None:
    of = scene_case.sequence()
    workbench = scene_case.opened(of, scene_case.run(of))
    view = Scene(server, workbench)
    workbench.seek(30)
    workbench.set_layers({"others": False})
    assert view.wait(SECONDS)
    assert nodes(server)["/people/boxes"].points.shape == (24, 2, 3)  # nobody is selected
    workbench.select(2)
    assert view.wait(SECONDS)
    assert not nodes(server)["/people/boxes"].visible
    assert nodes(server)["/people/selected_box"].points.shape == (12, 2, 3)
    assert len(nodes(server)["/people/ellipsoids"].batched_positions) == 1
    assert len(visible(server, "/labels/people")) == 1
    view.close()


def test_lines_from_truth_to_estimate_say_how_far(server: viser.ViserServer) -> None:
    of = scene_case.sequence()
    shown = scene_case.run(of)
    workbench = scene_case.opened(of, shown)
    view = Scene(server, workbench)
    workbench.seek(10)
    assert view.wait(SECONDS)
    lines = nodes(server)["/people/errors"].points
    assert lines.shape == (2, 2, 3)
    np.testing.assert_allclose(
        lines[:, 0], of.ground_truth.positions[of.ground_truth.at(10)], rtol=1e-6
    )
    np.testing.assert_allclose(lines[:, 1], shown.tracks.positions[shown.tracks.at(10)], rtol=1e-6)
    workbench.set_layers({"truth": False})
    assert view.wait(SECONDS)
    assert not nodes(server)["/people/errors"].visible
    view.close()


def test_a_person_stands_on_the_floor_in_the_colour_of_the_label(
    server: viser.ViserServer,
) -> None:
    of = scene_case.sequence()
    shown = scene_case.run(of)
    workbench = scene_case.opened(of, shown)
    view = Scene(server, workbench)
    workbench.seek(30)
    assert view.wait(SECONDS)
    now = shown.tracks.at(30)
    body = nodes(server)["/people/figures"]
    top = shown.tracks.positions[now][:, 2] + scene_case.HALF[2]
    low = body.batched_positions[:, 2] + body.position[2]
    np.testing.assert_allclose(low, scene_case.ROOM.minimum[2], atol=1e-6)
    np.testing.assert_allclose(body.batched_scales[:, 2], top, rtol=1e-6)
    discs = nodes(server)["/labels/people_discs"]
    expected = linear(PALETTES["dark"].of(shown.tracks.ids[now]))
    np.testing.assert_array_equal(discs.colors[:, 0], expected)
    assert "/labels/entrances_discs" not in visible(server, "/labels")
    workbench.set_layers({"bodies": False})
    assert view.wait(SECONDS)
    assert not nodes(server)["/people/figures"].visible
    assert not nodes(server)["/people/feet"].visible
    view.close()


def test_how_it_would_be_is_drawn_until_the_run_is_another(server: viser.ViserServer) -> None:
    of = scene_case.sequence()
    run = scene_case.run(of)
    workbench = scene_case.opened(of, run)
    view = Scene(server, workbench)
    workbench.seek(30)
    near = run.tracks.take((run.tracks.frames > 20) & (run.tracks.frames < 40))
    workbench.show_ghosts(Ghosts(run.key, near))
    assert view.wait(SECONDS)
    ways = nodes(server)["/people/ghost_ways"]
    assert ways.visible
    # a piece of way between each two steps of a track, and none from one track to another
    assert len(ways.points) == len(near) - len(np.unique(near.ids))
    assert len(nodes(server)["/people/ghost_boxes"].points) == 12 * len(np.unique(near.ids))
    other = scene_case.run(of, walkers=3)
    other.keys = {**other.keys, "tracks": "another"}
    workbench.run_begins(other.key)
    workbench.run_progresses(other, Progress("tracks", of.frames, of.frames, 1.0, of.frames))
    assert view.wait(SECONDS)
    assert not ways.visible
    view.close()


def test_the_pinned_run_is_drawn_beside_another(server: viser.ViserServer) -> None:
    of = scene_case.sequence()
    workbench = scene_case.opened(of, scene_case.run(of))
    view = Scene(server, workbench)
    workbench.seek(30)
    assert workbench.pin()
    assert view.wait(SECONDS)
    assert not nodes(server)["/people/pinned"].visible  # it is the shown one
    other = scene_case.run(of, walkers=3)
    other.keys = {**other.keys, "tracks": "another"}
    workbench.run_begins(other.key)
    workbench.run_progresses(other, Progress("tracks", of.frames, of.frames, 1.0, of.frames))
    assert view.wait(SECONDS)
    assert nodes(server)["/people/pinned"].visible
    assert nodes(server)["/people/pinned_trails"].visible
    workbench.set_layers({"pinned": False})
    assert view.wait(SECONDS)
    assert not nodes(server)["/people/pinned"].visible
    view.close()


def test_the_theme_reaches_every_line(server: viser.ViserServer) -> None:
    of = scene_case.sequence()
    workbench = scene_case.opened(of, scene_case.run(of))
    view = Scene(server, workbench)
    assert view.wait(SECONDS)
    dark = {
        name: np.array(nodes(server)[name].colors) for name in ("/room/volume", "/people/boxes")
    }
    workbench.set_theme("light")
    assert view.wait(SECONDS)
    for name, before in dark.items():
        assert (nodes(server)[name].colors != before).any(), name
    view.close()


def test_nothing_of_another_run_is_shown(server: viser.ViserServer) -> None:
    of = scene_case.sequence()
    workbench = scene_case.opened(of, scene_case.run(of))
    view = Scene(server, workbench)
    workbench.seek(40)
    assert view.wait(SECONDS)
    assert visible(server, "/people") > {"/people/truth", "/people/errors", "/people/future"}
    workbench.run_begins("another")
    assert view.wait(SECONDS)
    assert visible(server, "/people") == {"/people/truth"}
    assert not visible(server, "/labels/people")
    assert 'data-state="computing"' in view._status.content
    view.close()


def test_a_step_appears_as_soon_as_it_is_computed(server: viser.ViserServer) -> None:
    of = scene_case.sequence()
    workbench = scene_case.opened(of)
    view = Scene(server, workbench)
    workbench.seek(40)
    partial = scene_case.run(of, done=20)
    workbench.run_begins(partial.key)
    workbench.run_progresses(partial, Progress("fusion", 20, of.frames, 1.0, 20))
    assert view.wait(SECONDS)
    assert visible(server, "/people") == {"/people/truth"}
    whole = scene_case.run(of)
    partial.fused, partial.tracks, partial.done = whole.fused, whole.tracks, whole.done
    workbench.run_progresses(partial, Progress("fusion", of.frames, of.frames, 1.0, of.frames))
    assert view.wait(SECONDS)
    assert nodes(server)["/people/boxes"].visible
    view.close()


def test_an_empty_workbench_shows_nothing(server: viser.ViserServer) -> None:
    view = Scene(server, scene_case.Workbench())
    assert view.wait(SECONDS)
    assert not visible(server, "/people") | visible(server, "/room") | visible(server, "/cameras")
    assert "No sequence" in view._status.content
    view.close()
    view.close()


def test_words_of_the_status() -> None:
    of = scene_case.sequence()
    workbench = scene_case.opened(of)
    assert 'data-state="missing"' in scene.status_html(workbench.snapshot(), None)
