"""Commands that show scenarios, parts, parameters and robots."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from teleop_core.base import ParameterError
from teleop_core.commands.options import Geometry


def scenarios() -> None:
    """List the scenarios."""
    from teleop_core.graph.layers import list_scenarios

    for name, description in list_scenarios().items():
        print(f"{name:16} {description}")


def parts() -> None:
    """List the parts that --set and teleop.stages take by name, your own included."""
    from teleop_core.coupling.architectures import ARCHITECTURES
    from teleop_core.coupling.filters import TREMOR_FILTERS
    from teleop_core.coupling.network import NETWORKS
    from teleop_core.coupling.passivity import PASSIVITIES
    from teleop_core.evaluation import METRICS
    from teleop_core.graph.stage import STAGES
    from teleop_core.hand.operators import OPERATORS
    from teleop_core.hand.operators.policy import POLICIES
    from teleop_core.hand.tasks import TASKS
    from teleop_core.robots import ROBOTS
    from teleop_core.shapes import SHAPES
    from teleop_core.slave.bridges import BRIDGES
    from teleop_core.slave.controllers import CONTROLLERS
    from teleop_core.slave.plants import PLANTS
    from teleop_core.slave.world import WORLD_OBJECTS

    registries = (
        OPERATORS, POLICIES, SHAPES, ROBOTS, CONTROLLERS, PLANTS, WORLD_OBJECTS, ARCHITECTURES,
        NETWORKS, PASSIVITIES, TREMOR_FILTERS, TASKS, BRIDGES, STAGES, METRICS,
    )  # fmt: skip
    for registry in registries:
        print(f"{registry.kinds:16}{', '.join(registry)}")


def parameters(stage: str | None = None, /, *, markdown: bool = False) -> None:
    """List every parameter with unit, bounds and meaning.

    Args:
        stage: Print only the parameters of this stage.
        markdown: Print a Markdown table for documents.
    """
    from teleop_core.base.errors import UnknownNameError
    from teleop_core.graph.layers import declared_groups
    from teleop_core.session.configuration import parameter_rows

    groups = declared_groups()
    if stage is not None and stage not in groups:
        raise UnknownNameError("stage", stage, groups)
    rows = parameter_rows([stage] if stage else groups)
    if markdown:
        print("| parameter | default | allowed | meaning |\n|---|---|---|---|")
        for row in rows:
            print("| `" + " | ".join((f"{row[0]}`", *row[1:])) + " |")
        return
    for name, default, allowed, text in rows:
        print(f"{name:42} {default:18} {text} ({allowed})")


def robot(
    name: str | None = None,
    /,
    *,
    geometry: Geometry = (),
    table: Annotated[Path | None, Parameter(name="--from", metavar="TABLE.yaml")] = None,
    urdf: Path | None = None,
) -> None:
    """Show a robot: joints, limits, home, tip pose.

    For example:

        teleop robot  # all robots
        teleop robot rcrt1 --urdf rcrt1.urdf

    Args:
        name: Name or file of a robot; without it, all robots are listed.
        geometry: Lengths and options that replace the published ones [m, rad], such as tip=tool0 of a URDF.
        table: File with a Denavit-Hartenberg table of a robot, as in config/robots.
        urdf: Write the robot's links and joints to a URDF, for other tools.
    """
    from teleop_core.robots import list_robots, load_robot_set
    from teleop_core.robots.description import text

    if table is not None:
        from teleop_core.robots.arms.dh import load_table

        shown = load_table(table).robot()
    elif name is not None:
        shown = load_robot_set(name, geometry)
    else:
        print("\n".join(list_robots()))
        return
    if urdf is not None:
        from teleop_core.robots.bodies import urdf_of

        urdf.write_text(urdf_of(shown), encoding="utf-8")
        print(f"{urdf}: {shown.name}")
        return
    print(text(shown))
    for note in shown.notes:
        print(f"note: {note}")


def workspace(
    robot: str,
    /,
    *,
    geometry: Geometry = (),
    html: Path | None = None,
    csv: Path | None = None,
    samples: int = 20_000,
    seed: int = 1,
) -> None:
    """Draw where a robot's tip can be.

    Args:
        robot: One of `teleop robot`.
        geometry: Lengths and options that replace the published ones [m, rad], such as tip=tool0 of a URDF.
        html: Page with the picture.
        csv: Table with a line for each tip position: x, y, z [m], manipulability.
        samples: Number of joint vectors to draw.
        seed: Seed of the draws.
    """
    import numpy as np

    from teleop_core.evaluation.command import page_maker
    from teleop_core.robots import load_robot_set
    from teleop_core.robots.dexterity import sample_workspace, write_workspace_csv

    if seed < 0:
        raise ParameterError("--seed", seed, "0 or more")
    write_page = page_maker("workspace") if html is not None else None
    arm = load_robot_set(robot, geometry)
    rng = np.random.default_rng(seed)
    points, values = sample_workspace(arm, samples, rng)
    if len(points) < samples:
        print(f"{len(points)} of {samples} joint vectors assemble as at home")
    low, high = points.min(axis=0), points.max(axis=0)
    for axis, begin, end in zip("xyz", low, high, strict=True):
        print(f"{axis}: {begin:8.4f} … {end:8.4f} m")
    if csv is not None:
        write_workspace_csv(csv, points, values)
        print(csv)
    if write_page is not None:
        write_page(arm, points, values, html)
        print(html)
