"""Install teleop_exchange with pip or colcon; constraints.txt at the top pins dependencies."""

from setuptools import find_packages, setup

VERSION = "0.6.0"  # released together with teleop_core

setup(
    name="teleop_exchange",
    version=VERSION,
    description="Import and export of recordings for teleop_core: tables, ROS bags, LeRobot",
    license="Apache-2.0",
    packages=find_packages(include=["teleop_exchange", "teleop_exchange.*"]),
    package_data={"teleop_exchange": ["py.typed", "*.pyi"]},
    python_requires=">=3.11",
    install_requires=[
        f"teleop_core=={VERSION}",
        "av",
        "cyclopts",
        "lazy_loader",
        "numpy",
        "pandas",
        "pyarrow",
        "rosbags",
        "scipy",
    ],
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/teleop_exchange"]),
        ("share/teleop_exchange", ["package.xml"]),
    ],
    entry_points={"teleop_core.readers": ["others = teleop_exchange.foreign:master_of_others"]},
)
