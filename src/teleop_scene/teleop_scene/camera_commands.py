"""Commands of cameras: ``teleop film`` after a session, and ``teleop camera`` beside a live one."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from teleop_core.commands.options import Words


def film(
    bag: Path,
    /,
    *,
    out: Path,
    cameras: Words,
    rate: float = 30.0,
    delay: float = 0.0,
    jitter: float = 0.0,
    loss: float = 0.0,
    seed: int = 0,
    marker: Annotated[bool, Parameter(negative=())] = False,
) -> None:
    """Write a copy of a recording that has the pictures of cameras too.

    For example:

        teleop sim --scenario coarse_box --out bags/cubes --set robot=cubes.xml scene.rate=60
        teleop film bags/cubes --out bags/cubes_seen --cameras front
        teleop film bags/cubes --out bags/cubes_far --cameras front:320x240 --delay 0.1 --jitter 0.03 --loss 0.05
        teleop export bags/cubes_seen --to lerobot cubes_set

    Args:
        bag: Recording of a session with a scene.
        out: Directory of the new recording.
        cameras: Cameras of the scene, as NAME or NAME:WIDTHxHEIGHT. A camera of your own has a place and a point at
            which it looks [m]: NAME:WIDTHxHEIGHT:X,Y,Z,X,Y,Z.
        rate: Pictures per second [Hz] of each camera, not above scene.rate.
        delay: Delay of the pictures on their way to the recorder [s].
        jitter: Standard deviation of a further delay [s], by which pictures may overtake each other.
        loss: Share of pictures that are lost, 0 to 1.
        seed: Seed of jitter and loss.
        marker: Draw the number of its tick into a corner of each picture, for tests.
    """
    from teleop_scene.film import Way
    from teleop_scene.film import film as made

    print(made(bag, out, cameras, rate=rate, way=Way(delay, jitter, loss, seed), is_marked=marker))


def camera(
    scene: str,
    names: tuple[str, ...],
    /,
    *,
    rate: float = 30.0,
    delay: float = 0.0,
    jitter: float = 0.0,
    loss: float = 0.0,
    seed: int = 0,
    marker: Annotated[bool, Parameter(negative=())] = False,
) -> None:
    """Publish pictures of a live session with a scene, from a process of its own.

    For example, in two terminals with the same ROS_DOMAIN_ID:

        teleop camera cubes.xml front
        teleop live --out bags/live --set robot=cubes.xml recorder.also=[camera/front/image_raw/compressed]

    Args:
        scene: Scene of the session.
        names: Cameras of the scene, as in `teleop film`.
        rate: Pictures per second [Hz] of each camera, not above scene.rate.
        delay: Delay of the pictures on their way [s].
        jitter: Standard deviation of a further delay [s], by which pictures may overtake each other.
        loss: Share of pictures that are lost, 0 to 1.
        seed: Seed of jitter and loss.
        marker: Draw the number of its tick into a corner of each picture, for tests.
    """
    from teleop_scene.camera import View
    from teleop_scene.film import Way
    from teleop_scene.live_camera import run
    from teleop_scene.models import file_of

    views = [View.parse(name, is_marked=marker) for name in names]
    run(file_of(scene), views, rate=rate, way=Way(delay, jitter, loss, seed))
