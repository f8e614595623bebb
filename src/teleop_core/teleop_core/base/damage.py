"""Damage: converts any exception of a reader about the content of a file into one error that names the file.

Foreign readers (rosbags, mcap, pyarrow, pandas, SQLite, decompressors) raise many kinds of exceptions for damaged
bytes: ``struct.error``, ``OverflowError``, ``MemoryError`` and their own errors. All code that opens a file reads it
within :func:`damage_told`; these exceptions are converted nowhere else.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from teleop_core.base.errors import RecordingError, TeleopError
from teleop_core.base.plain_yaml import UnreadableError, check_regular


@contextmanager
def damage_told(path: Path | str, said: str = "cannot be read: {}") -> Iterator[None]:
    """Convert exceptions that are raised while a file is read.

    Args:
        path: The file; must not be a pipe or a device.
        said: Text of the error, with ``{}`` for the reader's message.

    Raises:
        RecordingError: The file is missing, or its reader does not accept its content.
        TeleopError: Passed on unchanged if it is raised within.
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
        raise RecordingError(path, said.format("it needs more memory than is available")) from error
    except KeyError as error:  # the error contains only the missing name
        raise RecordingError(path, said.format(f"it lacks {error}")) from error
    except Exception as error:  # foreign readers do not document which exceptions they raise
        words = " ".join(str(error).split())[:200] or type(error).__name__
        raise RecordingError(path, said.format(words)) from error
