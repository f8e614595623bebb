"""Fuzzing: one law for whatever comes from outside, tried on very many cases.

A case hands something broken to the package: a file, a text, the bytes of a message. The law: it either works or is
refused with a :class:`TeleopError` of one printable line, within bounds of time and memory. A target is a test that
:func:`fuzz` turns into so many cases; its own claims come on top::

    from fuzzing import TEXTS, fuzz

    @fuzz("settings", text=TEXTS)
    def test_any_setting_is_taken_or_refused(text):
        parse_setting(text)

Cases are shared out by :data:`SHARES`, to which a new target adds itself. ``TELEOP_FUZZ_CASES``
says how many there are in all: 8,000 in every test run, the same ones each time; 1,000,000 by
``make fuzz``, other ones each time. A case that fails is printed, and shrunk to a small one.
"""

import functools
import inspect
import os
import resource
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from teleop_core.base.errors import TeleopError
from teleop_core.base.texts import LONGEST_LINE, printable

USUAL = 8_000
CASES = int(os.environ.get("TELEOP_FUZZ_CASES", USUAL))
SHARES = {
    "CDR": 0.33,
    "chunks": 0.22,
    "command calibrate": 0.0075,
    "command console": 0.0075,
    "command evaluate": 0.0075,
    "command export": 0.0075,
    "command import": 0.0075,
    "command play": 0.0075,
    "command reach": 0.0075,
    "command recover": 0.0075,
    "command replay": 0.0075,
    "configurations": 0.02,
    "imports": 0.05,
    "metadata": 0.06,
    "recordings": 0.08,
    "robot tables": 0.01,
    "settings": 0.06,
    "state commands": 0.06,
    "stored configurations": 0.02,
    "table of rests": 0.02,
}
"""Part of all cases that each target gets; less where a case takes long."""
TIME = 60
"""Seconds for one case before it counts as a hang: thousands of times what a case takes."""
MEMORY = 2 << 30
"""Bytes that one case may take beside what the process has: far above the largest chunk."""


class HangError(BaseException):
    """A case went on for longer than :data:`TIME`; no handler of ours may catch it."""


def cases(target: str, parts: int = 1) -> int:
    """Cases that each of so many tests of a target gets."""
    assert sum(SHARES.values()) <= 1.0 + 1e-9, "the shares are more than all"
    return max(1, round(CASES * SHARES[target] / parts))


def fuzz(
    target: str, parts: int = 1, **strategies: st.SearchStrategy
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Test that tries a target on its cases, drawn from ``strategies`` by argument.

    Args:
        target: One of :data:`SHARES`.
        parts: Tests among which the cases of the target are shared out.
        **strategies: Where the arguments of the test come from.
    """

    def decorate(test: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(test)
        def case(*arguments: object, **drawn: object) -> None:
            _untold.append(target)
            if len(_untold) == _TOLD:
                _tell()
            with lawful():
                test(*arguments, **drawn)

        chosen = settings(
            max_examples=cases(target, parts),
            deadline=None,
            database=None,
            print_blob=True,
            derandomize=CASES == USUAL,
            phases=(Phase.explicit, Phase.generate, Phase.shrink),
            suppress_health_check=list(HealthCheck),
        )
        tried = chosen(given(**strategies)(case))

        def counted(**fixtures: object) -> None:
            try:
                tried(**fixtures)
            finally:
                _tell()

        counted.__name__, counted.__doc__ = test.__name__, test.__doc__
        counted.__signature__ = inspect.signature(tried)  # type: ignore[attr-defined]
        return counted

    return decorate


_untold: list[str] = []
"""Target of each case that is not in the file of counts yet."""
_TOLD = 500


def _tell() -> None:
    """Add how many cases were tried to the file of ``TELEOP_FUZZ_COUNTS``, if there is one."""
    place = os.environ.get("TELEOP_FUZZ_COUNTS")
    if place and _untold:
        with open(place, "a", encoding="utf-8") as file:
            file.write(f"{len(_untold):8} {_untold[0]}\n")
    _untold.clear()


@contextmanager
def lawful() -> Iterator[None]:
    """One case: it works, or is refused in one printable line, within the bounds."""
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    signal.signal(signal.SIGALRM, _hangs)
    signal.setitimer(signal.ITIMER_REAL, TIME)
    resource.setrlimit(resource.RLIMIT_AS, (_size() + MEMORY, hard))
    try:
        yield
    except TeleopError as error:
        assert_one_line(str(error))
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
        signal.setitimer(signal.ITIMER_REAL, 0)


def assert_one_line(text: str) -> None:
    """Make sure that a message is one that a terminal can show."""
    assert text
    assert len(text) <= LONGEST_LINE, f"{len(text)} characters: {text}"
    assert "\n" not in text
    assert printable(text) == text


def _hangs(*_: object) -> None:
    raise HangError(f"a case takes longer than {TIME} s")


def _size() -> int:
    """Bytes of address space that the process has now."""
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[0]) * resource.getpagesize()


# -- what is broken ------------------------------------------------------------------------------

NASTY = (
    "", " ", "=", "null", "~", "true", "yes", "0", "-1", "1e400", ".nan", ".inf", "-.inf", "1e-400",
    "0x" + "f" * 300, "9" * 400, "9" * 5000, "1:30:59", "0b", "-0b_", "0x_", "!!int x", "!!float x",
    "!!bool 2", "!!binary x", "!!timestamp 2021-13-45", "2021-13-45", "2021-02-30 25:61:61",
    "!!set [1]", "!!omap x", "!!pairs [1]", "!!null 3", "!!str [1]", "!!python/none",
    "!!python/object/apply:os.system [ls]", "!a!b c", "!<x> 1", "&a [*a]", "&a {x: *a}", "*a",
    "<<: 3", "{<<: &a {b: 1}, <<: *a}", "[1, 2", "]", "{a: b", "a: b: c", "? ", "- - - -",
    "[" * 400, "{a: " * 200, "[" * 300 + "]" * 300, "[[1], [2]]", "{[1]: 2}", "{{}: 3}",
    "%YAML 9.9\n---\na", "--- a\n--- b", "\x1b[31mred", '"\\e[31mred"', '"\\0"', "\ufeff", "\x00",
    "\x85", "\u202e", "a" * 5000, "[" + "1, " * 500 + "]", "'", '"', "|", ">", "`", "@", "\t- a",
    "..", "/", "/dev/zero", "/dev/null", "/proc/self/mem", "../../../etc/passwd", "~root",
    "a/b/c.d.e",
    "{a: &a [x, x, x], b: &b [*a, *a, *a], c: &c [*b, *b, *b], d: [*c, *c, *c]}",
    "[&a [x,x,x,x,x,x,x,x], &b [*a,*a,*a,*a,*a,*a,*a,*a], &c [*b,*b,*b,*b,*b,*b,*b,*b], "
    "&d [*c,*c,*c,*c,*c,*c,*c,*c], &e [*d,*d,*d,*d,*d,*d,*d,*d], [*e,*e,*e,*e,*e,*e,*e,*e]]",
)  # fmt: skip
"""Texts that have broken readers of YAML, ours or others."""
TEXTS = st.one_of(
    st.sampled_from(NASTY),
    st.text(max_size=30),
    st.integers(-(10**30), 10**30).map(str),
    st.floats().map(repr),
    st.lists(st.one_of(st.integers(), st.floats(), st.text(max_size=5)), max_size=8).map(repr),
)
"""Values as a user, or nobody in his right mind, would write them."""


KINDS = ("flip", "flip", "cut", "repeat", "put", "number", "length", "end")


@st.composite
def damaged(draw: st.DrawFn, whole: bytes, most: int = 4) -> bytes:
    """Bytes of which some are flipped, cut out, repeated or replaced, or whose end is missing."""
    data = bytearray(whole)
    for _ in range(draw(st.integers(1, most))):
        at = draw(st.integers(0, max(0, len(data) - 1)))
        kind = draw(st.sampled_from(KINDS))
        count = draw(st.integers(1, 40))
        if kind == "flip" and data:
            data[at] ^= 1 << draw(st.integers(0, 7))
        elif kind == "cut":
            del data[at : at + count]
        elif kind == "repeat":
            data[at:at] = data[at : at + count]
        elif kind == "put":
            data[at:at] = draw(st.binary(max_size=12))
        elif kind == "number":  # what lengths and times must not be believed in
            value = draw(st.sampled_from((0, 1, 2**31 - 1, 2**32 - 1, 2**62, 2**63, 2**64 - 1)))
            data[at : at + 8] = value.to_bytes(8, "little")
        elif kind == "length":  # the same of four bytes, or one that is nearly right
            by = draw(st.sampled_from((1, -1, 2**16, 2**31 - 1, 2**31, -(2**16))))
            value = (int.from_bytes(data[at : at + 4], "little") + by) % 2**32
            data[at : at + 4] = value.to_bytes(4, "little")
        elif kind == "end":
            del data[at:]
    return bytes(data)
