"""Start: starts the node of any stage, of this package or of a user, from the command line.

``ros2 run teleop_core slave_sim`` starts a built-in stage by the name of its executable;
``ros2 run teleop_core stage NAME`` starts any registered stage, such as a stage of another package.
"""

import sys
from itertools import takewhile
from pathlib import Path

from teleop_core.base.errors import TeleopError
from teleop_core.base.own_parts import load_own_parts
from teleop_core.graph.stage import STAGES
from teleop_core.nodes.making import make_node
from teleop_core.nodes.process import run

SESSION = "teleop_session"
"""Executable of a whole session in one process."""
ANY = "stage"
"""Executable of any stage."""
_FLAGS = ("-r", "--remap")
_RULES = {"__ns": "__ns", "__node": "__node", "__name": "__node"}
"""Remapping rules for all nodes of a process; a rule for one node begins with the name of the node and a colon."""


def main() -> int:
    """Entry point of every executable: its name, or its first argument, names the stage.

    Returns:
        Exit code: 0 without a failure; 1 after a failure at work; 2 if a name, parameter or file is wrong.
    """
    try:
        load_own_parts()
        return _start()
    except TeleopError as error:
        print(error, file=sys.stderr)
        return 2


def _start() -> int:
    name = Path(sys.argv[0]).stem
    if name not in {SESSION, *STAGES}:
        name = sys.argv.pop(1) if len(sys.argv) > 1 and sys.argv[1][:1] != "-" else ANY
    if {"-h", "--help"} & set(sys.argv):
        print(help_text(name))
        return 0
    if name == SESSION:
        from teleop_core.nodes.teleop_session import TeleopSession

        sys.argv[:], given = taken_names(sys.argv)
        if "__node" in given:
            text = "the nodes of a session have the names of their stages"
            print(f"{SESSION}: not named {given['__node']}: {text}", file=sys.stderr)
        names = list(takewhile(lambda word: word[:1] != "-", sys.argv[1:]))
        del sys.argv[1 : 1 + len(names)]
        return run(lambda: TeleopSession(given.get("__ns", "").strip("/"), names))
    stage = STAGES.find(name)
    return run(lambda: make_node(stage))


def taken_names(arguments: list[str]) -> tuple[list[str], dict[str, str]]:
    """Remove remapping rules that would give all nodes of a process the same name.

    The middleware applies ``__node:=arm``, which launch files pass, to every node of a process, and ``__ns:=/lab``
    replaces the namespaces of arms. A process of several nodes removes these rules, and adds the namespace before the
    namespaces of its nodes itself.

    Returns:
        The other arguments, and the removed values: ``__ns``, ``__node``.
    """
    kept, names = list[str](), dict[str, str]()
    is_ros = False
    for word in arguments:
        is_ros = (is_ros or word == "--ros-args") and word != "--"
        rule, is_rule, value = word.partition(":=")
        if is_ros and is_rule and rule in _RULES and kept[-1:] and kept[-1] in _FLAGS:
            kept.pop()
            names[_RULES[rule]] = value
            continue
        kept.append(word)
    return kept, names


def help_text(name: str) -> str:
    """Help text of an executable: its purpose, its topics and its parameters.

    Args:
        name: Name of a stage, :data:`SESSION`, or :data:`ANY` for all stages.

    Raises:
        UnknownNameError: There is no such stage.
    """
    if name == ANY:
        return f"usage: {ANY} NAME [--ros-args ...], with NAME one of {', '.join(STAGES)}"
    nodes = "[NODE ...] " if name == SESSION else ""
    lines = [f"usage: {name} {nodes}[--ros-args ...]", ""]
    if name == SESSION:
        lines.append("  a whole session in one process; its parameters are those of its stages")
        lines.append("  with names of nodes, these alone, without the recorder: one side of several")
    else:
        stage = STAGES.find(name)
        for verb, topics in (("reads", stage.reads), ("writes", stage.writes)):
            lines.append(f"  {verb:7} {', '.join(topic.name for topic in topics) or 'nothing'}")
    ways = {
        f"{name} --ros-args -p NAME:=VALUE": "set a parameter",
        f"{name} --ros-args --params-file FILE.yaml": "set those of a file",
        f"{name} --ros-args -r __ns:=/left": "be one of the arm `left`",
        f"teleop parameters {'' if name == SESSION else name}": "list them",
    }
    return "\n".join([*lines, "", *(f"  {way:60} {what}" for way, what in ways.items())])
