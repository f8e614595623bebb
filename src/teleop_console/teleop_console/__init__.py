"""Console: a page in the browser that shows a session, commands it and lets a person be the hand.

A :class:`~teleop_console.link.SessionLink` gives access to a live session over its topics, or to a recording. All other
modules of this package draw the data of this link, and pass the actions of people on the page to it.
"""

import lazy_loader

__version__ = "0.6.0"

# The stub file of this package lists the module of each name; a name is loaded on first use.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
