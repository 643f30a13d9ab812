"""A real recording: what is painted is the step that the readout says."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy import ndarray
from playwright.sync_api import Page

from tests.browser.looking import (
    clear_overlays,
    overlay_steps,
    painted,
    readout,
    shown_in_3d,
    until,
    viser,
)
from tests.browser.serving import Server
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.reader import read_sequence

NAME = "av163-seq30-2p-1101"
pytestmark = pytest.mark.data


@pytest.fixture(scope="module")
def recording(data_folder: Path) -> Path:
    """Two people in a meeting room, three cameras."""
    folder = data_folder / NAME
    if not folder.is_dir():
        pytest.skip(f"the recording {NAME} is not there")
    return folder


@pytest.fixture(scope="module")
def server(recording: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """The workbench on the recording."""
    running = Server(recording, tmp_path_factory.mktemp("cache"))
    yield running
    running.stop()


def small(picture: ndarray) -> ndarray:
    """As numbers that a little scaling does not change."""
    grey = cv2.cvtColor(np.asarray(picture), cv2.COLOR_BGR2GRAY)
    return np.asarray(cv2.resize(grey, (180, 144), interpolation=cv2.INTER_AREA), dtype=float)


def test_every_step_by_key_is_the_recordings_own(browser, recording: Path, server: Server) -> None:
    first = 290  # people walk
    sequence = read_sequence(recording)
    reader = FrameReader(sequence)
    frames = [
        [small(reader.picture(camera, step)) for step in range(first - 1, first + 6)]
        for camera in range(len(sequence.views))
    ]
    reader.close()
    context = browser.new_context(viewport={"width": 1440, "height": 900})
    page: Page = context.new_page()
    page.goto(f"{server.address}?step={first}")
    scene = viser(page)
    clear_overlays(page)
    for offset in range(5):
        if offset:
            page.keyboard.press("ArrowRight")
        step = first + offset
        until(page, lambda step=step: readout(page) == str(step), f"the readout says {step}")
        for camera, picture in enumerate(painted(page)):
            away = [float(np.abs(small(picture) - other).mean()) for other in frames[camera]]
            assert int(np.argmin(away)) == offset + 1, f"camera {camera} at step {step}: {away}"
        assert overlay_steps(page) in ([str(step)] * 3, [""] * 3)
        until(page, lambda step=step: shown_in_3d(scene) == str(step), f"3D shows {step}")
    context.close()
