"""Command ``teleop scenes``: MuJoCo models of installed packages, and what an arm of a model needs."""

from typing import Annotated

from cyclopts import Parameter


def scenes(
    name: str | None = None,
    /,
    *,
    package: Annotated[tuple[str, ...], Parameter(consume_multiple=True)] = (),
    truth: bool = False,
) -> None:
    """List MuJoCo models that a session can use, or the arms of one.

    For example:

        teleop scenes
        teleop scenes cubes.xml
        teleop sim --out bags/cubes --set robot=cubes.xml teleop.stages=[jaw_command,jaw]

    Args:
        name: A file, or a name of the list; without it, the models of installed packages are listed.
        package: Names of further installed packages to search.
        truth: Instead, compare motions and contacts of MuJoCo with closed forms, and print the differences.
    """
    from teleop_scene import survey

    if truth:
        from teleop_scene.truth import table

        print(table())
    elif name is None:
        print("\n".join(survey.scenes_of((*survey.PACKAGES, *package))))
    else:
        print(survey.described(name))
