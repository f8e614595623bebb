"""Master-slave teleoperation: haptic master, motion scaling, inverse kinematics, 1 kHz slave.

The folders follow the data: ``hand`` contains the operator and the master, ``coupling`` the stages between master and
slave, ``slave`` the arm's server with its control laws and plants, ``bags`` the recordings, ``evaluation`` the scores.
``graph`` defines the stages and their links, ``session`` runs them in virtual time, ``nodes`` connects them to ROS 2
topics, ``commands`` contains the command ``teleop``. All folders use ``robots``, ``kinematics``, ``shapes``,
``kernels`` and ``base``.

Everything a user needs is here:

- :func:`run`, :func:`replay`, :func:`open_recording`: sessions and their recordings;
- :func:`configuration`: checked configuration of a session;
- :func:`load_robot`, :func:`list_robots`, :func:`robot_from_table`: arms;
- :class:`Stage`, :class:`Shape`, :class:`Controller`, :class:`Plant`,
  :class:`Operator`, :class:`Metric` and the ``register_...`` functions: parts of your own;
- :func:`kernel`, :func:`parameter`, ``topics``: building blocks of parts.

The packages ``teleop_console``, ``teleop_exchange``, ``teleop_scene``, ``teleop_lab`` and ``teleop_drill`` use this
package.
"""

import lazy_loader

__version__ = "0.6.0"

# The stub beside this file maps the names to modules; a name is imported on first use.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
