"""Build crtk_msgs for Python where ROS comes from pip, which brings rosidl but no ament_cmake.

The generators are those that ``rosidl_generate_interfaces`` calls in CMake, and what is installed
has the same names and places; only the C++ messages are left out. Needs a C and a C++ compiler.
"""

import argparse
import contextlib
import io
import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import warnings
from collections.abc import Iterable
from pathlib import Path

HERE = Path(__file__).resolve().parent
PACKAGE = "crtk_msgs"
DEPENDENCIES = ("builtin_interfaces", "geometry_msgs", "service_msgs", "std_msgs")
"""Packages whose messages ours hold; services hold ``service_msgs``."""
RUNTIME = (
    "rosidl_runtime_c",
    "rosidl_typesupport_interface",
    "rosidl_typesupport_c",
    "rosidl_typesupport_introspection_c",
    "rosidl_typesupport_fastrtps_c",
    "rosidl_typesupport_fastrtps_cpp",
    "rosidl_runtime_cpp",
    "rosidl_dynamic_typesupport",
    "rmw",
    "rcutils",
)
"""Packages whose headers the generated sources include."""
LINKED = (
    "rosidl_runtime_c",
    "rosidl_typesupport_c",
    "rosidl_typesupport_introspection_c",
    "rosidl_typesupport_fastrtps_c",
    "rosidl_typesupport_fastrtps_cpp",
    "rmw",
    "rcutils",
    "fastcdr",
)
"""Libraries they call; the linker keeps those that a library of ours needs."""


KINDS = (
    "rosidl_generator_c",
    "rosidl_typesupport_introspection_c",
    "rosidl_typesupport_fastrtps_c",
    "rosidl_typesupport_c",
    "rosidl_generator_py",
)
"""Libraries of one message package, in the order in which they need each other."""


class BuildError(Exception):
    """A tool is missing, or the compiler reported an error."""


def generate(folder: Path, share: Path) -> dict[str, list[Path]]:
    """Sources of all interfaces, by the generator that wrote them.

    Args:
        folder: Folder of the generated files, with one folder per generator.
        share: Folder ``share`` of the ROS installation.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the parser imports a deprecated module of Python
        from rosidl_adapter.cli import TranslateMsgToIDL, TranslateSrvToIDL
        from rosidl_generator_c.cli import GenerateC
        from rosidl_generator_py.cli import GeneratePython
        from rosidl_generator_type_description.cli import HashTypeDescription
        from rosidl_typesupport_c.cli import GenerateCTypesupport
        from rosidl_typesupport_fastrtps_c.cli import GenerateFastRTPSCTypesupport
        from rosidl_typesupport_introspection_c.cli import GenerateIntrospectionCTypesupport

    include = [share / name for name in DEPENDENCIES]
    described = folder / "description" / PACKAGE
    idl: list[str] = []
    for kind, translator in (("msg", TranslateMsgToIDL), ("srv", TranslateSrvToIDL)):
        files = [f"{HERE}:{path.relative_to(HERE)}" for path in sorted(HERE.glob(f"*/*.{kind}"))]
        idl += map(str, translator(kind).translate(PACKAGE, files, include, described))
    hashes = HashTypeDescription("hash").generate_type_hashes(PACKAGE, idl, include, described)
    own = ["rosidl_typesupport_c"]
    makers = (
        GenerateC("c"),
        GenerateIntrospectionCTypesupport("introspection_c"),
        GenerateFastRTPSCTypesupport("fastrtps_c"),
        GenerateCTypesupport("c"),
        GeneratePython("py", typesupport_implementations=own),
    )
    for name, maker in zip(KINDS, makers, strict=True):
        extra = {"type_description_files": hashes} if name == "rosidl_generator_c" else {}
        maker.generate(PACKAGE, idl, include, folder / name / PACKAGE, **extra)
    return {name: sorted((folder / name).rglob("*.c*")) for name in KINDS}


class Compiler:
    """Compiler of shared libraries against one ROS installation.

    Args:
        prefix: The installation.
        folder: Folder of the generated files, with one folder per generator.
        lib: Folder of the libraries.
    """

    def __init__(self, prefix: Path, folder: Path, lib: Path) -> None:
        import numpy as np

        headers = [prefix / "include" / name for name in ("", *RUNTIME, *DEPENDENCIES)]
        headers += [path for path in folder.iterdir() if path.is_dir()]
        headers += [Path(sysconfig.get_path("include")), Path(np.get_include())]
        self._include = [f"-I{path}" for path in headers]
        self._search = [f"-L{lib}", f"-L{prefix / 'lib'}"]
        foreign = [f"{name}__{kind}" for name in DEPENDENCIES for kind in KINDS]
        self._libraries = ["-Wl,--as-needed", *(f"-l{name}" for name in (*foreign, *LINKED))]

    def link(self, sources: Iterable[Path], own: Iterable[str], out: Path) -> None:
        """Make one shared library of sources, linked with libraries of ours.

        Raises:
            BuildError: There is no compiler, or it refuses.
        """
        sources = list(sources)
        is_cpp = any(path.suffix == ".cpp" for path in sources)
        command = [compiler("CXX", "c++") if is_cpp else compiler("CC", "cc")]
        command += ["-O1", "-fPIC", "-shared", "-w", *self._include, *map(str, sources)]
        command += ["-Wl,-rpath,$ORIGIN", *self._search, *(f"-l{name}" for name in own)]
        command += [*self._libraries, "-o", str(out)]
        out.parent.mkdir(parents=True, exist_ok=True)
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            raise BuildError(f"{out.name}: {done.stderr.strip()[:2000]}")


def compiler(variable: str, default: str) -> str:
    """Path of a compiler: what the environment names, or the usual one.

    Raises:
        BuildError: It is not there.
    """
    name = os.environ.get(variable, default)
    found = shutil.which(name)
    if found is None:
        raise BuildError(f"no compiler {name!r}; install one, such as apt install gcc g++")
    return found


def build(prefix: Path, folder: Path, ros: Path) -> None:
    """Generate, compile and install the package.

    Args:
        prefix: Folder of the installation.
        folder: Folder of the generated sources.
        ros: The ROS installation.

    Raises:
        BuildError: Something is missing, or a source cannot be compiled.
    """
    shutil.rmtree(folder, ignore_errors=True)
    compiler("CC", "cc"), compiler("CXX", "c++")
    with contextlib.redirect_stdout(io.StringIO()):  # a line for each file
        sources = generate(folder, ros / "share")
    lib, made = prefix / "lib", []
    module = Path(sysconfig.get_path("purelib", "posix_prefix", {"base": str(prefix)})) / PACKAGE
    shutil.rmtree(module, ignore_errors=True)
    make = Compiler(ros, folder, lib)
    entry = [path for path in sources["rosidl_generator_py"] if ".ep." in path.name]
    for name, files in sources.items():
        rest = [path for path in files if path not in entry]
        make.link(rest, made, lib / f"lib{PACKAGE}__{name}.so")
        made.append(f"{PACKAGE}__{name}")
    make.link(entry, made, module / f"{PACKAGE}_s__rosidl_typesupport_c.so")
    _install_python(folder / "rosidl_generator_py" / PACKAGE, module)
    _install_share(folder / "description" / PACKAGE, prefix / "share")


def _install_python(generated: Path, module: Path) -> None:
    for path in generated.rglob("*.py"):
        target = module / path.relative_to(generated)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, target)
    (module / "__init__.py").touch()


def _install_share(described: Path, share: Path) -> None:
    """Interfaces, and the marks by which ROS finds the package and what it holds."""
    names = []
    for root in (HERE, described):
        for path in sorted([*root.glob("msg/*"), *root.glob("srv/*")]):
            target = share / PACKAGE / path.relative_to(root)
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(path, target)
            if path.suffix in {".msg", ".srv", ".idl"}:
                names.append(str(path.relative_to(root)))
    shutil.copy(HERE / "package.xml", share / PACKAGE)
    index = share / "ament_index" / "resource_index"
    for kind, text in (("packages", ""), ("rosidl_interfaces", "\n".join(sorted(names)))):
        (index / kind).mkdir(parents=True, exist_ok=True)
        (index / kind / PACKAGE).write_text(text)


def main() -> int:
    """Build from the command line; returns the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument(
        "--prefix", type=Path, default=Path(sys.prefix), help="where to install (default: this Python environment)"
    )
    parser.add_argument("--build", type=Path, help="where to generate (default: a folder in /tmp)")
    given = parser.parse_args()
    os.environ.setdefault("AMENT_PREFIX_PATH", sys.prefix)
    try:
        from ament_index_python import get_package_prefix

        ros = Path(get_package_prefix("std_msgs"))
        with tempfile.TemporaryDirectory() as own:
            build(given.prefix.absolute(), (given.build or Path(own) / "generated").absolute(), ros)
    except ImportError as error:
        print(f"{PACKAGE} not built: {error}; install teleop_core[ros,crtk]", file=sys.stderr)
    except (BuildError, LookupError) as error:
        print(f"{PACKAGE} not built: {error}", file=sys.stderr)
    else:
        print(f"{PACKAGE} installed in {given.prefix}")
        return 0
    return 1


if __name__ == "__main__":
    sys.exit(main())
