"""Lab of teleop_core: experiments, calibration, fitting and planning.

- :func:`fit_plant`, ``calibration``: identify a real arm;
- ``experiments``, :func:`register_experiment`: experiments of the sources, and your own;
- :func:`reach`: computes which part of a hand's motion a slave can follow, before a session is run.
"""

import lazy_loader

__version__ = "0.6.0"

# The stub file of this package lists the module of each name; a name is loaded on first use.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
