# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The command line as others see it: exit codes, one-line errors, JSON on stdout, progress on a terminal only."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

import lugre_steering
from lugre_steering.bench.replay import write_cycle

ROOT = Path(__file__).resolve().parents[1]
VEHICLE = ROOT / "config" / "test_vehicle.yaml"
CONFORMANCE = ROOT.parent / "shared" / "conformance"
ENVIRONMENT: Mapping[str, str] = os.environ | {
    "PYTHONPATH": str(Path(lugre_steering.__file__).parents[1]),
    "TERM": "xterm",
}


def run(*arguments: str | Path, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "lugre_steering.cli", *map(str, arguments)]
    return subprocess.run(command, cwd=cwd, env=ENVIRONMENT, capture_output=True, text=True, check=False, timeout=600)


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bags") / "synthetic_cycle"
    write_cycle(folder, 20.0)
    return folder


def test_replay_writes_what_the_contract_promises(bag: Path, tmp_path: Path) -> None:
    done = run("replay", bag, "--vehicle", VEHICLE, "--out", tmp_path / "out", "--json", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout) == json.loads((tmp_path / "out" / "summary.json").read_text())
    assert (tmp_path / "out" / bag.name / "metadata.yaml").is_file()
    assert (tmp_path / "out" / f"{bag.name}.png").is_file()


def test_text_result_names_the_fit_and_the_folder(bag: Path, tmp_path: Path) -> None:
    done = run("replay", bag, "--vehicle", VEHICLE, "--out", "out", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert "RMSE" in done.stdout
    assert done.stdout.endswith("results in out\n")


def test_the_version_is_told(tmp_path: Path) -> None:
    done = run("--version", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (0, f"lugre-steering {lugre_steering.__version__}\n")


def test_brackets_in_names_are_names(tmp_path: Path) -> None:
    """Rich would take them for its markup: lost words, or a traceback."""
    name = "name: test vehicle, front axle, dry concrete"
    sheet = VEHICLE.read_text().replace(name, 'name: "truck [/b] [prototype]"')
    (tmp_path / "own.yaml").write_text(sheet.replace("rubber_dma", f"{VEHICLE.parent}/rubber_dma"))
    done = run("vehicle", "own.yaml", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert "truck [/b] [prototype]" in done.stdout
    done = run("simulate", "small-loops", "--vehicle", "own.yaml", "--out", "folder [/x]", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert "folder [/x]" in done.stdout


@pytest.mark.skipif(sys.platform == "win32", reason="no pseudo-terminal")
def test_progress_is_shown_on_a_terminal(bag: Path, tmp_path: Path) -> None:
    ours, its = os.openpty()
    command = [sys.executable, "-m", "lugre_steering.cli", "replay", bag, "--vehicle", VEHICLE, "--out", tmp_path / "o"]
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
    bag: Path, tmp_path: Path, arguments: tuple[str | Path, ...], words: tuple[str, ...]
) -> None:
    (tmp_path / "text.txt").write_text("neither a bag nor a vehicle\n")
    done = run(*(str(argument).replace("{bag}", str(bag)) for argument in arguments), cwd=tmp_path)
    assert done.returncode == 2
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) == 1
    assert all(word in done.stderr for word in words), done.stderr


def test_list_of_simulations_as_json(tmp_path: Path) -> None:
    done = run("simulate", "--list", "--json", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    rows = json.loads(done.stdout)
    assert {"manoeuvre", "experiment", "file"} == {row["kind"] for row in rows}
    assert all(row["name"] and row["description"] for row in rows)


def test_wrong_usage_is_exit_code_2_without_traceback(tmp_path: Path) -> None:
    done = run("replay", cwd=tmp_path)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr


def test_help_lists_the_commands(tmp_path: Path) -> None:
    done = run("--help", cwd=tmp_path)
    assert done.returncode == 0
    assert "replay" in done.stdout


@pytest.mark.skipif(not CONFORMANCE.is_dir(), reason="the independent recordings are not here")
@pytest.mark.parametrize("name", ["baseline_clean", "baseline_noisy"])
def test_agrees_with_an_independent_simulation(tmp_path: Path, name: str) -> None:
    """Torque within 250 N m RMS and rubber temperature within 0.3 K, at every 0.1 s."""
    done = run("replay", CONFORMANCE / name, "--vehicle", VEHICLE, "--out", tmp_path, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
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


def test_what_a_vehicle_file_amounts_to(tmp_path: Path) -> None:
    done = run("vehicle", VEHICLE, "--out", "sheet", "--json", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    result = json.loads(done.stdout)
    found = {row["quantity"]: (row["value"], row["unit"]) for row in result["quantities"]}
    # Half of 90 kN and 6.2 kN; 0.42 m2; 5393.7 N m per degree.
    assert found["load on the ground"] == (pytest.approx(51_200.0), "N")
    assert found["ground pressure, mean"] == (pytest.approx(51_200.0 / 0.42), "Pa")
    assert found["presliding stiffness"] == (pytest.approx(np.rad2deg(5393.7)), "N m/rad")
    assert found["time constant of cooling"] == (pytest.approx(1120.0 * 1750.0 * 0.012 / 18.0), "s")
    assert [row["topic"] for row in result["inputs"]][2] == "steering/pressure/main_a"
    assert (tmp_path / result["picture"]).read_bytes().startswith(b"\x89PNG")


def test_a_vehicle_sheet_of_a_rig_has_its_units_and_no_footprint(tmp_path: Path) -> None:
    rig = ROOT / "config" / "emps_vehicle.yaml"
    done = run("vehicle", rig, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert "N s/m" in done.stdout
    assert "N m" not in done.stdout
    refused = run("vehicle", rig, "--out", "sheet", cwd=tmp_path)
    assert refused.returncode == 2
    assert "axle" in refused.stderr
    assert not (tmp_path / "sheet").exists()
