"""The rendered rooms: scripted events, exact truth, pictures that agree with the cameras."""

from __future__ import annotations

import csv
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.rooms import ROOMS, RenderCancelled, read_visibility, render
from tests.rooms.avi import AviWriter, compress
from tests.rooms.cast.paths import FASTEST, FRAMES_PER_SECOND, walk
from tests.rooms.lighting import floor_shadows
from tests.rooms.rooms import CAMERAS, TARGET_HALF_EXTENTS
from tests.rooms.scene import Scene, script
from tests.rooms.studio import Studio, studio_of
from tests.rooms.walls.background import Tracer
from tests.rooms.walls.interior import furnish
from tracker.sequences.reader import read_sequence

pytestmark = pytest.mark.full  # the generator is no part of the program


@pytest.fixture(scope="module")
def scenes() -> dict[str, Scene]:
    return {name: script(spec) for name, spec in ROOMS.items()}


@pytest.fixture(scope="module")
def studio() -> Studio:
    return studio_of(ROOMS["room44-3p"], CAMERAS[:2], seed=0)


@pytest.fixture(scope="module")
def rendered(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("rooms") / "room24-2p"
    render("room24-2p", folder, frames=64)
    return folder


# ── the script ────────────────────────────────────────────────────────────────


def test_people_of_room44_enter_at_their_steps(scenes: dict[str, Scene]) -> None:
    inside = [figure.inside for figure in scenes["room44-3p"].figures]
    assert [int(np.argmax(i)) for i in inside] == [99, 144, 247]


@pytest.mark.parametrize("name", sorted(ROOMS))
def test_people_walk_like_people(scenes: dict[str, Scene], name: str) -> None:
    scene = scenes[name]
    for figure in scene.figures:
        assert figure.path.speed.max() <= FASTEST
        steps = np.flatnonzero(figure.inside)
        # nobody leaves the volume and comes back as if by magic
        assert np.all(np.diff(steps) == 1)
        acceleration = np.gradient(figure.path.speed) * FRAMES_PER_SECOND
        assert np.abs(acceleration).max() < 3.0
        # a foot on the ground stays where it is while the person walks
        for foot in figure.path.footprints:
            moved = np.hypot(*np.gradient(foot[:, :2], axis=0).T) * FRAMES_PER_SECOND
            planted = (foot[:, 2] < 1e-4) & (figure.path.speed > 0.5)
            assert np.median(moved[planted]) < 0.02


@pytest.mark.parametrize("name", sorted(ROOMS))
def test_people_keep_apart(scenes: dict[str, Scene], name: str) -> None:
    figures = scenes[name].figures
    for i, one in enumerate(figures):
        for other in figures[:i]:
            both = one.drawn & other.drawn
            gap = np.linalg.norm((one.path.position - other.path.position)[both], axis=1)
            assert gap.min() > 0.38


@pytest.mark.parametrize("name", sorted(ROOMS))
def test_whoever_is_in_the_volume_is_in_the_first_two_pictures(
    scenes: dict[str, Scene], name: str
) -> None:
    for figure in scenes[name].figures:
        for camera in CAMERAS[:2]:
            assert camera.sees(figure.centres[figure.inside]).all()


def test_legs_reach_the_ground(scenes: dict[str, Scene]) -> None:
    for figure in scenes["room44-3p"].figures:
        rotations = figure.poses.rotations
        identity = rotations @ np.swapaxes(rotations, 2, 3)
        np.testing.assert_allclose(identity, np.broadcast_to(np.eye(3), identity.shape), atol=1e-9)
        assert np.linalg.det(rotations).min() > 0.999


def test_a_walk_through_one_place_stands_still() -> None:
    path = walk(((0, 0.5, 0.5), (10, 0.5, 0.5)), (), 20, leg=0.83)
    np.testing.assert_allclose(path.position, np.full((20, 2), 0.5))
    assert path.speed.max() < 1e-9


def test_constant_velocity_is_kept_in_time() -> None:
    path = walk(((0, 0.0, 0.0), (50, 2.0, 0.0), (100, 4.0, 0.0)), (), 100, leg=0.83)
    np.testing.assert_allclose(path.position[20:80, 0], 0.04 * np.arange(20, 80), atol=1e-6)


# ── occlusion ─────────────────────────────────────────────────────────────────


@pytest.mark.parametrize("step", [264, 280, 295])
def test_person_2_hides_3_in_both_cameras(studio: Studio, step: int) -> None:
    visible = studio.draw(step, step + 1).visible[0]
    assert np.all(visible[2] < 0.5)
    assert np.all(visible[1] > 0.95)


def test_1_hides_3_in_camera_1_and_2_hides_1_in_camera_2(studio: Studio) -> None:
    visible = studio.draw(809, 810).visible[0]
    assert visible[2, 0] < 0.2
    assert visible[2, 1] > 0.95
    assert visible[0, 1] < 0.4
    assert visible[0, 0] > 0.95


def test_person_1_passes_an_armchair_of_its_colours(studio: Studio) -> None:
    """In camera 2 the armchair lies behind the target for a part of the steps 600-700."""
    armchair = np.array([[-1.88, 0.22, 0.72]])
    pixel = CAMERAS[1].project(armchair)[0][0]
    figure = studio.scene.figures[0]
    boxes, _ = CAMERAS[1].project_boxes(figure.centres[600:700], TARGET_HALF_EXTENTS)
    inside = np.all((pixel > boxes[:, :2]) & (pixel < boxes[:, :2] + boxes[:, 2:]), axis=1)
    assert inside.sum() >= 25
    empty = studio.draw(20, 21).pictures[1][0]
    person = studio.draw(500, 501).pictures[1][0]
    box, _ = CAMERAS[1].project_boxes(figure.centres[500:501], TARGET_HALF_EXTENTS)
    x, y = (box[0, :2] + box[0, 2:] * [0.5, 0.6]).astype(int)
    shirt = person[y - 2 : y + 3, x - 2 : x + 3].mean(axis=(0, 1))
    u, v = pixel.astype(int)
    chair = empty[v - 2 : v + 3, u - 2 : u + 3].mean(axis=(0, 1))
    assert np.abs(shirt - chair).max() < 60.0


# ── pictures ──────────────────────────────────────────────────────────────────


def test_silhouettes_are_where_the_truth_says(studio: Studio) -> None:
    """What differs from the empty room lies around the projected truth."""
    figures = studio.scene.figures
    # a step at which nobody is near another in either picture
    columns = np.stack(
        [[camera.project(f.centres)[0][:, 0] for f in figures] for camera in CAMERAS[:2]]
    )
    gaps = np.abs(columns[:, [0, 0, 1]] - columns[:, [1, 2, 2]]).min(axis=(0, 1))
    gaps[~np.all([f.inside for f in figures], axis=0)] = 0.0
    step = int(np.argmax(gaps))
    assert gaps[step] > 50.0
    for number, camera in enumerate(CAMERAS[:2]):
        shown = studio.draw(step, step + 1).pictures[number][0].astype(float)
        empty = studio.draw(20, 21).pictures[number][0].astype(float)
        changed = np.abs(shown - empty).max(axis=2) > 40.0
        for figure in figures:
            box, _ = camera.project_boxes(figure.centres[[step]], TARGET_HALF_EXTENTS)
            left, top, width, height = box[0]
            rows = slice(int(top), int(top + height))
            body = changed[rows, int(left) : int(left + width)]
            assert body.mean() > 0.35
            middle = np.flatnonzero(changed[rows, int(left - 5) : int(left + width + 6)].any(0))
            centre = int(left - 5) + (middle[0] + middle[-1]) / 2.0
            assert abs(centre - (left + width / 2.0)) < 0.3 * width
            # the box ends at the crown of the head
            head = changed[int(top - 8) : int(top + 8), int(left) : int(left + width)].any(1)
            assert abs(np.flatnonzero(head)[0] - 8) <= 5


def test_pictures_do_not_depend_on_how_the_steps_are_shared_out(studio: Studio) -> None:
    together = studio.draw(140, 144)
    apart = studio.draw(142, 143)
    for number in range(2):
        np.testing.assert_array_equal(together.pictures[number][2], apart.pictures[number][0])
    np.testing.assert_array_equal(together.visible[2], apart.visible[0])


def test_pictures_look_exposed(studio: Studio) -> None:
    for picture in studio.draw(300, 301).pictures:
        assert 80.0 < picture.mean() < 170.0
        assert np.percentile(picture, 1) < 50.0
        assert np.percentile(picture, 99) > 190.0


def test_rays_find_the_walls() -> None:
    spec = ROOMS["room44-3p"]
    tracer = Tracer(furnish(spec.decor, spec.back_door, spec.front_door))
    origins = np.array([[0.0, 0.0, 1.9], [0.0, 0.0, 1.9]], dtype=np.float32)
    directions = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], dtype=np.float32)
    distances, solids = tracer.nearest(origins, directions)
    assert distances[0] == pytest.approx(2.1, abs=0.05)
    assert distances[1] == pytest.approx(0.8, abs=0.05)
    assert (solids >= 0).all()
    none = np.empty((0, 3), dtype=np.float32)
    distances, solids = tracer.nearest(none, none)
    assert len(distances) == len(solids) == 0


def test_shadows_are_dark_under_the_ball_only() -> None:
    lamps = np.array([[0.0, 0.0, 2.7, 0.5]])
    origin = np.array([-2.0, -2.0])
    balls = np.array([[[0.0, 0.0, 0.2, 0.1]], [[0.0, 0.0, 0.2, 0.0]]])
    field = floor_shadows(balls, lamps, 100, 100, origin, 0.04)
    assert field[0, 50, 50] < 0.7
    assert field[0, 0, 0] == 1.0
    assert (field[1] == 1.0).all()


# ── the folder ────────────────────────────────────────────────────────────────


def test_the_folder_is_an_ordinary_sequence(rendered: Path, scenes: dict[str, Scene]) -> None:
    sequence = read_sequence(rendered)
    assert sequence.name == "room24-2p"
    assert sequence.frames == 64
    assert len(sequence.views) == 2
    assert len(sequence.room.entrances) == 2
    np.testing.assert_allclose(sequence.target_half_extents, TARGET_HALF_EXTENTS)
    for view, camera in zip(sequence.views, CAMERAS, strict=False):
        for field in ("intrinsics", "rotation", "translation", "distortion"):
            np.testing.assert_array_equal(getattr(view.camera, field), getattr(camera, field))
    truth = sequence.ground_truth
    assert truth is not None
    figure = scenes["room24-2p"].figures[0]
    steps = np.flatnonzero(figure.inside[:64])
    np.testing.assert_array_equal(truth.frames[truth.ids == 1], steps)
    np.testing.assert_allclose(truth.positions[truth.ids == 1], figure.centres[steps], atol=1e-5)
    assert {t.name for t in sequence.templates} == {"person1"}
    assert {t.camera for t in sequence.templates} == {"cam1", "cam2"}


def test_videos_have_every_step(rendered: Path) -> None:
    video = cv2.VideoCapture(str(rendered / "cam1.avi"))
    assert video.get(cv2.CAP_PROP_FRAME_COUNT) == 64
    assert video.get(cv2.CAP_PROP_FPS) == 25.0
    pictures = []
    while True:
        there, picture = video.read()
        if not there:
            break
        pictures.append(picture)
    assert len(pictures) == 64
    assert pictures[0].shape == (288, 360, 3)
    drawn = studio_of(ROOMS["room24-2p"], CAMERAS[:2], 0).draw(50, 51).pictures[0][0]
    assert np.abs(pictures[50].astype(float) - drawn).mean() < 4.0


def test_visibility_has_a_row_for_every_true_position(rendered: Path) -> None:
    visible = read_visibility(rendered)
    with (rendered / "ground_truth.csv").open() as file:
        rows = [(int(r["frame"]), int(r["id"]) - 1) for r in csv.DictReader(file)]
    assert visible.shape == (64, 1, 2)
    assert {(int(f), int(i)) for f, i in np.argwhere(~np.isnan(visible[:, :, 0]))} == set(rows)
    assert np.nanmax(visible) <= 1.0
    assert np.nanmin(visible) >= 0.0
    assert np.nanmedian(visible) > 0.9


def test_the_same_seed_gives_the_same_files(tmp_path: Path) -> None:
    for name, seed in (("a", 3), ("b", 3), ("c", 4)):
        render("room35-2p", tmp_path / name, frames=3, cameras=3, seed=seed)
    files = sorted(path.name for path in (tmp_path / "a").iterdir())
    assert files == [
        "SHA256SUMS",
        "cam1.avi",
        "cam2.avi",
        "cam3.avi",
        "ground_truth.csv",
        "sequence.toml",
        "visibility.csv",
    ]
    for file in files:
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()
    assert (tmp_path / "a" / "cam1.avi").read_bytes() != (tmp_path / "c" / "cam1.avi").read_bytes()
    # nobody is there yet: no truth, no templates, and still a sequence
    assert read_sequence(tmp_path / "a").templates == ()
    assert read_visibility(tmp_path / "a").size == 0


def test_progress_is_told_and_cancelling_leaves_nothing(tmp_path: Path) -> None:
    told: list[tuple[int, int]] = []
    render(
        "room24-2p",
        tmp_path / "room",
        frames=5,
        progress=lambda done, total: told.append((done, total)),
    )
    assert told[0] == (0, 5)
    assert told[-1] == (5, 5)
    assert (tmp_path / "room").stat().st_mode & 0o777 == 0o755
    before = (tmp_path / "room" / "sequence.toml").read_bytes()
    asked = iter([False, True])
    with pytest.raises(RenderCancelled):
        render("room24-2p", tmp_path / "room", frames=60, cancelled=lambda: next(asked))
    assert [path.name for path in tmp_path.iterdir()] == ["room"]
    assert (tmp_path / "room" / "sequence.toml").read_bytes() == before


def test_wrong_calls_say_what_is_possible(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="room24-2p, room35-2p, room44-3p"):
        render("room1", tmp_path / "x")
    with pytest.raises(ValueError, match="cameras must be 2 … 3, got 4"):
        render("room44-3p", tmp_path / "x", cameras=4)
    with pytest.raises(ValueError, match="frames must be 1 … 1500"):
        render("room44-3p", tmp_path / "x", frames=0)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("precious")
    with pytest.raises(FileExistsError, match="not a sequence folder"):
        render("room44-3p", tmp_path / "mine", frames=1)
    assert (tmp_path / "mine" / "thesis.txt").read_text() == "precious"


def test_an_empty_video_is_still_a_file(tmp_path: Path) -> None:
    with AviWriter(tmp_path / "none.avi", (32, 32), 25.0):
        pass
    assert (tmp_path / "none.avi").read_bytes()[:4] == b"RIFF"


def test_video_frames_come_back_in_order(tmp_path: Path) -> None:
    """Each picture's grey value is its number, odd and even sizes mixed."""
    rng = np.random.default_rng(0)
    with AviWriter(tmp_path / "v.avi", (64, 48), 25.0) as writer:
        for number in range(30):
            picture = np.full((48, 64, 3), 8 * number, dtype=np.uint8)
            picture[:8, : 1 + number] = rng.integers(0, 255, size=(8, 1 + number, 3))
            writer.write(compress(picture, 90))
    video = cv2.VideoCapture(str(tmp_path / "v.avi"))
    for number in (7, 3, 29, 0, 15):
        video.set(cv2.CAP_PROP_POS_FRAMES, number)
        there, picture = video.read()
        assert there
        assert abs(float(picture[30:].mean()) - 8 * number) < 2.0
