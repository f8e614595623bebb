"""Links as texts: they define, for a node in another process, the topics that feed its ports."""

from teleop_core.graph.graph import Graph, Member


def link_texts(graph: Graph, member: Member) -> list[str]:
    """Links of a member, except for ports that are fed by the topic of the same name.

    Returns:
        Texts ``port=topic`` or ``port=topic@delay``, with the delay in seconds. Topics are relative to the arm's
        namespace; ``../topic`` is outside of it. If a port has several topics, their values are added, and the stamp
        of the first topic is used.
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
    """Name of a topic of the arm ``of``, relative to the namespace of ``arm``."""
    return topic.removeprefix(f"{arm}/") if of == arm or not arm else f"../{topic}"
