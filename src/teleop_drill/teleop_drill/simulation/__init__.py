"""Simulation: a machine with its processes, clocks and middleware, all drawn from one seed.

Nodes of teleop_core run in it unchanged: they ask for time, threads and topics through
:mod:`teleop_core.middleware.world`, and here a scheduler answers in simulated time.

- ``scheduler``: who runs when, and what it costs;
- ``machine``: processes, what may become of them, and sockets between them;
- ``bus``: topics and services, as ROS 2 and Fast DDS carry them;
- ``nodes``: nodes, parameters, lifecycle and executors;
- ``world``: all of it as one process sees it.
"""
