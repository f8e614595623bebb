"""Type support: loads only the parts of ROS that Python messages need."""

import sys
from collections.abc import Iterable
from importlib import import_module

from rclpy.type_support import check_for_type_support

_GENERATOR = "rosidl_generator_py.generate_py_impl"
_OF_EVERY_NODE = ("rcl_interfaces", "lifecycle_msgs", "type_description_interfaces", "std_srvs")


def spare_generator() -> None:
    """Load ``rosidl_generator_py`` without its code generator; messages need only one function of it.

    The generator's parsers take 20 MB and 0.2 s in each process, so the package is loaded without them. Code that
    needs the generator can still import it later.
    """
    if _GENERATOR in sys.modules:
        return
    modules: dict[str, object] = sys.modules  # type: ignore[assignment]
    modules[_GENERATOR] = None  # makes the import fail, as if the parsers were not installed
    try:
        import_module("rosidl_generator_py")
    finally:
        del modules[_GENERATOR]


def load_type_support(kinds: Iterable[object]) -> None:
    """Load the libraries of some messages, and of the services that every node has.

    Args:
        kinds: Classes of messages.
    """
    found = [*kinds]
    for package in _OF_EVERY_NODE:
        for folder in ("msg", "srv"):
            try:
                found += vars(import_module(f"{package}.{folder}")).values()
            except ModuleNotFoundError:  # a package without messages or without services
                continue
    for kind in found:
        if hasattr(type(kind), "_TYPE_SUPPORT"):
            check_for_type_support(kind)
