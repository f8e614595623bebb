"""Simulation: a simulated machine with processes, clocks and middleware; all random choices follow from one seed.

Nodes of teleop_core run unchanged in the simulation. They get time, threads and topics from
:mod:`teleop_core.middleware.platform`; in the simulation a scheduler provides these in simulated time.

- ``scheduler``: the order in which threads run, and the time that this takes;
- ``machine``: processes, their faults, and sockets between them;
- ``bus``: topics and services with the behaviour of ROS 2 and Fast DDS;
- ``nodes``: nodes, parameters, lifecycle and executors;
- ``platform``: the simulation from the view of one process.
"""
