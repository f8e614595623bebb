"""Page template: the report page is one file; its style and scripts are files beside this module."""

from functools import cache
from importlib.resources import files

# The browser refuses every request of the page. Evaluation of code is allowed, because plotly.js compiles its shaders.
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval'; style-src 'unsafe-inline'; "
    "img-src data: blob:; font-src data:; worker-src blob:"
)
_SCRIPTS = ("theme", "unpack", "thin", "bands", "paths", "plot", "recording", "page")


@cache
def style() -> str:
    """Style sheet of the page."""
    return text_of("style.css")


@cache
def script() -> str:
    """All scripts as one text; each script may use the scripts before it."""
    parts = "\n".join(text_of(f"{name}.js") for name in _SCRIPTS)
    return f'"use strict";\n(function () {{\n{parts}}})();\n'


def text_of(name: str) -> str:
    """Text of a file beside this module."""
    return (files("teleop_console.report") / name).read_text(encoding="utf-8")


PAGE = """\
<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<link rel="icon" href="data:,">
<title>{title}</title>
<style>
{style}</style>
</head>
<body data-drawn="0">
<main>
<noscript><p class="notice">This page draws its plots with JavaScript, which is off here. Tables are
there without it; nothing is loaded from anywhere.</p></noscript>
<p id="errors" class="error"></p>
{body}
</main>
<script id="page-data" type="application/json">{data}</script>
<script id="plotly" type="text/plain">{plotly}</script>
<!-- The last script but one is {library}, deflated; MIT license, Copyright Plotly, Inc. -->
<script>
{script}</script>
</body>
</html>
"""

TIMES = """\
<div class="times" id="{place}" hidden>
<div class="strip" tabindex="0" role="group"
 aria-label="Visible time: drag it, or use the arrow keys"
 title="Drag the marked part or its ends; double-click for all">
<canvas></canvas><div class="view"></div></div>
<div class="range">
<label>time <input class="from" type="number" step="any" aria-label="from, in seconds"></label>
<label>to <input class="to" type="number" step="any" aria-label="to, in seconds"></label>
<span>of {duration} s</span>
<span class="buttons">
<button class="earlier" title="earlier" aria-label="earlier">◀</button>
<button class="later" title="later" aria-label="later">▶</button>
<button class="closer" title="zoom in" aria-label="zoom in">+</button>
<button class="further" title="zoom out" aria-label="zoom out">−</button>
<button class="all" title="the whole recording">all</button></span>
<span class="told"></span></div>
</div>
"""
