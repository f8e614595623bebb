"""What a person does at the console's page: wait for the slave, pull the stylus, let it rest."""

import numpy as np

from browser import Tab

TIP = "/arm/robot/tip"
GRIP, ARROW = "/arm/master/grip", 0.07  # the stylus' gizmo, and the heads of its arrows [m]
PULLED = 0.012  # m
# Software draws the page with the processors that the session needs: a small one.
SIZE = (1000, 560)  # px
# A browser that waits for a processor sends late, which is no reason to let go of the stylus.
PATIENT = "operator.remote.timeout=1.5"  # s
STILL = 2e-4  # m


def ready(tab: Tab) -> None:
    """Wait until the slave follows; where it paused because this machine stood still, resume.

    A session begins enabled, on its way to where it starts: it follows nobody until it is there.
    """
    tab.until("/ENABLED|PAUSED/.test(document.body.innerText)")
    if tab.value("document.body.innerText.includes('PAUSED')"):
        tab.click("Start")
    tab.shows("ENABLED, homed", 120)


Place = tuple[float, float]


def arrow(tab: Tab, axis: int, way: float = PULLED) -> tuple[Place, Place]:
    """Where an arrow of the stylus is seen, and where it would be a way farther [px]."""
    begin, end = np.zeros(3), np.zeros(3)
    begin[axis], end[axis] = ARROW, ARROW + way
    return tab.seen_at(GRIP, begin), tab.seen_at(GRIP, end)


def pull(tab: Tab, axis: int, way: float = PULLED) -> Place:
    """Take an arrow of the stylus and pull it along itself; the button stays down."""
    grip, goal = arrow(tab, axis, way)
    tab.mouse("mouseMoved", *grip)
    tab.value("new Promise((done) => setTimeout(done, 200))")
    tab.pull(grip, goal, steps=10)
    return goal


def rest(tab: Tab) -> None:
    """Wait until the slave is drawn in one place for half a second."""
    tab.value(f"""new Promise((done) => {{
        let last = [], since = 0;
        const look = () => {{
            const now = performance.now(), place = {tab.place_of(TIP)};
            if (!last.length || Math.hypot(...place.map((x, i) => x - last[i])) > {STILL})
                [last, since] = [place, now];
            now - since > 500 ? done() : setTimeout(look, 20);
        }};
        look();
    }})""")
