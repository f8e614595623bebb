"""Files from outside that cannot be used: cases of a table, and the law that all of them keep."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd
import pytest

from teleop_core.base import ParameterError, TeleopError

Step = Callable[[Path], object]


class Case(NamedTuple):
    """A reader, the name of its file, what stands in it (None: there is no file), the error, and words of its text."""

    read: Step
    name: str
    content: Any
    error: type[TeleopError]
    words: str


def of(read: Step, name: str, *rows: tuple[Any, str], error: type[TeleopError] = ParameterError) -> list[Case]:
    """Cases of one reader: what stands in the file, and words of the refusal.

    A content is a text, bytes, a table, or a function that makes what it likes at a path.
    """
    return [Case(read, name, content, error, words) for content, words in rows]


def assert_refused(case: Case, folder: Path) -> None:
    """The reader refuses what it finds with that error, in one line with those words, and writes nothing."""
    path = folder / case.name
    if isinstance(case.content, pd.DataFrame):
        case.content.to_csv(path, index=False)
    elif callable(case.content):
        case.content(path)
    elif case.content is not None:
        path.write_bytes(case.content.encode() if isinstance(case.content, str) else case.content)
    before = sorted(folder.rglob("*"))
    with pytest.raises(case.error) as refused:
        case.read(path)
    assert re.search(case.words, str(refused.value)), refused.value
    assert "\n" not in str(refused.value)
    assert sorted(folder.rglob("*")) == before
