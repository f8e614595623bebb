"""Naming: what ROS arguments say of the name and namespace of all nodes of a process at once."""

_FLAGS = ("-r", "--remap")
_RULES = {"__ns": "__ns", "__node": "__node", "__name": "__node"}
"""Rules for all nodes of a process; a rule for one node has its name and a colon before it."""


def taken_names(arguments: list[str]) -> tuple[list[str], dict[str, str]]:
    """Take the rules out that would name all nodes of a process alike.

    The middleware applies ``__node:=arm``, as launch files give it, to every node of a process,
    and ``__ns:=/lab`` in place of the namespaces of arms. A process of several nodes takes them
    out, and puts the namespace before those of its nodes itself.

    Returns:
        The other arguments, and what was given: ``__ns``, ``__node``.
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
