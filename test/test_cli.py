# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The command line as others see it: exit codes, one-line errors, JSON on stdout, progress on a terminal only."""

from __future__ import annotations

import codecs
import inspect
import io
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest
from outside import outside
from rich.console import Console
from rich.table import Table
from rosbags.highlevel import AnyReader
from typer.testing import CliRunner, Result

import lugre_steering
from lugre_steering import cli
from lugre_steering.bench.replay import write_cycle
from lugre_steering.diagnosis.effect_card import show_effect
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.report.words import number
from lugre_steering.simulate.command import show_outcomes
from lugre_steering.simulate.paper.outcome import Check, Outcome
from lugre_steering.terminal import Prose, output, point

pytestmark = pytest.mark.filterwarnings("error::UserWarning", "error::RuntimeWarning")  # a process would show them on stderr

ROOT = Path(__file__).resolve().parents[1]
VEHICLE = ROOT / "config" / "test_vehicle.yaml"
CONFORMANCE = outside("conformance")
ENVIRONMENT: Mapping[str, str] = os.environ | {
    "PYTHONPATH": str(Path(lugre_steering.__file__).parents[1]),
    "TERM": "xterm",
}


def run(*arguments: str | Path, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "lugre_steering.cli", *map(str, arguments)]
    return subprocess.run(command, cwd=cwd, env=ENVIRONMENT, capture_output=True, text=True, check=False, timeout=600)


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Result]:
    """The command line without the seconds that a process takes to begin, for what is the same in one; in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    return lambda *arguments: CliRunner().invoke(cli.app, [*map(str, arguments)], env={"COLUMNS": "80"}, prog_name="lugre-steering")


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bags") / "synthetic_cycle"
    write_cycle(folder, 20.0)
    return folder


def test_replay_writes_what_the_contract_promises(bag: Path, tmp_path: Path, here: Callable[..., Result]) -> None:
    done = here("replay", bag, "--vehicle", VEHICLE, "--out", tmp_path / "out", "--json")
    assert (done.exit_code, done.stderr) == (0, "")
    assert json.loads(done.stdout) == json.loads((tmp_path / "out" / "summary.json").read_text())
    assert (tmp_path / "out" / bag.name / "metadata.yaml").is_file()
    assert (tmp_path / "out" / f"{bag.name}.png").is_file()


def test_text_result_names_the_fit_and_the_folder(bag: Path, tmp_path: Path, here: Callable[..., Result]) -> None:
    named = shutil.copytree(bag, tmp_path / "synthetic_hidden_stop_a")
    done = here("replay", named, "--vehicle", VEHICLE, "--out", "out")
    assert (done.exit_code, done.stderr) == (0, "")
    assert "RMSE" in done.stdout
    assert f"\n{named.name} " in done.stdout  # whole, at 80 columns
    assert done.stdout.endswith(f"results in out, for people in {named.name}.html\n")


def test_the_version_is_told(tmp_path: Path) -> None:
    done = run("--version", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (0, f"lugre-steering {lugre_steering.__version__}\n")


def test_brackets_in_names_are_names(tmp_path: Path, here: Callable[..., Result]) -> None:
    """Rich would take them for its markup: lost words, or a traceback."""
    name = "name: test vehicle, front axle, dry concrete"
    sheet = VEHICLE.read_text().replace(name, 'name: "truck [/b] [prototype]"')
    (tmp_path / "own.yaml").write_text(sheet.replace("rubber_dma", f"{VEHICLE.parent}/rubber_dma"))
    done = here("vehicle", "own.yaml")
    assert (done.exit_code, done.stderr) == (0, "")
    assert "truck [/b] [prototype]" in done.stdout
    done = here("simulate", "small-loops", "--vehicle", "own.yaml", "--out", "folder [/x]")
    assert (done.exit_code, done.stderr) == (0, "")
    assert "folder [/x]" in done.stdout


@pytest.mark.skipif(sys.platform == "win32", reason="no pseudo-terminal")
def test_progress_is_shown_on_a_terminal(bag: Path, tmp_path: Path) -> None:
    ours, its = os.openpty()
    command = [sys.executable, "-m", "lugre_steering.cli", "replay", bag, "--vehicle", VEHICLE, "--out", tmp_path / "o", "--json"]
    with subprocess.Popen(command, cwd=tmp_path, env=ENVIRONMENT, stdout=subprocess.PIPE, stderr=its) as process:
        os.close(its)
        shown = b""
        try:
            while chunk := os.read(ours, 4096):
                shown += chunk
        except OSError:  # how a terminal ends on Linux
            pass
        finally:
            os.close(ours)
        assert process.stdout is not None
        assert json.loads(process.stdout.read()) == json.loads((tmp_path / "o" / "summary.json").read_text())  # and nothing else
        assert process.wait() == 0
    assert b"100%" in shown


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("replay", "absent", "--vehicle", VEHICLE, "--out", "out"), ("absent", "no such file")),
        (("replay", "text.txt", "--vehicle", VEHICLE, "--out", "out"), ("text.txt", "not a recording")),
        (("replay", "{bag}", "--vehicle", "absent.yaml", "--out", "out"), ("absent.yaml",)),
        (("replay", "{bag}", "--vehicle", "text.txt", "--out", "out"), ("text.txt",)),
        (("replay", "{bag}", "--vehicle", VEHICLE, "--out", "text.txt"), ("text.txt", "cannot be written")),
        (("replay", "{bag}", "--vehicle", VEHICLE, "--out", "{bag}"), ("synthetic_cycle", "choose another --out")),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(
    bag: Path, tmp_path: Path, arguments: tuple[str | Path, ...], words: tuple[str, ...], here: Callable[..., Result]
) -> None:
    (tmp_path / "text.txt").write_text("neither a bag nor a vehicle\n")
    done = here(*(str(argument).replace("{bag}", str(bag)) for argument in arguments))
    assert done.exit_code == 2
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) == 1
    assert all(word in done.stderr for word in words), done.stderr


def test_list_of_simulations_as_json(here: Callable[..., Result]) -> None:
    done = here("simulate", "--list", "--json")
    assert (done.exit_code, done.stderr) == (0, "")
    rows = json.loads(done.stdout)
    assert {"manoeuvre", "experiment", "file"} == {row["kind"] for row in rows}
    assert all(row["name"] and row["description"] for row in rows)


def test_wrong_usage_is_exit_code_2_without_traceback(tmp_path: Path) -> None:
    done = run("replay", cwd=tmp_path)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    absent = run("replay", "absent", "--vehicle", VEHICLE, "--out", "out", cwd=tmp_path)
    assert (absent.returncode, absent.stdout, len(absent.stderr.splitlines())) == (2, "", 1)


def test_help_lists_the_commands(tmp_path: Path) -> None:
    done = run("--help", cwd=tmp_path)
    assert done.returncode == 0
    assert "replay" in done.stdout


@pytest.mark.skipif(not CONFORMANCE.is_dir(), reason="the independent recordings are not here")
@pytest.mark.parametrize("name", ["baseline_clean", "baseline_noisy"])
def test_agrees_with_an_independent_simulation(tmp_path: Path, name: str, here: Callable[..., Result]) -> None:
    """Torque within 250 N m RMS and rubber temperature within 0.3 K, at every 0.1 s."""
    done = here("replay", CONFORMANCE / name, "--vehicle", VEHICLE, "--out", tmp_path)
    assert done.exit_code == 0, done.stderr
    expected = np.genfromtxt(CONFORMANCE / "expected.csv", delimiter=",", names=True)
    found: dict[str, list[tuple[float, float]]] = {}
    with AnyReader([tmp_path / name]) as reader:
        for connection, _, raw in reader.messages():
            part = connection.topic.removeprefix("/steering_torque_estimator/")
            if part == "torque" or part.startswith("rubber_temperature"):
                message = reader.deserialize(raw, connection.msgtype)
                time = message.header.stamp.sec - 1_790_000_000 + message.header.stamp.nanosec * 1e-9
                value = message.wrench.torque.z if part == "torque" else message.temperature
                found.setdefault(part, []).append((time, value))
    error = {part: np.interp(expected["t_s"], *np.transpose(rows)) for part, rows in found.items()}
    assert np.sqrt(np.mean((error["torque"] - expected["torque_Nm"]) ** 2)) < 250.0
    for side in ("left", "right"):
        difference = error[f"rubber_temperature/{side}"] - expected[f"{side}_temperature_degC"]
        assert np.abs(difference).max() < 0.3


def test_what_a_vehicle_file_amounts_to(tmp_path: Path, here: Callable[..., Result]) -> None:
    done = here("vehicle", VEHICLE, "--out", "sheet", "--json")
    assert (done.exit_code, done.stderr) == (0, "")
    result = json.loads(done.stdout)
    found = {row["quantity"]: (row["value"], row["unit"]) for row in result["quantities"]}
    # Half of 90 kN and 6.2 kN; 0.42 m2; 5393.7 N m per degree.
    assert found["load on the ground"] == (pytest.approx(51_200.0), "N")
    assert found["ground pressure, mean"] == (pytest.approx(51_200.0 / 0.42), "Pa")
    assert found["presliding stiffness"] == (pytest.approx(np.rad2deg(5393.7)), "N m/rad")
    assert found["time constant of cooling"] == (pytest.approx(1120.0 * 1750.0 * 0.012 / 18.0), "s")
    assert [row["topic"] for row in result["inputs"]][2] == "steering/pressure/main_a"
    assert (tmp_path / result["picture"]).read_bytes().startswith(b"\x89PNG")


def test_a_vehicle_sheet_of_a_rig_has_its_units_and_no_footprint(tmp_path: Path, here: Callable[..., Result]) -> None:
    rig = ROOT / "config" / "emps_vehicle.yaml"
    done = here("vehicle", rig)
    assert (done.exit_code, done.stderr) == (0, "")
    assert "N s/m" in done.stdout
    assert "N m" not in done.stdout
    refused = here("vehicle", rig, "--out", "sheet")
    assert refused.exit_code == 2
    assert "axle" in refused.stderr
    assert not (tmp_path / "sheet").exists()


# ----------------------------------------------------------------- help, letters, defaults


@pytest.mark.parametrize("module", ["lugre_steering", "lugre_steering.cli"])
def test_it_runs_as_a_module_and_h_helps(tmp_path: Path, module: str) -> None:
    command = [sys.executable, "-m", module, "simulate", "-h"]
    done = subprocess.run(command, cwd=tmp_path, env={**ENVIRONMENT, "COLUMNS": "80"}, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("Usage: lugre-steering simulate")
    words = " ".join(done.stdout.split())
    for kept in ("mcap or sqlite3 [mcap]", "sampling instants [s]", "deg [as the vehicle's sensors section]"):
        assert kept in words
    assert max(map(len, done.stdout.splitlines())) <= 80


def test_help_of_every_option_is_whole() -> None:
    """Square brackets of units and defaults are text, in every help there is."""
    for registered in cli.app.registered_commands:
        name = registered.name or registered.callback.__name__  # type: ignore[union-attr]
        shown = " ".join(CliRunner().invoke(cli.app, [name, "--help"], env={"COLUMNS": "80"}).stdout.split())
        for parameter in inspect.signature(registered.callback, eval_str=True).parameters.values():  # type: ignore[arg-type]
            for info in getattr(parameter.annotation, "__metadata__", ()):
                assert "[" not in info.help or info.help.split("[")[1][:3] in shown, info.help


@pytest.mark.parametrize("arguments", [("effects", "end_stop"), ("vehicle", VEHICLE), ("simulate", "--list"), ("effects", "--help")])
def test_terminals_that_know_ascii_only_get_near_letters(tmp_path: Path, arguments: tuple[str | Path, ...]) -> None:
    environment = {**ENVIRONMENT, "PYTHONIOENCODING": "ascii", "LC_ALL": "C", "COLUMNS": "80"}
    command = [sys.executable, "-m", "lugre_steering", *map(str, arguments)]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (0, b"")
    assert done.stdout.isascii()
    assert len(done.stdout) > 500


def test_the_nearest_letters() -> None:
    from lugre_steering.terminal import nearest

    codecs.register_error("test.nearest", nearest)
    assert "1\u202f750 … 2 → 3 Ω".encode("ascii", "test.nearest") == b"1 750 ... 2 -> 3 ?"


def test_the_list_of_effects_fits_80_columns_and_one_screen_or_so(here: Callable[..., Result]) -> None:
    done = here("effects")
    assert done.exit_code == 0
    lines = done.stdout.splitlines()
    assert len(lines) < 60
    assert max(map(len, lines)) <= 80


def test_saved_defaults_stand_in_for_options(
    bag: Path, tmp_path: Path, here: Callable[..., Result], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("LUGRE_STEERING_CONFIG")
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "etc"))
    assert here("config").stdout == "no defaults are saved\n"
    (tmp_path / "own.yaml").write_text(VEHICLE.read_text().replace("rubber_dma", f"{VEHICLE.parent}/rubber_dma"))
    assert here("config", "vehicle", "own.yaml").exit_code == 0
    assert here("config", "diagnose.seed", "7").exit_code == 0
    saved = json.loads(here("config", "--json").stdout)["defaults"]
    assert saved == {"vehicle": str(tmp_path / "own.yaml"), "diagnose.seed": 7}
    done = here("replay", bag, "--out", "out")  # no --vehicle
    assert (done.exit_code, done.stderr) == (0, "")
    given = here("replay", bag, "--out", "out", "--vehicle", "absent.yaml")
    assert (given.exit_code, "absent.yaml" in given.stderr) == (2, True)  # what is given counts
    for refusable in (("diagnose.seed", "x"), ("nothing", "1"), ("replay.seed", "1"), ("vehicle",)):
        refused = here("config", *refusable)
        assert (refused.exit_code, len(refused.stderr.splitlines())) == (2, 1)
    assert here("config", "vehicle", "--unset").exit_code == 0
    assert "Missing option" in here("replay", bag, "--out", "out").stderr
    kept = tmp_path / "etc" / "lugre_steering" / "defaults.yaml"
    for wrong, key in (("jobs: 1.5", "jobs"), ("vehicle: [a]", "vehicle"), ("fail-on: 3", "fail-on"), ("colour: red", "colour")):
        kept.write_text(wrong)
        broken = here("effects")
        assert (broken.exit_code, len(broken.stderr.splitlines())) == (2, 1)
        assert f"{kept}: key '{key}'" in broken.stderr
    assert here("config", "colour", "--unset").exit_code == 0  # the way out that it names
    assert here("effects").exit_code == 0


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ("diag", ["diagnose"]), ("diagnose --mat", ["--material"]), ("effects surf", ["surface_patch"]),
        ("diagnose --without end", ["end_stop"]),
    ],
)
def test_completion_is_offered(typed: str, offered: list[str]) -> None:
    asked = {"_LUGRE_STEERING_COMPLETE": "complete_bash", "COMP_WORDS": f"lugre-steering {typed}", "COMP_CWORD": str(len(typed.split()))}
    assert CliRunner().invoke(cli.app, [], env=asked, prog_name="lugre-steering").stdout.split() == offered


def test_completion_is_offered_by_the_program(tmp_path: Path) -> None:
    asked = {"_LUGRE_STEERING_COMPLETE": "complete_bash", "COMP_WORDS": "lugre-steering diag", "COMP_CWORD": "1"}
    command = [sys.executable, "-m", "lugre_steering"]
    done = subprocess.run(command, cwd=tmp_path, env={**ENVIRONMENT, **asked}, capture_output=True, text=True, check=False)
    assert done.stdout.split() == ["diagnose"]


def test_names_of_parameters_are_never_cut() -> None:
    """They must be typed as they stand: --effect end_stop:cubic_stiffness=1e7."""
    for effect in CATALOGUE.values():
        with (console := Console(width=80)).capture() as said:
            show_effect(console, effect, {"shown_by": [], "picture": ""})
        assert [p.name for p in effect.parameters if p.name not in said.get()] == [], effect.id
        assert [p.name for p in effect.parameters if number(p.high) not in said.get()] == [], effect.id


def test_no_line_of_a_terminal_ends_between_a_number_and_its_unit() -> None:
    said = "Missing from the model: free play between sensor and track, 24 % of the time, up to 9750 N m, beyond 30.1 deg."
    for width in range(20, 100):
        with (terminal := Console(width=width)).capture() as shown:
            terminal.print(Prose(said), point(said))
        lines = shown.get().splitlines()
        assert max(map(len, lines)) <= width
        assert " ".join(line.strip() for line in lines) == f"{said} - {said}"
        assert not [line for line in lines if re.search(r"\d$|N$", line.rstrip())], width


@pytest.mark.parametrize("width", [60, 80, 93])
def test_what_experiments_say_is_not_parted_inside_a_number(width: int, tmp_path: Path) -> None:
    ours = "53\u202f045, 50\u202f372, 48\u202f084, 46\u202f197, 44\u202f604, 43\u202f238 N m at the first limit"
    check = Check("the torque of each cycle is lower", "torque decreases", ours, True)
    note = f"compared on arrival at the limits, the same angle in each cycle. The largest torque of each cycle also falls ({ours})."
    outcome = Outcome("paper-cycles", "Six cycles", ("cycle",), ((1,),), (check,), (), {"friction level factor": 1.0191}, (note,))
    with (terminal := Console(width=width)).capture() as shown:
        show_outcomes(terminal, [outcome], tmp_path)
    for torque in ours.split(" N m")[0].split(", "):
        assert shown.get().count(torque) == 2, torque
    assert shown.get().count("43\u202f238 N m") == 2


def test_columns_stay_straight_where_letters_are_replaced(monkeypatch: pytest.MonkeyPatch) -> None:
    shown = io.TextIOWrapper(io.BytesIO(), encoding="ascii", errors="strict", write_through=True)
    monkeypatch.setattr(sys, "stdout", shown)
    table = Table("interval", "unit")
    for interval in ("1 … 2", "1 to 2", "1\u202f000 → 2"):
        table.add_row(interval, "m")
    output().print(table)
    lines = shown.buffer.getvalue().decode("ascii").splitlines()  # type: ignore[attr-defined]
    assert any("1 ... 2" in line for line in lines)
    assert len(set(map(len, lines))) == 1
    assert len({line.rindex("m") for line in lines if " m " in line}) == 1


def test_help_calls_values_what_they_are_to_people() -> None:
    shown = CliRunner().invoke(cli.app, ["diagnose", "--help"], env={"COLUMNS": "80"}).stdout
    for option in ("--vehicle PATH", "--without TEXT", "--seed INTEGER", "--material NUMBER", "--effects PATH"):
        assert option in shown


@pytest.mark.parametrize(
    ("command", "usage", "argument"),
    [
        ("replay", "replay [OPTIONS] BAGS...", "BAGS...  rosbag2 folders"),
        ("diagnose", "diagnose [OPTIONS] [BAGS...]", "BAGS...  rosbag2 folders"),
        ("effects", "effects [OPTIONS] [ID]", "ID  explain this effect"),
        ("config", "config [OPTIONS] [OPTION] [VALUE]", "OPTION  name of an option"),
    ],
)
def test_help_calls_arguments_what_they_are_to_people(command: str, usage: str, argument: str) -> None:
    shown = CliRunner().invoke(cli.app, [command, "--help"], env={"COLUMNS": "80"}).stdout
    assert f"{usage}\n" in shown
    assert argument in shown
