"""Chain: bodies, joints and inertias between the base and the tip of an arm in a MuJoCo model.

Source:
    The chapter Computation of MuJoCo's documentation; the XML reference, elements body and joint.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np

from teleop_core.base import ParameterError, UnknownNameError
from teleop_core.kernels import Array, product, rotation, rotations_from_quaternions, transform
from teleop_core.kernels.fields import Integers
from teleop_core.robots.dynamics.chain_dynamics import body_row
from teleop_core.robots.files.urdf_tree import ASSUMED, turn_of_z

HINGE, SLIDE = int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)
_NAMES = {int(mujoco.mjtJoint.mjJNT_FREE): "free", int(mujoco.mjtJoint.mjJNT_BALL): "ball"}
_TIES = (int(mujoco.mjtEq.mjEQ_CONNECT), int(mujoco.mjtEq.mjEQ_WELD))
_INSIDE = 1e-3  # depth of a contact that is no touch [m]
_EYE = np.eye(4)


@dataclass(frozen=True, kw_only=True, eq=False)
class Chain:
    """Chain of an arm.

    Attributes:
        tip: Name of the site or body that is the tip.
        bodies: Bodies from the first to the last one that a joint of the arm moves.
        joints: Joints of the arm (n,).
        T_last_tip: Pose (4, 4) of the tip in the last of these bodies.
    """

    tip: str
    bodies: tuple[int, ...]
    joints: Integers
    T_last_tip: Array


def ancestors(model: mujoco.MjModel, body: int) -> Iterator[int]:
    """The body and its parents, without the world."""
    while body > 0:
        yield body
        body = int(model.body_parentid[body])


def joints_of(model: mujoco.MjModel, body: int) -> range:
    """Joints between a body and its parent."""
    first = int(model.body_jntadr[body])
    return range(first, first + int(model.body_jntnum[body]))


def joint_name(model: mujoco.MjModel, joint: int) -> str:
    """Name of a joint, with a number in place of a missing name."""
    return model.joint(joint).name or f"joint{joint}"


def chain_of(model: mujoco.MjModel, tip: str, base: str) -> Chain:
    """Chain from a base to a tip.

    Args:
        model: The model.
        tip: Site or body; empty for the site ``tip``, or else for the only site that an arm moves.
        base: Body that carries the arm; empty for the parent of the first body with a joint.

    Raises:
        UnknownNameError: There is no such site or body.
        ParameterError: The tip is not given although there are several sites, or no hinge or slide joint moves it, or a
            free or ball joint lies between base and tip.
    """
    name, body, T_body_tip = _tip(model, tip)
    path = list(ancestors(model, body))[::-1]
    if base:
        names = {model.body(b).name: b for b in path}
        if base not in names:
            raise UnknownNameError("base", base, names)
        path = path[path.index(names[base]) + 1 :]
    moved = [i for i, b in enumerate(path) if len(joints_of(model, b))]
    if not moved:
        raise ParameterError("tip", name, "a site or body that a hinge or slide joint moves")
    joints = [j for b in path for j in joints_of(model, b)]
    for j in joints:
        if model.jnt_type[j] not in (HINGE, SLIDE):
            kind = _NAMES[int(model.jnt_type[j])]
            needed = f"a site or body of an arm; the {kind} joint {joint_name(model, j)} moves it"
            raise ParameterError("tip", name, f"{needed}; base=BODY begins the arm after this joint")
    T = _EYE
    for b in path[moved[-1] + 1 :]:
        T = product(T, pose(model.body_pos[b], model.body_quat[b]))
    bodies = tuple(path[moved[0] : moved[-1] + 1])
    return Chain(tip=name, bodies=bodies, joints=np.array(joints, np.int64), T_last_tip=product(T, T_body_tip))


def _tip(model: mujoco.MjModel, tip: str) -> tuple[str, int, Array]:
    """Name of the tip, its body, and its pose (4, 4) in that body."""
    sites = {model.site(i).name: i for i in range(model.nsite) if model.site(i).name}
    moved = [name for name, i in sites.items() if _is_on_arm(model, int(model.site_bodyid[i]))]
    if not tip:
        if "tip" not in sites and len(moved) != 1:
            choices = ", ".join(moved) or "none, but a body is a tip too"
            raise ParameterError("tip", "", f"given: geometry=[tip=NAME], a site or body; sites of arms: {choices}")
        tip = "tip" if "tip" in sites else moved[0]
    if tip in sites:
        i = sites[tip]
        return tip, int(model.site_bodyid[i]), pose(model.site_pos[i], model.site_quat[i])
    bodies = {model.body(i).name: i for i in range(1, model.nbody)}
    if tip not in bodies:
        raise UnknownNameError("tip", tip, (*moved, *bodies))
    return tip, bodies[tip], _EYE


def _is_on_arm(model: mujoco.MjModel, body: int) -> bool:
    kinds = [model.jnt_type[j] for b in ancestors(model, body) for j in joints_of(model, b)]
    return bool(kinds) and all(kind in (HINGE, SLIDE) for kind in kinds)


def pose(place: Array, quaternion: Array) -> Array:
    """Transform (4, 4) of a position [m] and a quaternion w, x, y, z."""
    return transform(rotations_from_quaternions(np.array(quaternion, np.float64)), np.array(place, np.float64))


def frames(model: mujoco.MjModel, chain: Chain) -> tuple[list[Array], list[float]]:
    """Constant transforms (4, 4) before, between and after the joints, whose axes are along z; kinds of the joints.

    A kind is 1 for a turning and 2 for a sliding joint, negative if it moves against z.
    """
    fixed, kinds, last = list[Array](), list[float](), _EYE
    for body in chain.bodies:
        last = product(last, pose(model.body_pos[body], model.body_quat[body]))
        for j in joints_of(model, body):
            sign, align = turn_of_z(model.jnt_axis[j])
            is_turn = model.jnt_type[j] == HINGE
            anchor = model.jnt_pos[j].copy() if is_turn else np.zeros(3)
            fixed.append(product(product(last, transform(np.eye(3), anchor)), align))
            kinds.append(sign * (1.0 if is_turn else 2.0))
            zero = -sign * float(model.qpos0[model.jnt_qposadr[j]])  # the model's joints may begin at another value
            back = transform(rotation("z", zero if is_turn else 0.0), np.array([0.0, 0.0, 0.0 if is_turn else zero]))
            last = product(product(back, np.ascontiguousarray(align.T)), transform(np.eye(3), -anchor))
    return [*fixed, product(last, chain.T_last_tip)], kinds


def world_base(model: mujoco.MjModel, chain: Chain, begin: Array) -> Array:
    """Pose (4, 4) of the base in the world, with all joints at ``begin`` (nq,)."""
    data = _placed(model, begin)
    base = int(model.body_parentid[chain.bodies[0]])
    return pose(data.xpos[base], data.xquat[base])


def bodies(model: mujoco.MjModel, chain: Chain, begin: Array) -> Array:
    """Body of each joint with everything that it carries (n, 13), see :func:`body_row`; other joints are at ``begin``.

    The frame of a body is that after its joint, whose axis is z; the joint itself is at its value in ``begin``.
    """
    data, own = _placed(model, begin), set(chain.joints.tolist())
    found = np.zeros((len(chain.joints), 13))
    places = {int(j): i for i, j in enumerate(chain.joints)}
    for b in range(1, model.nbody):
        path = [j for a in ancestors(model, b) for j in reversed(joints_of(model, a)) if j in own]
        if path and chain.bodies[0] in ancestors(model, b):
            T = _frame_after(model, data, path[0])
            R = product(np.ascontiguousarray(T[:3, :3].T), data.ximat[b].reshape(3, 3).copy())
            centre = product(np.ascontiguousarray(T[:3, :3].T), data.xipos[b] - T[:3, 3])
            inertia = product(R * model.body_inertia[b], np.ascontiguousarray(R.T))
            found[places[path[0]]] += body_row(float(model.body_mass[b]), centre, inertia)
    return found


def _frame_after(model: mujoco.MjModel, data: mujoco.MjData, joint: int) -> Array:
    """Frame (4, 4) in the world of a body that a joint moves, with the joint's axis along z, see :func:`frames`.

    The last joint of a body turns this frame with the body; earlier joints of the same body carry no mass of their own.
    """
    body = int(model.jnt_bodyid[joint])
    _, align = turn_of_z(model.jnt_axis[joint])
    is_turn = model.jnt_type[joint] == HINGE
    anchor = model.jnt_pos[joint].copy() if is_turn else np.zeros(3)
    T = product(pose(data.xpos[body], data.xquat[body]), transform(np.eye(3), anchor))
    T = product(T, align)
    zero = turn_of_z(model.jnt_axis[joint])[0] * float(model.qpos0[model.jnt_qposadr[joint]])
    forth = transform(rotation("z", zero if is_turn else 0.0), np.array([0.0, 0.0, 0.0 if is_turn else zero]))
    return product(T, forth)


def _placed(model: mujoco.MjModel, begin: Array) -> mujoco.MjData:
    data = mujoco.MjData(model)
    data.qpos[:] = begin
    mujoco.mj_kinematics(model, data)
    return data


def limits(model: mujoco.MjModel, joint: int) -> tuple[float, float]:
    """Lower and upper limit of a joint [rad, m]; assumed if the model states none."""
    if model.jnt_limited[joint]:
        lower, upper = model.jnt_range[joint].tolist()
        return lower, upper
    most = ASSUMED["turn" if model.jnt_type[joint] == HINGE else "slide"]
    return -most, most


def gravity(model: mujoco.MjModel, chain: Chain, base: Array) -> Array:
    """Acceleration (3,) [m/s²] in axes of the base that the joints feel, less what the model compensates by itself."""
    carried = [b for b in range(1, model.nbody) if chain.bodies[0] in ancestors(model, b)]
    mass = model.body_mass[carried]
    share = float((mass * model.body_gravcomp[carried]).sum() / max(float(mass.sum()), 1e-12))
    return product(np.ascontiguousarray(base[:3, :3].T), model.opt.gravity * (1.0 - share))


def touching(model: mujoco.MjModel, chain: Chain, begin: Array) -> tuple[str, ...]:
    """Note on a body of the arm that is inside another body at the start, so that the arm cannot move freely."""
    data = _placed(model, begin)
    mujoco.mj_fwdPosition(model, data)
    for contact in data.contact:
        bodies = [int(model.geom_bodyid[g]) for g in contact.geom if g >= 0]
        is_arm = any(x in chain.bodies for b in bodies for x in ancestors(model, b))
        if is_arm and contact.dist < -_INSIDE:
            first, second = (model.body(b).name or "the world" for b in bodies)
            return (
                f"at the start {first} is {-1e3 * contact.dist:.1f} mm inside {second}; start=[...] moves the arm away",
            )
    return ()


def refuse_unusable(model: mujoco.MjModel, chain: Chain) -> None:
    """Refuse constraints between joints of the arm, or between the arm and others; inverse kinematics ignore them.

    Raises:
        ParameterError: There is such an equality constraint or tendon; the message names it.
    """
    own = set(chain.joints.tolist())
    for i in range(model.neq):
        if model.eq_active0[i] and (what := _tie(model, chain, own, i)):
            name = model.equality(i).name or f"equality constraint {i}"
            raise ParameterError("scene", name, f"left out: {what}, which inverse kinematics cannot use")
    for i in range(model.ntendon):
        first, count = int(model.tendon_adr[i]), int(model.tendon_num[i])
        wraps = range(first, first + count)
        tied = own & {int(model.wrap_objid[k]) for k in wraps if model.wrap_type[k] == mujoco.mjtWrap.mjWRAP_JOINT}
        if tied and (count > 1 or model.tendon_limited[i] or model.tendon_stiffness[i]):
            name = model.tendon(i).name or f"tendon {i}"
            needed = f"left out: it pulls at joint {joint_name(model, min(tied))}"
            raise ParameterError("scene", name, f"{needed}, which inverse kinematics cannot use")


def _tie(model: mujoco.MjModel, chain: Chain, own: set[int], i: int) -> str:
    """What an equality constraint ties the arm to; empty if it does not concern the arm's joints."""
    kind, a, b = model.eq_type[i], int(model.eq_obj1id[i]), int(model.eq_obj2id[i])
    if kind == mujoco.mjtEq.mjEQ_JOINT:
        return f"it ties joint {joint_name(model, min(own & {a, b}))}" if own & {a, b} else ""
    if kind not in _TIES or is_puppet(model, i):
        return ""
    if model.eq_objtype[i] == mujoco.mjtObj.mjOBJ_SITE:
        a, b = int(model.site_bodyid[a]), int(model.site_bodyid[b])
    links = [next((x for x in ancestors(model, body) if x in chain.bodies), 0) for body in (a, b)]
    if links[0] == links[1] or any(_is_free(model, body) for body in (a, b)):
        return ""
    names = [model.body(x).name for x in (a, b)]
    return f"it ties {names[0]} to {names[1]}"


def _is_free(model: mujoco.MjModel, body: int) -> bool:
    """Whether a free joint moves a body, which an arm may carry."""
    kinds = [model.jnt_type[j] for b in ancestors(model, body) for j in joints_of(model, b)]
    return mujoco.mjtJoint.mjJNT_FREE in kinds


def is_puppet(model: mujoco.MjModel, i: int) -> bool:
    """Whether an equality constraint pulls an arm by a mocap body, as some environments move their arms."""
    if model.eq_type[i] != mujoco.mjtEq.mjEQ_WELD or model.eq_objtype[i] == mujoco.mjtObj.mjOBJ_SITE:
        return False
    return any(model.body_mocapid[int(k)] >= 0 for k in (model.eq_obj1id[i], model.eq_obj2id[i]))
