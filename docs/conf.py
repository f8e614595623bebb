"""Settings of the site that ``make docs`` builds from these pages."""

import re
from typing import Any

import teleop_core

project = "teleop_core"
author = "teleop_core maintainers"
version = release = teleop_core.__version__

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinxcontrib.mermaid",
]
html_theme = "furo"
html_title = f"teleop_core {version}"
html_copy_source = False

# Pages are plain Markdown that reads well on GitHub too.
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4
myst_fence_as_directive = ["mermaid"]

# Tutorials run when their page is built; one that raises or takes too long fails the build.
nb_execution_mode = "force"
nb_execution_timeout = 300
nb_execution_raise_on_error = True
nb_merge_streams = True

autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
maximum_signature_line_length = 88
napoleon_numpy_docstring = False
napoleon_use_ivar = True  # what a docstring tells of attributes stands once
napoleon_custom_sections = ["Source"]

# Pages of the site for what lies outside of this folder.
OUTSIDE = {
    "../README.md": "index.md",
    "../CHANGELOG.md": "changelog.md",
    "../examples": "examples.md",
}


def read(app: object, name: str, source: list[str]) -> None:
    """Lead links to documents outside to their pages; give the first page its menu."""
    for target, page in OUTSIDE.items():
        source[0] = re.sub(rf"\]\({re.escape(target)}(#[^)]*)?\)", f"]({page})", source[0])
    if name == "index":
        source[0] += menu(source[0])


def menu(text: str) -> str:
    """The menu of the site: the pages that each section of the first page links, in their order."""
    parts = []
    for section in re.split(r"^## ", text, flags=re.MULTILINE)[1:]:
        caption, _, body = section.partition("\n")
        pages = [name for name in re.findall(r"\]\(([\w/]+)\.md\)", body) if name != "index"]
        parts.append(
            "\n".join(["", "```{toctree}", ":hidden:", f":caption: {caption}", *pages, "```"])
        )
    return "\n".join(parts) + "\n"


def setup(app: Any) -> None:
    """Have Sphinx call ``read`` for each page."""
    app.connect("source-read", read)
