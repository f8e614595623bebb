"""Train a policy to pick and place from demonstrations with the jaw: how often it succeeds if it sees the slave late.

The simulated person ``observer`` carries a block to another peg. A small network imitates how fast the hand goes and
when the jaw closes. Both see the same late display, and are told the goal and the step of the task.
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import teleop_core as tc
from teleop_core.graph.topics import TASK_STATE
from teleop_lab.policies import trained

Array = NDArray[np.float64]
PERIOD = 0.02  # of the policy [s], the inverse of operator.policy.rate
SOON, LATER = 0.3, 0.7  # the network imitates the jaw in so many seconds, and the mean speed until then
NEAR, GAIN = 0.004, 2.0  # distance below which the network sees finer [m]; motion of the tip per motion of the hand
DONE = (1, 2, 3, 8, 9)  # steps of the task: reach, grasp, lift, carry, place
STEP, GOAL_X = (TASK_STATE.columns.index(name) for name in ("step", "goal_x"))
SLAVE_OF_HAND = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
DELAYS = (0.0, 0.2, 0.4, 0.5, 0.6, 0.8)  # of the network on the way back [s]
KEPT = ("hand/servo_cp", "hand/jaw", "display/measured_cp", "task/state")
SETTINGS: dict[str, Any] = {
    "teleop.stages": ["jaw_command", "jaw", "jaw_sim", "display", "task", "network"],
    "teleop.ends_with_task": True,
    "operator.tremor_amplitude": 0.0,
    "operator.buttons.jaw": (),
    "coarse_gain": GAIN,  # the whole board is within reach without the clutch
    "task": "peg_transfer",
    "task.peg_transfer.longest": 20.0,
    "task.peg_transfer.tries": 1,
    "task.peg_transfer.clearance": 0.003,
    "jaw_sim.pegs.clearance": 0.003,
    "policy.name": "picks",
}


def transfer(operator: str, seed: int, late: float = 0.0) -> tc.Recording:
    """Session with one block; the seed places its two pegs."""
    rng = np.random.default_rng(seed)
    block, turn = np.array([0.256, -0.2357]) + rng.uniform(-0.015, 0.015, 2), rng.uniform(-0.5, 0.5)
    way = 0.04 * np.array([np.sin(turn), -np.cos(turn)])
    placed = {
        "jaw_sim.object.place": [*block, -0.0911],
        "jaw_sim.pegs.place": [*block, *(block + way)],
        "task.peg_transfer.ways": list(way),
        "network.back.least_delay": late,
    }
    return tc.run("peg_transfer", duration=25.0, seed=seed, operator=operator, settings=SETTINGS | placed, keep=KEPT)


def inputs(distance: Array, step: Array) -> Array:
    """Inputs of the network (n, 7) for distances from the tip to the goal (n,) [m] and steps of the task (n,)."""
    return np.column_stack((distance, np.tanh(distance / NEAR), step[:, None] == DONE))


def demonstration(seed: int) -> tuple[Array, Array]:
    """Inputs (n, 7), and outputs (n, 2) of one transfer: way of the tip to the goal in a period [m], and the jaw."""
    shown = transfer("observer", seed)
    steps = shown["task/state"]
    busy = steps.time[np.isin(steps["step"], DONE)]
    times = np.arange(busy[0], busy[-1], 0.2)

    def at(topic: str, when: Array) -> Array:
        stream = shown[topic]
        return np.asarray(stream.values[np.searchsorted(stream.time, when, side="right") - 1])

    ends = steps.time[1:][np.diff(steps["step"]) != 0.0]
    until = np.minimum(times + LATER, ends[np.searchsorted(ends, times, side="right")])
    moved = (at("hand/servo_cp", until) - at("hand/servo_cp", times))[:, :3] @ SLAVE_OF_HAND.T * GAIN
    task = at("task/state", times)
    way = task[:, GOAL_X : GOAL_X + 3] - at("display/measured_cp", times)[:, :3]
    distance = np.linalg.norm(way, axis=1)
    speed = PERIOD / (until - times) * (moved * way).sum(axis=1) / distance
    return inputs(distance, task[:, STEP]), np.column_stack((speed, at("hand/jaw", times + SOON)))


def share(operator: str, late: float, seeds: range) -> float:
    """Share of sessions whose block comes to rest on its peg [%]."""
    ends = [transfer(operator, seed, late)["task/state"]["successes"][-1] for seed in seeds]
    return 100.0 * float(np.mean(ends))


def plot(file: str, shares: list[tuple[float, float]]) -> None:
    """Write the shares of demonstrator and policy [%] over the delays as an SVG."""
    x = [60 + 400 * late / DELAYS[-1] for late in DELAYS]
    text = [f'<text x="{a:g}" y="250">{1e3 * late:.0f}</text>' for a, late in zip(x, DELAYS, strict=True)]
    text += [f'<text x="35" y="{225 - 2 * y}">{y}</text><path d="M60 {220 - 2 * y}h400"/>' for y in (0, 50, 100)]
    text += ['<text x="260" y="275">delay of the network on the way back, ms</text>']
    text += ['<text x="60" y="0">success, %</text>']
    for column, (name, colour) in enumerate((("demonstrator", "#0072b2"), ("policy", "#d55e00"))):
        corners = " ".join(f"{a:g},{220 - 2 * both[column]:g}" for a, both in zip(x, shares, strict=True))
        dash = "6 4" if column else "none"
        text.append(f'<polyline points="{corners}" stroke="{colour}" stroke-width="3" stroke-dasharray="{dash}"/>')
        text.append(f'<text x="{230 + 130 * column}" y="0" style="fill:{colour}">{name}</text>')
    style = "text{font:14px sans-serif;text-anchor:middle}path{stroke:#ccc}polyline{fill:none}"
    head = '<svg xmlns="http://www.w3.org/2000/svg" width="480" height="310" viewBox="0 -20 480 310">'
    body = "\n".join(['<rect y="-20" width="480" height="310" fill="#fff"/>', *text])
    Path(file).write_text(f"{head}<style>{style}</style>\n{body}\n</svg>\n", encoding="utf-8")


def main() -> None:
    """Print the shares of success; arguments: numbers of demonstrations and of sessions per delay, file of a plot."""
    given = sys.argv[1:]
    count, sessions = (int(word) for word in [*given[:2], *("40", "4")[len(given) :]])
    seen, done = zip(*map(demonstration, range(1000, 1000 + count)), strict=True)
    network = trained(np.concatenate(seen), np.concatenate(done), hidden=16, seed=1)
    print(f"trained on {sum(map(len, seen))} moments of {count} demonstrations")

    def picks(view: tc.View) -> Array:
        if view.goal is None or not view.is_following:
            return view.place
        way = view.goal - view.measured_cp[:3]
        distance = float(np.linalg.norm(way))
        speed, jaw = network(inputs(np.array([distance]), view.task[STEP : STEP + 1]))[0]
        return np.append(view.place + view.to_hand(way * speed / max(distance, 1e-9)), jaw > 0.5)

    tc.register_policy("picks", picks)
    shares = list[tuple[float, float]]()
    for late in DELAYS:
        shares.append((share("observer", late, range(sessions)), share("policy", late, range(sessions))))
        print(f"network {1e3 * late:4.0f} ms: demonstrator {shares[-1][0]:3.0f} %, policy {shares[-1][1]:3.0f} %")
    if len(given) > 2:
        plot(given[2], shares)


if __name__ == "__main__":
    main()
