"""Write what documents say about the code from the code: lists, the diagram, the plant's numbers.

python docs/generate.py            write the pages
python docs/generate.py --check    say which of them differ, and fail if one does
python docs/generate.py --quick    leave out the tables that take sessions of 20 s: half a minute
"""

import argparse
import sys
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

from teleop_core.base.parameters import specs
from teleop_core.coupling.filters.tremor_filter import TREMOR_FILTER
from teleop_core.coupling.fixtures.remote_centre import REMOTE_CENTRE_STAGE
from teleop_core.evaluation import key_table
from teleop_core.graph.graph import Graph, Link, build_graph
from teleop_core.graph.layers import declared_groups
from teleop_core.graph.topics import (
    BY_NAME,
    DIAGNOSTICS,
    IMPEDANCE_TOPICS,
    JAW_TOPICS,
    NETWORK_TOPICS,
    OPERATOR_BUTTONS,
    OPERATOR_JAW,
    OPERATOR_SERVO_CP,
    PASSIVITY_TOPICS,
    PORTS_BETWEEN_ARMS,
    POSES,
    SCENE_TOPICS,
    TASK_TOPICS,
    Kind,
    Topic,
)
from teleop_core.kernels.geometry import Array
from teleop_core.robots import Robot, load_robot
from teleop_core.robots.hardware import NUMBERS
from teleop_core.session.configuration import parameter_rows
from teleop_core.slave.plants.hardware import HardwareParameters

sys.path.insert(0, str(Path(__file__).parent))
import passivity_tables
from reference_pages import api_page, commands_page, examples_page

ROOT = Path(__file__).resolve().parents[1]
NOTE = "<!-- Written by docs/generate.py; change the code, not this page. -->"
GRAPH = "<!-- graph: written by docs/generate.py -->", "<!-- end of graph -->"
PLANT = "<!-- numbers: written by docs/generate.py -->", "<!-- end of numbers -->"
VALUES = {
    Kind.POSE: "x, y, z [m], quaternion w, x, y, z",
    Kind.TWIST: "linear x, y, z [m/s], angular x, y, z [rad/s]",
    Kind.WRENCH: "force x, y, z [N], torque x, y, z [N·m]",
    Kind.BUTTONS: "clutch, fixture, mode; 1 pressed",
    Kind.JOINTS: "position of each joint [rad or m]",
    Kind.STATE: "position, velocity, effort of all joints",
    Kind.POSES: f"{POSES} poses, each x, y, z [m], quaternion w, x, y, z",
    Kind.JAW: "position [rad], velocity [rad/s], effort [N·m] of `jaw`",
}


WAY = """## From a file to a kernel

A parameter has one declaration, and one name on its way from a file to the kernel that uses it. Here the way of
`motion_scaling.fixture.damping`, through five files. From step 3 on, an editor follows it by the type.

| step | where | what it holds |
|---|---|---|
| 1 | `graph/layers.py`, `load_file` | values of a file, by stage and name |
| 2 | `session/configuration.py`, `Configuration.from_layers` | values of all files and settings |
| 3 | `base/parameters.py`, `build` | checked values |
| 4 | `coupling/mapping/walls.py`, `WallParameters` | the declaration, and the value: `parameters.fixture.damping` |
| 5 | `coupling/mapping/motion_scaling.py`, `MotionScaling.retune` | the record of the stage |
| 6 | `base/parameters.py`, `fill` | the number in the record: `p.fixture.damping` |
| 7 | `coupling/mapping/walls.py`, `damped_wall` | the kernel: `wall.damping` |

Steps 1 and 2 hold plain mappings, of stage and dotted name to an unchecked value. A layer gives some values of a group,
and merging must know which ones. A typed layer would need a second class of every group, in which each field may be
missing. Types begin with `build`, because `fine_gain <= coarse_gain` concerns the merged values alone.

A stage's function `derive` writes the few numbers that follow from several parameters, from the robot or from the
length of a tick. [Records and kernels](records_and_kernels.md) has the rules.
"""


def parameters_page() -> str:
    """All parameters, group by group."""
    parts = [
        "# Parameters",
        "`teleop parameters` prints them; `--set NAME=VALUE` changes them, by the full name or by "
        "its end, which sets every stage that has it: `--set robot=puma560`. An end that different "
        "parameters share is refused with their names: `pid.bandwidth`, not `bandwidth`. Parts of "
        "your own add theirs. *Fixed* ones can be set before a session alone, all others while "
        "nodes run too.",
        WAY.strip(),
    ]
    for group in declared_groups():
        rows = [f"| `{name}` | {default} | {allowed} | {text} |"
                for name, default, allowed, text in parameter_rows([group])]  # fmt: skip
        head = ["| parameter | default | allowed | meaning |", "|---|---|---|---|"]
        parts += [f"## {group}", "\n".join([*head, *rows])] * bool(rows)
    return page(parts)


def topics_page(graph: Graph) -> str:
    """All topics of an arm with their writers and readers."""
    rows = ["| topic | message | values | written by | read by | stamp |", "|---|---|---|---|---|---|"]
    for member in graph.members:
        for topic in member.writes:
            rows.append(topic_row(topic, member.name, graph))
    rows.append(topic_row(DIAGNOSTICS, "every node", graph))
    for topic in (OPERATOR_SERVO_CP, OPERATOR_BUTTONS, OPERATOR_JAW):
        row = topic_row(topic, "[a person](hand.md)", graph)
        rows.append(row.replace("–", "operator, if it is `remote`", 1))
    with_network = build_graph(stages=["network"])
    writer = "[network](network.md), a further stage"
    rows += [topic_row(topic, writer, with_network) for topic in NETWORK_TOPICS]
    with_ports = build_graph(stages=["network", "passivity"])
    writers = {t: member.name for member in with_ports.members for t in member.writes}
    rows += [topic_row(t, f"{writers[t]}, with [passivity](passivity.md)", with_ports) for t in PASSIVITY_TOPICS]
    with_yield = build_graph(stages=["network", "impedance"])
    writers = {t: member.name for member in with_yield.members for t in member.writes}
    rows += [
        topic_row(t, f"{writers[t]}, with [impedance](world.md#a-slave-that-yields)", with_yield)
        for t in IMPEDANCE_TOPICS
    ]
    with_filter = build_graph(stages=["tremor_filter"])
    writer = "[tremor_filter](tremor_filters.md), a further stage"
    rows += [topic_row(topic, writer, with_filter) for topic in TREMOR_FILTER.writes]
    with_centre = build_graph(stages=["remote_centre"])
    writer = "[remote_centre](remote_centre.md), a further stage"
    rows += [topic_row(topic, writer, with_centre) for topic in REMOTE_CENTRE_STAGE.writes]
    with_task = build_graph(stages=["display", "task"])
    writers = {t: member.name for member in with_task.members for t in member.writes}
    rows += [topic_row(t, f"{writers[t]}, a further stage ([tasks](tasks.md))", with_task) for t in TASK_TOPICS]
    with_jaw = build_graph(stages=["network", "jaw_command", "jaw", "jaw_sim"])
    writers = {t: member.name for member in with_jaw.members for t in member.writes}
    rows += [topic_row(t, f"{writers[t]}, with a [jaw](gripper.md)", with_jaw) for t in JAW_TOPICS]
    rows += [topic_row(t, "scene, with a [scene](scenes.md)", with_jaw) for t in SCENE_TOPICS]
    return page([
        "# Topics",
        "CRTK names, standard messages, SI units. Streams are offered reliable with a queue of "
        "one, so that subscribers of both kinds get them, and read best effort, "
        "`teleop/state` is latched, `diagnostics` comes once a second. The recorder takes all of "
        "them but those of a person elsewhere. Those of a further arm stand below its name: "
        "`left/slave/servo_cp`.",
        "\n".join(rows),
        "*Late*: the reader takes what was there at the end of the last tick. *In force*: the "
        "stamp of the command that the slave follows; 0 before the first one.",
        "`fixture_center_*` and `fixture_size_*` of `teleop/state` say in `slave_base` [m] where "
        "the fixture holds the slave; all are 0 without one. `gain` is metres of the slave for a "
        "metre of the hand.",
        "[How a sample travels](how_a_sample_travels.md) shows them as a picture.",
    ])  # fmt: skip


def topic_row(topic: Topic, writer: str, graph: Graph) -> str:
    """One topic as a row of the table."""
    links = [link for link in graph.links if link.topic == topic]
    readers = ", ".join(link.reader.name + " (late)" * link.is_late for link in links) or "–"
    values = VALUES.get(topic.kind) or ", ".join(topic.columns) or "key-value pairs"
    message = topic.kind.ros_type.replace("/msg/", "/")
    return f"| `{topic.name}` | {message} | {values} | {writer} | {readers} | {topic.stamp.text} |"


def scores_page() -> str:
    """All keys of a score."""
    return page([
        "# Scores",
        "Keys of `teleop evaluate --json` and of `Score.value(key)`. A metric of your own adds its "
        "keys. Null stands for what does not apply, such as the penetration of a fixture that was "
        "never on.",
        key_table(),
    ])  # fmt: skip


def page(parts: list[str]) -> str:
    """Page of some paragraphs, the heading first."""
    return "\n\n".join([parts[0], NOTE, *parts[1:]]) + "\n"


def diagram(graph: Graph) -> str:
    """The graph as a Mermaid diagram; dotted: what is late by a tick."""
    lines = ["```mermaid", "flowchart LR"]
    pairs: dict[tuple[str, str, bool], list[Link]] = {}
    for link in graph.links:
        pairs.setdefault((link.writer.name, link.reader.name, link.is_late), []).append(link)
    for (writer, reader, is_late), links in sorted(pairs.items(), key=lambda item: item[0][2]):
        label = "<br/>".join(link.topic.name for link in links)
        arrow = f'-. "{label}" .->' if is_late else f'-- "{label}" -->'
        lines.append(f"  {writer} {arrow} {reader}")
    for member in graph.members:
        unread = [t for t in member.writes if all(link.topic != t for link in graph.links)]
        if unread:
            lines.append(f'  {member.name} -- "{"<br/>".join(t.name for t in unread)}" --> recorder')
    lines += ["  recorder[(recorder)] --> evaluate", "  recorder --> replay", "```"]
    return "\n".join(lines)


def plant_numbers(robot: Robot) -> str:
    """Numbers of the hardware plant for a robot, with how each is known."""
    known, model = robot.hardware, robot.dynamics
    assert known is not None
    assert known.links is not None
    assert model is not None
    joints, links = robot.joint_names, known.links.named()
    values = {name: per_joint(getattr(known, name)) for name in NUMBERS}
    pairs = zip(*known.coupling.nonzero(), strict=True)
    values["coupling"] = ", ".join(
        f"{joints[i]} moves by {known.coupling[i, j]:.3g} of the lag of {joints[j]}" for i, j in pairs
    )
    values["links"] = f"d3 {1e3 * links['d3']:+.1f} mm, and {len(links) - 1} small ones"
    values["dynamics"] = ", ".join(
        f"{symbol} = {known.dynamics[place]:.4g} kg·m" for symbol, place in model.unknown.items()
    )
    rows = [f"| `{name}` | {text} | {known.sources[name]} |" for name, text in values.items()]
    for spec in specs(HardwareParameters):
        if spec.source:
            rows.append(f"| `{spec.name}` | {f'{spec.default} {spec.unit}'.strip()} | {spec.source} |")
    head = [f"| number | {', '.join(joints)} [SI] | how it is known |", "|---|---|---|"]
    return "\n".join([*head, *rows])


def per_joint(values: Array) -> str:
    """Numbers of all joints with three digits; one if all are alike."""
    texts = [f"{value:.3g}" for value in values]
    return texts[0] if len(set(texts)) == 1 else ", ".join(texts)


ROW = ROOT / "src" / "teleop_core" / "teleop_core" / "graph" / "row.py"
ROW_HEAD = '''"""Row: fields of the records of stages' ports, of every topic of the built-in stages.

Written by docs/generate.py from :mod:`teleop_core.graph.topics`; change that, not this file. A
stage has the fields of its own topics alone: a kernel that asks for another one does not compile.
"""

from teleop_core.kernels.fields import Fields
from teleop_core.kernels.geometry import Array


class Row(Fields):
    """Newest value of each topic, as its kind has it, and its stamp [ns]."""

    now_ns: int
    answered_ns: int
'''


def row_module() -> str:
    """Module with the class that names the fields of stages' records."""
    topics = [topic for topic in (*BY_NAME.values(), *PORTS_BETWEEN_ARMS) if topic.width(1)]
    lines = [f"    {topic.field}: Array\n    {topic.field}_ns: int\n" for topic in topics]
    return ROW_HEAD + "".join(lines)


def between(text: str, markers: tuple[str, str], written: str) -> str:
    """A document with what is written between two markers."""
    before, begin, rest = text.partition(markers[0])
    _, end, after = rest.partition(markers[1])
    if not (begin and end):
        raise SystemExit(f"a document must hold {markers[0]} and {markers[1]}")
    return f"{before}{begin}\n{written}\n{end}{after}"


def session_pages() -> Iterator[tuple[Path, str]]:
    """Pages with tables that come from sessions."""
    tables = passivity_tables.tables()
    for name in ("passivity.md", "network.md"):
        path = ROOT / "docs" / name
        text = path.read_text(encoding="utf-8")
        for key, written in tables.items():
            markers = f"<!-- {key}: written by docs/generate.py -->", f"<!-- end of {key} -->"
            if markers[0] in text:
                text = between(text, markers, f"\n{written}\n")
        yield path, text


def pages() -> Iterator[tuple[Path, str]]:
    """Every generated file with what it must hold, but for :func:`session_pages`."""
    graph, docs = build_graph(), ROOT / "docs"
    yield ROW, row_module()
    yield docs / "parameters.md", parameters_page()
    yield docs / "topics.md", topics_page(graph)
    yield docs / "scores.md", scores_page()
    yield docs / "commands.md", page(commands_page())
    yield docs / "api.md", page(api_page())
    yield docs / "examples.md", page(examples_page())
    for path in (ROOT / "README.md", docs / "how_a_sample_travels.md"):
        yield path, between(path.read_text(encoding="utf-8"), GRAPH, diagram(graph))
    plant = docs / "plant.md"
    numbers = plant_numbers(load_robot("rcrt1"))
    yield plant, between(plant.read_text(encoding="utf-8"), PLANT, numbers)


def main() -> int:
    """Write the pages, or check them; returns the exit code."""
    parser = argparse.ArgumentParser(description="Write the generated pages of the documents.")
    parser.add_argument("--check", action="store_true", help="write nothing, fail if one differs")
    parser.add_argument("--quick", action="store_true", help="leave out tables that take sessions")
    options = parser.parse_args()
    is_check, stale = options.check, []
    for path, text in chain(pages(), () if options.quick else session_pages()):
        before = path.read_text(encoding="utf-8") if path.exists() else ""
        if before != text:
            stale.append(path.relative_to(ROOT).as_posix())
            if not is_check:
                path.write_text(text, encoding="utf-8")
    for name in stale:
        print(f"{name}: {'is not what the code says; run docs/generate.py' * is_check or 'written'}")
    return int(is_check and bool(stale))


if __name__ == "__main__":
    sys.exit(main())
