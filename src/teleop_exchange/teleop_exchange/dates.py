"""Dates: texts of dates and times of the day in the usual forms, as nanoseconds since 1970."""

import re
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

FORMS = (
    "read are 2025-04-02T09:30:00.5, with / or . between the numbers, 02.04.2025 09:30:00,5, 02-Apr-2025 09:30:00, "
    "20250402T093000 and 09:30:00.5, with a zone such as Z, +02 or +02:00"
)
"""The forms of dates that are read, for messages."""
_MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
_TIME = r"(?P<h>\d\d?):(?P<min>\d\d)(?::(?P<s>\d\d?))?(?:[.,:](?P<part>\d+))?"
_SHORT_TIME = r"(?P<h>\d\d)(?P<min>\d\d)(?P<s>\d\d)(?:[.,](?P<part>\d+))?"
_ZONE = r"\s*(?P<zone>Z|UTC|GMT|[+-]\d\d(?::?\d\d)?)?"
_DATES = [
    re.compile(rf"\s*{form}{_ZONE}\s*", re.I)
    for form in (
        rf"(?P<y>\d{{4}})(?P<gap>[-/.])(?P<m>\d\d?)(?P=gap)(?P<d>\d\d?)[-T _]\s*{_TIME}",
        rf"(?P<d>\d\d?)\.(?P<m>\d\d?)\.(?P<y>\d{{4}})[T _]\s*{_TIME}",
        rf"(?P<d>\d\d?)(?P<gap>[- ])(?P<name>{'|'.join(_MONTHS)})(?P=gap)(?P<y>\d{{4}})\s+{_TIME}",
        rf"(?P<y>\d{{4}})(?P<m>\d\d)(?P<d>\d\d)[T _](?:{_TIME})",
        rf"(?P<y>\d{{4}})(?P<m>\d\d)(?P<d>\d\d)[T _]{_SHORT_TIME}",
        _TIME,
    )
]
"""Years first, days first between dots or before a name, times of the day. Others could mix up days and months."""
_PLAIN = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d:\d\d(?:\.\d{1,9})?(Z|[+-]\d\d:\d\d)?")
_LIKE = re.compile(r"\d\d?:\d\d|\d[-/.]\d\d?[-/.]\d|\d{8}T?\d{6}")
_MINUTE_NS = 60_000_000_000


def is_date(text: str) -> bool:
    """Whether a text is a date with a time, or a time of the day, in one of the forms that are read."""
    return _match(text) is not None


def has_zone(texts: Sequence[str]) -> bool | None:
    """Whether dates in the form that fast readers know have a zone; None for other forms, or if only some have one."""
    found = [_PLAIN.fullmatch(text.strip()) for text in texts]
    zones = {bool(one[1]) for one in found if one}
    return zones.pop() if len(zones) == 1 and all(found) else None


def looks_like_date(text: str) -> bool:
    """Whether a text may be a date in any form."""
    return bool(_LIKE.search(text))


def nanoseconds(texts: Sequence[str | None]) -> NDArray[np.int64] | NDArray[np.float64]:
    """Dates as times since 1970 [ns]; dates without a zone are UTC, and times of the day are those of one day.

    The result has floating-point numbers if texts are missing, with NaN for these.

    Raises:
        ValueError: A text is not a date.
    """
    found = [_nanoseconds(text) if text and text.strip() else None for text in texts]
    if None in found:
        return np.array([np.nan if one is None else one for one in found], np.float64)
    return np.array(found, np.int64)


def _match(text: str) -> re.Match[str] | None:
    return next((found for pattern in _DATES if (found := pattern.fullmatch(text))), None)


def _nanoseconds(text: str) -> int:
    """One date [ns].

    Raises:
        ValueError: The text is not a date.
    """
    if (found := _match(text)) is None:
        raise ValueError(f"holds {text!r}, which is no date; {FORMS}")
    parts = found.groupdict()
    minute = f"{parts['h']:0>2}:{parts['min']}{(parts['zone'] or 'Z').upper()}"
    day = "1970-01-01"
    if parts.get("y"):
        month = 1 + _MONTHS.index(parts["name"].lower()) if parts.get("name") else parts["m"]
        day = f"{parts['y']}-{month:0>2}-{parts['d']:0>2}"
    return _minute_ns(day, minute) + int(parts["s"] or 0) * 1_000_000_000 + int(f"{parts['part'] or 0:0<9}"[:9])


@lru_cache(4096)
def _minute_ns(day: str, minute: str) -> int:
    """Beginning of a minute [ns]; all dates of a minute share it.

    Raises:
        ValueError: There is no such day, time or zone.
    """
    time, zone = minute[:5], minute[5:]
    begin = np.datetime64(f"{day}T{time}", "ns").astype(np.int64)
    if zone[0] not in "+-":
        return int(begin)
    digits = zone[1:].replace(":", "").ljust(4, "0")
    offset = (int(digits[:2]) * 60 + int(digits[2:])) * _MINUTE_NS
    return int(begin) - (offset if zone[0] == "+" else -offset)
