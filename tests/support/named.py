"""What README, site and ``--help`` name: commands, scenarios, experiments, examples, tutorials.

    python tests/support/named.py        print what of it no test runs, and why

``tests/scenario/test_named.py`` runs all the rest.
"""

import re
import shlex
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import teleop_core as tc
from teleop_core.commands.cli import application, main, overview

ROOT = Path(__file__).resolve().parents[2]
HELP = "--help"
PAGES = sorted({*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("bags/*.md")})
_LIVE = "needs a session that runs, or is one: tests/ros starts and stops it"
_DEVICE = "needs a device"
NOT_RUN = {
    r"drill .* --scheduler": "needs a Dask scheduler: tests/simulated/test_search.py",
    r"live|console|play|stop|operate|topic|param|service|conformance|drill(?! --list)|--parts mine\.py drill": _LIVE,
    r"camera": _LIVE,
    r"people": "needs a person at the page, or what people did: tests/ros/test_people.py",
    r"devices": _DEVICE,
    r"compile": "the kernels are compiled before tests: tests/scenario/test_compile_command.py",
    r"fit rests\.csv|sim --config scara\.yaml": "needs measurements of a machine",
    r"import user\.bag": "needs a bag of ROS 1: tests/unit/test_import_bags.py",
    r"export drive\.db3": "needs a bag of others: tests/unit/test_data_set_with_pictures.py",
    r"study .* --scheduler": "needs a Dask scheduler: tests/unit/test_studies.py",
    r"study config/studies/(uva|ten_thousand)": "takes ten minutes and more of all processors; tests check its points",
    r"experiment": "each is run by a test of its own, below its name",
}
"""Commands that are not run as they stand, by their beginnings, and why."""
LONG = r"fit\b|.*\bsoft\.yaml|study config/(?!.* --explain)|tune config|.*ten_minutes"
"""Commands of more than half a minute, which only ``make soak`` runs."""


class Named(NamedTuple):
    """A command and where it is named."""

    place: str
    words: tuple[str, ...]

    @property
    def line(self) -> str:
        """The command as it is typed, without ``teleop``."""
        return shlex.join(self.words)

    @property
    def reason(self) -> str:
        """Why it is not run; empty if it is."""
        text = " ".join(self.words)
        reasons = (why for start, why in NOT_RUN.items() if re.match(rf"(?:{start})(?!\w)", text))
        return next(reasons, "")

    @property
    def is_long(self) -> bool:
        """Whether it takes too long to run with every change."""
        return re.match(LONG, self.line) is not None


def commands() -> Iterator[Named]:
    """Every command, in the order in which each page and each ``--help`` names them."""
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for line in re.findall(r"^ {4}(?:\S*/)?teleop (.+)$", text, re.MULTILINE):
            yield from _named(page.relative_to(ROOT).as_posix(), line)
    for line in shown_in_help():
        yield from _named(HELP, line)


def shown_in_help() -> list[str]:
    """Every command that a ``--help`` shows."""
    app = application()
    helps = "\n".join([overview(), *(app[name].help for name in app if not name.startswith("-"))])
    return re.findall(r"^ +teleop (.+?)(?:  .*)?$", helps, re.MULTILINE)


def _named(place: str, line: str) -> Iterator[Named]:
    words = shlex.split(line, comments=True)
    if words and "..." not in words:
        yield Named(place, tuple(words))


def places() -> list[str]:
    """Pages with commands that are run."""
    return list(dict.fromkeys(named.place for named in commands() if not named.reason))


def not_run() -> dict[str, list[str]]:
    """Commands that no test runs as they stand, by the reason."""
    found: dict[str, list[str]] = {}
    for named in commands():
        if named.reason and named.line not in found.setdefault(named.reason, []):
            found[named.reason].append(named.line)
    return found


# -- what a user has, that commands name -----------------------------------------------------------


def circle(count: int = 400) -> Any:
    """A small circle (count, 4): times [s] and places [m]."""
    t = np.arange(count) * 0.01
    turn = np.pi * t
    zero = np.zeros(count)
    return np.column_stack((t, 0.01 * np.sin(turn), 0.01 * (1.0 - np.cos(turn)), zero))


def _table(path: Path, names: str, columns: Any) -> None:
    separator = "," if path.suffix == ".csv" else " "
    np.savetxt(path, columns, header=names.replace(" ", separator), comments="", delimiter=separator, fmt="%.6f")


def _hand(path: Path) -> None:
    _table(path, "t x y z", circle())


def _hands(path: Path) -> None:
    numbers = np.repeat(np.arange(3.0), 400)
    _table(path, "episode_index t x y z", np.column_stack((numbers, np.tile(circle(), (3, 1)))))


def _hand_in_mm(path: Path) -> None:
    _table(path, "t px py pz", circle() * 1e3)


def _two(path: Path) -> None:
    hand = circle()
    _table(path, "t x y z x2 y2 z2", np.column_stack((hand, hand[:, 1:])))


def _mocap(path: Path) -> None:
    turns = np.tile(np.eye(3).ravel(), (400, 1))
    np.savetxt(path, np.column_stack((circle()[:, 1:], turns)), fmt="%.6f")


def _tool(path: Path) -> None:
    _table(path, "t x y z yaw pitch roll", np.column_stack((circle(), np.zeros((400, 3)))))


def _poses(path: Path) -> None:
    robot = tc.load_robot("rcrt1")
    joints = np.random.default_rng(1).uniform(robot.lower, robot.upper, (30, robot.n))
    places = robot.fk(joints)[:, :3, 3]
    _table(path, " ".join((*robot.joint_names, "x y z")), np.column_stack((joints, places)))


def _mesh(path: Path) -> None:
    import trimesh

    trimesh.creation.box((30.0, 30.0, 30.0)).export(path)  # mm


def _heights(path: Path) -> None:
    np.savetxt(path, np.zeros((5, 5)), delimiter=",")


def _study(path: Path) -> None:
    text = (ROOT / "config/studies/delay.yaml").read_text(encoding="utf-8")
    short = text.replace("duration: 20.0", "duration: 1.0").replace("seeds: 5", "seeds: 1")
    path.write_text(short, encoding="utf-8")


def _drives(path: Path) -> None:
    path.write_text("elbow_joint: {inertia: 0.4, speed_limit: 2.0}\n", encoding="utf-8")


def _tube(path: Path) -> None:
    text = (ROOT / "docs/tutorials/own_fixture.md").read_text(encoding="utf-8")
    (first, *_) = re.findall(r"^```{code-cell} python\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    path.write_text(first, encoding="utf-8")


def _arm(path: Path) -> None:
    path.write_text((ROOT / "examples/ur5e.urdf").read_text(encoding="utf-8"), encoding="utf-8")


def _data_set(path: Path) -> None:
    """Two episodes, as `teleop export --to lerobot` writes them."""
    bags = [path.with_name(f"of_{path.name}_{seed}") for seed in (1, 2)]
    for seed, bag in enumerate(bags):
        if not bag.exists():
            tc.run("coarse_box", duration=2.0, seed=seed, out=bag)
    if not path.exists():
        words = ["export", *map(str, bags), "--to", "lerobot", str(path)]
        assert main([*words, "--task", "follow the edge"]) == 0


FILES: dict[str, Callable[[Path], None]] = {
    "hand.csv": _hand, "two.csv": _two, "mocap.txt": _mocap, "tool.csv": _tool,
    "skull.stl": _mesh, "part.stl": _mesh, "heights.csv": _heights,
    "my_arm.urdf": _arm, "arm.urdf": _arm, "poses.csv": _poses,
    "hands.csv": _hands, "drives.yaml": _drives, "delay.yaml": _study, "tube.py": _tube,
    "dataset": _data_set,
}  # fmt: skip
"""Makers of the files that commands name and readers have."""


def provide(named: Named, folder: Path) -> None:
    """Make what a command reads and no command before it wrote: files, and recordings.

    Where a page shows a command in several forms, each has its output to itself.
    """
    for name, make in FILES.items():
        if any(re.search(rf"(?:^|[=,]){re.escape(name)}\b", word) for word in named.words):
            maker = _hand_in_mm if name == "hand.csv" and "px" in named.words else make
            maker(folder / name)
    written = _value(named.words, "--out") or (_value(named.words, "lerobot") if named.words[0] == "export" else "")
    if (place := folder / written).is_file():
        place.unlink()
    elif written and place.is_dir():
        shutil.rmtree(place)
    for word in named.words:
        for name in re.findall(r"(?:^|=)(bags/\w+)", word):
            if name != written and not (folder / name).exists():
                tc.run("coarse_box", duration=2.0, out=folder / name)
    if named.words[0] == "recover":
        _cut(folder / named.words[1])


def _value(words: tuple[str, ...], option: str) -> str:
    return words[words.index(option) + 1] if option in words else ""


def _cut(path: Path) -> None:
    """Cut the end off a recording, as a crash does."""
    file = path if path.is_file() else next(path.glob("*.mcap"))
    data = file.read_bytes()
    file.write_bytes(data[: int(0.9 * len(data))])
    file.with_name("metadata.yaml").unlink(missing_ok=True)


if __name__ == "__main__":
    for reason, lines in not_run().items():
        print(f"not run here: {reason}")
        print("\n".join(f"    teleop {line}" for line in lines))
