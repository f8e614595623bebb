"""Master-slave teleoperation: haptic master, motion scaling, inverse kinematics, 1 kHz slave.

Folders follow the data: ``hand`` is the operator and the master, ``coupling`` what lies between master and slave,
``slave`` the arm's server with its control laws and plants, ``bags`` what is recorded, ``evaluation`` what it is
worth. ``graph`` says which stages there are and how they are linked, ``session`` runs them in virtual time, ``nodes``
puts them on ROS 2 topics, ``commands`` is the ``teleop`` of a terminal. All stand on ``robots``, ``kinematics``,
``shapes``, ``kernels`` and ``base``.

Everything a user needs is here:

- :func:`run`, :func:`replay`, :func:`open_recording`: sessions and what was recorded of them;
- :func:`configuration`: what a session runs, checked;
- :func:`load_robot`, :func:`list_robots`, :func:`robot_from_table`: arms;
- :class:`Stage`, :class:`Shape`, :class:`Controller`, :class:`Plant`,
  :class:`Operator`, :class:`Metric` and the ``register_...`` functions: parts of your own;
- :func:`kernel`, :func:`parameter`, ``topics``: what parts are made of.

``teleop_console``, ``teleop_exchange``, ``teleop_lab`` and ``teleop_drill`` use this one.
"""

import lazy_loader

__version__ = "0.6.0"

# The stub beside this file says what is where; a name is loaded on first use.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
