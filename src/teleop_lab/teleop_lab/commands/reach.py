"""``teleop reach``: the share of a recorded hand's motion that a slave can follow, and the settings that enlarge it."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from teleop_core.base.errors import TeleopError
from teleop_core.commands.options import SessionOptions

if TYPE_CHECKING:
    from teleop_lab.planning.reach_result import Reach


def reach(
    sources: Annotated[tuple[str, ...], Parameter(name="BAG|SCENARIO")],
    /,
    *,
    arm: str = "",
    share: float = 99.0,
    keep_axes: bool = False,
    html: Path | None = None,
    out: Path | None = None,
    settings: SessionOptions = SessionOptions(),
) -> None:
    """Say how much of a hand's motion a slave can follow, and propose where to put it.

    Shares are of the time: as given, and with a start of the slave, an order of axes and gains that reach the goal
    with the largest gains. Take them as they are printed, or as a file:

        teleop reach bags/hand --robot rcrt1 --html reach.html --out reach.yaml
        teleop replay bags/hand --out bags/followed --robot rcrt1 --config reach.yaml

    Args:
        sources: Recordings, in our or a foreign format, or scenarios of `teleop scenarios`.
        arm: Namespace of the arm; without it, the first.
        share: Share of the time for which the slave should be able to follow [%].
        keep_axes: Do not propose another map of axes from hand to slave.
        html: Page with pictures.
        out: Write the proposal as a ROS 2 parameter file for --config; needs a single recording.
        settings: Values of parameters.
    """
    from teleop_core.evaluation.command import check_places

    if out is not None and len(sources) > 1:
        raise TeleopError("--out writes the proposal for one recording; give a single recording, or leave out --out")
    check_places(html, out)
    if not 0.0 < share <= 100.0:
        raise TeleopError(f"--share {share:g} must be above 0 and at most 100 percent")
    found = [_reach(source, arm, share, keep_axes, settings) for source in sources]
    print("\n\n".join(map(str, found)))
    if html is not None:
        from teleop_lab.planning.motion_page import write_reach_page

        write_reach_page(found, html)
        print(f"page: {html}")
    if out is not None:
        out.write_text(found[0].parameter_file(), encoding="utf-8")
        print(f"parameters: {out}; take them with --config {out}")


def _reach(source: str, arm: str, share: float, keep_axes: bool, settings: SessionOptions) -> "Reach":
    from teleop_core.commands.progress import shown_progress
    from teleop_lab.planning.reach import reach as found_reach

    with shown_progress(f"searching, {Path(source).name}") as progress:
        return found_reach(
            source,
            arm=arm,
            share=share / 100.0,
            keeps_axes=keep_axes,
            progress=progress,
            files=settings.config,
            texts=settings.texts,
        )
