"""Drill and conformance tests for CRTK arms, of teleop_core or of other vendors.

- :class:`Exercise`, :func:`register_exercise`, :func:`chosen`: faults of a drill;
- ``conformance``: the requirements of CRTK on an arm;
- ``nodes``: drills and tests of running nodes; only these modules need ROS.
"""

import lazy_loader

__version__ = "0.6.0"

# The stub file of this package lists the module of each name; a name is loaded on first use.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
