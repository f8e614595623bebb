"""Texts: make texts from files, topics and users safe to show on a terminal."""

LONGEST_LINE = 600
"""Largest number of characters of a message; a terminal shows it in a few rows."""
LONGEST_VALUE = 200
"""Largest number of characters of a value in a message."""

_CONTROLS = {code: 0x2400 + code for code in range(32) if chr(code) not in "\n\t"} | {0x7F: 0x2421}
_HIDDEN = dict.fromkeys(
    [*range(0x80, 0xA0), *range(0x202A, 0x202F), *range(0x2066, 0x206A), *range(0xD800, 0xE000)], 0xFFFD
)
_SHOWN = _CONTROLS | _HIDDEN


def printable(text: str) -> str:
    """The text with all control characters replaced by visible characters.

    Control characters of the first set become their pictures (``ESC`` is U+241B). Control characters of the second
    set, marks that reverse the direction of writing, and single surrogates become U+FFFD. Newlines and tabs stay.
    """
    return text if text.isascii() and text.isprintable() else text.translate(_SHOWN)


def one_line(text: str, longest: int = LONGEST_LINE) -> str:
    """The text on one printable line of at most ``longest`` characters, cut in the middle."""
    if len(text) > 20 * longest:  # text far beyond the shown part need not be processed
        text = f"{text[: 10 * longest]} … {text[-10 * longest :]}"
    line = printable(" ".join(text.split()))
    if len(line) <= longest:
        return line
    end = longest // 4
    return f"{line[: longest - end - 3]} … {line[-end:]}"


def shown(value: object, longest: int = LONGEST_VALUE) -> str:
    """Text of a value for messages: its ``repr``, cut in the middle."""
    if isinstance(value, int) and value.bit_length() > 1000:  # Python refuses to write some numbers
        return f"a number of about {value.bit_length() * 301 // 1000} digits"
    if isinstance(value, str | bytes) and len(value) > 10 * longest:
        value = value[: 10 * longest]
    try:
        text = repr(value)
    except (ValueError, RecursionError):  # a nested number of that size
        return f"a {type(value).__name__} that is too large to show"
    return one_line(text, longest)
