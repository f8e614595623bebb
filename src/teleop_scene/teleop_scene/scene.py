"""Scene: a running MuJoCo model, which all arms and other stages of a session share.

A tick calls ``mj_step`` by its address from compiled code, without Python. The scene advances when the first of its
arms begins its next tick: by then every arm has given its efforts for the last tick. So the order of the arms has no
effect, and two arms move one world.

The scene begins with its whole state at the keyframe or at the model's own zero; :meth:`Scene.reset` restores all of
it, with the solver's warm start. So equal controls give equal bits on one machine with one version of MuJoCo.
"""

import copy
import ctypes
import math
import weakref
from functools import cache, partial
from pathlib import Path
from time import perf_counter

import mujoco
import numpy as np

from teleop_core.base import TeleopError
from teleop_core.kernels import Array, Fields, addressed, call_address, kernel, record
from teleop_core.kernels.fields import Integers
from teleop_core.kernels.memory import call
from teleop_scene import actuators, models

_STEPS_TRIED = 40
_SHARE = 0.7  # of a tick that the steps of a scene may take in a live session
_HUGE = 1e10  # MuJoCo calls a larger position or speed bad
_DISABLED = mujoco.mjtDisableBit


class SceneState(Fields):
    """State record of a running scene; the addresses are those of C functions and of their arguments."""

    step: int
    find_forces: int
    model: int
    data: int
    substeps: int
    dt: float  # of a step [s]
    ticks: int  # that the scene has made
    is_lost: int  # whether a number is not finite, so that the scene stands still
    tell: int  # address of the function that ends the session then, and of its block
    tell_block: int
    work: float  # that drives have done on the scene since the start [J]


@cache
def _library() -> ctypes.CDLL:
    """The library of MuJoCo that Python has loaded; warnings that it would write into a file are dropped."""
    path = next(Path(mujoco.__file__).parent.glob("libmujoco.so*"))
    library = ctypes.CDLL(str(path))
    quiet = ctypes.cast(ctypes.CDLL(None).strlen, ctypes.c_void_p).value  # any function of a text that does nothing
    ctypes.c_void_p.in_dll(library, "mju_user_warning").value = quiet
    return library


def address_of(name: str) -> int:
    """Address of a C function of MuJoCo."""
    found = ctypes.cast(getattr(_library(), name), ctypes.c_void_p).value
    assert found is not None
    return found


@kernel
def advance(s: SceneState, qpos: Array, qvel: Array, force: Array, given: Array) -> None:
    """Move the scene by a tick; a scene with a number that is huge or not finite stands still.

    Args:
        s: State record; written.
        qpos: Positions (nq,) of the scene.
        qvel: Speeds (nv,) of the scene.
        force: Efforts (nv,) of the actuators at the joints.
        given: Efforts (nv,) that drives of ours give.
    """
    if s.is_lost != 0:
        return
    for _ in range(s.substeps):
        call(s.step, s.model, s.data, 0, 0)
        for i in range(qvel.shape[0]):
            s.work += (force[i] + given[i]) * qvel[i] * s.dt
    call(s.find_forces, s.model, s.data, 0, 0)
    for i in range(qpos.shape[0]):
        if not abs(qpos[i]) < _HUGE:
            s.is_lost = 1
    for i in range(qvel.shape[0]):
        if not abs(qvel[i]) < _HUGE:
            s.is_lost = 1
    s.ticks += 1
    if s.is_lost != 0:
        call_address(s.tell, s.tell_block)


def _end(scene: "weakref.ref[Scene]") -> None:
    """End the session of a scene that became unstable.

    Raises:
        TeleopError: Always; it is raised at the end of the running ticks.
    """
    found = scene()
    raise TeleopError("" if found is None else found.problem())


class Scene:
    """A model in motion. A session whose scene becomes unstable ends with a TeleopError.

    Args:
        file: File of the model.
        dt: Length of a tick [s], which is divided into steps not longer than those of the model.

    Attributes:
        model: The scene's own copy of the model.
        data: Its state.
        state: Record that kernels use.
        arrays: Positions, speeds and efforts, the last arguments of :func:`advance`.

    Raises:
        TeleopError: As in :func:`~teleop_scene.models.model_of`.
    """

    def __init__(self, file: Path, dt: float) -> None:
        self.file, self.dt = file, dt
        self.model = copy.copy(models.model_of(file))
        option = self.model.opt
        substeps = max(1, math.ceil(dt / option.timestep - 1e-9))
        option.timestep = dt / substeps
        option.disableflags |= int(_DISABLED.mjDSBL_AUTORESET)
        option.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
        self.data = mujoco.MjData(self.model)
        self.state = s = record(SceneState)
        s["step"], s["find_forces"] = address_of("mj_step"), address_of("mj_rnePostConstraint")
        s["model"], s["data"], s["substeps"] = self.model._address, self.data._address, substeps
        s["dt"] = option.timestep
        self._tell = addressed(partial(_end, weakref.ref(self)))
        s["tell"], s["tell_block"] = self._tell.address, self._tell.block_address
        data = self.data
        self.arrays = (data.qpos, data.qvel, data.qfrc_actuator, data.qfrc_applied)
        self.begin = np.array(self.model.key_qpos[0] if self.model.nkey else self.model.qpos0)
        self.control = np.array(self.model.key_ctrl[0] if self.model.nkey else np.zeros(self.model.nu))
        self._claims: set[str] = set()
        self._friction = self.model.dof_frictionloss.copy(), self.model.dof_solimp.copy()
        self.reset()

    def claim(self, owner: str) -> bool:
        """Let an arm or another stage own its part of the scene; False if this part has an owner already."""
        is_free = owner not in self._claims
        self._claims.add(owner)
        return is_free

    def has(self, owner: str) -> bool:
        """Whether a part of the scene has this owner."""
        return owner in self._claims

    def place(self, joints: Integers, values: Array) -> None:
        """Let the scene begin with some joints, and their servos, at given positions [rad, m]."""
        self.begin[self.model.jnt_qposadr[joints]] = values
        for joint, value in zip(joints.tolist(), values.tolist(), strict=True):
            drive = actuators.drive_of(self.model, joint)
            if drive.is_servo:
                self.control[drive.index] = drive.gear * value

    def reset(self) -> None:
        """Return to the state before the first tick."""
        mujoco.mj_resetData(self.model, self.data)
        if self.model.nkey:
            self.data.act[:] = self.model.key_act[0]
        self.data.ctrl[:] = self.control
        self.data.qpos[:] = self.begin
        self.model.dof_frictionloss[:], self.model.dof_solimp[:] = self._friction
        mujoco.mj_forward(self.model, self.data)
        self.data.qacc_warmstart[:] = 0.0
        self.state["ticks"], self.state["is_lost"], self.state["work"] = 0, 0, 0.0

    def problem(self) -> str:
        """Text about a scene that became unstable; empty for a sound one."""
        if not self.state["is_lost"]:
            return ""
        when = self.state["ticks"] * self.dt
        names = [self.model.joint(j).name or f"joint{j}" for j in range(self.model.njnt) if self._is_lost(j)]
        moved = f" at {names[0]}" if names else ""
        return (
            f"scene {self.file.name} became unstable after {when:.3f} s{moved}: give the model shorter steps, softer "
            "contacts or more damping"
        )

    def _is_lost(self, joint: int) -> bool:
        begin = int(self.model.jnt_dofadr[joint])
        return not abs(float(self.data.qvel[begin])) < _HUGE

    def step_time(self) -> float:
        """Processor time [s] of the steps of a tick, the median of some ticks at the start on a copy of the state."""
        data, times = copy.copy(self.data), []
        for _ in range(_STEPS_TRIED):
            begin = perf_counter()
            mujoco.mj_step(self.model, data, int(self.state["substeps"]))
            times.append(perf_counter() - begin)
        return float(np.median(times))

    def slowness(self) -> str:
        """Text about a scene whose steps take too long for a live session; empty for a fast one."""
        time = self.step_time()
        if time <= _SHARE * self.dt:
            return ""
        return (
            f"scene {self.file.name} takes {1e3 * time:.2f} ms for each tick of {1e3 * self.dt:g} ms, too slow for a "
            "live session: use fewer contacts or geometries, or longer steps"
        )


_newest: "weakref.WeakValueDictionary[tuple[Path, float], Scene]" = weakref.WeakValueDictionary()


def shared(file: Path, dt: float, owner: str) -> Scene:
    """Scene of the session that is being built.

    Stages of a session are made one after the other, in any order. A part that already has an owner therefore belongs
    to another session, so that this owner gets a scene of its own, which the following stages share.

    Args:
        file: File of the model.
        dt: Length of a tick [s].
        owner: What the caller will move: the tip of an arm, or its jaw.
    """
    key = (file.resolve(), dt)
    scene = _newest.get(key)
    if scene is None or not scene.claim(owner):
        scene = _newest[key] = Scene(file, dt)
        scene.claim(owner)
    return scene


def leave(scene: Scene) -> None:
    """Let no further stage share a scene."""
    for key in [key for key, value in _newest.items() if value is scene]:
        del _newest[key]
