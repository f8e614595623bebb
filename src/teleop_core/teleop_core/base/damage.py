"""Damage: whatever a reader raises about the content of a file becomes one refusal that names it.

Readers of others (rosbags, mcap, pyarrow, pandas, SQLite, decompressors) raise what they like about
bytes that lie: ``struct.error``, ``OverflowError``, ``MemoryError``, errors of their own. Every
place that opens a file reads it within :func:`damage_told`, and nowhere else are these translated.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from teleop_core.base.errors import RecordingError, TeleopError
from teleop_core.base.plain_yaml import UnreadableError, check_regular


@contextmanager
def damage_told(path: Path | str, said: str = "cannot be read: {}") -> Iterator[None]:
    """Tell what goes wrong while a file is read.

    Args:
        path: The file; must be no pipe and no device.
        said: What is said of it, with ``{}`` for the reader's own words.

    Raises:
        RecordingError: The file is missing, or its content is not what its reader takes.
        TeleopError: As it was raised within.
    """
    path = Path(path)
    try:
        check_regular(path)
        yield
    except TeleopError:
        raise
    except UnreadableError as error:
        raise RecordingError(path, str(error)) from error
    except OSError as error:
        reason = error.strerror or " ".join(str(error).split())
        raise RecordingError(path, f"cannot be read: {reason}") from error
    except MemoryError as error:
        raise RecordingError(path, said.format("it asks for more memory than there is")) from error
    except KeyError as error:  # says the name alone
        raise RecordingError(path, said.format(f"it lacks {error}")) from error
    except Exception as error:  # there is no list of what foreign readers raise
        words = " ".join(str(error).split())[:200] or type(error).__name__
        raise RecordingError(path, said.format(words)) from error
