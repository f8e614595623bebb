"""Mobility: the degrees of freedom and independent loops of a mechanism of links and joints."""

from teleop_core.base.errors import ParameterError

SPATIAL, PLANAR = 6, 3


def degrees_of_freedom(links: int, joints: int, joint_freedoms: int, *, space: int = SPATIAL) -> int:
    """Mobility by counting: ``space (links - joints - 1) + joint_freedoms``.

    The formula assumes constraints in general position. Mechanisms with special geometry, such as parallel axes counted
    in space, can move although the count is zero or negative. A mechanism with a negative count is overconstrained.

    Args:
        links: Number of links, the fixed link included.
        joints: Number of joints between two links; a joint of three links counts twice.
        joint_freedoms: Sum of the freedoms of all joints.
        space: Degrees of freedom of a free body: 6 in space, 3 in a plane (:data:`SPATIAL`, :data:`PLANAR`).

    Returns:
        The degrees of freedom.

    Raises:
        ParameterError: No mechanism can have such a count.

    Source:
        Grübler 1883, Kutzbach 1929, as Ghosal 2020, lecture 11, eq. 1.
    """
    _check_counts(links, joints)
    if space not in {SPATIAL, PLANAR}:
        raise ParameterError("space", space, "6 (spatial) or 3 (planar)")
    if not joints <= joint_freedoms <= space * joints:
        raise ParameterError("joint_freedoms", joint_freedoms, f"1 to {space} for each joint")
    return space * (links - joints - 1) + joint_freedoms


def independent_loops(links: int, joints: int) -> int:
    """Number of loops that are independent of each other: ``joints - links + 1``.

    Raises:
        ParameterError: No connected mechanism can have such a count.

    Source:
        Singh 2014, eq. 3.16.
    """
    _check_counts(links, joints)
    return joints - links + 1


def passive_joints(joints: int, freedoms: int) -> int:
    """Number of joints without a motor, of a mechanism with as many motors as freedoms.

    Raises:
        ParameterError: There are more freedoms than joints, or a count is negative.
    """
    if not 0 <= freedoms <= joints:
        raise ParameterError("freedoms", freedoms, f"0 to {joints}, the number of joints")
    return joints - freedoms


def _check_counts(links: int, joints: int) -> None:
    if links < 1:
        raise ParameterError("links", links, "at least 1, the fixed link")
    if joints < links - 1:
        raise ParameterError("joints", joints, f"at least {links - 1}, to connect every link")
