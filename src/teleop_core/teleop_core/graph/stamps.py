"""Stamps: which samples of a device are too old, repeated, or not stamped."""


def wrong_stamp(stamp_ns: int, newest_ns: int, now_ns: int, oldest: float, option: str) -> str:
    """Text with the reason why the stamp of a sample is rejected; empty if the stamp is valid.

    Args:
        stamp_ns: The stamp [ns].
        newest_ns: Stamp of the newest valid sample [ns].
        now_ns: Time [ns].
        oldest: Largest difference between a stamp and our clock [s]; 0: stamps only have to increase.
        option: Name of the parameter that makes the bridge use sending times in place of stamps.
    """
    if stamp_ns == 0:
        return f"its messages have no stamp; {option}: sent uses the time when each was sent"
    if stamp_ns <= newest_ns:
        behind = 1e-9 * (newest_ns - stamp_ns)
        return f"its stamp is {behind:.4g} s older than the newest one; stamps must rise"
    age = 1e-9 * (now_ns - stamp_ns)
    if 0.0 < oldest < abs(age):
        return f"its stamp is {age:.4g} s old; it may differ from our clock by at most {oldest:g} s"
    return ""
