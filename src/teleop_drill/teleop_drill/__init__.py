"""Drill and conformance for CRTK arms, those of teleop_core and any other.

- :class:`Exercise`, :func:`register_exercise`, :func:`chosen`: what a drill breaks;
- ``conformance``: what CRTK asks of an arm;
- ``nodes``: drills and tests of running nodes; these modules alone need ROS.
"""

import lazy_loader

__version__ = "0.6.0"

# The stub beside this file says what is where; a name is loaded on first use.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
