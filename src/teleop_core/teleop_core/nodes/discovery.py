"""Discovery and transport: this machine alone by default, and no reader can hold a writer up.

Fast DDS is set up by a profile, an XML file that this package brings:

- **UDP in place of shared memory.** A reader that is killed leaves shared memory in a state that
  blocks whoever writes to it for two seconds at a time until the reader's lease ends. The kernel
  throws away what nobody fetches from a socket: the writer never waits.
- **Loopback.** ``ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST`` alone keeps discovery on the machine,
  but binds all interfaces: who knows the ports gets all data. The profile binds 127.0.0.1.
- **Announcements.** Fast DDS announces a new participant five times in half a second, then every
  three seconds. While several processes start on a busy machine, all five may be missed: then
  a topic is silent, and its recording incomplete, for three seconds.
"""

import os
from collections.abc import Mapping, MutableMapping
from pathlib import Path

RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
"""ROS's variable for how far discovery goes: LOCALHOST, SUBNET, SYSTEM_DEFAULT or OFF."""
_PEERS, _LOCAL_ONLY = "ROS_STATIC_PEERS", "ROS_LOCALHOST_ONLY"
_PROFILES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
_FOLDER = Path(__file__).with_name("profiles")
LOOPBACK, NETWORK = str(_FOLDER / "loopback.xml"), str(_FOLDER / "network.xml")
"""Profiles for this machine alone and for several machines."""


def choose_transport(environment: MutableMapping[str, str] = os.environ) -> None:
    """Choose the transport of this process and its children; a profile of the user's own wins.

    To be called before the middleware is started. By default, and with LOCALHOST, nothing is sent to or heard from
    other machines. Middlewares other than Fast DDS get the range alone.

    Args:
        environment: Variables, which are changed in place.
    """
    if _profile(environment):
        return
    is_local = _is_local(environment)
    if not environment.get("RMW_IMPLEMENTATION", "rmw_fastrtps").startswith("rmw_fastrtps"):
        if is_local:
            environment[RANGE] = "LOCALHOST"
        return
    if is_local:
        # With LOCALHOST rmw_fastrtps adds shared memory and sockets on all interfaces to those of
        # the profile; the profile itself says what the range means.
        environment[RANGE] = "SYSTEM_DEFAULT"
        environment.pop(_LOCAL_ONLY, None)
    environment.update(dict.fromkeys(_PROFILES, LOOPBACK if is_local else NETWORK))


def _is_local(environment: Mapping[str, str]) -> bool:
    """Whether nothing that is said reaches beyond this machine."""
    if environment.get(_LOCAL_ONLY) == "1":
        return True
    is_said = environment.get(RANGE, "").upper()
    return is_said in {"", "LOCALHOST"} and not environment.get(_PEERS)


def _profile(environment: Mapping[str, str]) -> str:
    return next((environment[name] for name in _PROFILES if environment.get(name)), "")


def beyond_this_machine(environment: Mapping[str, str] = os.environ) -> str:
    """Who else may take part, in one line; empty if it is this machine alone.

    Args:
        environment: Variables, after :func:`choose_transport`.
    """
    profile = _profile(environment)
    said = environment.get(RANGE, "").upper() or "SUBNET"
    if profile == LOOPBACK or (not profile and said == "LOCALHOST"):
        return ""
    if profile and profile != NETWORK:
        return f"the transport is that of your profile {profile}"
    peers = f" and {_PEERS}={environment[_PEERS]}" if environment.get(_PEERS) else ""
    return (
        f"open to other machines: {RANGE}={said}{peers}; anybody there can read and command. "
        f"{RANGE}=LOCALHOST keeps to this one"
    )
