"""Install teleop_drill with pip or colcon; constraints.txt at the top pins dependencies."""

from setuptools import find_packages, setup

VERSION = "0.6.0"  # released together with teleop_core

setup(
    name="teleop_drill",
    version=VERSION,
    description="Drill and conformance test for CRTK arms",
    license="Apache-2.0",
    packages=find_packages(include=["teleop_drill", "teleop_drill.*"]),
    package_data={"teleop_drill": ["py.typed", "*.pyi"]},
    python_requires=">=3.11",
    install_requires=[
        f"teleop_core=={VERSION}",
        "cyclopts",
        "greenlet",
        "lazy_loader",
        "mcap",
        "numpy",
        "pyyaml",
        "rich",
    ],
    extras_require={"dask": ["distributed"], "ros": ["teleop_core[ros]"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/teleop_drill"]),
        ("share/teleop_drill", ["package.xml"]),
    ],
)
