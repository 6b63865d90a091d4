# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Physics of users: from YAML, Python and packages through every command, shared, refused. All data are synthetic."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
import sys
import textwrap
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from catalogue import put_back
from click.testing import Result
from typer.testing import CliRunner

from lugre_steering.chain.step import new_parameters, run_side, torque_side
from lugre_steering.cli import app
from lugre_steering.diagnosis import effect_card
from lugre_steering.effects import registry
from lugre_steering.effects.entry import Seen
from lugre_steering.effects.own import read_effects
from lugre_steering.errors import EffectError, VehicleFileError
from lugre_steering.estimator import Estimator
from lugre_steering.fitting.fingerprint import _suggested
from lugre_steering.resources import config_folder
from lugre_steering.vehicle import EffectEntry, load, save
from lugre_steering.vehicle.model import build_model

OWN = config_folder() / "own_physics"
RIPPLE = OWN / "chain_ripple.yaml"
SHEET = config_folder() / "test_vehicle.yaml"


def run(*arguments: object, **environment: str) -> subprocess.CompletedProcess[str]:
    """The command line in a process of its own: this one's catalogue stays as it is."""
    command = [sys.executable, "-m", "lugre_steering.cli", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, env={**os.environ, **environment}, check=False)


def run_here(*arguments: object) -> Result:
    """The same in this process, which compiles foreign physics once for several commands; its catalogue is put back."""
    with put_back():
        return CliRunner().invoke(app, list(map(str, arguments)))


SEVERAL = """
import json, sys
from typer.testing import CliRunner
from lugre_steering.cli import app

for arguments in json.loads(sys.argv[1]):
    done = CliRunner().invoke(app, arguments)
    print(json.dumps({"code": done.exit_code, "stdout": done.stdout, "stderr": done.stderr}))
"""


def run_in_turn(*commands: Sequence[object], **environment: str) -> list[dict[str, Any]]:
    """Several command lines in one other process, which compiles once for all of them."""
    command = [sys.executable, "-c", SEVERAL, json.dumps([list(map(str, arguments)) for arguments in commands])]
    done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, **environment}, check=True)
    return [json.loads(line) for line in done.stdout.splitlines()]


def test_an_effect_of_one_line_is_simulated_named_shared_and_run(tmp_path: Path) -> None:
    ripple = ("--effect", "chain_ripple:torque=1500,pitch=0.11", "--effects", RIPPLE)
    made = run_here("simulate", "double-cycle", *ripple, "--rate", "20", "--out", tmp_path)
    assert made.exit_code == 0, made.stderr
    bag = tmp_path / "synthetic_double_cycle"
    done = run_here("diagnose", bag, "--vehicle", SHEET, "--effects", RIPPLE, "--out", tmp_path / "d", "--no-report", "--json")
    found = json.loads(done.stdout)
    assert found["verdict"] == "missing_physics"
    assert [effect["id"] for effect in found["effects"]] == ["chain_ripple"]
    parameters = found["effects"][0]["parameters"]
    assert parameters["torque"]["value"] == pytest.approx(1500.0, rel=0.02)
    assert parameters["pitch"]["value"] == pytest.approx(0.11, rel=0.01)
    augmented = tmp_path / "d" / "augmented.yaml"
    told = run_here("replay", bag, "--vehicle", augmented, "--out", tmp_path / "r")
    assert told.exit_code == 2
    assert "chain_ripple.yaml, which is not here" in told.stderr
    assert len(told.stderr.splitlines()) == 1
    ran = run_here("replay", bag, "--vehicle", augmented, "--effects", RIPPLE, "--out", tmp_path / "r", "--json")
    left = json.loads(ran.stdout)["overall"]["rmse_Nm"]
    assert left < 0.2 * found["baseline"]["rmse_Nm"]  # causal, and from the sheet's temperatures
    other = tmp_path / "chain_ripple.yaml"
    other.write_text(RIPPLE.read_text().replace("sin(6", "cos(6"))
    assert "others under the same name" in run_here("vehicle", augmented, "--effects", other).stderr


def test_a_law_of_yaml_is_its_formula() -> None:
    (effect,), _ = read_effects(RIPPLE)
    theta = np.linspace(-0.5, 0.5, 101)
    found = effect.law("torque", {"torque": 3.0, "pitch": 0.2}, theta=theta)
    np.testing.assert_allclose(found, 3.0 * np.sin(6.283185307 * theta / 0.2), atol=1e-12)


@pytest.fixture
def catalogue() -> Iterator[None]:
    with put_back():
        yield


def test_cards_show_the_catalogue_as_it_is_now() -> None:
    """An effect that comes after the first card has one too, and none when it is gone again."""
    assert effect_card.traces(registry.CATALOGUE["end_stop"])
    with put_back():
        registry.add_files(RIPPLE)
        assert effect_card.traces(registry.CATALOGUE["chain_ripple"])
    assert effect_card.traces(registry.CATALOGUE["end_stop"])


@pytest.mark.usefixtures("catalogue")
def test_a_memory_of_yaml_follows_its_update() -> None:
    """Grease that stiffens at rest: the torque after a pause against the closed form of its two exponentials."""
    registry.add_files([OWN / "thixotropic_grease.yaml"])
    p = build_model(load(SHEET)).parameters[0].copy()
    rubber = build_model(load(SHEET)).rubber
    time = np.arange(0.0, 8.0, 0.01)
    omega = np.where(time >= 6.0, 0.1, 0.0)
    theta = np.cumsum(omega) * 0.01
    plain = torque_side(p, rubber, time, theta, omega, np.zeros(time.size))
    for name, value in (("viscosity", 4000.0), ("rest_time", 5.0), ("shear_angle", 0.1)):
        p[f"thixotropic_grease_{name}"] = value
    added = torque_side(p, rubber, time, theta, omega, np.zeros(time.size)) - plain
    assert not added[time < 6.0].any()
    first = int(np.flatnonzero(time >= 6.0)[0])
    structure = 1.0 - np.exp(-time[first - 1] / 5.0)
    assert added[first] == pytest.approx(4000.0 * 0.1 * structure, rel=1e-9)  # the law sees the memory as the last step left it
    steady = 0.0
    for _ in range(2000):  # the fixed point of stiffening against shearing
        steady = (1.0 - (1.0 - steady) * np.exp(-0.01 / 5.0)) * np.exp(-0.001 / 0.1)
    assert steady < added[-1] / 400.0 < 1.1 * structure


def refusal(file: Path, text: str, old: str, new: str, words: str) -> str:
    """What is said of a file of effects with one thing changed."""
    assert old in text
    file.write_text(text.replace(old, new))
    with pytest.raises(EffectError, match=words) as caught:
        registry.add_files([file])
    return str(caught.value)


OWN_PYTHON = """
import numpy as np
from lugre_steering.effects import Effect, Parameter, law

GAIN = 1.0

@law
def shape(theta):
    return GAIN * np.interp(theta, np.array([-1.0, 1.0]), np.array([-1.0, 1.0]))  # a law may make arrays

def torque(stiffness, theta):
    return stiffness * shape(theta)

EFFECT = Effect(
    id="own_spring", stage="parallel_torque", tier=2, title="own spring", equation="k theta", source="own", trace="a line",
    coordinate="angle", parameters=(Parameter("stiffness", "N m/rad", "stiffness", 1e4),), hooks={"torque": torque},
)
"""


def test_own_python_runs_as_it_stands_now(tmp_path: Path) -> None:
    """A constant that only a helper of the law reads: what is compiled of it is kept between starts, and follows the file."""
    file, program = tmp_path / "mine.py", f"""
import numpy as np, sys
from lugre_steering.chain.step import torque_side
from lugre_steering.effects import registry
from lugre_steering.vehicle import EffectEntry, load
from lugre_steering.vehicle.model import build_model

registry.add_files([sys.argv[1]])
vehicle = load(r"{SHEET}").replace(effects=(EffectEntry("own_spring", {{"stiffness": 0.0}}),))
model = build_model(vehicle, lean=True)
p, time = model.parameters[0].copy(), np.arange(50) * 0.01
still = np.zeros(50), np.zeros(50)
plain = torque_side(p, model.rubber, time, np.full(50, 0.1), *still)
p["own_spring_stiffness"] = 1000.0
print(round((torque_side(p, model.rubber, time, np.full(50, 0.1), *still) - plain)[-1], 6), registry.ORIGINS["own_spring"].sha256)
"""

    def added(gain: str) -> list[str]:
        file.write_text(OWN_PYTHON.replace("GAIN = 1.0", f"GAIN = {gain}"))
        os.utime(file, (1e9, 1e9))  # as of an edit within the same second, of the same length
        done = subprocess.run([sys.executable, "-c", program, str(file)], capture_output=True, text=True, check=True)
        assert done.stderr == ""  # what was kept is not damaged
        return done.stdout.split()

    first, again, changed = added("1.0"), added("1.0"), added("3.0")
    assert first == again
    assert float(first[0]) == pytest.approx(100.0)
    assert float(changed[0]) == pytest.approx(300.0)
    assert changed[1] != first[1]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('stage="parallel_torque"', 'stage="engine"', "stage: got 'engine'; expected one of contact"),
        ("tier=2", 'tier=2, acts_by=("stifness",)', "acts_by: got 'stifness'; did you mean 'stiffness'"),
        ("tier=2", 'tier=2, places=(("stiffness", "end"),)', "places: got 'end'"),
        ("tier=2", 'tier=2, play="gap"', "play: got 'gap'"),
        ("tier=2", 'tier=2, needs=("rubbr",)', "needs: got 'rubbr'; did you mean 'rubber'"),
        ("tier=2", 'tier=2, rivals=("end_stopp",)', "rivals: got 'end_stopp'; did you mean 'end_stop'"),
        ("tier=2", 'tier=2, memory={"wound": "sigma_O"}', "memory.wound: got 'sigma_O'; did you mean 'sigma_0'"),
        ("tier=2", 'tier=2, constants={"table": 1.0}', "constants: got 'table'"),
        ('"stiffness", 1e4)', '"stiffness", 1e4, relative_to="angle")', "relative_to: got 'angle'; did you mean 'max_angle'"),
        ("hooks={", "hooks={} and {", "hooks: got none"),
        ('id="own_spring"', "id=5", "effect 5: id: got 5, expected a text"),
        ('id="own_spring"', 'id="A B"', "id: got 'A B', expected a name"),
        ("tier=2", 'tier="x"', "tier: got 'x', expected a whole number"),
        ("tier=2", "tier=2, one_sided=1", "one_sided: got 1, expected True or False"),
        ("tier=2", 'tier=2, places=("stiffness",)', "places: got 'stiffness', expected pairs of names"),
        ("tier=2", "tier=2, rivals=(5,)", "rivals: got 5, expected texts"),
        ("tier=2", "tier=2, variants=5", "variants: got 5, expected a function, or None"),
        ("parameters=(", 'parameters=("x", ', r"parameters\[0\]: got 'x', expected a Parameter"),
        ("1e4)", '"x")', r"parameters\[0\].scale: got 'x', expected a number"),
        ("1e4)", '1e4, grid=("x",))', r"parameters\[0\].grid: got 'x', expected numbers"),
        ('{"torque": torque}', '{"torque": 5}', "hooks.torque: got 5, expected a function"),
        ('{"torque": torque}', '{"torque": max}', "hooks.torque: got <built-in function max>, expected a function"),
        ('{"torque": torque}', "torque", "hooks: got <function torque at .*>, expected a mapping"),
        ("GAIN = 1.0", "raise SystemExit(3)", "cannot be run: SystemExit: 3"),
        ("* shape(theta)", "* shape(thta)", "name 'thta' is not defined"),
        ("tier=2", "tier=2, per_line=True", "per_line: got True, expected True for the law 'line', or else False"),
        ('{"torque": torque}', '{"line": lambda stiffness: stiffness}', "per_line: got False"),
        ("tier=2", 'tier=2, tables={"tab": -1}', "tables.tab: got -1, expected a length of at least 1"),
        ('{"torque": torque}', '{"delay": lambda stiffness: stifness}', "name 'stifness' is not defined"),
        ('{"torque": torque}', '{"arm": lambda theta, stiffness: (1.0, stiffness)}', "cannot be compiled: float.. argument"),
        ('{"torque": torque}', '{"arm": lambda stiffness, wound: 1.0}', "got the argument 'wound', expected one of its own parameters"),
        ("def torque(stiffness, theta):", "def torque(stiffness, theta, wound):", "every memory that it names"),
    ],
)
def test_what_own_python_declares_must_mean_something(tmp_path: Path, old: str, new: str, words: str) -> None:
    text = OWN_PYTHON if "wound" not in new or "memory" in new else OWN_PYTHON.replace("tier=2", 'tier=2, memory={"wound": 0.0}')
    assert len(refusal(tmp_path / "mine.py", text, old, new, words).splitlines()) == 1


def test_variants_that_fail_are_an_error_of_their_effect(tmp_path: Path) -> None:
    file = tmp_path / "mine.py"
    file.write_text(OWN_PYTHON.replace("tier=2", "tier=2, variants=lambda seen: 1 / 0"))
    told = run("effects", "own_spring", "--effects", file)
    assert told.returncode == 2
    assert "effect 'own_spring': variants: ZeroDivisionError: division by zero; expected" in " ".join(told.stderr.split())


@pytest.mark.parametrize(
    ("variants", "words"),
    [
        (lambda _: 5, "TypeError: 'int' object is not iterable; expected"),
        (lambda _: [{"treshold": 1.0}], "got treshold, expected parameters of it"),
        (lambda _: [{"threshold": "far"}], "ValueError: could not convert string to float: 'far'; expected"),
    ],
)
def test_variants_are_shapes_of_their_effect(variants: Callable[[Seen], Any], words: str) -> None:
    seen = Seen(np.zeros(3), -1.0, 1.0, 10.0, np.zeros((2, 3)), np.zeros(3))
    with pytest.raises(EffectError, match=words):
        _suggested(registry.CATALOGUE["end_stop"], variants, seen)


@pytest.mark.usefixtures("catalogue")
def test_physics_of_users_runs_live_as_in_replay() -> None:
    registry.add_files([RIPPLE])
    entry = EffectEntry("chain_ripple", {p.name: p.typical for p in registry.effect("chain_ripple").parameters})
    vehicle = load(SHEET).replace(effects=(entry,))
    time = np.repeat(np.arange(1500) * 0.01, 2)
    channel, stamp, angle = np.tile([0, 1], 1500), (time * 1e9).astype(np.int64) + 1_000_000_000, 0.4 * np.sin(0.6 * time)
    whole, _ = Estimator(vehicle).push_block(channel, stamp, angle, np.full(time.size, np.nan))
    live = Estimator(vehicle)
    alone = [live.push(int(c), int(s), float(a))[0]["total"].copy() for c, s, a in zip(channel, stamp, angle, strict=True)]
    assert whole["total"].size > 1400
    assert np.array_equal(np.concatenate(alone), whole["total"])


def test_a_package_is_known_once_installed(tmp_path: Path) -> None:
    source = tmp_path / "source"
    shutil.copytree(OWN / "example_package", source)
    install = [sys.executable, "-m", "pip", "install", "-q", "--no-build-isolation", "--no-deps", "--target", tmp_path / "site", source]
    subprocess.run(list(map(str, install)), check=True, capture_output=True)
    path = os.pathsep.join([str(tmp_path / "site"), *filter(None, [os.environ.get("PYTHONPATH", "")])])
    bag, augmented = tmp_path / "synthetic_double_cycle", tmp_path / "d" / "augmented.yaml"
    told, made, done = run_in_turn(
        ("effects", "centre_detent", "--check", "--json"),
        ("simulate", "double-cycle", "--effect", "centre_detent:hold=4000,width=0.02", "--rate", "12.5", "--out", tmp_path),
        ("diagnose", bag, "--vehicle", SHEET, "--out", tmp_path / "d", "--no-report", "--json"),
        PYTHONPATH=path,
    )
    assert json.loads(told["stdout"]) == {"id": "centre_detent", "broken": []}, told["stderr"]
    assert made["code"] == 0, made["stderr"]
    found = json.loads(done["stdout"])
    assert [effect["id"] for effect in found["effects"]] == ["centre_detent"]
    assert found["effects"][0]["parameters"]["hold"]["value"] == pytest.approx(4000.0, rel=0.02)
    lacking = run_here("replay", bag, "--vehicle", augmented, "--out", tmp_path / "r")  # not installed here
    assert lacking.exit_code == 2
    assert "lugre-steering-example-physics" in lacking.stderr
    code = tmp_path / "site" / "example_physics.py"
    code.write_text(code.read_text().replace("0.5 * (1.0 - x * x)", "0.4 * (1.0 - x * x)"))
    assert "others under the same name" in run("vehicle", augmented, PYTHONPATH=path).stderr
    assert "not in the catalogue" in run_here("effects", "centre_detent").stderr


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("* theta", "* tetha", "did you mean 'theta'"),
        ("torque * sin", "__import__('os').system('true') * sin", "is not allowed|no function"),
        ("torque: torque", "wind_up: torque", "needs a .py file"),
        ("torque: torque", "torsion: torque", "expected a hook"),
        ("torque * sin(6.283185307 * theta / pitch)", "torque", "pitch: no law reads it"),
        ("torque * sin(6.283185307 * theta / pitch)", "torque / (pitch - pitch)", "no numbers"),
        ("id: chain_ripple", "id: end_stop", "there is one of this name in lugre_steering itself"),
        ("stage: parallel_torque", "stage: engine", "expected one of motion"),
        ("scale: 300.0", "scale: many", "a plain number"),
        ("laws:", "lawz:", "no such key"),
        ("id: chain_ripple", "id: class", "no word of Python"),
        ("id: chain_ripple", "id: law_1", "id: got 'law_1', expected another name: law_1, law_2, ... are the laws of a vehicle file"),
        ("id: chain_ripple", f"id: {'a' * 300}", "at most 64"),
        ("title: ", 'title: "a\\nb" #', r"title: got 'a\\nb', expected one line"),
        ("high: 1.0e4", "high: -1.0", "parameters.torque.low: got 0.0, expected less than high"),
        ("scale: 300.0", "scale: 0.0", "parameters.torque.scale: got 0.0, expected a typical size above 0"),
        ("scale: 300.0", "scale: -5.0", "parameters.torque.scale: got -5.0, expected"),
        ("scale: 300.0", "scale: 1.0e+9", "parameters.torque.scale: got 1000000000.0, expected a typical size above 0, at most"),
        ("grid: [", "grid: [7.0, ", "parameters.pitch.grid: got 7.0, expected values from low"),
        ("laws:", "memory: {wound: 0.0}\nlaws:", "the next value of each memory"),
        ("scale: 300.0", "scale: 300.0, grid: [300.0]", "expected an amplitude, which switches the effect off at zero"),
        ("torque: torque", "line: torque", "needs a .py file"),
        ("torque: torque * sin(6.283185307 * theta / pitch)", "arm: 1 + torque * theta / coulomb_torque * pitch", "no 'coulomb_torque'"),
        ("torque: torque * sin(6.283185307 * theta / pitch)", "arm: log(-pitch - abs(torque))", "readings that are no numbers"),
        ("laws:", "memory: {wound: 0.0}\nupdate: {wound: theta}\nlaws:\n  arm: 1 + torque * wound", "no 'wound'"),
    ],
)
def test_what_is_no_effect_is_refused(tmp_path: Path, old: str, new: str, words: str) -> None:
    assert "mine.yaml" in refusal(tmp_path / "mine.yaml", RIPPLE.read_text(), old, new, words)


@pytest.mark.parametrize(
    ("identity", "name", "field"),
    [
        ("end", "stop_stiffness", "end_stop_stiffness"),
        ("rubber", "temperature", "rubber_temperature"),
        ("contact", "angle", "contact_angle"),
    ],
)
def test_an_effect_has_no_field_of_another(tmp_path: Path, identity: str, name: str, field: str) -> None:
    told = refusal(tmp_path / "mine.yaml", RIPPLE.read_text().replace("pitch", name), "id: chain_ripple", f"id: {identity}", name)
    assert f"'{field}', which there is already" in told


KEPT = """
- id: {name}_loss
  title: {name}
  law: {{channel: gain, coordinate: none, form: constant, range: [0.0, 1.0], values: {{value: {value}}}}}
"""


def test_a_vehicle_file_knows_its_entry_whatever_else_stands_in_the_file(tmp_path: Path) -> None:
    """By the entry itself, or as earlier vehicle files have it by the whole file; another entry of its name is refused."""
    file, written = tmp_path / "mine.yaml", tmp_path / "vehicle.yaml"
    first, second = KEPT.format(name="first", value=0.1), KEPT.format(name="second", value=0.2)

    def read(text: str) -> str | None:
        """The hash that the vehicle file has of the first effect once it is read and written beside these."""
        file.write_text(f"effects:\n{text}")
        with put_back():
            registry.add_files(file)
            vehicle = load(written)
        save(vehicle, written)
        return vehicle.effects[0].sha256

    of_file = hashlib.sha256(f"effects:\n{first}".encode()).hexdigest()
    save(load(SHEET).replace(effects=(EffectEntry("first_loss", {"size": 1.0}, file.name, of_file),)), written)
    of_entry = read(first)
    assert of_entry != of_file
    assert read(f"# both\n{first}{second}") == of_entry
    with pytest.raises(VehicleFileError, match="others under the same name"):
        read(first.replace("0.1", "0.3"))


@pytest.mark.usefixtures("catalogue")
def test_two_laws_of_yaml_share_a_memory(tmp_path: Path) -> None:
    """A law of a sensor stands before that which turns the memory on, and another reads it: a ramp of the samples so far."""
    laws = "laws: {delay: 0 * late, torque: size * turns, level: 1 + 0 * size * turns}\nmemory: {turns: 0.0}\nupdate: {turns: turns + 1}"
    size, late = "size: {unit: N m, meaning: of a sample, scale: 5.0}", "late: {unit: s, meaning: nothing, scale: 0.01}"
    (tmp_path / "ramp.yaml").write_text(
        f"id: ramp\nstage: parallel_torque\ntitle: a ramp\n{laws}\nparameters: {{{size}, {late}}}\n", encoding="utf-8"
    )
    registry.add_files(tmp_path / "ramp.yaml")
    p, still = new_parameters(registry.composed(["ramp"])), np.zeros(5)
    for field in ("static_torque", "coulomb_torque", "sigma_0", "stribeck_speed", "stribeck_exponent", "heat_capacity", "table_step"):
        p[field] = 1.0
    p["ramp_size"] = 3.0
    assert run_side(p, np.ones((2, 2)), np.arange(5) * 0.1, still, still, still)["torque"].tolist() == [0.0, 3.0, 6.0, 9.0, 12.0]


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.yaml", "effects:\n" + 2 * textwrap.indent(RIPPLE.read_text(), "    ").replace("    id:", "  - id:"), "there are 2 of this id"),
        ("a.yaml", RIPPLE.read_text().replace("pitch", "dt"), "got 'dt', expected a name"),
        ("a.yaml", RIPPLE.read_text().replace(" pitch", " sin"), "got 'sin', expected a name that is none of the functions"),
        ("a.py", "EFFECT = 3", "got int, expected EFFECT"),
        ("a.py", "import nothing_of_this_name", "cannot be run: ModuleNotFoundError"),
        ("a.txt", "", "expected .py or .yaml"),
        ("a.yaml", "effects: []", "expected a list of effects"),
        ("a.yaml", "{", "not valid YAML"),
    ],
)
def test_a_file_without_effects_is_refused(tmp_path: Path, name: str, text: str, words: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(EffectError, match=words):
        registry.add_files([tmp_path / name])
