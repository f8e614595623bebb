"""Discovery and transport: by default, nodes communicate only within this machine, and no reader blocks a writer.

Fast DDS is configured by a profile, an XML file of this package:

- **UDP instead of shared memory.** A killed reader leaves shared memory in a state that blocks each writer for two
  seconds at a time, until the reader's lease ends. With sockets, the kernel drops messages that nobody reads: the
  writer never waits.
- **Loopback.** ``ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST`` alone limits discovery to the machine, but binds all
  interfaces: another machine that knows the ports gets all data. The profile binds 127.0.0.1.
- **Announcements.** Fast DDS announces a new participant five times in half a second, then every
  three seconds. While several processes start on a busy machine, all five may be missed: then
  a topic is silent, and its recording incomplete, for three seconds.
"""

import os
from collections.abc import Mapping, MutableMapping
from pathlib import Path

RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
"""ROS variable for the range of discovery: LOCALHOST, SUBNET, SYSTEM_DEFAULT or OFF."""
_PEERS, _LOCAL_ONLY = "ROS_STATIC_PEERS", "ROS_LOCALHOST_ONLY"
_PROFILES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
_FOLDER = Path(__file__).with_name("profiles")
LOOPBACK = str(_FOLDER / "loopback.xml")
"""Profile for communication within this machine."""
NETWORK = str(_FOLDER / "network.xml")
"""Profile for communication between several machines."""


def choose_transport(environment: MutableMapping[str, str] = os.environ) -> None:
    """Choose the transport of this process and its children; a user's own profile has priority.

    Must be called before the middleware is started. By default, and with LOCALHOST, nothing is sent to or received
    from other machines. For middlewares other than Fast DDS only the range is set.

    Args:
        environment: Environment variables; changed in place.
    """
    if _profile(environment):
        return
    is_local = _is_local(environment)
    if not environment.get("RMW_IMPLEMENTATION", "rmw_fastrtps").startswith("rmw_fastrtps"):
        if is_local:
            environment[RANGE] = "LOCALHOST"
        return
    if is_local:
        # With LOCALHOST, rmw_fastrtps adds shared memory and sockets on all interfaces to the profile's transports.
        # Therefore only the profile sets the range.
        environment[RANGE] = "SYSTEM_DEFAULT"
        environment.pop(_LOCAL_ONLY, None)
    environment.update(dict.fromkeys(_PROFILES, LOOPBACK if is_local else NETWORK))


def _is_local(environment: Mapping[str, str]) -> bool:
    """Whether no message leaves this machine."""
    if environment.get(_LOCAL_ONLY) == "1":
        return True
    is_said = environment.get(RANGE, "").upper()
    return is_said in {"", "LOCALHOST"} and not environment.get(_PEERS)


def _profile(environment: Mapping[str, str]) -> str:
    return next((environment[name] for name in _PROFILES if environment.get(name)), "")


def beyond_this_machine(environment: Mapping[str, str] = os.environ) -> str:
    """One line about other machines that may take part; empty if only this machine can.

    Args:
        environment: Environment variables, after :func:`choose_transport`.
    """
    profile = _profile(environment)
    said = environment.get(RANGE, "").upper() or "SUBNET"
    if profile == LOOPBACK or (not profile and said == "LOCALHOST"):
        return ""
    if profile and profile != NETWORK:
        return f"the transport is that of your profile {profile}"
    peers = f" and {_PEERS}={environment[_PEERS]}" if environment.get(_PEERS) else ""
    return (
        f"open to other machines: {RANGE}={said}{peers}; their users can read and command. "
        f"{RANGE}=LOCALHOST limits ROS to this machine"
    )
