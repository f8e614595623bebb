"""Console: a page in the browser that shows a session, commands it and lets a person be the hand.

A :class:`~teleop_core.console.link.Link` is where a session is seen and commanded: a live one over
its topics, or a recording. Everything else here draws what the link shows and passes on what people
do on the page.
"""
