"""Peg transfer: bring each block to the peg of its colour, by one arm, two, or from jaw to jaw."""

from dataclasses import dataclass

import numpy as np

from teleop_core.base import ParameterError, Within, parameter
from teleop_core.graph.topics import JAW_OBJECTS
from teleop_core.hand.tasks import Task, transfer
from teleop_core.kernels import Array, kernel

_ONE_WAY, _WAYS = 2, 2 * JAW_OBJECTS


@dataclass(frozen=True, kw_only=True)
class PegTransferParameters:
    """How to transfer the blocks of ``jaw_sim``; the kinds are those of Hwang et al. 2020, arXiv 2012.12844."""

    arms: str = parameter(
        "one",
        choices=transfer.KINDS,
        doc="which arm transfers a block: one arm transfers all; two arms take turns; or the first "
        "arm hands each block over to the second",
    )
    ways: tuple[float, ...] = parameter(
        (0.0, -0.04),
        Within(-1.0, 1.0, "m"),
        "x, y of the displacement from each block to the peg of its colour; a single one is used for all blocks",
    )
    lift: float = parameter(
        0.03, Within(1e-3, 0.5, "m"), "height above the standing blocks at which a block is carried"
    )
    clearance: float = parameter(
        0.0015, Within(0.0, 0.1, "m"), "clearance between peg and block; the same as jaw_sim.pegs.clearance"
    )
    width: float = parameter(0.002, Within(1e-4, 0.1, "m"), "diameter of a goal, which is a ball")
    longest: float = parameter(
        60.0, Within(1.0, 600.0, "s"), "longest time of a transfer; a longer transfer is an error"
    )
    tries: int = parameter(2, Within(1, 99), "number of times that the arm picks up a block, if it drops the block")

    def __post_init__(self) -> None:
        if len(self.ways) not in {_ONE_WAY, _WAYS}:
            raise ParameterError("task.peg_transfer.ways", self.ways, f"x, y of one way, or of {JAW_OBJECTS}")


def numbers(p: PegTransferParameters) -> Array:
    """Numbers of the judge: lift, width, longest, kind, x and y of six displacements, clearance, tries."""
    kind = transfer.KINDS.index(p.arms)
    return np.array([p.lift, p.width, p.longest, kind, *np.resize(p.ways, _WAYS), p.clearance, p.tries], np.float64)


@kernel
def peg_transfer_judge(numbers: Array, memory: Array, scene: Array, state: Array) -> None:
    """Step by step, set the goals of each hand; judge each block when it comes to rest; see :mod:`.transfer`."""
    transfer.lead(numbers, memory, scene, state)


PEG_TRANSFER = Task("peg_transfer", PegTransferParameters, peg_transfer_judge, numbers)
