"""Sides of a session for loops of another program: a slave that follows joints, a master.

Each side is a session in virtual time, which a call of the loop advances by one period. Nothing here needs LeRobot;
``lerobot_robot_teleop_core`` and ``lerobot_teleoperator_teleop_core`` give both to it.
"""

from teleop_core_lerobot.device import Connection, SessionFields
from teleop_core_lerobot.episodes import Episodes
from teleop_core_lerobot.live_camera import LiveCamera
from teleop_core_lerobot.master_side import MasterSide
from teleop_core_lerobot.side import Side
from teleop_core_lerobot.slave_side import SlaveSide

__all__ = ["Connection", "Episodes", "LiveCamera", "MasterSide", "SessionFields", "Side", "SlaveSide"]
