"""The API as it describes itself: calls in any order, with what fits and what does not.

``MULTIVIEW_PHD_CASES=SECONDS`` has it longer.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.app.folders import write_crossing
from tests.browser.serving import Server

SECONDS = int(os.environ.get("MULTIVIEW_PHD_CASES", "12"))
CHECKS = (
    "not_a_server_error",
    "status_code_conformance",
    "content_type_conformance",
    "response_headers_conformance",
    "response_schema_conformance",
)
TOKEN = "the-token-of-these-calls"


@pytest.mark.full
def test_no_call_makes_the_server_fail_or_answer_what_is_not_documented(
    tmp_path: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    data = tmp_path_factory.mktemp("data")
    folder = write_crossing(data / "crossing")
    running = Server(folder, tmp_path_factory.mktemp("cache"), data=data, token=TOKEN)
    try:
        running.wait_for_run()
        schemathesis = [
            sys.executable, "-m", "schemathesis.cli", "run", f"{running.address}openapi.json",
            "--header", f"Authorization: Bearer {TOKEN}", "--checks", ",".join(CHECKS),
            "--phases", "coverage,fuzzing,stateful", "--max-time", str(SECONDS),
            "--exclude-path", "/api/teach/detector/fetched",  # it would have npm download
            "--request-timeout", "30", "--continue-on-failure", "--no-shrink",
        ]  # fmt: skip
        done = subprocess.run(schemathesis, cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout[-8000:] + done.stderr[-2000:]
        assert running.get("/api/state").status_code == 200
    finally:
        running.stop()
        running.end_studies()
