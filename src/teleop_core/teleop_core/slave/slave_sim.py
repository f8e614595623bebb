"""Slave simulator: drives and mechanics of an arm, which follow its setpoints at 1 kHz."""

from dataclasses import dataclass, field, replace

import numpy as np

from teleop_core.base import Choice, ClosureError, ParameterError, Within, choice, fixed, parameter
from teleop_core.graph import DT, RunningStage, Stage, assign, topics
from teleop_core.kernels import Array, fields_of, pointer, record, record_array
from teleop_core.kinematics import FK, dh_kernels
from teleop_core.robots import load_robot_set
from teleop_core.robots.drives import ACCELERATION, GRAVITY
from teleop_core.robots.selection import RobotParameters
from teleop_core.slave import handover, simulation, stability, transmission
from teleop_core.slave.arm import ArmParts
from teleop_core.slave.controllers import CONTROLLERS, per_joint
from teleop_core.slave.elastic import gear_damping
from teleop_core.slave.force_sensor import ForceSensorParameters, SensorNoise
from teleop_core.slave.friction import bristle_damping
from teleop_core.slave.plants import PER_JOINT, PLANTS, Mover, Physics
from teleop_core.slave.world import WORLD_OBJECTS, contact, puncture
from teleop_core.slave.world.button import ButtonRecord
from teleop_core.slave.world.contents import WorldParameters


@dataclass(frozen=True, kw_only=True)
class ControllerParameters:
    """The control law of all joints."""

    kind: Choice = choice(CONTROLLERS, "pid", fixed=True, doc="control law of the joints")


@dataclass(frozen=True, kw_only=True)
class PlantParameters:
    """The plant, which the simulator moves."""

    kind: Choice = choice(PLANTS, "ideal", fixed=True, doc="model of the arm that the simulator moves")


@dataclass(frozen=True, kw_only=True)
class SlaveSimParameters(RobotParameters):
    """Parameters of :class:`SlaveSim`."""

    seed: int = fixed(1, Within(0), "seed of everything random in the session")

    gravity_compensation: str = parameter(
        "published",
        choices=("published", "all", "none"),
        doc="axes with gravity feed-forward: source: as published (axis 2), all, or none",
    )
    integration_steps: int = parameter(2, Within(1, 50), "number of Runge-Kutta steps in each control tick")
    viscous: tuple[float, ...] = parameter(
        (), Within(0.0, None, "N·m·s/rad or N·s/m"), "viscous friction of each joint; empty: the plant's"
    )
    coulomb: tuple[float, ...] = parameter(
        (), Within(0.0, None, "N·m or N"), "dry friction of each joint; empty: the plant's"
    )
    plant: PlantParameters = field(default_factory=PlantParameters)
    world: WorldParameters = field(default_factory=WorldParameters)
    force_sensor: ForceSensorParameters = field(default_factory=ForceSensorParameters)
    controller: ControllerParameters = field(default_factory=ControllerParameters)
    trials: str = parameter(
        "all",
        choices=("all", "small"),
        doc="errors that must decay in the stability check before a session: all: small errors and "
        "those after a move at full speed; small: small errors only, for experiments with bad "
        "control laws",
    )


class SlaveSim(RunningStage):
    """Stage that simulates an arm: a discrete control law on continuous drives and links.

    The arm begins at home, at rest and in balance: the control law balances the uncompensated gravity if it has an
    integral. Its tip can touch the world, and the contact force acts on the drives.

    Raises:
        ParameterError: The robot has no drives, the length of a list is not its number of joints, errors do not decay
            in the control loop, or the tip begins inside an object.
    """

    def __init__(self, parameters: SlaveSimParameters, dt: float = DT) -> None:
        self.robot = load_robot_set(parameters.robot, parameters.geometry)
        if self.robot.drives is None or self.robot.dynamics is None:
            raise ParameterError("slave_sim.robot", parameters.robot, "a robot with drives")
        n, model = self.robot.n, self.robot.dynamics
        super().__init__(SLAVE_SIM, n, dt)
        self.parameters = record(simulation.SimulationRecord, n)
        self.state = record(simulation.SimulationState, n)
        self._law = CONTROLLERS.find(parameters.controller.kind.kind)
        self._seed, physics = parameters.seed, self._physics(parameters)
        self._noise = SensorNoise(parameters.seed)
        gains = self._gains(parameters, physics.viscous)
        is_as_drawn = len(physics.tip_geometry) == 0
        touched = WORLD_OBJECTS.find(parameters.world.kind.kind)
        self.arm = ArmParts(
            tip_fk=self.robot.fk_pointer if is_as_drawn else pointer(dh_kernels.fk, FK),
            jacobian=pointer(self.robot.kernels.jacobian if is_as_drawn else dh_kernels.jacobian, FK),
            distance=touched.pointer,
            acceleration=pointer(model.acceleration, ACCELERATION),
            gravity=pointer(model.gravity, GRAVITY),
            control=self._law.control_pointer,
            tip_geometry=(self.robot.geometry_row if is_as_drawn else physics.tip_geometry).copy(),
            coupling=np.array(physics.coupling, dtype=np.float64, order="C"),
            dynamics=self._dynamics(physics).copy(),
            model=model.parameters.copy(),
            gains=gains,
            memory=np.zeros((n, max(self._law.memory, 1))),
            q=np.zeros(n),
            dq=np.zeros(n),
            effort=np.zeros(n),
            setpoint=np.zeros(n),
            measured=np.zeros(n),
            feedforward=np.zeros(self._law.feedforward(n)),
            limit=np.zeros(n),
            joints=np.zeros(n),
            tip=np.zeros(n),
            T=np.zeros((4, 4)),
            shape=parameters.world.shape.copy(),
            contacts=record_array(contact.ContactState, parameters.world.tool_points, n),
            offset=np.zeros(3),
            normal=np.zeros(3),
            J=np.zeros((6, n)),
            noises=self._noise.rows,
        )
        self.kernel, self.arguments = simulation.simulation_step, (self.parameters, self.state, self.arm)
        self._take(parameters)
        self._mover = self._moved_by(parameters)
        self.reset()
        self._check_world(parameters.world)
        self._check_loop(parameters)
        self._examined, self._gains_in_force = parameters, self.arm.gains.copy()
        handover.missing_effort(self.arm, np.zeros(n), self.arm.gains, dt, ticks=0)  # compiles the kernels

    def reset(self) -> None:
        """Return to home, at rest."""
        self._rest_at(self.robot.home)

    def _rest_at(self, home: Array) -> None:
        """Place the arm at joints (n,), at rest and in balance."""
        s, arm = self.state, self.arm
        assign(s, 0)
        assign(arm.contacts, 0)
        self._noise.reset()
        step = self.parameters["encoder_step"]
        s["measured"], s["speed"] = np.round(home / step) * step, 0.0
        arm.q[:], arm.dq[:], arm.effort[:], arm.memory[:] = home, 0.0, 0.0, 0.0
        s["grip"], s["carried"] = 1.0, home
        s["noise"] = np.random.SeedSequence(self._seed).generate_state(self.robot.n) % 2147483646 + 1
        relieved = self._gravity(arm.model) * self.parameters["compensated"]
        held = self._gravity(arm.dynamics) - relieved - self.parameters["bias"]
        self._law.begin(arm.memory, np.array(s["measured"]), held)
        stiffness = self.parameters["gear_stiffness"]
        bent = np.divide(self._gravity(arm.dynamics), stiffness, out=np.zeros_like(home), where=stiffness > 0.0)
        s["link"] = home - bent
        row = self.signals
        row["slave_setpoint_js"], row["slave_measured_js"] = home, 0.0
        row["slave_true_cf"] = row["slave_measured_cf"] = row["slave_estimated_cf"] = 0.0
        row["slave_measured_js"][: self.robot.n] = s["measured"]
        row["slave_measured_js_ns"] = topics.NO_COMMAND_NS  # position before the first tick
        if self._mover is not None:
            self._mover.reset()

    @property
    def punctures(self) -> int:
        """Number of punctures of the object so far."""
        return int(self.arm.contacts[0]["punctures"])

    @property
    def presses(self) -> int:
        """Number of presses of a button down to its stop so far."""
        return int(self.arm.contacts[0]["presses"])

    @property
    def depth(self) -> float:
        """Depth of the tip in the channel of the last puncture, one tick ago [m]; 0 outside the channel."""
        tip = self.arm.contacts[0]
        return max(-float(tip["gap"]), 0.0) if tip["is_open"] else 0.0

    def prepare(self, ticks: int) -> None:
        """Draw the noise of the force sensor for the next ticks."""
        if self.parameters["has_noise"]:
            self._noise.prepare(self.state, ticks)

    def concerns(self) -> list[str]:
        """Problems of a simulator of others that moves the arm."""
        return [] if self._mover is None else self._mover.concerns()

    def examine(self, parameters: SlaveSimParameters) -> None:
        """Try parameters on a separate copy of the arm, at home and at the present position.

        This takes tenths of a second if the control loop changes. A running session therefore does it outside the
        ticks, before :meth:`retune`.

        Raises:
            ParameterError: The length of a list is not the number of joints; friction is too large for the drives or
                the integrator; or an error would grow, or not decay.
        """
        trial = SlaveSim(parameters, self.dt)
        if trial._mover is not None:
            trial._mover.close()
        if stability.loop_key(trial.parameters, trial.arm) != stability.loop_key(self.parameters, self.arm):
            trial._rest_at(self.arm.q.clip(self.robot.lower, self.robot.upper))
            trial._check_loop(parameters)
        self._examined = parameters

    def retune(self, parameters: SlaveSimParameters) -> None:
        """Take new parameters from the next tick on; a law with ``shift`` keeps the effort continuous.

        Raises:
            ParameterError: As in :meth:`examine`, which is called first if it has not run for these parameters. If it
                fails, no parameter changes.
        """
        if parameters is not self._examined:
            self.examine(parameters)
        self._take(parameters)
        self._hand_over()

    def _moved_by(self, parameters: SlaveSimParameters) -> Mover | None:
        """Simulator of the plant that moves the arm, with its kernels in the parameter record; None for our own."""
        kind, p = parameters.plant.kind, self.parameters
        make = PLANTS.find(kind.kind).mover
        if make is None:
            return None
        if p["has_world"]:
            raise ParameterError(
                "world.kind", parameters.world.kind.kind, f"empty, because plant={kind.kind} has a world"
            )
        mover = make(kind.parameters, self.robot, self.arm, self.signals, self.dt)
        p["see"], p["see_block"] = mover.see.address, mover.see.block_address
        p["move"], p["move_block"] = mover.move.address, mover.move.block_address
        p["has_servos"] = mover.has_servos
        return mover

    def _take(self, parameters: SlaveSimParameters) -> None:
        """Write parameters into the records that the step reads."""
        robot, p, drives = self.robot, self.parameters, self.robot.drives
        assert drives is not None
        assert robot.dynamics is not None
        physics = self._physics(parameters)
        self.arm.gains[:] = self._gains(parameters, physics.viscous)
        for name in PER_JOINT:
            p[name] = getattr(physics, name)
        p["bristle_damping"] = bristle_damping(physics.bristle, drives.inertia)
        p["gear_damping"] = gear_damping(physics.gear_stiffness, physics.motor_inertia)
        p["has_gears"] = np.any(physics.gear_stiffness)
        p["delay_ticks"] = min(round(physics.effort_delay / self.dt), transmission.LONGEST_DELAY)
        p["effort_limit"], p["speed_limit"] = drives.effort_limit, drives.speed_limit
        self.arm.limit[:] = drives.effort_limit
        self._take_world(parameters.world)
        parameters.force_sensor.write(p, self.dt)
        compensated = {"published": robot.dynamics.compensated, "all": 1.0, "none": 0.0}[
            parameters.gravity_compensation
        ]
        relieved = self._gravity(self.arm.model)
        self._law.shift(self.arm.memory, relieved * (p["compensated"] - compensated))
        p["compensated"] = compensated
        p["steps"], p["braking"] = (parameters.integration_steps, drives.effort_limit / drives.inertia)

    def _take_world(self, world: WorldParameters) -> None:
        """Write the object's position and material."""
        p, made_of = self.parameters, world.made_of
        p["has_world"] = world.kind.kind != "empty"
        if p["has_world"]:
            p["world_center"] = world.center(self._tip_at_start())
        p["tool_length"], p["tool_radius"] = world.tool_length, world.tool_radius
        p["world_stiffness"], p["world_damping"] = made_of.stiffness, made_of.damping
        p["world_friction"] = made_of.friction
        for name, *_ in fields_of(puncture.PunctureRecord):
            p[name] = getattr(world, name)
        for name, *_ in fields_of(ButtonRecord):
            p[name] = getattr(world.kind.parameters, name, 0.0)
        self.arm.shape[:] = world.shape

    def _tip_at_start(self) -> Array:
        """Pose (4, 4) of the tip at the robot's start.

        Raises:
            ParameterError: The forward kinematics cannot close the robot's loops at the start.
        """
        try:
            return self.robot.fk(self.robot.start)
        except ClosureError as error:
            text = f"given for {self.robot.name}, because the position of its tip at the start is unknown"
            raise ParameterError("world.place", (), text) from error

    def _check_world(self, world: WorldParameters) -> None:
        """Raise an error if the tool begins inside the object.

        Raises:
            ParameterError: The tool begins inside the object.
        """
        center, tool = self.parameters["world_center"], world.tool(self.robot.fk(self.robot.home))
        inside = -world.distance(tool, center) if self.parameters["has_world"] else 0.0
        if inside > 0.0:
            text = (
                f"chosen so that the object does not contain the tip at home, which is {1000.0 * inside:.1f} mm inside"
            )
            raise ParameterError("world.place", tuple(center.tolist()), text)

    def _check_loop(self, parameters: SlaveSimParameters) -> None:
        """Try the present control loop at the arm's position; see :mod:`teleop_core.slave.stability`."""
        assert self.robot.drives is not None
        if self.parameters["has_servos"]:
            return
        if self._mover is None:
            stability.check_friction(self.parameters, self.robot.drives.inertia, self.dt)
        loop = stability.ClosedLoop(self.parameters, self.state, self.arm, self.signals, self.dt)
        stability.check_stable(self._law, self.robot, loop, are_large_tried=parameters.trials == "all")

    def _hand_over(self) -> None:
        """Add the effort that the law loses by its new gains to the integrators, after these gains were set."""
        if np.array_equal(self.arm.gains, self._gains_in_force):
            return
        if self.signals["now_ns"] > 0:  # before the first tick the arm is at rest, so no effort is lost
            speed = np.array(self.state["speed"])
            missing = handover.missing_effort(self.arm, speed, self._gains_in_force, self.dt)
            self._law.shift(self.arm.memory, missing)
        self._gains_in_force = self.arm.gains.copy()

    def _physics(self, parameters: SlaveSimParameters) -> Physics:
        """Numbers of the plant; friction values of the slave's own parameters replace those of the plant."""
        chosen, robot = parameters.plant.kind, self.robot
        made = PLANTS.find(chosen.kind).physics(chosen.parameters, robot)
        viscous = per_joint(robot, "viscous", parameters.viscous, made.viscous)
        coulomb = per_joint(robot, "coulomb", parameters.coulomb, made.coulomb)
        return replace(made, viscous=viscous, coulomb=coulomb)

    def _dynamics(self, physics: Physics) -> Array:
        """Parameter row of the true dynamics."""
        model = self.robot.dynamics
        assert model is not None
        return physics.dynamics if len(physics.dynamics) else model.parameters

    def _gains(self, parameters: SlaveSimParameters, viscous: Array) -> Array:
        table = self._law.gains(parameters.controller.kind.parameters, self.robot, viscous)
        return np.array(table, dtype=np.float64, order="C")

    def _gravity(self, dynamics: Array) -> Array:
        """Effort (n,) that holds an arm with these dynamics at its present position [N·m or N]."""
        assert self.robot.dynamics is not None
        effort = np.zeros(self.robot.n)
        self.robot.dynamics.gravity(self.arm.q, dynamics, effort)
        return effort


SLAVE_SIM = Stage(
    "slave_sim",
    SlaveSimParameters,
    reads=(topics.SLAVE_SETPOINT_JS, topics.SLAVE_OPERATION),
    writes=(
        topics.SLAVE_MEASURED_JS,
        topics.SLAVE_MEASURED_CF,
        topics.SLAVE_ESTIMATED_CF,
        topics.SLAVE_TRUE_CP,
        topics.SLAVE_TRUE_CF,
    ),
    make=SlaveSim,
    node="teleop_core.nodes.slave_sim:SlaveSimNode",
)
