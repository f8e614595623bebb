"""Install teleop_lab with pip or colcon; constraints.txt at the top pins dependencies."""

from setuptools import find_packages, setup

VERSION = "0.6.0"  # released together with teleop_core

setup(
    name="teleop_lab",
    version=VERSION,
    description="Experiments, calibration, fitting and planning for teleop_core",
    license="Apache-2.0",
    packages=find_packages(include=["teleop_lab", "teleop_lab.*"]),
    package_data={
        "teleop_lab": ["py.typed", "*.pyi", "fitting/*.csv", "experiments/*.csv", "people/*.js", "people/*.css"]
    },
    python_requires=">=3.11",
    install_requires=[
        f"teleop_core=={VERSION}",
        f"teleop_machines=={VERSION}",
        f"teleop_console=={VERSION}",
        f"teleop_exchange=={VERSION}",
        "cyclopts",
        "lazy_loader",
        "numpy",
        "pandas",
        "pyyaml",
        "rich",
        "scipy",
        "xarray",
    ],
    extras_require={"dask": ["distributed"], "gym": ["gymnasium"], "tune": ["optuna"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/teleop_lab"]),
        ("share/teleop_lab", ["package.xml"]),
    ],
)
