"""Lab of teleop_core: experiments, calibration, fitting and planning.

- :func:`fit_plant`, ``calibration``: what a real arm does;
- ``experiments``, :func:`register_experiment`: what the sources did, and experiments of your own;
- :func:`reach`: what a slave can follow of a hand's motion, before a session is run.
"""

import lazy_loader

__version__ = "0.6.0"

# The stub beside this file lists the module of each name; a name is loaded on first use.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
