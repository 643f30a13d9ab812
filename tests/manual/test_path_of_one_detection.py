"""The path of one detection, as the architecture page tells it, is the one that it takes."""

from __future__ import annotations

import io
import re
import sys
import threading
from importlib import import_module
from pathlib import Path
from types import FrameType
from typing import Any

from tests.manual.places import PAGES
from tests.world import boxes, folder, ring, sequence, together, walk
from tracker.export import write_tracks_csv
from tracker.runs import pipeline
from tracker.sequences.library import open_sequence

LINK = re.compile(r"\[`([\w.]+)`\]\(api/(\w+)\.md#([\w.]+)\)")


def linked() -> list[tuple[str, str, str]]:
    """The text, the page and the target of each link of the section."""
    text = (PAGES / "architecture.md").read_text(encoding="utf-8")
    section = text.partition("## The path of one detection")[2].partition("\n## ")[0]
    return LINK.findall(section)


def resolved(target: str) -> Any:
    """The function of a dotted name."""
    parts = target.split(".")
    for end in range(len(parts) - 1, 0, -1):
        try:
            found: Any = import_module(".".join(parts[:end]))
        except ModuleNotFoundError:
            continue
        for name in parts[end:]:
            found = getattr(found, name)
        return found
    raise AssertionError(target)


def test_every_link_leads_to_a_function_on_the_page_of_its_package() -> None:
    assert len(linked()) >= 12
    for shown, page, target in linked():
        assert callable(resolved(target))
        assert target.endswith(f".{shown}")
        assert target.split(".")[1] == page


def called_by(kernel: Any) -> set[Any]:
    """The functions of the engine that a kernel calls, directly or through others."""
    found: set[Any] = set()
    waiting = [kernel]
    while waiting:
        function = getattr(waiting.pop(), "py_func", None)
        if function is None or function in found:
            continue
        found.add(function)
        waiting += [function.__globals__.get(name) for name in function.__code__.co_names]
    return found


def test_the_kernels_of_the_path_are_called_by_the_first() -> None:
    """They are compiled, so no profile sees their calls."""
    kernels = [resolved(target) for _, page, target in linked() if page == "kernels"]
    assert len(kernels) >= 3
    reached = called_by(kernels[0])
    assert {kernel.py_func for kernel in kernels} <= reached
    other = resolved("tracker.kernels.bernoulli.share_boxes")
    assert other.py_func not in reached, "the filter of intensities has its own"


def test_a_box_takes_that_path(tmp_path: Path) -> None:
    """Every function of the path is called, but the kernels and the method of pictures."""
    called = set()

    def note(frame: FrameType, event: str, _: object) -> None:
        if event == "call":
            called.add(frame.f_code)

    cameras = ring(3)
    ways = ([(-1.5, -1.0), (1.5, 1.0)], [(-1.5, 1.0), (1.5, -1.0)])
    people = together(*(walk(way, [0.0, 4.0], 10.0) for way in ways))
    recording = folder(tmp_path / "room", sequence(cameras, people, boxes(cameras, people)))
    threading.setprofile(note)
    sys.setprofile(note)
    try:
        opened = open_sequence(str(recording))
        parameters = pipeline.default_parameters(opened)
        run = pipeline.compute(opened, parameters, seed=0)
        write_tracks_csv(io.StringIO(), opened, run.tracks, parameters, 0)
    finally:
        sys.setprofile(None)
        threading.setprofile(None)
    assert len(set(run.tracks.ids.tolist())) == 2
    of_pictures = "tracker.single_view.colour_phd.ColourPhd.step"
    for _, page, target in linked():
        if page != "kernels" and target != of_pictures:
            assert resolved(target).__code__ in called, target
