"""Links as texts: how a graph tells a node in another process what feeds its ports."""

from teleop_core.graph.graph import Graph, Member


def link_texts(graph: Graph, member: Member) -> list[str]:
    """Links of a member that differ from "every port is fed by the topic of its name".

    Returns:
        Texts ``port=topic`` or ``port=topic@delay``, below the arm's namespace, with the delay in seconds; ``../topic``
        is one beside that namespace. Topics of one port are added, the first is the one whose stamp counts.
    """
    texts = []
    for port in member.stage.reads:
        links = [link for link in graph.links_of(member) if link.port == port]
        names = [_below(member.arm, link.topic.name, link.topic.arm) for link in links]
        feeds = [
            f"{port.name}={name}" + (f"@{link.delay!r}" if link.delay else "")
            for name, link in zip(names, links, strict=True)
        ]
        if feeds != [f"{port.name}={port.name}"]:
            texts += feeds
    return texts


def _below(arm: str, topic: str, of: str) -> str:
    """Name of an arm's topic as it is seen from the namespace of another, or from its own."""
    return topic.removeprefix(f"{arm}/") if of == arm or not arm else f"../{topic}"
