"""Show a recording on your own page, like `teleop console BAG`, in a few lines."""

import tempfile
from pathlib import Path

import numpy as np

import teleop_core as tc
from teleop_console.app import Console
from teleop_console.recorded import RecordedLink
from teleop_console.server import ConsoleServer


def main() -> None:
    """Serve a page on a free port, draw some times of a recording, and print the shown data."""
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / "bag"
        tc.run("coarse_box", duration=4.0, out=bag)
        link = RecordedLink(bag)
        with ConsoleServer(port=0) as server:  # any free port; a browser opens server.url
            page = Console(server, link)
            for time in np.linspace(0.0, link.duration, 5):
                link.seek(float(time))
                page.draw()
                tip = link.view().arms[""].streams["slave/measured_cp"][:3]
                print(f"at {time:4.1f} s the page draws the tip at {np.round(1e3 * tip)} mm")
        print(f"served to {server.host} alone, {len(link.parameters())} parameters shown")


if __name__ == "__main__":
    main()
