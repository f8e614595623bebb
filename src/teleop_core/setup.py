"""Install teleop_core with pip or colcon; dependencies are pinned by constraints.txt at the top."""

from pathlib import Path

from setuptools import find_packages, setup

VERSION = "0.6.0"  # released together with the other distributions
NODES = (
    "operator",
    "haptic_master",
    "master_bridge",
    "motion_scaling",
    "inverse_kinematics",
    "network",
    "slave",
    "slave_sim",
    "arm_bridge",
    "recorder",
    "frames",
    "teleop_session",
    "stage",
)


def files(folder: str, pattern: str) -> tuple[str, list[str]]:
    """Share files of one folder, as (destination, sources)."""
    return f"share/teleop_core/{folder}", sorted(map(str, Path(folder).glob(pattern)))


setup(
    name="teleop_core",
    version=VERSION,
    description="Master-slave teleoperation stack for ROS 2 Jazzy",
    license="Apache-2.0",
    packages=find_packages(include=["teleop_core", "teleop_core.*"]),
    package_data={"teleop_core": ["py.typed", "*.pyi", "kernels/compiled/**/*.nb?", "nodes/profiles/*.xml"]},
    python_requires=">=3.11",
    install_requires=[
        "cyclopts>=5.5",
        "lazy_loader",
        "numpy",
        "numba>=0.68,<0.69",
        "mcap",
        "rosbags",
        "pandas",
        "lz4",
        "zstandard",
        "pyyaml",
        "rich",
        "scipy",
    ],
    extras_require={
        "mesh": ["trimesh"],
        "urdf": ["xacro", "robot_descriptions"],
        "devices": ["pygame-ce", "hidapi"],
        "ros": ["ros-jazzy-rclpy[fastrtps]", "ros-jazzy-common-interfaces", "setproctitle"],
        "crtk": ["catkin-pkg"],
        "test": [
            "EAIK",
            "coverage",
            "distributed",
            "gymnasium",
            "optuna",
            "pytest",
            "pytest-rerunfailures",
            "pytest-timeout",
            "pytest-xdist",
            "hypothesis",
            "import-linter",
            "proselint",
            "pin",
            "mujoco",
            "trimesh",
            "xacro",
            "robot_descriptions",
            "roboticstoolbox-python",
            "mcap-ros2-support",
            "ruff",
            "mypy",
            "types-PyYAML",
            "types-greenlet",
            "psutil",
            "colcon-common-extensions",
            "colcon-ros",
        ],
        "bench": ["ikpy"],
        "docs": ["sphinx", "furo", "myst-nb", "sphinxcontrib-mermaid", "matplotlib"],
    },
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/teleop_core"]),
        ("share/teleop_core", ["package.xml"]),
        files("config", "*.yaml"),
        files("config", "*.json"),
        files("config", "*.rviz"),
        files("config/robots", "*.yaml"),
        files("config/arms", "*.yaml"),
        files("config/masters", "*.yaml"),
        files("config/studies", "*.yaml"),
        files("launch", "*.launch.py"),
    ],
    entry_points={
        "console_scripts": [
            "teleop = teleop_core.commands.cli:main",
            *(f"{node} = teleop_core.nodes.start:main" for node in NODES),
        ]
    },
)
