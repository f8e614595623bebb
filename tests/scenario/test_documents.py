"""Documents keep their word: links lead somewhere, commands parse, snippets run, pages are new."""

import os
import re
import shlex
import subprocess
import sys
import tomllib
import xml.etree.ElementTree as ET
from functools import cache
from pathlib import Path
from typing import Any

import pytest

import teleop_core
import teleop_drill
import teleop_lab
import teleop_machines
from named import shown_in_help
from teleop_core.commands.cli import Call, parse
from teleop_core.commands.options import ParameterOptions
from teleop_core.evaluation.score import keys
from teleop_core.graph.layers import parse_setting
from teleop_core.session import api, virtual

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "docs"))
import blocks  # noqa: E402

STYLE = tomllib.loads((ROOT / "docs" / "words.toml").read_text(encoding="utf-8"))
TUTORIALS = sorted((ROOT / "docs" / "tutorials").glob("*.md"))
PAGES = [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("bags/*.md")]
NAMES = [path.relative_to(ROOT).as_posix() for path in sorted(PAGES)]
HISTORY = {"CHANGELOG.md", "docs/style.md"}  # what was written before, and the words themselves
HISTORY |= {name for name in NAMES if name.startswith("docs/changes/")}
COUNTS = {"four": 4, "five": 5, "six": 6, "seven": 7, "eight": 8}
PACKAGE_HEADING = "## As an installed package"


def text_of(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def snippets(text: str, language: str) -> list[str]:
    """Fenced blocks of a language."""
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.DOTALL | re.MULTILINE)


def commands(text: str) -> list[str]:
    """Lines of code that call ``teleop``, without their comments."""
    return re.findall(r"^ {4}(?:\S*/)?teleop (.+)$", text, re.MULTILINE)


def anchors(text: str) -> set[str]:
    """Anchors of the headings, as they are made from their texts."""
    heads = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head).strip().lower().replace(" ", "-") for head in heads}


def run(code: list[str], folder: Path, **env: str) -> "subprocess.CompletedProcess[str]":
    done = subprocess.run(
        [sys.executable, *code],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
        env=os.environ | env,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done


def test_every_relative_link_leads_somewhere() -> None:
    for name in NAMES:
        for target in re.findall(r"\]\(([^)\s]+)\)", text_of(name)):
            if "://" in target:
                continue
            path, _, anchor = target.partition("#")
            place = ((ROOT / name).parent / path).resolve() if path else ROOT / name
            assert place.exists(), (name, target)
            assert not anchor or anchor in anchors(place.read_text(encoding="utf-8")), (name, target)


def settings_of(call: Call | None) -> list[str]:
    """Texts ``key=value`` of the settings of a command."""
    values = () if call is None else call.arguments.arguments.values()
    return [text for value in values if isinstance(value, ParameterOptions) for text in value.texts]


def test_every_teleop_command_parses_with_its_settings() -> None:
    for line in dict.fromkeys(line for name in NAMES for line in commands(text_of(name))):
        words = shlex.split(line, comments=True)
        call = parse([word for word in words if word != "..."])
        for setting in settings_of(call):
            assert call is not None
            assert call.parts or parse_setting(setting)


@pytest.mark.slow
def test_every_session_of_a_documented_command_can_be_begun(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("bags", "config", "examples"):
        (tmp_path / name).symlink_to(ROOT / name)
    (tmp_path / "my_arm.urdf").symlink_to(ROOT / "examples/ur5e.urdf")  # "yours" of a document
    monkeypatch.chdir(tmp_path)
    begun = set()
    for line in [*shown_in_help(), *(line for name in NAMES for line in commands(text_of(name)))]:
        words = [word for word in shlex.split(line, comments=True) if word != "..."]
        call = parse(words)
        settings = settings_of(call)
        needs_more = re.search(r"\.(py|yaml|csv|stl)\b|=(gamepad|spacemouse|elsewhere|bags/)", line)
        if settings and call is not None and "scenario" in call.arguments.signature.parameters and not needs_more:
            scenario = call.arguments.arguments.get("scenario")
            virtual.VirtualTime(api.configuration(scenario, texts=settings))
            begun.add(line)
    assert len(begun) > 5


def test_no_sentence_has_more_words_than_the_style_allows() -> None:
    wrong = []
    for name in NAMES:
        for paragraph in re.split(r"\n\s*\n|\n(?=- )", "" if name == "CHANGELOG.md" else prose(name)):
            found = re.split(r"(?<=[.!?:;])\s+| · ", " ".join(paragraph.split()))
            wrong += [(name, one) for one in found if len(one.split()) > STYLE["longest_sentence"]]
    assert not wrong


@pytest.mark.parametrize(("avoided", "better"), (STYLE["instead"] | STYLE["glossary"]).items())
def test_no_page_has_a_word_that_the_style_avoids(avoided: str, better: str) -> None:
    for name in NAMES:
        text = "" if name in HISTORY else re.sub(r"`[^`]*`", "", prose(name))
        found = re.search(rf"\b(?:{avoided})", text, re.IGNORECASE)
        assert found is None, f"{name}: {found[0]!r}: say {better}"


@cache
def prose(name: str) -> str:
    """Sentences of a page: without code, tables and headings, links as they are read."""
    text = re.sub(r"```.*?```|<!--.*?-->", "", text_of(name), flags=re.DOTALL)
    text = re.sub(r"^( {4}|\||#).*$", "\n", text, flags=re.MULTILINE)
    return re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", text)


@pytest.mark.parametrize("path", TUTORIALS, ids=lambda path: path.stem)
def test_every_tutorial_teaches_one_thing_in_ten_minutes_and_opens_with_its_picture(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert text.count("**You learn:**") == 1
    assert text.count("```{code-cell} python\n:tags: [picture]\n") == 1
    words_a_minute = 120  # of somebody who reads the code too
    assert len(text.split()) <= 10 * words_a_minute


def test_every_block_that_says_so_is_run_or_parsed_by_the_tests() -> None:
    for name in NAMES:
        for language, code in re.findall(r"^```(\w+)\n(.*?)^```", text_of(name), re.DOTALL | re.M):
            if blocks.mark_of(language, code) == blocks.RUN_BY_TESTS:
                assert code in snippets(text_of(name), "python")
    parsed = "teleop sim --scenario coarse_box"
    assert blocks.mark_of("", parsed) == blocks.CHECKED
    assert commands(f"\n    {parsed}\n") == [parsed.removeprefix("teleop ")]
    for code in ("make demo", f"{parsed}\nros2 run teleop_core slave", "pip install teleop_core"):
        assert blocks.mark_of("", code) == blocks.NOT_RUN


def test_every_picture_is_drawn_by_the_build_or_says_which_version_it_shows() -> None:
    kept = {path.name for path in ROOT.glob("docs/**/*") if path.suffix in {".png", ".webp", ".gif"}}
    assert kept == set(blocks.TAKEN)
    assert (ROOT / "docs/images/console.webp").stat().st_size < 2e6


def test_generated_pages_are_what_the_code_says() -> None:
    run([str(ROOT / "docs" / "generate.py"), "--check", "--quick"], ROOT)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [name for name in NAMES if snippets(text_of(name).split(PACKAGE_HEADING)[0], "python")]
)
def test_python_of_a_document_runs_from_top_to_bottom(name: Any, tmp_path: Path) -> None:
    code = "\n".join(snippets(text_of(name).split(PACKAGE_HEADING)[0], "python"))
    (tmp_path / "document.py").write_text(code, encoding="utf-8")
    run(["document.py"], tmp_path)


@pytest.mark.slow
def test_parts_of_the_package_in_the_documents_are_there_once_it_is_installed(tmp_path: Path) -> None:
    section = text_of("docs/parts.md").split(PACKAGE_HEADING)[1]
    (tmp_path / "pyproject.toml").write_text(snippets(section, "toml")[0])
    (tmp_path / "my_teleop_parts.py").write_text(snippets(section, "python")[0])
    # What an editable installation does, without pip, which would ask an index for build tools.
    run(["-c", "import setuptools; setuptools.setup()", "-q", "egg_info"], tmp_path)
    sim = ["sim", "--duration", "1", "--out", "bag", "--set", "fixture=fence",
           "fixture.fence.room=0.02", "operator=still"]  # fmt: skip
    run(["-m", "teleop_core.commands.cli", *sim], tmp_path, PYTHONPATH=str(tmp_path))


def test_every_key_of_a_score_that_a_page_names_is_one() -> None:
    every = "\n".join(text_of(name) for name in NAMES if name not in HISTORY)
    named = set(re.findall(r"\.value\(\s*\"([\w.]+)\"", every))
    assert len(named) > 3
    for key in named - {"farthest.max"}:  # of a metric that the page itself makes
        assert any(known.covers(key.split(".")) for known in keys()), key


def test_pages_agree_on_how_many_distributions_and_extras_there_are() -> None:
    folders = [path.parent.name for path in ROOT.glob("src/*/pyproject.toml")]
    folders += [path.parent.name for path in ROOT.glob("src/*/setup.py")]
    count = len({name for name in folders if name != "crtk_msgs"})
    for name in ("README.md", "docs/install.md", "docs/use.md"):
        (said,) = set(re.findall(r"(\w+)\s+\[distributions\]", text_of(name)))
        assert COUNTS[said] == count, name
    setup = text_of("src/teleop_core/setup.py").split("extras_require")[1].split("\n    },")[0]
    extras = set(re.findall(r"^        \"(\w+)\": \[", setup, re.MULTILINE))
    (said,) = re.findall(r"(\w+) extras add more", text_of("docs/install.md"))
    assert COUNTS[said.lower()] == len(extras - {"test", "bench", "docs"})


def test_version_is_the_same_wherever_it_stands() -> None:
    version = teleop_core.__version__
    assert version == teleop_lab.__version__ == teleop_drill.__version__
    assert version == teleop_machines.__version__
    for package in (
        "teleop_core",
        "teleop_machines",
        "teleop_console",
        "teleop_exchange",
        "teleop_scene",
        "teleop_lab",
        "teleop_drill",
    ):
        assert ET.parse(ROOT / f"src/{package}/package.xml").findtext("version") == version
        assert f'VERSION = "{version}"' in text_of(f"src/{package}/setup.py")
    for said in (f'version = "{version}"', f"teleop_core=={version}"):
        assert said in text_of("src/lerobot_robot_teleop_core/pyproject.toml")
    assert re.findall(r"^## (\d\S*)", text_of("CHANGELOG.md"), re.MULTILINE) == [version]


def test_each_release_is_told_in_at_most_forty_lines() -> None:
    pages = sorted((ROOT / "docs/changes").glob("*.md"))
    texts = [path.read_text(encoding="utf-8") for path in pages]
    newest = text_of("CHANGELOG.md").split("\n## ")[-1]
    assert pages
    assert max(len(text.splitlines()) for text in [*texts, newest]) <= 40
