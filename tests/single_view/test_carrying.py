"""Templates of one camera are carried to the others, and tell how far foreground is believed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_allclose

from tests import world
from tests.single_view.conftest import COLOURS
from tests.single_view.test_scenes import stays
from tracker.geometry.boxes import Boxes
from tracker.parameters.groups.foreground import ForegroundParams
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.reader import read_sequence
from tracker.sequences.sequence import Room, Sequence, Template
from tracker.single_view.box_sizes import upright_boxes
from tracker.single_view.colour import carrying
from tracker.single_view.colour.carrying import with_carried
from tracker.single_view.colour.trust import template_trust
from tracker.single_view.pictures.foreground import learn

STEPS, TAUGHT = 6, 3
PATHS = world.together(
    world.walk([(-0.8, 0.1, 1.2), (0.1, 0.4, 1.2)], [0, 1], STEPS),
    world.stand([0.5, -0.2, 1.1], STEPS),
)
CAMERAS = tuple(
    world.look_at(name, place, (0.0, 0.0, 1.1), focal=90.0, image_size=(96, 72))
    for name, place in (("left", (-1.9, -1.8, 1.7)), ("right", (1.9, -1.9, 1.6)))
)


def filmed(folder: Path, paths: ndarray = PATHS) -> Sequence:
    """Somebody who walks and somebody who does not, taught in the first camera."""
    exact = world.upright(CAMERAS[0], PATHS[TAUGHT], world.HEAD)
    templates = [
        Template(name, "left", TAUGHT, Boxes(box).left_top)
        for name, box in zip(("walks", "sits"), exact, strict=True)
    ]
    whole = world.sequence(
        CAMERAS, PATHS, fps=STEPS, room=world.volume(1.2, 1.9), half_extents=world.HEAD,
        templates=templates,
    )  # fmt: skip
    own = world.painted(CAMERAS, PATHS, COLOURS, half_extents=world.HEAD)
    other = world.painted(CAMERAS, paths, COLOURS, half_extents=world.HEAD)
    return read_sequence(
        world.folder(folder / "two", whole, lambda camera, step: (own, other)[camera](camera, step))
    )


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> Sequence:
    return filmed(tmp_path_factory.mktemp("two"))


def carried_by(sequence: Sequence) -> dict[str, Template]:
    with FrameReader(sequence) as reader:
        carried = with_carried(sequence, "hue_saturation", "epanechnikov", reader)
    return {template.name: template for template in carried.templates[len(sequence.templates) :]}


def test_a_template_is_carried_to_where_the_other_camera_has_the_person(
    two: Sequence, request: pytest.FixtureRequest
) -> None:
    carried = carried_by(two)
    stays("carried", [carried[name].box.tolist() for name in ("walks", "sits")], request)
    assert set(carried) == {"walks", "sits"}
    exact = world.upright(CAMERAS[1], PATHS[TAUGHT], world.HEAD)
    for name, box in zip(("walks", "sits"), exact, strict=True):
        found = Boxes.from_left_top(carried[name].box).centred
        assert carried[name].camera == "right"
        assert carried[name].frame == TAUGHT
        assert_allclose((found[:2] - box[:2]) / box[2:], 0.0, atol=0.5)
        assert_allclose(found[2:] / box[2:], 1.0, atol=0.25)


def test_nothing_is_carried_to_whoever_has_a_template_or_is_not_seen(
    two: Sequence, tmp_path: Path
) -> None:
    own = replace(two.templates[0], camera="right")
    assert set(carried_by(replace(two, templates=(*two.templates, own)))) == {"sits"}
    assert carried_by(replace(two, templates=())) == {}
    gone = PATHS.copy()
    gone[:, 1] = np.nan
    assert set(carried_by(filmed(tmp_path, gone))) == {"walks"}


def test_the_foreground_is_believed_by_its_share_in_the_templates(two: Sequence) -> None:
    p = ForegroundParams(threshold=30.0)
    with FrameReader(two) as reader:
        trust = [template_trust(two, camera, reader, p) for camera in range(2)]
        model = learn(two, 0, reader, p)
        picture = reader.picture(0, TAUGHT)
        assert model is not None
        assert picture is not None
        _, found = model.step(model.start(), picture)
    y, x = np.indices(found.mask.shape)
    for template in two.templates:
        left, top, width, height = template.box
        inside = (x >= left) & (x <= left + width) & (y >= top) & (y <= top + height)
        u = np.clip((found.mask[inside].mean() - 0.1) / 0.2, 0.0, 1.0)
        assert trust[0][template.name] == pytest.approx(3.0 * u**2 - 2.0 * u**3)
    assert trust[0]["walks"] == 1.0
    assert trust[0]["sits"] == 0.0
    assert trust[1] == trust[0]  # who has no template there is judged by those elsewhere


@pytest.mark.parametrize("at_once", [7, 4096])
def test_a_place_stands_out_if_hardly_any_other_is_as_alike(
    at_once: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By trying all places but those within the box around it."""
    monkeypatch.setattr(carrying, "_AT_ONCE", at_once)
    rng = np.random.default_rng(3)
    bins = np.kron(rng.integers(0, 6, (12, 16)), np.ones((5, 5))).astype(np.uint16)
    template = np.zeros(512)
    template[:6] = rng.dirichlet(np.ones(6))
    picture = carrying._Picture.of(bins, template, "rgb", "flat")
    place = np.array([30.0, 25.0, 6.0, 9.0])
    others = [
        [x, y, 6.0, 9.0]
        for y in np.arange(4.5, 60.0, 2.25)
        for x in np.arange(3.0, 80.0, 3.0)
        if abs(x - 30.0) > 6.0 or abs(y - 25.0) > 9.0
    ]
    distances = np.sort(picture.distances(np.array(others)))
    most = int(0.15 * len(others))
    assert distances[most] < distances[most + 1]
    assert carrying._stands_out(picture, place, distances[most])
    assert not carrying._stands_out(picture, place, np.nextafter(distances[most], 1.0))
    # where the box is all that there is nothing else is alike
    alone = carrying._Picture.of(bins[:8, :8], template, "rgb", "flat")
    assert carrying._stands_out(alone, np.array([4.0, 4.0, 9.0, 9.0]), 0.9)


@pytest.mark.parametrize(
    ("floor", "larger"), [(0.0, 1.0), (0.6, 1.0), (0.9, 1.0), (0.0, 2.8), (0.0, 0.65)]
)  # and those who would stand before the room or beyond it, too
def test_who_a_template_is_may_stand_along_its_ray_in_the_room_as_high_as_it_is(
    two: Sequence, floor: float, larger: float
) -> None:
    """And where people stand, on the floor."""
    top = 1.9 if floor == 0.0 else 1.3
    room = Room(np.array([-1.2, -1.2, floor]), np.array([1.2, 1.2, top]))
    whole, camera, half = replace(two, room=room), CAMERAS[0], two.target_half_extents
    (box,) = world.upright(camera, np.array([[0.1, 0.3, 1.1]]), half)
    box[3] *= larger
    positions, scores = carrying._along_ray(camera, whole, box)
    ray = camera.back_project(box[None, :2])[0]
    away = (positions - camera.centre) @ ray
    assert_allclose(positions, camera.centre + away[:, None] * ray, atol=1e-9)
    low, high = room.minimum - half, room.maximum + half
    stands = 4.0 * half[2] > top - floor
    assert stands == (floor == 0.9)
    steps = []
    corners = [[x, y, z] for x in (-1.2, 1.2) for y in (-1.2, 1.2) for z in (floor, top)]
    reach = max(np.linalg.norm(corner - camera.centre) for corner in corners)
    for distance in 0.05 * reach * 20.0 ** (np.arange(400) / 399.0):
        place = camera.centre + distance * ray
        drawn, seen = upright_boxes(camera, place[None], half)
        if not ((place >= low) & (place <= high)).all() or not seen[0]:
            continue
        ratio = np.log(drawn[0, 3] / box[3])
        if abs(ratio) > 0.36:
            continue
        score = -0.5 * (ratio / 0.12) ** 2
        if stands:
            score -= 0.5 * ((place[2] - half[2] - room.minimum[2]) / 0.2) ** 2
        steps.append((distance, score))
    assert len(steps) > 5
    assert_allclose(np.column_stack([away, scores]), steps, atol=1e-8)
