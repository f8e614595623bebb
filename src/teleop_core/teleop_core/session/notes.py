"""Notes: what runs but may not be meant, of a configuration before its session begins."""

from teleop_core.graph import BUILT_IN
from teleop_core.mapping.parameters import FixtureParameters, MotionScalingParameters
from teleop_core.mapping.walls import WALLS
from teleop_core.master.device import DeviceParameters
from teleop_core.master.haptic_master import HapticMasterParameters
from teleop_core.session.configuration import Configuration

_MASTER, _MAPPING = BUILT_IN[:2]


def notes_of(configuration: Configuration) -> list[str]:
    """One line for each thing that may not be meant; none where all is well."""
    found = list(configuration.graph.notes)
    for arm in configuration.graph.namespaces:
        master, mapping = (configuration.group(name, arm) for name in (_MASTER, _MAPPING))
        if isinstance(master, HapticMasterParameters) and isinstance(
            mapping, MotionScalingParameters
        ):
            note = rendered_note(master.device, mapping.fixture)
            found += [f"arm {arm!r}: {note}" if arm else note] if note else []
    return found


def rendered_note(device: DeviceParameters, fixture: FixtureParameters) -> str:
    """What becomes of a wall that is stiffer than the device; empty where none is.

    The device bends by force over its stiffness, so wall and device are two springs in series.
    """
    stiffness = WALLS[fixture.wall].spring(fixture.stiffness, fixture.max_force)
    soft = [i for i in range(3) if stiffness > device.stiffness[i]]
    if not soft or fixture.max_force == 0.0:
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
        f"the {fixture.wall} wall has {stiffness:.0f} N/m, more than the device renders on {axes} "
        f"({own} N/m): the hand feels {both} N/m"
    )
