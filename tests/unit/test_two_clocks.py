"""Two clocks: the slave's side has a clock of its own, and nothing but its stamps tells so."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import teleop_core as tc
from teleop_core.bags.reader import Bag
from teleop_core.graph.signals import TICK_NS
from teleop_core.kernels.geometry import Array
from teleop_core.session import configuration, virtual
from teleop_core.slave.operation import OperationParameters
from teleop_core.slave.pair import ArmParameters, SimulatedArm

MS = 1_000_000
STAMPED_THERE = ("network_measured_cp_ns", "network_measured_cf_ns", "network_slave_energy_ns")
"""What the slave samples: the rest of what comes back has the stamp of a command."""


def session(*given: str, scenario: str = "palpation", stages: str = "[network]") -> Any:
    """Session whose sides are 50 ms apart, there and back."""
    settings = [f"teleop.stages={stages}", "network.there.least_delay=0.05", "network.back.least_delay=0.05", *given]
    return virtual.VirtualTime(configuration.configure(scenario, settings=settings))


@pytest.mark.parametrize(("offset", "drift"), [(0.5, 100.0), (-0.5, -100.0), (3600.0, 0.0)])
@pytest.mark.parametrize("stages", ["[network]", "[network, passivity]"])
def test_a_session_with_two_clocks_moves_as_one_with_a_single_clock_to_the_bit(
    offset: float, drift: float, stages: str
) -> None:
    felt = ["reflection.architecture=position_force"]
    plain = session(*felt, stages=stages)
    plain, ticks = plain.run(plain.lead + 7000), plain.lead + 7000
    clocks = (f"network.clock_offset={offset}", f"network.clock_drift={drift}")
    other = session(*felt, *clocks, stages=stages).run(ticks)
    for name in plain.dtype.names:
        if name not in (*STAMPED_THERE, "network_state"):
            np.testing.assert_array_equal(plain[name], other[name], err_msg=name)
    assert np.linalg.norm(plain["master_servo_cf"][:, :3], axis=1).max() > 0.1
    assert plain["teleop_state"][-1, 0] == 1.0
    shown = [name for name in STAMPED_THERE if name in plain.dtype.names]
    assert len(shown) == (3 if "passivity" in stages else 2)
    for name in shown:
        stamps = plain[name]
        has_come = stamps > 520 * MS  # before that, a clock that is behind has stamps below 0
        ahead = (other[name] - stamps)[has_come]
        expected = 1e9 * offset + 1e-6 * drift * (stamps[has_come] - plain["now_ns"][0])
        assert np.abs(ahead - expected).max() <= 2.0
        assert (other[name][~has_come] <= stamps[~has_come]).all() or offset > 0.0


def test_the_age_that_is_scored_is_the_true_one_whatever_the_slaves_clock_says(tmp_path: Path) -> None:
    given: dict[str, Any] = {"stages": "network", "duration": 5.0, "preset": "own"}
    found: Any = []
    for name, clock in (("one", {}), ("two", {"clock_offset": 0.5, "clock_drift": 100.0})):
        settings = {f"network.{key}": value for key, value in clock.items()}
        settings |= {"network.there.least_delay": 0.03, "network.back.least_delay": 0.2}
        ran = tc.run("free_motion", out=tmp_path / name, **given, settings=settings)
        score = ran.score()
        found.append(
            [score.value(f"network.{way}.{key}") for way in ("there", "back") for key in ("age_mean_ms", "age_p99_ms")]
        )
    np.testing.assert_allclose(found[1], found[0], atol=0.1)
    # What is measured is two ticks old when it is sent.
    assert found[1][2] == pytest.approx(202.0, abs=0.5)
    series = Bag(tmp_path / "two").read("network/measured_cp")
    assert (series.log_ns - series.stamp_ns)[-1] / MS == pytest.approx(202.0 - 500.5, abs=0.5)


@pytest.mark.parametrize("ahead", [-3600.0, -0.5, 0.5])
def test_a_slave_follows_commands_of_another_clock_as_those_of_its_own(ahead: float) -> None:
    """Up to a second ahead, from where on a stamp counts as wrong."""

    def setpoints(ahead_ns: int, drift: float) -> tuple[Array, Array]:
        operation = OperationParameters(oldest_command=0.0)
        slave = SimulatedArm(ArmParameters(start_speed=1.0, operation=operation))
        row, begin, found = slave.signals, 4_000 * 10**9, []
        slave.step()
        rest = place = np.array(row["slave_setpoint_js"])
        for i in range(1, 6000):
            now_ns = begin + i * TICK_NS
            row["now_ns"] = now_ns
            if i > 4000:
                if i == 4001:
                    place = np.array(row["slave_setpoint_js"])
                row["slave_servo_jp"] = place
                place = place + 2e-4 * np.sin(2e-3 * (i - 4000))
                row["slave_servo_jp_ns"] = now_ns + ahead_ns + int(drift * i * TICK_NS)
            slave.step()
            found.append(np.array(row["slave_setpoint_js"]))
        assert np.abs(found[-1] - found[4000]).max() > 1e-2
        return np.array(found), rest

    own, _ = setpoints(0, 0.0)
    other, _ = setpoints(round(1e9 * ahead), 0.0)
    np.testing.assert_array_equal(own, other)
    drifting, _ = setpoints(round(1e9 * ahead), 1e-4)
    assert np.abs(own - drifting).max() < 1e-4


def behind(there: float, back: float, *given: str) -> tuple[Array, Array]:
    """Session of 10 s over these delays [s]: whether it follows, and setpoint from command [m]."""
    delays = (f"network.there.least_delay={there}", f"network.back.least_delay={back}")
    run = session(*delays, *given, "slave.starts_at_home=true", scenario="free_motion")
    rows = run.run(10_000)
    arrived, reached = rows["network_servo_cp"][:, :3], rows["slave_setpoint_cp"][:, :3]
    assert np.ptp(reached[3000:], axis=0).max() > 5e-3
    off = np.linalg.norm(reached - arrived, axis=1)[3000:]
    return rows["teleop_state"][:, 0], off


@pytest.mark.parametrize(("there", "back"), [(0.35, 0.35), (0.1, 0.6), (0.6, 0.1)])
def test_a_slave_is_followed_whose_answer_takes_700_ms(there: float, back: float) -> None:
    following, off = behind(there, back, "network.clock_offset=0.5", "network.clock_drift=100")
    assert following[3000:].all()
    _, near = behind(0.0, 0.0)
    assert off.max() < 1.1 * near.max()  # it is as near what arrives as one next door
