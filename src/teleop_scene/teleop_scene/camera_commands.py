"""Commands of cameras: ``teleop film`` after a session, and ``teleop camera`` beside a live one."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from teleop_core.commands.options import ParameterOptions, Words


def film(
    bag: Path,
    /,
    *,
    out: Path,
    cameras: Words = (),
    rate: float | None = None,
    marker: Annotated[bool, Parameter(negative=())] = False,
    set_: Annotated[Words, Parameter(name="--set", metavar="KEY=VALUE")] = (),
) -> None:
    """Write a copy of a recording that has the pictures of cameras too.

    For example:

        teleop sim --scenario coarse_box --out bags/cubes --set robot=cubes.xml scene.rate=60
        teleop film bags/cubes --out bags/cubes_seen --cameras front
        teleop film bags/cubes --out bags/cubes_far --cameras front --set teleop.stages=[network] network.preset=iss
        teleop export bags/cubes_seen --to lerobot cubes_set

    Args:
        bag: Recording of a session with a scene.
        out: Directory of the new recording.
        cameras: Cameras of the scene, as NAME or NAME:WIDTHxHEIGHT. A camera of your own has a place and a point at
            which it looks [m]: NAME:WIDTHxHEIGHT:X,Y,Z,X,Y,Z. Without names: scene.cameras of the session.
        rate: Pictures per second [Hz] of each camera, not above scene.rate; without it, scene.camera_rate.
        marker: Draw the number of its tick into a corner of each picture, for tests.
        set_: Parameters that replace those of the session, such as those of the network on the way of the pictures.
    """
    from teleop_scene.film import film as made

    print(made(bag, out, cameras, rate=rate, texts=set_, is_marked=marker))


def camera(
    scene: str,
    names: tuple[str, ...],
    /,
    *,
    rate: float = 30.0,
    marker: Annotated[bool, Parameter(negative=())] = False,
    settings: ParameterOptions = ParameterOptions(),
) -> None:
    """Publish pictures of a live session with a scene, from a process of its own.

    For example, in two terminals with the same ROS_DOMAIN_ID:

        teleop camera cubes.xml front
        teleop live --out bags/live --set robot=cubes.xml recorder.also=[camera/front/image_raw/compressed]

    Args:
        scene: Scene of the session.
        names: Cameras of the scene, as in `teleop film`.
        rate: Pictures per second [Hz] of each camera, not above scene.rate.
        marker: Draw the number of its tick into a corner of each picture, for tests.
        settings: Parameters of the session; its network is on the way of the pictures.
    """
    from teleop_core.session import api
    from teleop_scene.film import network_of
    from teleop_scene.live_camera import run
    from teleop_scene.models import file_of
    from teleop_scene.parameters import View

    views = [View.parse(name, is_marked=marker) for name in names]
    network = network_of(api.configuration(files=settings.config, texts=settings.texts))
    run(file_of(scene), views, rate=rate, network=network)
