"""Settings of the site that ``make docs`` builds from these pages."""

import re
import shutil
import sys
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

from docutils import nodes

import teleop_core
from teleop_core.commands.cli import main

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

from blocks import mark_of, taken_by  # noqa: E402

project = "teleop_core"
author = "teleop_core maintainers"
version = release = teleop_core.__version__

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode", "sphinxcontrib.mermaid"]
html_theme = "furo"
html_title = f"teleop_core {version}"
html_copy_source = False
html_static_path = ["_static"]
html_css_files = ["site.css"]
templates_path = ["_templates"]  # sidebar/variant-selector.html: the menu of versions

# Pages are plain Markdown that reads well on GitHub too.
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4
myst_fence_as_directive = ["mermaid"]

# Tutorials run when their page is built; one that raises or takes too long fails the build.
nb_execution_mode = "force"
nb_execution_timeout = 600
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
OUTSIDE = {"../README.md": "index.md", "../CHANGELOG.md": "changelog.md", "../examples": "examples.md"}


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
        parts.append("\n".join(["", "```{toctree}", ":hidden:", f":caption: {caption}", *pages, "```"]))
    return "\n".join(parts) + "\n"


def versions() -> dict[str, Any]:
    """What the menu of versions shows: releases and their pages, and whether this is one."""
    text = (HERE.parent / "CHANGELOG.md").read_text(encoding="utf-8")
    newest = re.findall(r"^## (\d\S*)", text, re.MULTILINE)
    older = sorted((path.stem for path in (HERE / "changes").glob("*.md")), reverse=True)
    pages = [*((name, "changelog") for name in newest), *((name, f"changes/{name}") for name in older)]
    unreleased = text.partition("## Unreleased")[2].partition("\n## ")[0]
    return {"versions": pages, "is_ahead": bool(unreleased.strip())}


html_context = versions()


def mark(app: object, document: nodes.document) -> None:
    """Put a picture at the top of a tutorial, and a mark below each block and picture."""
    for image in list(document.findall(nodes.image)):
        text = taken_by(image["uri"])
        if text:
            below(image.parent if isinstance(image.parent, nodes.paragraph) else image, text)
    for cell in list(document.findall(is_code_cell)):
        describe(cell)
        if "tag_picture" in cell["classes"]:
            raise_picture(document, cell)
    for block in list(document.findall(nodes.literal_block)):
        if not any(is_code_cell(parent) for parent in ancestors(block)):
            below(block, mark_of(block.get("language", ""), block.astext()))


def is_code_cell(node: nodes.Node) -> bool:
    """Whether a node is a cell that ran in this build, with its outputs."""
    return isinstance(node, nodes.container) and node.get("nb_element") == "cell_code"


def ancestors(node: nodes.Node) -> list[nodes.Node]:
    """All nodes around a node, the nearest first."""
    return [] if node.parent is None else [node.parent, *ancestors(node.parent)]


def below(node: nodes.Node, text: str) -> None:
    """Put a mark below a node."""
    if text:
        place = node.parent.index(node) + 1
        node.parent.insert(place, nodes.paragraph("", text, classes=["mark"]))


def describe(cell: nodes.container) -> None:
    """Give plots without a description the heading above them, for those who cannot see them."""
    sections = [node for node in ancestors(cell) if isinstance(node, nodes.section)]
    for image in cell.findall(nodes.image):
        image.setdefault("alt", f"Plot: {sections[0].next_node(nodes.title).astext()}")


def raise_picture(document: nodes.document, cell: nodes.container) -> None:
    """Show the plot of a cell below the title too: what the page leads to."""
    title = document.next_node(nodes.title)
    plots = [part for part in cell.findall(is_output) if part.next_node(nodes.image)]
    title.parent.insert(title.parent.index(title) + 1, plots[-1].deepcopy())


def is_output(node: nodes.Node) -> bool:
    """Whether a node holds one output of a cell in all its forms."""
    return isinstance(node, nodes.container) and node.get("nb_element") == "mime_bundle"


def write_report(app: Any, error: Exception | None) -> None:
    """Run a session and write its report beside the page that shows it."""
    file, bag = Path(app.outdir) / "report_of_this_build.html", Path(app.doctreedir) / "session"
    if error is None and not file.exists():
        shutil.rmtree(bag, ignore_errors=True)
        with redirect_stdout(StringIO()):
            main(["sim", "--scenario", "coarse_box", "--duration", "15", "--out", str(bag)])
            main(["evaluate", str(bag), "--html", str(file)])


def setup(app: Any) -> None:
    """Have Sphinx call ``read`` for each page, ``mark`` after its cells, ``write_report`` last."""
    app.connect("source-read", read)
    app.connect("doctree-read", mark)
    app.connect("build-finished", write_report)
