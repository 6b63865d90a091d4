# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The package as pip and as ROS 2 see it: metadata, installed layout, what each part may import."""

from __future__ import annotations

import ast
import configparser
import email
import os
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
NAME = "lugre_steering"
HEADER = ["# Copyright 2026 The lugre_steering contributors", "# SPDX-License-Identifier: Apache-2.0"]
ROS = re.compile(r"rclpy|rcl_interfaces|builtin_interfaces|launch(_ros)?|ament_\w+|\w+_msgs|std_srvs")
PLOTTING = {"matplotlib", "plotly"}
NOT_CORE = ("live", "report", "bench")
DRAWING = ("figure.py", "figures.py", "plots.py", "page.py", "show.py", "effect_card.py")
"""Pictures lie beside the command that writes them, in files of these names."""
ROS_KEYS = {
    "rclpy", "rcl_interfaces", "builtin_interfaces", "sensor_msgs", "geometry_msgs", "std_msgs", "std_srvs",
    "trajectory_msgs", "diagnostic_msgs", "launch", "launch_ros", "ament_index_python",
}  # fmt: skip
ROSDEP_KEYS = {f"python3-{name}" for name in ("numpy", "scipy", "numba", "yaml", "matplotlib", "pytest")}


def python_files() -> list[Path]:
    folders = ("lugre_steering", "test", "launch")
    return [ROOT / "setup.py", *(file for folder in folders for file in sorted((ROOT / folder).rglob("*.py")))]


@pytest.mark.parametrize("file", python_files(), ids=lambda file: str(file.relative_to(ROOT)))
def test_every_file_has_the_licence_header(file: Path) -> None:
    assert file.read_text(encoding="utf-8").splitlines()[:2] == HEADER


# ----------------------------------------------------------------- imports


def imported(tree: ast.AST) -> Iterator[str]:
    """Top-level packages that running the module imports; blocks for the type checker are never run."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            continue
        if isinstance(node, ast.Import):
            yield from (alias.name.split(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and not node.level:
            yield (node.module or "").split(".")[0]
        else:
            yield from imported(node)


def test_the_core_imports_neither_ros_nor_plotting() -> None:
    offences = []
    for file in sorted((ROOT / NAME).rglob("*.py")):
        part = file.relative_to(ROOT / NAME).parts[0]
        packages = set(imported(ast.parse(file.read_text(encoding="utf-8"))))
        if part not in NOT_CORE and file.name not in DRAWING:
            offences += [f"{file}: {name}" for name in packages if ROS.fullmatch(name) or name in PLOTTING]
        elif part == "live":
            offences += [f"{file}: {name}" for name in packages if name in PLOTTING | {"rosbags", "rich", "typer"}]
    assert offences == []


def test_importing_the_core_loads_neither_ros_nor_plotting() -> None:
    """One after the other: what is loaded stays, so that the first one to load it is the one that is named."""
    code = f"""
import importlib, sys
for module in ("estimator", "replay", "cli", "vehicle", "bag"):
    importlib.import_module("{NAME}." + module)
    print(module, *sorted({{name.split(".")[0] for name in sys.modules}}))
"""
    done = subprocess.run([sys.executable, "-c", code], env=environment(), capture_output=True, text=True, check=True)
    loaded = {module: names for module, *names in map(str.split, done.stdout.splitlines())}
    assert len(loaded) == 5
    assert {module: bad for module, names in loaded.items() if (bad := [n for n in names if ROS.fullmatch(n) or n in PLOTTING])} == {}


def environment(**changes: str) -> dict[str, str]:
    import lugre_steering

    return os.environ | {"PYTHONPATH": str(Path(lugre_steering.__file__).parents[1])} | changes


SLOWLY = """
import functools
import lugre_steering as ls
ls.simulate = functools.partial(ls.simulate, angle_rate_Hz=20.0, pressure_rate_Hz=20.0)
"""
"""Before an example of the guide, so that what it simulates is quicker to diagnose."""


# ------------------------------------------------------------- package.xml


def test_package_xml_is_format_3_with_known_keys() -> None:
    package = ElementTree.parse(ROOT / "package.xml").getroot()
    assert (package.tag, package.get("format")) == ("package", "3")
    assert package.findtext("name") == NAME
    assert package.findtext("license") == "Apache-2.0"
    assert re.fullmatch(r"\d+\.\d+\.\d+", package.findtext("version") or "")
    maintainer = package.find("maintainer")
    assert maintainer is not None
    # colcon silently treats the package as plain Python when this is no e-mail address.
    assert re.fullmatch(r"[\w.-]+@[\w-]+(\.[\w-]+)+", maintainer.get("email") or "")
    assert package.findtext("export/build_type") == "ament_python"
    depends = {element.text for element in package if element.tag.endswith("depend")}
    assert depends <= ROS_KEYS | ROSDEP_KEYS
    assert {"rclpy", "sensor_msgs", "python3-numpy", "python3-numba"} <= depends


def test_every_ros_import_is_declared() -> None:
    package = ElementTree.parse(ROOT / "package.xml").getroot()
    declared = {element.text for element in package if element.tag == "exec_depend"}
    files = [ROOT / NAME / "node.py", *(ROOT / NAME / "live").glob("*.py"), *(ROOT / "launch").glob("*.py")]
    used = {name for file in files for name in imported(ast.parse(file.read_text(encoding="utf-8")))}
    assert {name for name in used if ROS.fullmatch(name)} <= declared


def test_version_is_the_same_everywhere() -> None:
    version = ElementTree.parse(ROOT / "package.xml").findtext("version")
    assert f'VERSION = "{version}"' in (ROOT / "setup.py").read_text(encoding="utf-8")
    assert f"## {version}" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


# -------------------------------------------------------------------- pip


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy to build in: building leaves folders behind."""
    folder = tmp_path_factory.mktemp("workspace") / "src" / NAME
    ignored = shutil.ignore_patterns(".*", "*.egg-info", "__pycache__", "build", "bags", "install", "log")
    shutil.copytree(ROOT, folder, ignore=ignored)
    return folder


@pytest.fixture(scope="module")
def wheel(source: Path, tmp_path_factory: pytest.TempPathFactory) -> zipfile.ZipFile:
    pytest.importorskip("setuptools")
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation", "-w", folder, source]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if "invalid command 'bdist_wheel'" in done.stderr:
        pytest.skip("this setuptools needs the package wheel to build one")
    assert done.returncode == 0, done.stderr
    return zipfile.ZipFile(next(folder.glob("*.whl")))


def test_plain_install_pulls_no_ros_and_no_plotting(wheel: zipfile.ZipFile) -> None:
    metadata = next(name for name in wheel.namelist() if name.endswith("dist-info/METADATA"))
    requirements = email.message_from_bytes(wheel.read(metadata)).get_all("Requires-Dist") or []
    plain = {re.split(r"[^\w.-]", item)[0] for item in requirements if "extra ==" not in item}
    assert {"numpy", "scipy", "numba", "rosbags", "typer", "rich", "lz4"} <= {name.lower() for name in plain}
    assert not [name for name in plain if name.startswith("ros-") or name in PLOTTING]


def test_wheel_holds_data_commands_and_ament_files(wheel: zipfile.ZipFile) -> None:
    names = wheel.namelist()
    scripts = configparser.ConfigParser()
    scripts.read_string(wheel.read(next(name for name in names if name.endswith("entry_points.txt"))).decode())
    assert set(scripts["console_scripts"]) == {"lugre-steering"}  # no common word on the PATH
    assert any(name.endswith(f"data/lib/{NAME}/estimator") for name in names)
    for file in (f"{NAME}/py.typed", f"{NAME}/config/pavements.yaml", f"{NAME}/config/rubber_dma_10hz.csv"):
        assert file in names
    for file in (f"ament_index/resource_index/packages/{NAME}", f"{NAME}/package.xml"):
        assert any(name.endswith(f"data/share/{file}") for name in names)
    modules = {f"{NAME}/{path.relative_to(ROOT / NAME).as_posix()}" for path in (ROOT / NAME).rglob("*.py")}
    assert modules <= set(names)


def test_installed_command_line_works_without_ros(wheel: zipfile.ZipFile, tmp_path: Path) -> None:
    wheel.extractall(tmp_path / "site")
    code = """
import sys
for name in ("rclpy", "sensor_msgs", "geometry_msgs", "trajectory_msgs", "builtin_interfaces"):
    sys.modules[name] = None
from lugre_steering.cli import main
from lugre_steering.resources import config_folder
assert (config_folder() / "pavements.yaml").is_file() and "site" in str(config_folder())
main()
"""
    done = subprocess.run(
        [sys.executable, "-c", code, "--help"],
        cwd=tmp_path,
        env=environment(PYTHONPATH=str(tmp_path / "site")),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "replay" in done.stdout


# ------------------------------------------------------------------ colcon


def colcon(workspace: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """colcon of the environment that runs the tests."""
    pytest.importorskip("colcon_core")
    pytest.importorskip("colcon_ros")
    command = [sys.executable, "-m", "colcon", *arguments]
    return subprocess.run(
        command,
        cwd=workspace,
        env=os.environ | {"COLCON_HOME": str(workspace), "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )


def test_colcon_sees_an_ament_python_package(source: Path) -> None:
    done = colcon(source.parents[1], "list")
    assert done.stdout.split() == [NAME, f"src/{NAME}", "(ros.ament_python)"], done.stderr


def test_colcon_build_installs_what_ros2_run_and_launch_look_for(source: Path) -> None:
    done = colcon(source.parents[1], "build")
    assert done.returncode == 0, done.stdout + done.stderr
    installed = source.parents[1] / "install" / NAME
    for file in (
        f"share/ament_index/resource_index/packages/{NAME}",
        f"share/{NAME}/package.xml",
        f"share/{NAME}/config/test_vehicle.yaml",
        f"share/{NAME}/launch/estimator.launch.py",
        f"share/{NAME}/package.sh",
        f"lib/{NAME}/estimator",
    ):
        assert (installed / file).is_file(), file
    assert os.access(installed / "lib" / NAME / "estimator", os.X_OK)
    done = subprocess.run(
        ["bash", "-c", f". install/local_setup.bash && {sys.executable} -c 'import {NAME}; print({NAME}.__file__)'"],
        cwd=source.parents[1],
        env={key: value for key, value in environment().items() if key != "PYTHONPATH"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout.startswith(str(installed)), done.stderr
