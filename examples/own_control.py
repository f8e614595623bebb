"""Add your own button to the console's page: it switches to a low speed limit of the arm, and back.

teleop console --parts examples/own_control.py --set operator=remote
"""

import teleop_console
from teleop_console.controls import CONTROLS, Answers
from teleop_console.link import SessionLink

GENTLE, USUAL = 0.02, 0.0
"""Largest speeds of the tip [m/s]; 0: limited only by the joints."""


def be_gentle(link: SessionLink, arm: str) -> Answers:
    """Limit the speed of the tip, or restore the usual limit, while the session runs."""
    node = f"{arm}/slave" if arm else "slave"
    known = link.parameters().get((node, "operation.tool_speed"))
    speed = USUAL if known is not None and known.value == GENTLE else GENTLE
    refused = link.change(node, "operation.tool_speed", speed)
    limit = f"{1e3 * speed:g} mm/s" if speed else "what its joints make"
    return [(not refused, refused or f"{node}: the tip moves by at most {limit}")]


teleop_console.register_control(
    teleop_console.Control("Gentle", "slower limits for the arm; again: the usual", be_gentle)
)


def main() -> None:
    """Print the names of the page's buttons."""
    print("buttons:", ", ".join(CONTROLS))


if __name__ == "__main__":
    main()
