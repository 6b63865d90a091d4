# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The guide: the site builds without a warning, links lead somewhere, commands and notebooks run, tables hold what the code has."""

from __future__ import annotations

import ast
import dataclasses
import functools
import importlib.util
import json
import re
import shlex
import subprocess
import sys
import typing
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer.main
import yaml
from bag_making import thinned_bag
from catalogue import put_back
from test_packaging import environment
from test_report import CHROMIUM, needs_chromium
from typer.testing import CliRunner

import lugre_steering as ls
from lugre_steering import reference
from lugre_steering.calibration import result as calibration
from lugre_steering.chain.compose import HOOKS, QUANTITIES, quantities_of
from lugre_steering.cli import app
from lugre_steering.diagnosis import result as diagnosis
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.errors import DataError
from lugre_steering.fleet import result as fleet
from lugre_steering.replay import result as replay
from lugre_steering.vehicle import Vehicle

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
PAGES = [*(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "bags/README.md", "config/README.md")), *sorted(DOCS.glob("*.md"))]
NOTEBOOKS = sorted((DOCS / "notebooks").glob("*.ipynb"))


def named(page: Path) -> str:
    return str(page.relative_to(ROOT))


# --------------------------------------------------------------------- site


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("mkdocs")
    pytest.importorskip("material")
    folder = tmp_path_factory.mktemp("built") / "site"
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(folder)]
    done = subprocess.run(command, cwd=ROOT, env=environment(NO_MKDOCS_2_WARNING="1"), capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    return folder


def test_the_site_builds_without_a_warning(site: Path) -> None:
    shown = (site / "vehicle_file.html").read_text(encoding="utf-8")
    assert "load_N" in shown
    assert "<!-- reference" not in shown
    assert (site / "bags/synthetic_hidden_stop_found.png").is_file()
    assert not list(site.rglob("*.py"))


WIDTHS = """<script>window.addEventListener("load", function () {
  document.body.setAttribute("data-told", JSON.stringify(Array.from(document.querySelectorAll("iframe")).map(function (frame) {
    var page = frame.contentDocument;
    return [page.documentElement.scrollWidth].concat(Array.from(page.querySelectorAll("table, pre")).map(function (part) {
      return Math.ceil(part.getBoundingClientRect().right); }));
  })));
});</script>"""


@needs_chromium
def test_nothing_of_the_site_is_wider_than_a_phone(site: Path) -> None:
    pages = sorted(page.name for page in site.glob("*.html") if page.name != "404.html")
    frames = "".join(f'<iframe style="width:390px;height:800px;border:0" src="{page}"></iframe>' for page in pages)
    host = site / "all.html"
    host.write_text(f"<!doctype html><body>{frames}{WIDTHS}</body>", encoding="utf-8")
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--allow-file-access-from-files", f"--user-data-dir={site / 'profile'}"]
    command = [str(CHROMIUM), *options, "--virtual-time-budget=10000", "--dump-dom", host.as_uri()]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=600)
    told = re.search(r'data-told="([^"]*)"', done.stdout)
    assert told is not None, done.stderr
    widest = {page: max(widths) for page, widths in zip(pages, json.loads(told[1]), strict=True)}
    assert len(widest) > 15
    assert {page: width for page, width in widest.items() if width > 390} == {}


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_links_lead_somewhere(page: Path) -> None:
    text = re.sub(r"```.*?```|`[^`\n]*`", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if re.match(r"https?:|#", target):
            continue
        path, _, anchor = target.partition("#")
        assert (page.parent / path).exists(), f"{named(page)}: {target}"
        if anchor:
            headings = re.findall(r"^#+ (.*)$", (page.parent / path).read_text(encoding="utf-8"), re.MULTILINE)
            assert anchor in [re.sub(r"[^\w -]", "", heading).lower().replace(" ", "-") for heading in headings], f"{named(page)}: {target}"


def test_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_bytes()) <= 6000


# ----------------------------------------------------------------- commands


def shell_lines(page: Path) -> list[str]:
    """The commands in the blocks of a page, one a line."""
    blocks = re.findall(r"^```(\w*)\n(.*?)^```$", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    return [line.strip() for language, block in blocks if not language for line in block.splitlines() if line.strip()]


def of_ours(line: str) -> list[str] | None:
    """Arguments of `lugre-steering` in a line, if it is called there."""
    _, called, arguments = line.rpartition("lugre-steering ")
    return shlex.split(arguments) if called else None


def is_pattern(line: str) -> bool:
    """It shows what may be given, and is no command by itself."""
    return bool(re.search(r"\.\.\.|[\[\]<>|]|\b(?:FILE|DIR|NAME|ID|FOLDER|TABLE|BAG)\b", line))


COMMANDS: dict[str, Any] = getattr(typer.main.get_command(app), "commands")  # noqa: B009


def options(command: str) -> set[str]:
    return {name for parameter in COMMANDS[command].params for name in (*parameter.opts, *parameter.secondary_opts)}


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_commands_can_be_typed_as_they_stand(page: Path) -> None:
    for line in shell_lines(page):
        arguments = of_ours(line)
        if not is_pattern(line):
            subprocess.run(["bash", "-n", "-c", line], check=True)
        if arguments is None:
            continue
        if is_pattern(line):
            assert set(re.findall(r"--[a-z-]+", line)) <= options(arguments[0]), line
            continue
        COMMANDS[arguments[0]].make_context(arguments[0], arguments[1:])
        for path in (argument for argument in arguments if argument.startswith(("bags/", "config/"))):
            assert (ROOT / path).exists(), line


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_commands_in_the_text_exist(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for line in re.findall(r"`(lugre-steering [^`]+)`", text):
        words = line.split()
        assert words[1] in COMMANDS, f"{named(page)}: {line}"
        assert set(re.findall(r"--[a-z-]+", line)) <= options(words[1]), f"{named(page)}: {line}"
    for command in COMMANDS:  # options told of a command by its name
        for told in re.findall(rf"`{command} (--[a-z-]+)[^`]*`", text):
            assert told in options(command), f"{named(page)}: {command} {told}"
    for module in re.findall(r"python -m (lugre_steering[.\w]*\w)", text):
        assert importlib.util.find_spec(module) is not None, f"{named(page)}: {module}"


@pytest.mark.parametrize(("command", "gate"), [("replay", replay), ("calibrate", calibration), ("diagnose", diagnosis), ("fleet", fleet)])
def test_what_can_be_failed_for_is_told(command: str, gate: Any) -> None:
    page = (DOCS / "commands.md").read_text(encoding="utf-8")
    (told,) = re.findall(rf"^\| `{command}` \| (.*) \|$", page, re.MULTILINE)
    with pytest.raises(DataError) as refused:
        gate.gate(["nothing of the kind"])
    assert re.findall(r"`([^`]+)`", told) == str(refused.value).partition("expected one of ")[2].split(", ")


QUICK = ("vehicle", "simulate", "effects", "replay", "import")
LOG = "time_s,angle_left_deg,angle_right_deg,main_a_bar,main_b_bar,aux_a_bar,aux_b_bar\n"


def test_the_quick_commands_of_the_first_hour_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In their order; what the first diagnosis writes is a vehicle file in its place. They find what the page says, at 12.5 Hz too."""
    (tmp_path / "defaults.yaml").write_text("simulate.rate: 12.5\n")
    monkeypatch.setenv("LUGRE_STEERING_CONFIG", str(tmp_path / "defaults.yaml"))
    for name in ("bags", "config"):
        (tmp_path / name).symlink_to(ROOT / name)
    (tmp_path / "out/diagnosis").mkdir(parents=True)
    sheet = (ROOT / "config/test_vehicle.yaml").read_text().replace("rubber_dma", f"{ROOT}/config/rubber_dma")
    (tmp_path / "out/diagnosis/augmented.yaml").write_text(sheet)
    rows = (f"{0.02 * i:.2f},{10 * i / 500:.3f},{9 * i / 500:.3f},40.0,20.0,30.0,15.0\n" for i in range(500))
    (tmp_path / "my_log.csv").write_text(LOG + "".join(rows))
    monkeypatch.chdir(tmp_path)
    ran = []
    for arguments in filter(None, map(of_ours, shell_lines(DOCS / "first_hour.md"))):
        if arguments[0] in QUICK or "out/named" in arguments:
            done = CliRunner().invoke(app, arguments, input="\n" * 100)
            assert done.exit_code == 0, f"{arguments}: {done.output}"
            ran.append(arguments[0])
            if ran == ["replay"]:
                told = re.search(r"RMSE of (\d+) N m .*? and of (\d+) N m", (DOCS / "first_hour.md").read_text(), re.DOTALL)
                assert told is not None
                found = [bag["fit"]["rmse_Nm"] for bag in json.loads(Path("out/summary.json").read_text())["bags"]]
                assert [float(number) for number in told.groups()] == pytest.approx(found, rel=0.01)
    assert set(ran) == {*QUICK, "diagnose"}
    (named_one,) = json.loads(Path("out/named/diagnosis.json").read_text())["effects"]
    assert named_one["id"] == "backlash"
    assert named_one["indistinguishable_from"] == []
    assert named_one["parameters"]["width"]["value"] == pytest.approx(0.02, rel=0.02)
    assert (tmp_path / "my_vehicle_rubber.csv").exists()
    assert (tmp_path / "my_bag/metadata.yaml").exists()


# ---------------------------------------------------------------- notebooks


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=named)
def test_notebooks_run_and_hold_no_outputs(notebook: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What they simulate and the recordings that they read have 20 Hz here, which is quicker to diagnose."""
    plt = pytest.importorskip("matplotlib.pyplot")
    cells = [cell for cell in json.loads(notebook.read_text(encoding="utf-8"))["cells"] if cell["cell_type"] == "code"]
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in cells)
    (tmp_path / "config").symlink_to(ROOT / "config")
    for name in ("synthetic_hidden_stop_a", "synthetic_hidden_stop_b"):
        thinned_bag(ROOT / "bags" / name, tmp_path / "bags")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(ls, "simulate", functools.partial(ls.simulate, angle_rate_Hz=20.0, pressure_rate_Hz=20.0))
    with put_back():
        exec(compile("\n".join("".join(cell["source"]) for cell in cells), notebook.name, "exec"), {})
    plt.close("all")


# ------------------------------------------------------------------- tables


def keys_of(data: Any, path: str = "") -> Iterator[str]:
    """Dotted keys of a mapping as the guide writes them."""
    if isinstance(data, dict):
        for name, inner in data.items():
            here = f"{path}.{name}".removeprefix(".")
            yield here
            for entry in inner.values() if name == "cylinders" else ():
                yield from keys_of({"NAME": entry}, here)
            if name != "cylinders":
                yield from keys_of(inner, here)
    elif isinstance(data, list):
        for entry in data:
            yield from keys_of(entry, f"{path}[]")


def test_every_key_that_a_shipped_vehicle_file_holds_is_in_the_reference() -> None:
    known = {f"{section.path}.{key.name}".removeprefix(".") for section in reference.sections() for key in section.keys}
    read = {"rubber.dma_csv"}  # a file in place of the table rubber.dma
    free = re.compile(r"hydraulics\.cylinders\.NAME$|effects\[\]\.parameters\.|laws\[\]\.(values|intervals)\.|provenance\.")
    files = [file for file in (ROOT / "config").glob("*.yaml") if "schema: lugre_steering/vehicle/1" in file.read_text()]
    assert len(files) >= 5
    for file in files:
        found = set(keys_of(yaml.safe_load(file.read_text())))
        assert {key for key in found - read if not free.search(key)} <= known, file.name


def classes_in(cls: type) -> Iterator[type]:
    """The dataclasses of a vehicle file, by the annotations alone."""
    yield cls
    for hint in typing.get_type_hints(cls).values():
        for inner in (hint, *typing.get_args(hint)):
            if dataclasses.is_dataclass(inner):
                yield from classes_in(typing.cast(type, inner))


def test_every_key_is_there_with_its_meaning_unit_and_range() -> None:
    sections = list(reference.sections())
    assert len(sections) == len(list(classes_in(Vehicle)))
    assert sum(len(section.keys) for section in sections) == sum(len(dataclasses.fields(cls)) for cls in classes_in(Vehicle))
    assert [f"{s.path}.{key.name}" for s in sections for key in s.keys if not key.meaning] == []
    keys = {f"{section.path}.{key.name}": key for section in sections for key in section.keys}
    stiffness = keys["friction.stiffness_Nm_per_deg"]
    assert (stiffness.unit, stiffness.range, stiffness.default) == ("N m/deg", "0.001 to 1e+07", "**required**")
    assert keys["sensors.pressure_range_Pa"].default == "`4e+07`"
    page = reference.filled((DOCS / "vehicle_file.md").read_text(encoding="utf-8"))
    assert all(f"`{key.rpartition('.')[2]}`" in page for key in keys)


def test_node_parameters_and_effects_are_all_told() -> None:
    told = reference.filled((DOCS / "ros.md").read_text(encoding="utf-8"))
    defaults = yaml.safe_load((ROOT / "config/estimator_parameters.yaml").read_text())["/**"]["ros__parameters"]
    assert {name for name in defaults if f"| `{name}` |" not in told} == set()
    told = reference.filled((DOCS / "effects.md").read_text(encoding="utf-8"))
    assert {name for name in CATALOGUE if f"| `{name}` |" not in told} == set()


def test_what_laws_may_read_is_told() -> None:
    """Of every hook, and nothing that no law can read."""
    assert {name for hook in HOOKS.values() for name in hook.given} == set(QUANTITIES)
    told = reference.filled((DOCS / "adding_physics.md").read_text(encoding="utf-8"))
    readable = {name for hook in HOOKS for name in quantities_of(hook)}
    assert {name for name in readable if f"\n| `{name}` | " not in told} == set()


def test_the_tables_are_printed_by_name() -> None:
    command = [sys.executable, "-m", "lugre_steering.reference"]
    done = subprocess.run([*command, "effects"], env=environment(), capture_output=True, text=True, check=True)
    assert done.stdout.strip() == reference.effects().strip()
    done = subprocess.run([*command, "efects"], env=environment(), capture_output=True, text=True, check=False)
    assert (done.returncode, "Traceback" in done.stderr) == (2, False)
    done = subprocess.run(command, env=environment(), capture_output=True, text=True, check=True)
    assert all(table() in done.stdout for table in reference.TABLES.values())


def findings() -> set[str]:
    """Codes of findings, as they stand where one is made."""
    makers = {"Finding", "SheetFinding", "_Fault", "_finding", "_say", "report"}
    texts = [file.read_text(encoding="utf-8") for file in (ROOT / "lugre_steering").rglob("*.py")]
    calls = (
        node for text in texts if any(f"{maker}(" in text for maker in makers) for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Call) and node.args and isinstance(node.args[0], ast.Constant)
    )  # fmt: skip
    names = ((getattr(call.func, "id", getattr(call.func, "attr", "")), typing.cast(ast.Constant, call.args[0]).value) for call in calls)
    return {code for maker, code in names if maker in makers and isinstance(code, str) and re.fullmatch("[a-z]+(_[a-z]+)*", code)}


def test_every_finding_is_in_the_troubleshooting() -> None:
    codes = findings()
    assert {"stuck_sensor", "wrong_sheet", "truncated_bag", "sign_flipped", "dropout"} <= codes
    page = (DOCS / "troubleshooting.md").read_text(encoding="utf-8")
    assert {code for code in codes if f"`{code}`" not in page} == set()
