"""Install teleop_console with pip or colcon; constraints.txt at the top pins dependencies."""

from setuptools import find_packages, setup

VERSION = "0.6.0"  # released together with teleop_core

setup(
    name="teleop_console",
    version=VERSION,
    description="Console and report of teleop_core: a session in the browser, and scores as a page",
    license="Apache-2.0",
    packages=find_packages(include=["teleop_console", "teleop_console.*"]),
    package_data={
        "teleop_console": ["py.typed", "*.pyi", "*.css", "*.js", "report/*.js", "report/*.css", "report/*.html"]
    },
    python_requires=">=3.11",
    install_requires=[
        f"teleop_core=={VERSION}",
        "cyclopts",
        "jinja2",
        "lazy_loader",
        "msgspec",
        "numpy",
        "plotly",
        "segno",
        "viser>=1.1,<1.2",
    ],
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/teleop_console"]),
        ("share/teleop_console", ["package.xml"]),
    ],
    entry_points={
        "teleop_core.pages": [
            "report = teleop_console.report.report_page:report_page",
            "workspace = teleop_console.report.workspace:write_workspace_page",
        ]
    },
)
