"""Domains: numbers of ROS domains, from arguments and from the environment."""

import os

from teleop_core.base.errors import ParameterError

VARIABLE = "ROS_DOMAIN_ID"
MOST = 232
"""Largest domain: the UDP ports of the next one do not exist (DDSI-RTPS 2.5, 9.6.1.1)."""


def checked_domain(name: str, value: str | int) -> int:
    """The number of a ROS domain.

    Args:
        name: Name of the argument or variable.
        value: Its value.

    Raises:
        ParameterError: The value is not the number of a domain.
    """
    text = str(value).strip()
    if not (text.isdecimal() and text.isascii() and len(text) < 10 and int(text) <= MOST):
        raise ParameterError(name, value, f"the number of a ROS domain, 0 to {MOST}")
    return int(text)


def domain_of_environment() -> int | None:
    """Domain in ``ROS_DOMAIN_ID``; None if the variable is missing or empty, which the middleware reads as 0.

    Raises:
        ParameterError: The variable is not the number of a domain.
    """
    text = os.environ.get(VARIABLE, "")
    return checked_domain(VARIABLE, text) if text else None
