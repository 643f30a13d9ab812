"""The manual under ``/manual/``: built pages, which load nothing from another host."""

from __future__ import annotations

import base64
import hashlib
import os
import re
from functools import lru_cache
from pathlib import Path

from starlette.exceptions import HTTPException
from starlette.responses import FileResponse, HTMLResponse, Response
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

from app.paths import manual_folder

CONTENT_POLICY = (
    "default-src 'self'; script-src 'self'{scripts}; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data:; object-src 'none'; base-uri 'none'; frame-ancestors 'none'"
)
"""Of its pages: the scripts of a few lines that stand in them, and nothing of another host."""

NOT_BUILT = """<!doctype html><html lang="en"><meta charset="utf-8">
<title>The manual is not built</title>
<body style="font: 16px/1.6 system-ui, sans-serif; max-width: 40rem; margin: 4rem auto">
<h1>The manual is not built</h1>
<p>This workbench runs from a checkout without built pages. In its folder:</p>
<pre>.venv/bin/pip install --quiet --editable .</pre>
<p>builds them; with the tools of <code>.[docs]</code> installed, so does</p>
<pre>.venv/bin/mkdocs build --strict --config-file static/manual/mkdocs.yml</pre>
<p>Then load this page again. The texts are in <code>static/manual/pages/</code>.</p>"""
"""What is said where there are none."""


@lru_cache(maxsize=256)
def _scripts(page: str, changed: int) -> str:
    """The digests of the scripts in a page, as a policy names them."""
    text = Path(page).read_text(encoding="utf-8")
    digests = (
        base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
        for script in re.findall(r"<script(?![^>]*\ssrc=)[^>]*>(.*?)</script>", text, re.DOTALL)
    )
    return "".join(f" 'sha256-{digest}'" for digest in dict.fromkeys(digests))


class Manual(StaticFiles):
    """The built pages; looked for at each request, so that a build shows at once."""

    def __init__(self, folder: Path | None = None) -> None:
        """
        Args:
            folder: Of the pages; where the installation has them, if none.
        """
        super().__init__(directory=folder or manual_folder(), html=True, check_dir=False)
        self.config_checked = True  # that the folder is missing is said in words

    async def get_response(self, path: str, scope: Scope) -> Response:
        assert self.directory is not None
        if not Path(self.directory, "index.html").is_file():
            return HTMLResponse(NOT_BUILT, 404)
        try:
            response = await super().get_response(path, scope)
        except RuntimeError as error:  # a new build removes the folder for a moment
            raise HTTPException(404) from error
        if isinstance(response, FileResponse):
            page = str(response.path)
            scripts = _scripts(page, os.stat(page).st_mtime_ns) if page.endswith(".html") else ""
            response.headers["content-security-policy"] = CONTENT_POLICY.format(scripts=scripts)
        response.headers["cache-control"] = "no-cache"  # kept, but checked by its ETag
        return response
