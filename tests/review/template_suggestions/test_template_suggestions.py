"""What a run's tracks offer: whole people, apart, whom two cameras agree about, and by whom."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, cast

import cv2
import numpy as np
import pytest
from numpy import ndarray

from tests.engine.painted import GREEN, RED, Colour, corner_box, paint, wall
from tests.engine.synthetic import CAMERAS, HALF_EXTENTS, ROOM, walk
from tracker.fusion.trajectories import Trajectories
from tracker.geometry.boxes import box_overlaps
from tracker.parameters.catalogue import RunParameters
from tracker.review.template_suggestions import (
    Moments,
    Suggestion,
    _apart,
    _best,
    _considered,
    _long_lived,
    _names,
    _on_templates,
    _whole,
    drawn_boxes,
    suggest_templates,
    without_templates,
)
from tracker.runs.run import Run
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence, Template, View
from tracker.single_view.box_sizes import upright_boxes

STEPS = 60

PINK: tuple[Colour, Colour] = ((190.0, 60.0, 200.0), (230.0, 120.0, 250.0))

LOOKS = {"anna": RED, "bert": GREEN}

PATHS = {
    "anna": walk((-0.9, 0.6, 1.2), (0.5, 0.7, 1.2), STEPS),
    "bert": walk((0.9, -0.6, 1.2), (-0.5, -0.7, 1.2), STEPS),
}
"""Two who pass each other and are apart in every camera at the beginning and at the end."""


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Sequence:
    """Pictures of both by three cameras, without templates."""
    folder = tmp_path_factory.mktemp("room")
    views = []
    for camera in CAMERAS:
        files = []
        for step in range(STEPS):
            boxes = boxes_at(camera.name, step)
            files.append(folder / f"{camera.name}-{step:04d}.png")
            picture = paint(wall(camera), boxes, list(LOOKS.values()), step)
            cv2.imwrite(str(files[-1]), picture)
        views.append(View(camera, images=tuple(files)))
    return Sequence(
        name="two", folder=folder, fps=25.0, frames=STEPS, room=ROOM,
        target_half_extents=HALF_EXTENTS, views=tuple(views), templates=(), ground_truth=None,
        digest="two",
    )  # fmt: skip


def boxes_at(camera: str, step: int) -> ndarray:
    """Where Anna and Bert are in a camera's picture."""
    (own,) = (one for one in CAMERAS if one.name == camera)
    positions = np.array([path[step] for path in PATHS.values()])
    return upright_boxes(own, positions, HALF_EXTENTS)[0]


def template_of(name: str, camera: str, step: int) -> Template:
    """As somebody draws it."""
    box = boxes_at(camera, step)[list(PATHS).index(name)]
    return Template(name, camera, step, corner_box(box))


def tracked(
    sequence: Sequence,
    *,
    seen: Callable[[int, int], Many] = lambda person, step: (True, True, True),
    existence: float = 1.0,
    sigma: float = 0.02,
) -> Run:
    """A run that found everybody where they are, as track 1 and track 2.

    Args:
        sequence: The room.
        seen: Which cameras' boxes are a person's (0 or 1) at a step.
        existence: Of all of them.
        sigma: Standard deviation of each coordinate, metres.
    """
    run = Run(sequence, RunParameters(), 0, {})
    run.done = STEPS
    frames, ids = np.repeat(np.arange(STEPS), 2), np.tile([1, 2], STEPS)
    run.tracks = Trajectories(
        frames,
        ids,
        np.stack(list(PATHS.values()), axis=1).reshape(-1, 3),
        np.full(2 * STEPS, existence),
        np.full((2 * STEPS, 3), sigma),
        np.array([seen(k % 2, k // 2) for k in range(2 * STEPS)], dtype=bool),
        np.full(2 * STEPS, -1),
        ids,
        np.zeros(2 * STEPS),
        np.full(2 * STEPS, np.nan),
        np.full(2 * STEPS, np.nan),
    )
    return run


Many = tuple[bool, bool, bool]


@pytest.fixture
def offers_of() -> Iterator[Callable[[Run], list[Suggestion]]]:
    """What a run offers, its pictures read and closed again."""
    readers: list[FrameReader] = []

    def found(run: Run) -> list[Suggestion]:
        readers.append(FrameReader(run.sequence))
        return list(suggest_templates(run, readers[-1]))

    yield found
    for reader in readers:
        reader.close()


Found = Callable[[Run], list[Suggestion]]


def test_who_has_a_template_in_one_camera_is_offered_one_in_the_others(
    room: Sequence, offers_of: Found
) -> None:
    templates = (template_of("anna", "left", 5), template_of("bert", "left", 5))
    found = offers_of(tracked(replace(room, templates=templates)))
    places = {(one.template.name, one.template.camera) for one in found}
    assert places == {(name, camera) for name in LOOKS for camera in ("right", "back")}
    for one in found:
        person = list(PATHS).index(one.template.name)
        true = corner_box(boxes_at(one.template.camera, one.template.frame)[person])
        assert box_overlaps(one.template.box[None], true[None])[0, 0] > 0.9
        assert one.track == person + 1
        assert one.cameras == ("left", "right", "back")
        assert one.difference is not None
        assert "the first of this camera" in one.reason
        # nobody else is in the box
        other = corner_box(boxes_at(one.template.camera, one.template.frame)[1 - person])
        assert box_overlaps(one.template.box[None], other[None])[0, 0] < 0.05


def test_a_camera_that_shows_a_person_as_its_template_does_is_offered_nothing(
    room: Sequence, offers_of: Found
) -> None:
    templates = tuple(template_of(name, camera.name, 5) for name in LOOKS for camera in CAMERAS)
    assert offers_of(tracked(replace(room, templates=templates))) == []


def test_who_has_none_is_offered_as_somebody_new(room: Sequence, offers_of: Found) -> None:
    alone = offers_of(tracked(replace(room, templates=(template_of("anna", "left", 5),))))
    new = [one for one in alone if one.track == 2]
    assert {one.template.name for one in new} == {"person1"}
    assert {one.template.camera for one in new} == {"left", "right", "back"}
    assert all(one.difference is None and "nobody's template yet" in one.reason for one in new)
    assert {one.template.name for one in alone if one.track == 1} == {"anna"}
    nobody = offers_of(tracked(room))
    assert {(one.track, one.template.name) for one in nobody} == {(1, "person1"), (2, "person2")}


def test_where_a_track_is_somebody_it_is_his_template_and_not_his_looks_that_count(
    room: Sequence, offers_of: Found
) -> None:
    """A template that shows the person in another light is still the person's."""
    box = template_of("bert", "left", 5)
    wrong = replace_look(room, "left", 5)
    found = offers_of(tracked(replace(wrong, templates=(box,))))
    assert {one.template.name for one in found if one.track == 2} == {"bert"}


def replace_look(room: Sequence, camera: str, step: int) -> Sequence:
    """The room with a picture in which Bert is pink."""
    index = [one.name for one in CAMERAS].index(camera)
    view = room.views[index]
    picture = paint(wall(view.camera), boxes_at(camera, step), [RED, PINK], step)
    file = view.images[step].with_name(f"other-{camera}-{step}.png")
    cv2.imwrite(str(file), picture)
    images = (*view.images[:step], file, *view.images[step + 1 :])
    views = list(room.views)
    views[index] = replace(view, images=images)
    return replace(room, views=tuple(views))


@pytest.mark.parametrize(
    ("seen", "existence", "sigma"),
    [
        (lambda person, step: (True, False, False), 1.0, 0.02),
        (lambda person, step: (True, True, True), 0.5, 0.02),
        (lambda person, step: (True, True, True), 1.0, 0.5),
    ],
    ids=["one camera", "may not be there", "may be elsewhere"],
)
def test_of_whom_cameras_are_not_sure_nothing_is_offered(
    room: Sequence, offers_of: Found, seen: Callable[[int, int], Many], existence: float,
    sigma: float,
) -> None:  # fmt: skip
    run = tracked(room, seen=seen, existence=existence, sigma=sigma)
    assert offers_of(run) == []


def test_what_two_cameras_say_of_a_third_is_told_as_their_word(
    room: Sequence, offers_of: Found
) -> None:
    templates = tuple(template_of(name, "left", 5) for name in LOOKS)
    run = tracked(replace(room, templates=templates), seen=lambda person, step: (True, True, False))
    (back,) = (one for one in offers_of(run) if (one.track, one.template.camera) == (1, "back"))
    assert not back.own
    assert "2 cameras agree, this one finds nobody" in back.reason


def test_a_box_that_others_cover_is_not_offered(room: Sequence, offers_of: Found) -> None:
    run = tracked(room)
    together = run.tracks.positions.copy()
    together[1::2] = together[::2] + np.array([0.05, 0.0, 0.0])
    run.tracks = replace(run.tracks, positions=together)
    assert offers_of(run) == []


def test_who_is_there_for_less_than_a_second_is_not_offered(
    room: Sequence, offers_of: Found
) -> None:
    run = tracked(room)
    early = run.tracks.frames < 20
    run.tracks = run.tracks.take((run.tracks.ids == 1) | early)
    assert {one.track for one in offers_of(run)} == {1}


def test_nobody_and_a_recording_of_boxes_offer_nothing(room: Sequence, offers_of: Found) -> None:
    run = tracked(room)
    run.tracks = Trajectories.empty(3)
    assert offers_of(run) == []
    blind = replace(room, views=tuple(replace(view, images=()) for view in room.views))
    assert offers_of(tracked(blind)) == []


def test_what_was_taken_is_offered_no_more(room: Sequence, offers_of: Found) -> None:
    found = offers_of(tracked(room))
    taken = replace(room, templates=(found[0].template,))
    assert without_templates(found, taken) == found[1:]
    assert without_templates(found, room) == found  # and taken back it is offered again


def test_a_box_of_a_rolled_camera_bounds_whom_it_shows() -> None:
    """Turned by a quarter, what is high in the room is wide in the picture."""
    camera = CAMERAS[0]
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    rolled = replace(camera, rotation=turn @ camera.rotation, translation=turn @ camera.translation)
    half = np.array([0.2, 0.2, 0.8])
    place = np.array([[0.1, 0.0, 1.0]])
    (upright,) = drawn_boxes(camera, place, half)
    (lying,) = drawn_boxes(rolled, place, half)
    assert upright[3] / upright[2] > 2.0
    assert lying[2] / lying[3] > 2.0


# ── which moments are taken


def moments(*rows: tuple[int, int, int, bool, int, float]) -> Moments:
    """Track, camera, step, whether the camera sees the track itself, how many do, and height."""
    columns = (np.array(column) for column in zip(*rows, strict=True))
    tracks, cameras, steps, own, agreeing, heights = columns
    boxes = np.column_stack([np.zeros((len(rows), 2)), heights / 3.0, heights])
    there = np.arange(3) < agreeing[:, None]
    return Moments(tracks, cameras, steps, boxes, own, there, np.zeros(len(rows)))


def test_the_best_moments_are_seen_by_the_camera_by_most_others_and_large_and_a_second_apart() -> (
    None
):
    found = _best(
        moments(
            (1, 0, 0, False, 3, 90.0), (1, 0, 10, True, 2, 80.0), (1, 0, 14, True, 3, 70.0),
            (1, 0, 24, True, 3, 60.0), (1, 0, 33, True, 3, 50.0), (1, 0, 60, True, 2, 40.0),
            (2, 0, 14, True, 2, 30.0), (1, 1, 14, True, 2, 20.0),
        ),
        10.0,
    )  # fmt: skip
    rows = list(zip(found.tracks.tolist(), found.cameras.tolist(), found.steps.tolist(),
                    strict=True))  # fmt: skip
    # step 10 is too near to 14, 33 to 24, and of three at most the one that it does not see is left
    assert rows == [(1, 0, 14), (1, 0, 24), (1, 0, 60), (1, 1, 14), (2, 0, 14)]
    assert len(_best(Moments.none(3), 10.0)) == 0


def test_a_box_is_whole_within_the_picture_and_of_twelve_pixels() -> None:
    camera = CAMERAS[0]
    width, height = camera.image_size
    inside = np.array([-0.5, -0.5, width, height])
    beyond = [inside + change for change in 0.1 * np.array([-1, -1, 1, 1]) * np.eye(4)]
    sizes = [[9, 9, 12, 12], [9, 9, 11.9, 12], [9, 9, 12, 11.9], [np.nan] * 4]
    rows = [inside, *beyond, *sizes]
    assert _whole(camera, np.array(rows)).tolist() == [True, *[False] * 4, True, *[False] * 3]


def test_two_boxes_of_a_step_are_apart_if_a_twentieth_of_neither_is_the_others() -> None:
    frames = np.array([3, 3, 4, 4, 5, 5, 6, 7])
    boxes = np.array([
        [0, 0, 10, 20], [9.5, 0, 10, 20], [0, 0, 10, 20], [9.4, 0, 10, 20],
        [0, 0, 10, 20], [9, 15, 40, 80], [0, 0, 10, 20], [0, 0, 10, 20],
    ], dtype=float)  # fmt: skip
    assert _apart(frames, boxes).tolist() == [True] * 2 + [False] * 2 + [True] * 4
    boxes[5] = [-1, -1, 5, 5]
    assert _apart(frames, boxes)[4:6].tolist() == [False, False]


def test_a_drawn_box_is_as_wide_and_as_high_as_who_stands_there() -> None:
    camera, half = CAMERAS[0], np.array([0.2, 0.3, 0.8])
    place = np.array([0.1, 0.3, 1.0])
    ((left, top, width, height),) = drawn_boxes(camera, place[None], half)
    across = camera.rotation[0] * [1.0, 1.0, 0.0]
    across *= 0.25 / np.linalg.norm(across)
    left_end, right_end = camera.project(np.array([place - across, place + across]))[0]
    low, high = camera.project(place + np.array([[0.0, 0.0, -0.8], [0.0, 0.0, 0.8]]))[0]
    sizes = np.hypot(right_end - left_end, high - low)
    assert (width, height) == pytest.approx(tuple(sizes))
    assert (left + width / 2.0, top + height / 2.0) == pytest.approx(tuple((low + high) / 2.0))
    behind = camera.centre - 2.0 * camera.rotation[2]
    assert np.isnan(drawn_boxes(camera, behind[None], half)).all()


def test_tracks_are_looked_at_in_two_hundred_steps_and_last_a_second(room: Sequence) -> None:
    run = tracked(room)
    assert len(_considered(run)) == 2 * STEPS
    run.done = 40
    assert set(_considered(run).frames.tolist()) == set(range(40))
    run.tracks = replace(run.tracks, frames=7 * run.tracks.frames)
    run.done = 420
    assert set(_considered(run).frames.tolist()) == set(range(0, 420, 21))
    for count, there in ((24, [1]), (25, [1, 2])):
        brief = tracked(room)
        brief.tracks = brief.tracks.take((brief.tracks.ids == 1) | (brief.tracks.frames < count))
        assert _long_lived(brief).tolist() == there
        brief.done = 24
        assert _long_lived(brief).tolist() == [1, 2], "of a shorter recording all of it"


# ── whose they are, and which of them are worth it


def root(distance: float, side: int = 0) -> ndarray:
    """A look so far from the first one, towards one of two sides."""
    cosine = 1.0 - distance**2
    found = np.zeros(3)
    found[0], found[1 + side] = cosine, np.sqrt(1.0 - cosine**2)
    return found


def named(room: Sequence, names: list[str]) -> Run:
    """A run of which some people have templates, all of step 0 that nobody is near."""
    far = np.array([0.0, 0.0, 1.0, 1.0])
    templates = tuple(Template(name, "left", 0, far) for name in names)
    return tracked(replace(room, templates=templates))


@pytest.mark.parametrize(
    ("looks", "name"),
    [
        ([0.1], "anna"), ([0.45], "anna"), ([0.9], "person2"),  # like nobody who is known
        ([0.1, 0.1, 0.95], "anna"), ([0.1, 0.95, 0.95], "person2"),  # by the median
    ],
)  # fmt: skip
def test_a_track_is_whose_templates_most_of_its_moments_look_like(
    room: Sequence, looks: list[float], name: str
) -> None:
    run = named(room, ["anna", "person1"])
    known = [root(0.0), root(0.98, side=1)]
    rows = moments(*((1, 0, 20 * k, True, 3, 90.0) for k in range(len(looks))))
    found = _names(run, rows, np.array([root(one) for one in looks]), known)
    assert found == {1: name}
    several = moments((1, 0, 0, True, 3, 90.0), (2, 0, 0, True, 3, 90.0))
    two = _names(run, several, np.array([root(0.97), root(0.97)]), [root(0.0), root(0.0)])
    assert two == {1: "person2", 2: "person3"}


@pytest.mark.parametrize(("apart", "known"), [(0.06, True), (0.04, False)])
def test_a_track_that_looks_like_two_people_alike_is_nobodys(
    room: Sequence, apart: float, known: bool
) -> None:
    run = named(room, ["anna", "anna", "bert"])
    looks = [root(0.9), root(0.2), root(0.2 + apart, side=1)]  # the nearest of a person counts
    rows = moments((1, 0, 0, True, 3, 90.0))
    assert _names(run, rows, root(0.0)[None], looks) == ({1: "anna"} if known else {})
    alone = named(room, ["anna"])
    assert _names(alone, rows, root(0.0)[None], looks[1:2]) == {1: "anna"}


@pytest.mark.parametrize(("share", "stands"), [(0.41, True), (0.39, False)])
def test_a_track_is_whoever_has_most_templates_where_it_is(
    room: Sequence, share: float, stands: bool
) -> None:
    def template(name: str, step: int, width: float) -> Template:
        (box,) = drawn_boxes(CAMERAS[0], PATHS["bert"][step][None], HALF_EXTENTS)
        return Template(name, "left", step, box * [1.0, 1.0, width, 1.0])

    run = tracked(replace(room, templates=(template("carl", 5, share),)))
    assert _on_templates(run) == ({2: "carl"} if stands else {})
    several = (template("carl", 5, 1.0), template("anna", 9, 1.0), template("anna", 20, 0.9))
    assert _on_templates(tracked(replace(room, templates=several))) == {2: "anna"}
    elsewhere = replace(several[0], camera="nowhere")
    late = replace(several[0], frame=STEPS)
    assert _on_templates(tracked(replace(room, templates=(elsewhere, late)))) == {}


@pytest.mark.parametrize(
    ("looks", "suggested"),
    [
        ([0.0, 0.24], [0]), ([0.0, 0.26], [0, 1]),  # another look
        ([0.0, 0.5, 0.9], [0, 1]),  # two at most
        ([0.0, 0.1, 0.5], [0, 2]),
    ],
)  # fmt: skip
def test_of_one_person_two_looks_are_offered_in_a_camera(
    room: Sequence, looks: list[float], suggested: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = moments(*((1, 0, 20 * k, True, 3, 90.0) for k in range(len(looks))))
    own = np.array([root(one) for one in looks])
    place = "tracker.review.template_suggestions"
    monkeypatch.setattr(f"{place}.best_moments", lambda run: rows)
    monkeypatch.setattr(f"{place}._appearances", lambda found, pictures: (found, own))
    nobody = cast("Any", None)
    found = suggest_templates(tracked(room), nobody)
    assert [one.template.frame for one in found] == [20 * k for k in suggested]
    assert {one.template.name for one in found} == {"person1"}
    # one who has templates: by the nearest of the own ones, if no other person's is nearer
    known = [root(0.3), root(0.0, side=1)]
    monkeypatch.setattr(f"{place}._known", lambda sequence, pictures: known)
    monkeypatch.setattr(f"{place}._names", lambda *_: {1: "anna"})
    for names, count in ((["anna", "anna"], 0), (["anna", "bert"], 0), (["anna"], 1)):
        known[:] = [root(0.3), root(0.0, side=1)][: len(names)]
        templates = tuple(
            Template(name, "left", 0, np.array([0.0, 0.0, 9.0, 9.0])) for name in names
        )
        found = suggest_templates(tracked(replace(room, templates=templates)), nobody)
        assert len([one for one in found if one.template.frame == 0]) == count, names
        if count:
            assert found[0].difference == pytest.approx(0.3, abs=1e-9)
            assert found[0].known_here
