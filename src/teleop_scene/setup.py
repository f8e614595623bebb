"""Install teleop_scene with pip or colcon; constraints.txt at the top pins dependencies."""

from setuptools import find_packages, setup

VERSION = "0.6.0"  # released together with teleop_core

setup(
    name="teleop_scene",
    version=VERSION,
    description="MuJoCo models as slave and world for teleop_core",
    license="Apache-2.0",
    packages=find_packages(include=["teleop_scene", "teleop_scene.*"]),
    package_data={"teleop_scene": ["py.typed", "scenes/*.xml"]},
    python_requires=">=3.11",
    install_requires=[f"teleop_core=={VERSION}", "cyclopts", "mujoco-core", "numpy", "PyOpenGL", "simplejpeg"],
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/teleop_scene"]),
        ("share/teleop_scene", ["package.xml"]),
    ],
    entry_points={
        "teleop_core.scene_readers": ["scene = teleop_scene.parts:READER"],
        "teleop_core.plants": ["scene = teleop_scene.parts:SCENE"],
        "teleop_core.stages": ["scene = teleop_scene.parts:SCENE_STAGE"],
    },
)
