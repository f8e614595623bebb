"""Console: a page in the browser that shows a session, commands it and lets a person be the hand.

A :class:`~teleop_console.link.SessionLink` is where a session is seen and commanded: a live one over
its topics, or a recording. Everything else here draws what the link shows and passes on what people
do on the page.
"""

import lazy_loader

__version__ = "0.6.0"

# The stub beside this file says what is where; a name is loaded on first use.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
