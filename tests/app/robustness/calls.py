"""Calls of the API in any order, with what fits and what does not, as it describes itself.

``python -m tests.app.robustness.calls --cases 10000 --resume FILE`` makes so many, round by round;
the file keeps what was done, and the same command goes on after the last round that ended. Each
round has a server and a seed of its own: the first takes every bound of every field, of those after
it every second one makes commands alone.
"""

from __future__ import annotations

import argparse
import json
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from tests.app.folders import write_crossing
from tests.browser.serving import Server
from tracker.files.atomic import write_whole
from tracker.studies.definition import definition_of
from tracker.studies.errors import StudyError
from tracker.studies.store import create

CHECKS = (
    "not_a_server_error",
    "status_code_conformance",
    "content_type_conformance",
    "response_headers_conformance",
    "response_schema_conformance",
)
TOKEN = "the-token-of-these-calls"

EVERYTHING = ("--exclude-path", "/api/teach/detector/fetched")  # it would have npm download
COMMANDS = ("--include-path", "/api/commands")
EXAMPLES = {EVERYTHING: 8, COMMANDS: 200}
"""Of each operation in a round."""

STUDY = {
    "name": "one", "trials": 2,
    "parameters": {"fusion.clutter_rate": {"low": 0.1, "high": 5.0}},
}  # fmt: skip


@dataclass(frozen=True)
class Round:
    """What came of some calls."""

    cases: int
    status: int
    """0 where every answer was as it is documented, and none a failure of the server."""
    said: str


def call(folder: Path, seed: int, which: tuple[str, ...], examples: int) -> Round:
    """Make calls of a server that is started for them, and ended.

    Args:
        folder: Empty; gets the data, the caches and the report.
        seed: The same one makes the same calls; 0 those of every bound, at addresses of nothing.
            With others the recording, the run and the study of an address are there.
        which: The operations, by the flags of the tool.
        examples: The number of cases for each operation.
    """
    data, report = folder / "data", folder / "calls.json"
    sequence = write_crossing(data / "crossing")
    running = Server(sequence, folder / "home", data=data, token=TOKEN)
    try:
        state = running.wait_for_run()
        definition = definition_of(
            {**STUDY, "recordings": [str(sequence)]}, where="study", folder=folder
        )
        create(definition, folder / "home" / "studies")
        there = {"sequence_key": state["sequence"]["key"], "name": STUDY["name"], "run": 1}
        lines = [f'"path.{name}" = {json.dumps(value)}\n' for name, value in there.items()]
        known = ["[parameters]\n", *lines] if seed else []
        (folder / "schemathesis.toml").write_text("".join(known), encoding="utf-8")
        line = [
            sys.executable, "-m", "schemathesis.cli", "run", f"{running.address}openapi.json",
            "--header", f"Authorization: Bearer {TOKEN}", "--checks", ",".join(CHECKS),
            "--phases", "fuzzing,stateful" if seed else "coverage", "--seed", str(seed),
            "--max-examples", str(examples), "--request-timeout", "30", "--continue-on-failure",
            "--no-shrink", "--report", "json", "--report-json-path", str(report), *which,
        ]  # fmt: skip
        with _ending_studies(running):
            done = subprocess.run(line, cwd=folder, capture_output=True, text=True)
        assert running.get("/api/state").status_code == 200
        cases = json.loads(report.read_bytes())["test_cases"]["generated"]
        return Round(cases, done.returncode, done.stdout[-8000:] + done.stderr[-2000:])
    finally:
        running.stop()
        running.end_studies()


@contextmanager
def _ending_studies(running: Server) -> Iterator[None]:
    """Within it the studies that calls start end soon: each would compute for minutes."""
    over = threading.Event()

    def end() -> None:
        while not over.wait(3.0):
            with suppress(StudyError, OSError, AssertionError):  # a call may delete it meanwhile
                running.end_studies()

    thread = threading.Thread(target=end)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def main() -> int:
    """Make rounds until there were so many calls; 1 where an answer was not as it must be."""
    parser = argparse.ArgumentParser(prog="python -m tests.app.robustness.calls")
    parser.add_argument("--cases", type=int, default=10_000)
    parser.add_argument("--resume", type=Path, required=True, help="keeps what was done")
    arguments = parser.parse_args()
    # a shell has its background jobs ignore Ctrl-C, and servers that inherit that never end
    signal.signal(signal.SIGINT, signal.default_int_handler)
    stored = {"rounds": 0, "cases": 0, "failed": []}
    if arguments.resume.exists():
        stored = json.loads(arguments.resume.read_text(encoding="utf-8"))
    while stored["cases"] < arguments.cases:
        seed = stored["rounds"]
        which = COMMANDS if seed % 2 else EVERYTHING
        with tempfile.TemporaryDirectory(prefix="calls-") as folder:
            found = call(Path(folder), seed, which, EXAMPLES[which])
        stored["rounds"], stored["cases"] = seed + 1, stored["cases"] + found.cases
        stored["failed"] += [seed] if found.status else []
        write_whole(arguments.resume, json.dumps(stored).encode())
        print(f"round {seed}: {found.cases} calls, {stored['cases']} in all", flush=True)
        if found.status:
            print(found.said, flush=True)
    return 1 if stored["failed"] else 0


if __name__ == "__main__":
    sys.exit(main())
