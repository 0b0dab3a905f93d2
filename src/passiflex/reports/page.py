"""One HTML file that needs nothing else, and in which no text of a run can be anything but text."""

from __future__ import annotations

import html
import json
from collections.abc import Mapping
from typing import Any

from passiflex.reports.viewer import Viewer

POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:; "
    "base-uri 'none'; form-action 'none'"
)
"""The page may run its own script and make its own pictures; it can reach no network."""
ESCAPED = {ord(c): f"\\u{ord(c):04x}" for c in "<>&\u2028\u2029"}
"""Characters of JSON that could end its element, or begin another."""


def page_text(title: str, header: Mapping[str, Any], data: str, viewer: Viewer) -> str:
    """Return the document.

    Parameters
    ----------
    title: Of the window; any text.
    header: What the page says, as JSON; its numbers are finite.
    data: The numbers of its arrays, as `Arrays.text` gives them.
    """
    said = json.dumps(header, allow_nan=False, separators=(",", ":")).translate(ESCAPED)
    shown = html.escape(title).encode("utf-8", "replace").decode("utf-8")
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{POLICY}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="generator" content="passiflex">
<title>{shown}</title>
<style>
{viewer.style}
</style>
</head>
<body>
<div id="app"></div>
<noscript>This report is drawn by its own script, which this browser does not run.</noscript>
<script type="application/json" id="passiflex-report">{said}</script>
<script type="text/plain" id="passiflex-data">{data}</script>
<script type="text/plain" id="passiflex-licences">
{viewer.licences}
</script>
<script>
{viewer.script}
</script>
</body>
</html>
"""
