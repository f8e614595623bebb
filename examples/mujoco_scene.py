"""Write a MuJoCo scene of twenty lines, follow the hand with its arm, and carry a ball on a tray."""

from pathlib import Path
from tempfile import TemporaryDirectory

import teleop_core as tc

SCENE = """<mujoco model="tray">
  <worldbody>
    <geom type="plane" size="1 1 0.01"/>
    <body name="carriage" pos="0 0 0.3">
      <joint name="x" type="slide" axis="1 0 0" range="-0.3 0.3" damping="2" armature="0.5"/>
      <joint name="y" type="slide" axis="0 1 0" range="-0.3 0.3" damping="2" armature="0.5"/>
      <joint name="z" type="slide" axis="0 0 1" range="-0.2 0.3" damping="2" armature="0.5"/>
      <geom type="box" size="0.06 0.06 0.004" mass="0.5"/>
      <geom type="box" size="0.004 0.06 0.02" pos="0.06 0 0.02"/>
      <geom type="box" size="0.004 0.06 0.02" pos="-0.06 0 0.02"/>
      <geom type="box" size="0.06 0.004 0.02" pos="0 0.06 0.02"/>
      <geom type="box" size="0.06 0.004 0.02" pos="0 -0.06 0.02"/>
      <site name="tip"/>
    </body>
    <body name="ball" pos="0 0 0.325"><freejoint/><geom size="0.02" mass="0.2" condim="6"/></body>
  </worldbody>
  <keyframe><key qpos="0 0 0  0 0 0.325 1 0 0 0"/></keyframe>
</mujoco>
"""


def main() -> None:
    """Run a session with the scene, and print what the arm and the ball did."""
    with TemporaryDirectory() as folder:
        file = Path(folder) / "tray.xml"
        file.write_text(SCENE, encoding="utf-8")
        recording = tc.run("coarse_box", duration=8.0, robot=str(file))
        print(recording.score())
    weight = -float(recording["slave/measured_cf"]["fz"].mean())
    carriage, ball = recording["scene/poses"]["x0"], recording["scene/poses"]["x1"]
    print(f"mean weight on the tray: {weight:.2f} N; the ball weighs {0.2 * 9.81:.2f} N")
    print(f"the ball rolled {1e3 * float(abs(ball - carriage).max()):.0f} mm from the middle of the tray, at most")


if __name__ == "__main__":
    main()
