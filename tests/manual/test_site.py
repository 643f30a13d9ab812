"""The built manual: complete, without warnings, and without another host."""

from __future__ import annotations

import ast
import json
import os
import re
import subprocess
import sys
import zlib
from collections.abc import Iterator
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from app.paths import static_folder
from app.web.manual import CONTENT_POLICY, Manual
from tests.manual.places import MANUAL, ROOT
from tracker.parameters.catalogue import GROUPS, METHODS, PARAMETERS

pytestmark = pytest.mark.full


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The manual, built with every warning an error."""
    folder = tmp_path_factory.mktemp("manual")
    line = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet"]
    line += ["--config-file", str(MANUAL / "mkdocs.yml"), "--site-dir", str(folder)]
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(line, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture(scope="module")
def client(site: Path) -> TestClient:
    """What serves it."""
    return TestClient(Manual(site))


def test_every_public_name_of_the_engine_is_in_the_api(site: Path) -> None:
    inventory = (site / "objects.inv").read_bytes().split(b"\n", 4)[4]
    known = {line.split(" ")[0] for line in zlib.decompress(inventory).decode().splitlines()}
    missing = sorted(name for name in public_names() if name not in known)
    assert not missing


def public_names() -> Iterator[str]:
    """Every module, class, function and method of the engine without an underscore in front."""
    for path in (ROOT / "tracker").rglob("*.py"):
        parts = list(path.relative_to(ROOT).with_suffix("").parts)
        if parts[-1] == "__init__":
            parts.pop()
        if any(part.startswith("_") for part in parts):
            continue
        module = ".".join(parts)
        yield module
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if not isinstance(node, ast.FunctionDef | ast.ClassDef) or node.name.startswith("_"):
                continue
            yield f"{module}.{node.name}"
            for part in node.body if isinstance(node, ast.ClassDef) else ():
                if isinstance(part, ast.FunctionDef) and not part.name.startswith("_"):
                    yield f"{module}.{node.name}.{part.name}"


def test_every_parameter_has_its_place(site: Path) -> None:
    page = (site / "tuning" / "index.html").read_text(encoding="utf-8")
    anchors = set(re.findall(r'id="([^"]+)"', page))
    assert {*PARAMETERS, *GROUPS, *METHODS} <= anchors


def test_nothing_is_asked_of_another_host(site: Path) -> None:
    asked = re.compile(r'<(?:script|link|img|iframe)\b[^>]*?(?:src|href)="(?:https?:)?//[^"]*"')
    for page in site.rglob("*.html"):
        found = [
            tag
            for tag in asked.findall(page.read_text(encoding="utf-8"))
            if 'rel="canonical"' not in tag
        ]
        assert not found, page
    for sheet in site.rglob("*.css"):
        assert not re.search(r"url\(\s*['\"]?(?:https?:)?//", sheet.read_text(encoding="utf-8"))


def test_the_search_finds_a_parameter(site: Path) -> None:
    index = json.loads((site / "search" / "search_index.json").read_text(encoding="utf-8"))
    assert any(entry["location"] == "tuning/#fusion.clutter_rate" for entry in index["docs"])


def test_equations_need_no_script(site: Path) -> None:
    page = (site / "methods" / "index.html").read_text(encoding="utf-8")
    assert page.count("<math") > 20
    assert "$" not in re.sub(r"<(code|script|math).*?</\1>", "", page, flags=re.S)


def test_it_is_served(client: TestClient) -> None:
    for place in ("/", "/tuning/", "/search/search_index.json"):
        answer = client.get(place)
        assert answer.status_code == 200
        policy = answer.headers["content-security-policy"]
        assert policy.startswith(CONTENT_POLICY.partition("{")[0])
        assert ("'sha256-" in policy) == place.endswith("/")
        assert "script-src 'self' 'unsafe-inline'" not in policy


def test_the_page_leads_to_pages_that_there_are(site: Path) -> None:
    page = (static_folder() / "index.html").read_text(encoding="utf-8")
    places = re.findall(r'href="/manual/([^"#]*)(?:#([^"]*))?"', page)
    assert places
    for place, anchor in places:
        built = (site / place / "index.html").read_text(encoding="utf-8")
        assert not anchor or f'id="{anchor}"' in built


def test_without_pages_it_says_how_to_build_them(tmp_path: Path) -> None:
    answer = TestClient(Manual(tmp_path)).get("/")
    assert answer.status_code == 404
    assert "pip install --quiet --editable ." in answer.text
