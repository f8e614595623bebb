"""Notes: warnings about a valid configuration that may not be intended, made before its session begins."""

from teleop_core.coupling.mapping import gains, walls
from teleop_core.graph import BUILT_IN, DT, topics
from teleop_core.hand.master.device import DeviceParameters
from teleop_core.hand.master.haptic_master import HapticMasterParameters
from teleop_core.robots import load_robot_set
from teleop_core.robots.parts import is_scene, is_urdf
from teleop_core.robots.robot_notes import assumed_note, notes_on_robot
from teleop_core.session.configuration import Configuration
from teleop_core.slave.parameters import SlaveParameters
from teleop_core.slave.slave import SLAVE

_MASTER, _MAPPING = BUILT_IN[1:3]


def notes_of(configuration: Configuration, transport: float = 0.0) -> list[str]:
    """One line for each setting that may not be intended; empty if there is none.

    Args:
        configuration: Configuration of the session.
        transport: Time that a sample takes from the device to the wall and back, without the declared delays [s].
    """
    found = list(configuration.graph.notes)
    for arm in configuration.graph.namespaces:
        master, mapping = (configuration.group(name, arm) for name in BUILT_IN[1:3])
        if isinstance(master, HapticMasterParameters) and isinstance(mapping, gains.MotionScalingParameters):
            delay = transport + _delay(configuration, arm)
            told = (rendered_note(master.device, mapping.fixture), passive_note(master.device, mapping.fixture, delay))
            found += [f"arm {arm!r}: {note}" if arm else note for note in told if note]
        slave = configuration.group(SLAVE.name, arm)
        if isinstance(slave, SlaveParameters) and is_urdf(slave.robot):
            robot = load_robot_set(slave.robot, slave.geometry)
            has_task = any(entry.startswith("task=") for entry in slave.geometry)
            own = notes_on_robot(robot, slave.robot, has_task)
            own += filter(None, [assumed_note(robot, slave.robot)])
            found += [note for note in own if note not in found]
        elif isinstance(slave, SlaveParameters) and is_scene(slave.robot):  # models never state limits of speeds
            found += [f"{slave.robot}: {note}" for note in load_robot_set(slave.robot, slave.geometry).notes]
    return found


def _delay(configuration: Configuration, arm: str) -> float:
    """Sum of the declared delays between the device's samples and its force [s]."""
    around = (topics.MASTER_MEASURED_CP.name, topics.MASTER_SERVO_CF.name)
    ends = {topics.MASTER_MEASURED_CP.name: _MAPPING, topics.MASTER_SERVO_CF.name: _MASTER}
    return sum(
        link.delay
        for link in configuration.graph.links
        if link.port.name in around and link.reader.arm == arm and link.reader.stage.name == ends[link.port.name]
    )


def passive_note(device: DeviceParameters, fixture: gains.FixtureParameters, delay: float) -> str:
    """Note on a wall that is too stiff to be passive; empty if the wall is passive.

    Args:
        device: The device.
        fixture: Virtual fixture, whose wall is examined.
        delay: Delay of the wall's force in addition to the tick [s].
    """
    wall = walls.WALLS[fixture.wall]
    stiffness = wall.spring(fixture.stiffness, fixture.max_force)
    damping = fixture.damping if wall.is_damped else 0.0
    most = walls.passive_stiffness(damping, DT, delay, device.friction, device.position_resolution)
    if stiffness <= most * (1.0 + 1e-9) or not fixture.pushes:
        return ""
    until = f"with {1000.0 * (DT + delay):.3g} ms from sample to force, the wall is passive up to {most:.0f} N/m"
    if not wall.is_damped:
        until = "the wall has no damping"
    return f"the {fixture.wall} wall of {stiffness:.0f} N/m may return more energy than it absorbs: {until}"


def rendered_note(device: DeviceParameters, fixture: gains.FixtureParameters) -> str:
    """Note on a wall that is stiffer than the device; the note states the stiffness that the hand feels.

    The text is empty if the wall is not stiffer.

    The device bends by force divided by its stiffness, so wall and device are two springs in series.
    """
    stiffness = walls.WALLS[fixture.wall].spring(fixture.stiffness, fixture.max_force)
    soft = [i for i in range(3) if stiffness > device.stiffness[i]]
    if not soft or not fixture.pushes:
        return ""
    felt = [1.0 / (1.0 / stiffness + 1.0 / device.stiffness[i]) for i in soft]
    axes, own, both = (
        ", ".join(texts)
        for texts in (
            ["xyz"[i] for i in soft],
            [f"{device.stiffness[i]:.0f}" for i in soft],
            [f"{value:.0f}" for value in felt],
        )
    )
    return (
        f"the {fixture.wall} wall has {stiffness:.0f} N/m, more than the device's own stiffness along "
        f"{axes} ({own} N/m): the hand feels {both} N/m"
    )
