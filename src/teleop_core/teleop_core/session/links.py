"""Links as texts: how a graph tells a node in another process what feeds its ports."""

from teleop_core.graph.graph import Graph, Member


def link_texts(graph: Graph, member: Member) -> list[str]:
    """Links of a member that differ from "every port is fed by the topic of its name".

    Returns:
        Texts ``port=topic`` or ``port=topic@delay``, below the arm's namespace, with the delay in
        seconds. Topics of one port are added, the first is the one whose stamp counts.
    """
    texts = []
    for port in member.stage.reads:
        links = [link for link in graph.links_of(member) if link.port == port]
        names = [link.topic.name.removeprefix(f"{member.arm}/") for link in links]
        feeds = [
            f"{port.name}={name}" + (f"@{link.delay!r}" if link.delay else "")
            for name, link in zip(names, links, strict=True)
        ]
        if feeds != [f"{port.name}={port.name}"]:
            texts += feeds
    return texts
