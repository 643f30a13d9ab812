"""Every form that tracks leave in, read back by the form's own library."""

from __future__ import annotations

import configparser
import contextlib
import io
import json
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import jsonschema
import numpy as np
import pyarrow.parquet as pq
import pytest
import trimesh

from app.command.arguments import FormatName
from tests.library.written import STEPS, written
from tracker.evaluation import EvaluationSettings, evaluate
from tracker.export import json_file, tracks_csv
from tracker.export.exported_run import Options, Stopped
from tracker.export.palette import rgb
from tracker.export.registry import FORMATS, format_of, save

WRITTEN = written()
TRACKS = WRITTEN.tracks
CAMERAS = WRITTEN.sequence.cameras
FILES = [form for form in FORMATS.values() if not form.needs_pictures]


def saved(tmp_path: Path, name: str) -> Path:
    path = tmp_path / f"tracks{FORMATS[name].suffix}"
    save(path, FORMATS[name], WRITTEN)
    return path


def test_the_command_line_names_every_form() -> None:
    names = next(part for part in get_args(get_args(FormatName)[0]) if part is not type(None))
    assert list(get_args(names)) == list(FORMATS)


def test_the_form_follows_from_the_suffix_or_is_named() -> None:
    assert format_of(Path("a.PARQUET")).name == "parquet"
    assert format_of(Path("a")).name == "csv"
    with pytest.raises(ValueError, match=r"a\.xyz: .* ends in one of \.csv, \.json, .*'\.xyz'"):
        format_of(Path("a.xyz"))
    assert format_of(Path("a.txt"), "trc").name == "trc"
    with pytest.raises(ValueError, match=r"expected one of csv, .* got 'mp5'"):
        format_of(Path("a"), "mp5")
    with pytest.raises(ValueError, match=r"ends in \.glb for glTF, got 'a\.gltf'"):
        format_of(Path("a.gltf"))


def test_csv(tmp_path: Path) -> None:
    back = tracks_csv.read_tracks_csv(saved(tmp_path, "csv"))
    np.testing.assert_allclose(back.positions, TRACKS.positions, atol=5.1e-5)
    assert back.settings["seed"] == "5"


def test_json_is_as_its_schema_says(tmp_path: Path) -> None:
    told = json.loads(saved(tmp_path, "json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator(json_file.schema()).validate(told)
    assert told["run"]["parameters"]["fusion.survival_probability"] == 0.97
    assert {track["id"] for track in told["tracks"]} == set(TRACKS.ids.tolist())
    for track in told["tracks"]:
        rows = TRACKS.ids == track["id"]
        assert track["frames"] == TRACKS.frames[rows].tolist()
        assert track["positions"] == TRACKS.positions[rows].tolist()
        boxes = track["boxes"][CAMERAS[0].name]
        assert [box is not None for box in boxes] == WRITTEN.boxes[0][1][rows].tolist()
    jsonschema.Draft202012Validator.check_schema(json_file.schema())


def test_parquet(tmp_path: Path) -> None:
    path = saved(tmp_path, "parquet")
    table = pq.read_table(path)
    assert table.num_rows == len(TRACKS)
    np.testing.assert_array_equal(table["id"].to_numpy(), TRACKS.ids)
    for k, axis in enumerate("xyz"):
        np.testing.assert_array_equal(table[axis].to_numpy(), TRACKS.positions[:, k])
    there = WRITTEN.boxes[1][1]
    left = table[f"{CAMERAS[1].name}_left"]
    assert left.null_count == int((~there).sum())
    facts = json.loads(pq.read_schema(path).metadata[b"multiview-phd"])
    assert facts["parameters"]["fusion.survival_probability"] == "0.97"


def test_what_a_person_said_stands_in_json_and_parquet(tmp_path: Path) -> None:
    one = int(TRACKS.ids[0])
    row_corrections = ["a1b2" if track == one else "" for track in TRACKS.ids.tolist()]
    named = replace(WRITTEN, names={one: "Änne, 3"}, row_corrections=row_corrections)
    save(tmp_path / "tracks.json", FORMATS["json"], named)
    told = json.loads((tmp_path / "tracks.json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator(json_file.schema()).validate(told)
    for track in told["tracks"]:
        assert track.get("name") == ("Änne, 3" if track["id"] == one else None)
    save(tmp_path / "tracks.parquet", FORMATS["parquet"], named)
    table = pq.read_table(tmp_path / "tracks.parquet")
    expected = ["Änne, 3" if track == one else "" for track in TRACKS.ids.tolist()]
    assert table["name"].to_pylist() == expected
    assert table["correction"].to_pylist() == row_corrections
    assert "name" not in pq.read_schema(saved(tmp_path, "parquet")).names


def test_trc_into_a_file_of_any_name(tmp_path: Path) -> None:
    save(tmp_path / "Küche.trc", FORMATS["trc"], WRITTEN)
    first = (tmp_path / "Küche.trc").read_text(encoding="ascii").split("\n")[0]
    assert first == "PathFileType\t4\t(X/Y/Z)\tK?che.trc"


def test_motchallenge_of_any_name(tmp_path: Path) -> None:
    (first, *others) = WRITTEN.sequence.views
    strange = replace(first, camera=replace(first.camera, name="../../über"))
    sequence = replace(WRITTEN.sequence, name="Küche", views=(strange, *others))
    save(tmp_path / "mot", FORMATS["motchallenge"], replace(WRITTEN, sequence=sequence))
    assert [path.name for path in tmp_path.iterdir()] == ["mot"]
    home = tmp_path / "mot" / "gt" / "mot_challenge"
    (names,) = (home / "seqmaps").iterdir()
    _, *listed = names.read_text(encoding="utf-8").split()
    assert sorted(listed) == sorted(path.name for path in (home / "multiview-train").iterdir())


def test_trc(tmp_path: Path) -> None:
    lines = saved(tmp_path, "trc").read_text(encoding="ascii").split("\n")
    assert lines[0].split("\t")[:3] == ["PathFileType", "4", "(X/Y/Z)"]
    facts = dict(zip(lines[1].split("\t"), lines[2].split("\t"), strict=True))
    assert (facts["NumFrames"], facts["Units"]) == (str(STEPS), "m")
    names = lines[3].split("\t")[2::3]
    rows = [line.split("\t") for line in lines[6:] if line]
    assert len(rows) == STEPS
    assert {len(row) for row in rows} == {2 + 3 * int(facts["NumMarkers"])}
    for number in WRITTEN.ids:
        column = 2 + 3 * names.index(f"person{number}")
        of = TRACKS.ids == number
        there = [k for k, row in enumerate(rows) if row[column]]
        assert there == TRACKS.frames[of].tolist()
        values = np.array([rows[k][column : column + 3] for k in there], dtype=float)
        x, up, back = values.T
        np.testing.assert_allclose(
            np.stack([x, -back, up], axis=1), TRACKS.positions[of], atol=1e-6
        )


def test_gltf(tmp_path: Path) -> None:
    path = saved(tmp_path, "gltf")
    scene = trimesh.load_scene(path)
    names = {f"track {number}" for number in WRITTEN.ids}
    assert names <= set(scene.graph.nodes_geometry)
    for number in WRITTEN.ids:
        pose, geometry = scene.graph[f"track {number}"]
        mesh = scene.geometry[geometry]
        half = WRITTEN.sequence.target_half_extents
        np.testing.assert_allclose(np.sort(mesh.extents), np.sort(2.0 * half), rtol=1e-6)
        assert mesh.volume == pytest.approx(8.0 * float(np.prod(half)), rel=1e-5)  # faces outwards
        first = TRACKS.positions[TRACKS.ids == number][0]
        np.testing.assert_allclose(pose[:3, 3], [first[0], first[2], -first[1]], atol=1e-6)  # y up
        colour = (np.array(rgb(number)) / 255.0) ** 2.2
        found = np.array(mesh.visual.material.baseColorFactor[:3]) / 255.0
        np.testing.assert_allclose(found, colour, atol=0.01)
    data = path.read_bytes()
    length = struct.unpack_from("<I", data, 12)[0]
    document = json.loads(data[20 : 20 + length])
    binary = data[28 + length :]

    def values(accessor: int) -> np.ndarray:
        told = document["accessors"][accessor]
        width = {"SCALAR": 1, "VEC3": 3}[told["type"]]
        begin = document["bufferViews"][told["bufferView"]]["byteOffset"]
        flat = np.frombuffer(binary, np.float32, told["count"] * width, begin)
        return flat.reshape(-1, width)

    (animation,) = document["animations"]
    for channel in animation["channels"]:
        sampler = animation["samplers"][channel["sampler"]]
        times, moved = values(sampler["input"])[:, 0], values(sampler["output"])
        number = int(document["nodes"][channel["target"]["node"]]["name"].split()[1])
        of = TRACKS.ids == number
        assert (np.diff(times) > 0).all()
        if channel["target"]["path"] == "translation":
            np.testing.assert_allclose(times * WRITTEN.sequence.fps, TRACKS.frames[of], atol=1e-4)
            np.testing.assert_allclose(moved, TRACKS.positions[of], atol=1e-6)
        else:
            steps = np.arange(STEPS)
            at = np.searchsorted(times * WRITTEN.sequence.fps, steps + 0.5) - 1
            assert (moved[at, 0] == np.isin(steps, TRACKS.frames[of])).all()


def test_rerun(tmp_path: Path) -> None:
    from rerun.chunk import RrdReader

    path = saved(tmp_path, "rerun")
    (recording,) = RrdReader(path).recordings()
    assert recording.application_id == "multiview-phd"
    centres: dict[int, list] = {}
    for chunk in RrdReader(path).stream():
        if str(chunk.entity_path) != "/world/tracks":
            continue
        batch = chunk.to_record_batch()
        names = batch.schema.names
        (place,) = [k for k, name in enumerate(names) if "centers" in name]
        steps = batch.column(names.index("step")).to_pylist()
        for step, values in zip(steps, batch.column(place).to_pylist(), strict=True):
            centres[step] = values or []
    assert sorted(centres) == list(range(STEPS))
    for step, values in centres.items():
        expected = TRACKS.positions[TRACKS.at(step)]
        np.testing.assert_allclose(np.array(values).reshape(-1, 3), expected, atol=1e-6)


def test_report(tmp_path: Path) -> None:
    text = saved(tmp_path, "html").read_text(encoding="utf-8")
    assert "MOTA" in text
    assert text.startswith("<!doctype html>")


class OfTrackEval:
    """TrackEval's own reader of MOTChallenge on an exported folder, scored by its metrics."""

    def __init__(self, folder: Path) -> None:
        datasets = pytest.importorskip("trackeval.datasets", reason="TrackEval is not installed")
        self.metrics = pytest.importorskip("trackeval.metrics")
        config = {
            "GT_FOLDER": str(folder / "gt" / "mot_challenge"),
            "TRACKERS_FOLDER": str(folder / "trackers" / "mot_challenge"),
            "BENCHMARK": "multiview",
            "SPLIT_TO_EVAL": "train",
            "TRACKERS_TO_EVAL": ["multiview-phd"],
            "PRINT_CONFIG": False,
        }
        self.euclidean: float | None = None
        outer = self

        class Dataset(datasets.MotChallenge2DBox):  # type: ignore[misc, name-defined]
            def _calculate_similarities(self, truth: Any, tracks: Any) -> Any:
                if outer.euclidean is None:
                    return super()._calculate_similarities(truth, tracks)
                centres = [boxes[:, :2] + boxes[:, 2:4] / 2.0 for boxes in (truth, tracks)]
                return self._calculate_euclidean_similarity(*centres, outer.euclidean)

        self.dataset = Dataset(config)

    def data(self, sequence: str, euclidean: float | None = None) -> dict[str, Any]:
        self.euclidean = euclidean
        with contextlib.redirect_stdout(io.StringIO()):
            raw = self.dataset.get_raw_seq_data("multiview-phd", sequence)
            found: dict[str, Any] = self.dataset.get_preprocessed_seq_data(raw, "pedestrian")
        return found


@pytest.fixture
def motchallenge(tmp_path: Path) -> OfTrackEval:
    folder = tmp_path / "mot"
    save(folder, FORMATS["motchallenge"], WRITTEN)
    return OfTrackEval(folder)


def test_trackeval_and_evaluate_agree_on_the_ground_plane(motchallenge: OfTrackEval) -> None:
    gate = 1.0
    settings = EvaluationSettings(distance="ground", gate=gate)
    truth = WRITTEN.sequence.ground_truth
    ours = evaluate(truth, TRACKS, settings, steps=STEPS)
    name = f"{WRITTEN.sequence.name}-ground-plane"
    data = motchallenge.data(name, 2.0 * gate)
    config = {"THRESHOLD": 0.5, "PRINT_CONFIG": False}
    clear = motchallenge.metrics.CLEAR(config).eval_sequence(data)
    close = {"rel": 0, "abs": 1e-6}
    assert ours["mota"] == pytest.approx(clear["MOTA"], **close)
    assert (1.0 - (ours["motp"] or 0.0) / (2.0 * gate)) == pytest.approx(clear["MOTP"], **close)
    assert (ours["misses"], ours["false_positives"]) == (clear["CLR_FN"], clear["CLR_FP"])
    assert ours["id_switches"] == clear["IDSW"] > 0
    identity = motchallenge.metrics.Identity(config).eval_sequence(data)
    assert ours["idf1"] == pytest.approx(identity["IDF1"], **close)
    data = motchallenge.data(name, gate)
    hota = motchallenge.metrics.HOTA().eval_sequence(data)
    assert ours["hota"] == pytest.approx(float(np.mean(hota["HOTA"])), **close)


def test_trackeval_reads_no_position_as_a_class(tmp_path: Path) -> None:
    """TrackEval takes the eighth number for the class, and refuses classes above 1."""
    away = replace(TRACKS, positions=TRACKS.positions + 7.0)
    save(tmp_path / "mot", FORMATS["motchallenge"], replace(WRITTEN, tracks=away))
    data = OfTrackEval(tmp_path / "mot").data(f"{WRITTEN.sequence.name}-ground-plane")
    assert data["num_tracker_dets"] == np.count_nonzero(TRACKS.frames < STEPS)


def test_results_have_the_ten_columns_that_py_motmetrics_takes(motchallenge: OfTrackEval) -> None:
    for path in Path(motchallenge.dataset.tracker_fol).rglob("*.txt"):
        rows = [line.split(",") for line in path.read_text().splitlines()]
        assert rows
        ends = {tuple(row[7:9]) for row in rows}
        assert ({len(row) for row in rows}, ends) == ({10}, {("-1", "-1")}), path.name
        on_ground = path.stem.endswith("ground-plane")
        heights = set(TRACKS.positions[:, 2].round(10).tolist()) if on_ground else {-1.0}
        assert {float(row[9]) for row in rows} <= heights, path.name


def test_each_camera_s_boxes_are_read_by_trackeval(motchallenge: OfTrackEval) -> None:
    for index, camera in enumerate(CAMERAS):
        name = f"{WRITTEN.sequence.name}-{camera.name}"
        with contextlib.redirect_stdout(io.StringIO()):
            raw = motchallenge.dataset.get_raw_seq_data("multiview-phd", name)
        boxes, visible = WRITTEN.boxes[index]
        for step in range(STEPS):
            rows = np.arange(len(TRACKS))[TRACKS.at(step)]
            rows = rows[visible[rows]]
            np.testing.assert_allclose(
                raw["tracker_dets"][step], boxes[rows] + [1.0, 1.0, 0.0, 0.0], atol=1e-9
            )
            assert raw["tracker_ids"][step].tolist() == TRACKS.ids[rows].tolist()
    facts = configparser.ConfigParser()
    home = Path(motchallenge.dataset.gt_fol)
    (path,) = home.rglob(f"{WRITTEN.sequence.name}-{CAMERAS[0].name}/seqinfo.ini")
    facts.read(path)
    assert facts["Sequence"]["seqLength"] == str(STEPS)
    assert facts["Sequence"]["imWidth"] == str(CAMERAS[0].image_size[0])


@pytest.mark.parametrize("form", FILES, ids=lambda form: form.name)
def test_wholly_or_not_at_all(form: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / f"tracks{form.suffix}"
    if not form.folder:
        path.write_text("what was there before")

    def told(done: int, total: int) -> None:
        raise OSError(28, "No space left on device")

    with pytest.raises(OSError, match=r"tracks.*cannot be written \(No space left on device\)"):
        save(path, form, WRITTEN, Options(progress=told))
    with pytest.raises(Stopped):
        save(path, form, WRITTEN, Options(stopped=lambda: True))
    left = [p.name for p in tmp_path.iterdir()]
    if form.folder:
        assert left == []
    else:
        assert left == [path.name]
        assert path.read_text() == "what was there before"
    with pytest.raises(OSError, match="there is no folder"):
        save(tmp_path / "nowhere" / path.name, form, WRITTEN)


@pytest.mark.parametrize("form", FILES, ids=lambda form: form.name)
def test_nobody(form: Any, tmp_path: Path) -> None:
    nobody = type(WRITTEN)(
        WRITTEN.sequence, TRACKS.take(np.zeros(0, dtype=int)), WRITTEN.parameters
    )
    path = tmp_path / f"tracks{form.suffix}"
    save(path, form, nobody)
    assert path.exists()
    if form.name == "gltf":
        assert set(trimesh.load_scene(path).geometry) == {"floor"}
    if form.name == "parquet":
        assert pq.read_table(path).num_rows == 0


def test_a_folder_with_files_is_not_touched(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(OSError, match="expected a new folder, found one with files"):
        save(tmp_path, FORMATS["motchallenge"], WRITTEN)
    assert [p.name for p in tmp_path.iterdir()] == ["notes.txt"]


def test_a_package_that_is_not_there_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, module in (("parquet", "pyarrow"), ("rerun", "rerun")):
        monkeypatch.setitem(__import__("sys").modules, module, None)
        with pytest.raises(ValueError, match=rf'pip install "multiview-phd\[{name}\]"'):
            save(tmp_path / "x", FORMATS[name], WRITTEN)
    assert list(tmp_path.iterdir()) == []
