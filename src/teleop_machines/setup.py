"""Install teleop_machines with pip or colcon; constraints.txt at the top pins dependencies."""

from setuptools import find_packages, setup

ROBOTS = ("four_bar", "mma", "parallelogram", "rps3", "scara_stewart", "stewart", "three_finger_hand")
VERSION = "0.6.0"  # released together with teleop_core

setup(
    name="teleop_machines",
    version=VERSION,
    description="Robots with loops for teleop_core: parallel machines and the MMA handle",
    license="Apache-2.0",
    packages=find_packages(include=["teleop_machines", "teleop_machines.*"]),
    package_data={"teleop_machines": ["py.typed"]},
    python_requires=">=3.11",
    install_requires=[f"teleop_core=={VERSION}", "numpy"],
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/teleop_machines"]),
        ("share/teleop_machines", ["package.xml"]),
    ],
    entry_points={"teleop_core.robots": [f"{name} = teleop_machines.{name}:make" for name in ROBOTS]},
)
