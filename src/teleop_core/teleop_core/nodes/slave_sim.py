"""Node ``slave_sim``: the simulated arm, exactly one step per elapsed millisecond."""

from teleop_core.graph.topics import SLAVE_SETPOINT_JS
from teleop_core.nodes.ticking import TickingNode


class SlaveSimNode(TickingNode):
    """Moves the arm to the newest ``slave/setpoint_js``; before the first setpoint the arm is at home."""

    def concerns(self) -> list[str]:
        """Text about an arm that gets no setpoints."""
        setpoint = self.input(SLAVE_SETPOINT_JS)
        if setpoint.stamp_ns is None:
            return ["waits for slave/setpoint_js; the arm stands still"]
        is_silent = setpoint.age() > _SILENCE
        return [f"no slave/setpoint_js for {setpoint.age():.1f} s: the arm stands still"] if is_silent else []

    def values(self) -> dict[str, str]:
        """Presses of a button; number of punctures and depth of the needle if the world can be punctured."""
        stage = self.stage
        if stage.parameters["click_force"] > 0.0:
            return {"presses": str(stage.presses)}
        if not (stage.parameters["puncture_force"] > 0.0 or stage.punctures):
            return {}
        return {"punctures": str(stage.punctures), "depth_mm": f"{1e3 * stage.depth:.2f}"}


_SILENCE = 0.5  # a longer time without a setpoint is a concern [s]
