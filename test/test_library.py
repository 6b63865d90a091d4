# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The package as a library: its page runs, results are the command's, importing it is light, JSON keeps to its schemas."""

from __future__ import annotations

import functools
import importlib
import importlib.util
import inspect
import json
import re
import shutil
import subprocess
import sys
import typing
from collections.abc import Iterator
from dataclasses import is_dataclass, replace
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from a_law import a_law
from bag_making import thinned_bag
from outside import outside
from test_packaging import SLOWLY, environment
from typer.testing import CliRunner

import lugre_steering as ls
from lugre_steering import errors
from lugre_steering import typing as held
from lugre_steering.bag import read_recording
from lugre_steering.cli import app
from lugre_steering.diagnosis.found_law import FoundLaw
from lugre_steering.diagnosis.result import FrictionForm
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.schemas import FILES, schema_of

ROOT = Path(__file__).resolve().parents[1]
VEHICLE = ROOT / "config" / "test_vehicle.yaml"
LINEAR_AXIS = ROOT / "config" / "linear_axis_example.yaml"
STOP = ROOT / "bags" / "synthetic_hidden_stop_a"
DOUBLE_CYCLE = ROOT / "bags" / "synthetic_double_cycle"
PAGE = (ROOT / "docs" / "library.md").read_text(encoding="utf-8")


# ------------------------------------------------------------------- import


def loaded_by(code: str) -> tuple[float, set[str]]:
    """Seconds of a processor that ``import lugre_steering`` takes, and the packages that are loaded after ``code``."""
    program = (
        "import sys, time; before = time.process_time(); import lugre_steering as ls; took = time.process_time() - before\n"
        f"{code}\nprint(took, *{{name.split('.')[0] for name in sys.modules}})"
    )
    done = subprocess.run([sys.executable, "-c", program], env=environment(), capture_output=True, text=True, check=True)
    took, *names = done.stdout.split()
    return float(took), set(names)


def test_importing_it_is_quick_and_loads_nothing_heavy() -> None:
    took, names = loaded_by("dir(ls)")
    assert took < 0.3
    assert not names & {"numpy", "scipy", "numba", "yaml", "matplotlib", "plotly", "rclpy", "rosbags", "typer", "pandas"}


def test_every_public_name_is_there_without_ros_or_plotting() -> None:
    _, names = loaded_by("for name in ls.__all__: assert getattr(ls, name) is not None, name")
    assert not names & {"matplotlib", "plotly", "rclpy", "pandas"}


def test_fits_take_one_thread_of_blas_and_leave_the_rest_as_it_was() -> None:
    """Each would wait for the other: a diagnosis took four to five times the processor time where NumPy had been imported before."""
    code = (
        "import numpy, scipy.linalg, threadpoolctl\n"
        "def most(): return max(pool['num_threads'] for pool in threadpoolctl.threadpool_info() if pool['user_api'] == 'blas')\n"
        "threadpoolctl.threadpool_limits(2, 'blas'); seen = set()\n"
        f"run = ls.simulate('double-cycle', {str(VEHICLE)!r}, angle_rate_Hz=10.0).recording\n"
        f"ls.calibrate(run, {str(VEHICLE)!r}, progress=lambda _: seen.add(most()))\n"
        "assert 1 in seen and most() == 2, (seen, most())"
    )
    program = f"import lugre_steering as ls\n{code}"
    plain = {name: value for name, value in environment().items() if not name.endswith("NUM_THREADS")}
    done = subprocess.run([sys.executable, "-c", program], env=plain, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_dir_lists_what_is_public_and_nothing_else_exists() -> None:
    assert [name for name in dir(ls) if not name.startswith("__")] == sorted(ls.__all__)
    with pytest.raises(AttributeError, match="no attribute 'replays'"):
        ls.replays  # noqa: B018


def hints_of(what: Any) -> list[Any]:
    """Types of the fields of a class, or of the parameters and the result of a function."""
    lazily = dict.fromkeys(("DataFrame", "Figure", "Axes"), object)  # of packages that nobody must have
    return [hint for name, hint in typing.get_type_hints(what, localns=lazily).items() if not name.startswith("_")]


def functions_of(cls: type) -> Iterator[Any]:
    """Public methods and properties."""
    for name, item in vars(cls).items():
        function = getattr(item, "fget", getattr(item, "__func__", getattr(item, "func", item)))
        if not name.startswith("_") and inspect.isfunction(function):
            yield function


def own_classes(hint: Any) -> Iterator[type]:
    """The classes of this package in a type, such as what a tuple holds."""
    for part in typing.get_args(hint):
        yield from own_classes(part)
    if isinstance(hint, type) and hint.__module__.startswith("lugre_steering"):
        yield hint


def met_by_users() -> set[type]:
    """Every class that a program meets that calls public functions and looks at what it is given."""
    public = [getattr(ls, name) for name in ls.__all__]
    rooms = [importlib.import_module(f"lugre_steering.{name}.library") for name in ("replay", "simulate")]
    hints = [hint for f in [*filter(inspect.isfunction, public), rooms[0].replay, rooms[1].simulate] for hint in hints_of(f)]
    todo, found = [*filter(inspect.isclass, public), *(cls for hint in hints for cls in own_classes(hint))], set[type]()
    while todo:
        if (cls := todo.pop()) in found:
            continue
        found.add(cls)
        hints = hints_of(cls) if is_dataclass(cls) or issubclass(cls, tuple) else []
        hints += [hint for function in functions_of(cls) for hint in hints_of(function)]
        todo += [other for hint in hints for other in own_classes(hint)]
    return found


def test_every_class_that_a_program_meets_can_be_imported() -> None:
    met, offered = met_by_users(), {getattr(held, name) for name in held.__all__}
    assert {FoundLaw, *(type(ls.load_vehicle(VEHICLE).channels[0]),)} <= met  # in tuples, and behind properties
    assert sorted(cls.__name__ for cls in met - offered) == sorted(name for name in ls.__all__ if inspect.isclass(getattr(ls, name)))
    assert offered <= met


def test_every_error_that_a_program_meets_is_public() -> None:
    of_ours = {name for name, item in vars(errors).items() if inspect.isclass(item) and item.__module__ == errors.__name__}
    assert of_ours <= set(ls.__all__)


def test_rooms_show_what_they_are_called_with() -> None:
    assert list(inspect.signature(ls.replay).parameters) == ["data", "vehicle", "options", "look_ahead"]
    assert list(inspect.signature(ls.simulate).parameters)[:3] == ["what", "vehicle", "effects"]
    assert "kept in memory" in str(inspect.getdoc(ls.replay))
    assert "a built-in manoeuvre" in str(inspect.getdoc(ls.simulate))


def test_vehicles_and_recordings_are_shown_in_a_few_words() -> None:
    vehicle = ls.load_vehicle(VEHICLE)
    assert repr(vehicle).startswith(f"Vehicle(name: {vehicle.name}; sides: left, right; inputs: ")
    assert len(repr(vehicle)) < 500
    assert f"<p>{vehicle.name}</p>" in vehicle._repr_html_()
    recording = ls.Recording.from_arrays(TIME, angle=np.zeros(5), air=([0.0, 0.2], [20.0, 21.0]))
    assert repr(recording) == "Recording('recording'; angle/left: 5 samples to 0.4 s; air_temperature: 2 samples to 0.2 s)"
    assert "<td>air_temperature</td>" in recording._repr_html_()


def test_one_file_or_effect_needs_no_list() -> None:
    with pytest.raises(ls.LugreSteeringError, match=r"none\.yaml: cannot be read"):
        ls.add_effects("none.yaml")
    with pytest.raises(ls.LugreSteeringError, match=r"none\.py: cannot be read"):
        ls.add_effects(Path("none.py"))
    made = ls.simulate("double-cycle", effects="end_stop:engage_angle=0.3,stiffness=1e5", angle_rate_Hz=5.0)
    assert list(made.effects) == ["end_stop"]


def test_a_room_stays_callable_whatever_part_of_it_was_imported() -> None:
    _, names = loaded_by(
        "import lugre_steering.replay.result, lugre_steering.simulate.manoeuvres\n"
        "assert callable(ls.replay) and callable(ls.simulate) and ls.replay.result.Replay is ls.Replay"
    )
    assert "matplotlib" not in names


# --------------------------------------------------------------------- page


def blocks() -> list[tuple[str, str]]:
    """What each example needs ('' or a package), and its code, in the order of the page."""
    return re.findall(r"(?:<!-- needs (\w+) -->\n)?```python\n(.*?)```", PAGE, flags=re.DOTALL)


def test_the_examples_of_the_page_run(tmp_path: Path) -> None:
    code = "\n".join(block for need, block in blocks() if not need or importlib.util.find_spec(need))
    shutil.copytree(ROOT / "config", tmp_path / "config")
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", SLOWLY + code],
        cwd=tmp_path, env=environment(MPLBACKEND="Agg"), capture_output=True, text=True,
    )
    assert done.returncode == 0, done.stderr
    refused = re.search(r"print\(error\)  # (.*)", PAGE)
    assert refused is not None
    assert refused[1] in done.stdout.splitlines()
    assert "missing_physics" in done.stdout
    for file in ("augmented.yaml", "diagnosed/diagnosis.json", "calibrated/calibration.json", "simulated/synthetic_double_cycle"):
        assert (tmp_path / file).exists()


def test_every_public_name_stands_on_the_page() -> None:
    assert [name for name in ls.__all__ if name not in PAGE] == []


# ---------------------------------------------------- the numbers of the commands


def run(*arguments: object) -> dict:
    done = CliRunner().invoke(app, [*map(str, arguments), "--json"])
    assert done.exit_code == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def slow(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """STOP at 20 Hz, which is quicker to diagnose."""
    return thinned_bag(STOP, tmp_path_factory.mktemp("slow"))


UNSOUGHT = sorted(CATALOGUE.keys() - {"end_stop", "slope_bias", "kingpin_jacking"})
"""What may be found does not matter here, and few names are sought sooner than all."""


@pytest.fixture(scope="module")
def diagnosis(slow: Path) -> ls.Diagnosis:
    return ls.diagnose(str(slow), VEHICLE, without=UNSOUGHT)


@pytest.fixture(scope="module")
def slow_cycle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """DOUBLE_CYCLE at 20 Hz, which is quicker to calibrate."""
    return thinned_bag(DOUBLE_CYCLE, tmp_path_factory.mktemp("slow_cycle"))


@pytest.fixture(scope="module")
def calibration(slow_cycle: Path) -> ls.Calibration:
    return ls.calibrate([slow_cycle], str(VEHICLE))


@pytest.fixture(scope="module")
def replay() -> ls.Replay:
    return ls.replay(STOP, VEHICLE)


def undated(result: dict[str, Any]) -> dict[str, Any]:
    """The same without the second in which it was made."""
    return {**result, "provenance": {key: value for key, value in result["provenance"].items() if key != "date"}}


def test_a_diagnosis_is_that_of_the_command(diagnosis: ls.Diagnosis, slow: Path, tmp_path: Path) -> None:
    unsought = [word for name in UNSOUGHT for word in ("--without", name)]
    said = run("diagnose", slow, "--vehicle", VEHICLE, "--out", tmp_path / "command", "--no-report", *unsought)
    assert said["verdict"] == "missing_physics"
    own = json.loads(diagnosis.to_json())
    assert undated(own) == undated(said)
    diagnosis.save(str(tmp_path / "library"))
    for name in ("diagnosis.json", "augmented.yaml"):
        library, command = ((tmp_path / made / name).read_text().splitlines() for made in ("library", "command"))
        differing = [a for a, b in zip(library, command, strict=True) if a != b]
        assert len(differing) <= 1  # the date


def test_a_calibration_is_that_of_the_command(calibration: ls.Calibration, slow_cycle: Path, tmp_path: Path) -> None:
    said = run("calibrate", slow_cycle, "--vehicle", VEHICLE, "--out", tmp_path)
    own = json.loads(calibration.to_json())
    assert list(own) == list(said)
    assert {key for key in said if own[key] != said[key]} <= {"date", "bags", "vehicle", "picture", "picture_note", "provenance"}
    assert undated(own)["provenance"] == undated(said)["provenance"]
    assert own["vehicle_name"] == said["vehicle_name"] == own["vehicle"] == ls.load_vehicle(VEHICLE).name
    assert own["vehicle_file"] == said["vehicle_file"] == said["vehicle"] == str(VEHICLE)


def test_a_replay_in_memory_is_that_of_the_command(replay: ls.Replay, tmp_path: Path) -> None:
    said = run("replay", STOP, "--vehicle", VEHICLE, "--out", tmp_path)
    own = json.loads(replay.to_json())
    for summary in (own, said):
        for bag in summary["bags"]:
            del bag["picture"], bag["picture_note"], bag["page"]
    assert undated(own) == undated(said)
    series = replay.bags[0].kept()
    assert series.torque.size == said["bags"][0]["estimates"]
    error = np.sqrt(np.mean(series.residual**2))
    assert error == pytest.approx(said["overall"]["rmse_Nm"], rel=1e-9)


def test_a_replay_says_which_vehicle_and_which_file(replay: ls.Replay) -> None:
    """Wherever the vehicle came from; the key ``vehicle`` of earlier results means what it meant, the file or else the name."""
    vehicle = ls.load_vehicle(VEHICLE)
    assert (replay.vehicle_name, replay.vehicle_file, replay.vehicle) == (vehicle.name, str(VEHICLE), str(VEHICLE))
    other = vehicle.replace(name="other")
    kept = ls.replay(short(), other)
    assert (kept.vehicle_name, kept.vehicle_file, kept.vehicle) == ("other", None, "other")
    assert "Replay with other" in kept._repr_html_()
    assert list(kept.json)[-2:] == ["vehicle_name", "vehicle_file"]


def test_a_recording_in_memory_replays_as_its_bag(replay: ls.Replay) -> None:
    recording = read_recording(STOP, ls.load_vehicle(VEHICLE).channels)
    (own,) = ls.replay(recording, VEHICLE).bags
    np.testing.assert_allclose(own.kept().torque, replay.bags[0].kept().torque, rtol=1e-9, atol=1e-6)
    assert own.fit is not None
    assert own.fit.rmse_Nm == pytest.approx(replay.overall.rmse_Nm, rel=1e-6)


def test_arrays_of_a_bag_are_the_bag() -> None:
    bag = read_recording(STOP, ls.load_vehicle(VEHICLE).channels)
    start = bag.start_ns * 1e-9

    def pairs(signals):
        return {name: (start + signal.time_s, signal.value) for name, signal in signals.items()}

    made = ls.Recording.from_arrays(
        start + bag.angle["left"].time_s, angle=pairs(bag.angle), pressure=pairs(bag.pressure), name=bag.name
    )
    for kind in ("angle", "pressure"):
        for name, signal in getattr(bag, kind).items():
            np.testing.assert_array_equal(getattr(made, kind)[name].value, signal.value)
            np.testing.assert_allclose(getattr(made, kind)[name].time_s, signal.time_s, atol=1e-6)  # doubles of today's seconds
    with pytest.raises(ls.BagError, match="holds the same recording"):
        ls.calibrate([made, made], VEHICLE)


TIME = np.arange(5) * 0.1


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"time": TIME[::-1]}, "time: got 5 times"),
        ({"angle": np.zeros(4)}, "angle/left: got 4 samples for 5 times"),
        ({"angle": np.zeros((5, 2))}, "angle/left: got an array of shape"),
        ({"angle": np.full(5, 30.0)}, "angle/left: got 30, expected values in rad"),
        ({"angle": np.full(5, 300.0), "unit": "m"}, "angle/left: got 300, expected values in m up to 100"),
        ({"unit": "deg"}, "unit: got 'deg', expected rad or m"),
        ({"angle": np.full(5, np.nan)}, "angle/left: got no finite sample"),
        ({"angle": ["a"] * 5}, "angle/left: got list, expected an array of numbers"),
        ({"torque": (TIME,)}, "measured_torque: got 1 arrays"),
        ({"pressure": {"a": (TIME * 0.0, TIME)}}, "time of pressure/a: got 5 times"),
        ({"air": np.full(5, 293.0)}, "air_temperature: got 293, expected values in degC"),
        ({"time": 100.0 * TIME}, "time: got a sample every 10 s, expected times in seconds"),
        ({"angle": {}}, "angle: got no side, expected {side: samples}"),
        ({"angle": [TIME, TIME]}, "angle/left: got an array of shape (2, 5), expected (n,); of several sides or lines a mapping"),
        ({"angle": None}, "angle/left: got an array of shape ()"),
        ({"name": 5}, "name: got 5, expected a text"),
        ({"unit": ["rad"]}, "unit: got ['rad'], expected rad or m"),
        ({"angle": np.full(5, 0.1j)}, "angle/left: got complex128, expected real numbers"),
        ({"pressure": np.zeros(5)}, "pressure: got ndarray, expected a mapping"),
        ({"rate": np.full(5, np.timedelta64(1))}, "rate/left: got timedelta64, expected real numbers"),
    ],
)
def test_arrays_that_cannot_be_meant_are_refused(changes: dict, said: str) -> None:
    with pytest.raises(ls.DataError, match=re.escape(said)):
        ls.Recording.from_arrays(**{"time": TIME, "angle": np.zeros(5)} | changes)


def test_dates_are_seconds() -> None:
    dates = np.datetime64("2024-01-01") + np.arange(5) * np.timedelta64(100, "ms")
    made = ls.Recording.from_arrays(dates, angle=np.zeros(5), torque=(dates - dates[0], np.ones(5)))
    assert made.measured_torque is not None
    assert made.start_ns == 1  # the torque's durations begin at zero
    assert made.angle["left"].time_s[0] == dates[0].astype("datetime64[s]").astype(int)
    np.testing.assert_allclose(made.measured_torque.time_s, TIME)


def test_samples_that_are_no_number_are_left_out_and_counted() -> None:
    made = ls.Recording.from_arrays(TIME, angle=np.array([0.0, np.nan, 0.1, np.inf, 0.2]), torque=np.ones(5))
    assert made.rejected == {"angle/left": {"not_finite": 2}}
    np.testing.assert_allclose(made.angle["left"].time_s, [0.0, 0.2, 0.4])


def test_masked_samples_are_left_out_and_times_with_a_zone_are_those_of_utc() -> None:
    made = ls.Recording.from_arrays(TIME, angle=np.ma.masked_array([0, 1, 0, 1, 0], [False, True, False, False, False]))
    assert made.rejected == {"angle/left": {"not_finite": 1}}
    pd = pytest.importorskip("pandas")
    dates = pd.Series(pd.date_range("2024-01-01T02:00", periods=5, freq="100ms", tz="Europe/Berlin"))
    zoned = ls.Recording.from_arrays(dates, angle=pd.Series(np.zeros(5)))
    assert zoned.start_ns == np.datetime64("2024-01-01T01:00", "ns").astype(int)


def test_a_block_may_be_lists() -> None:
    given = [0, 1, 0, 1], [10**9, 10**9, 11 * 10**8, 11 * 10**8], [0.0, 0.0, 0.1, 0.1], [np.nan] * 4
    estimates, _ = ls.Estimator(VEHICLE).push_block(*given)
    assert estimates["stamp_ns"].tolist() == given[1][::2]


def test_positions_of_a_linear_axis_are_metres_where_that_is_said() -> None:
    made = ls.Recording.from_arrays(TIME, angle=np.full(5, 12.0), unit="m")
    assert made.angle["left"].value.tolist() == [12.0] * 5


LAWFUL = ls.load_vehicle(VEHICLE).replace(
    laws=(held.LawEntry("viscous_loss", "angle", "linear", (-0.5, 0.5), {"value": 0.0, "slope": 2e4}, title="a loss"),)
)
FOREIGN = ls.Recording.from_arrays(TIME, angle={"left": np.zeros(5), "right": np.zeros(5)}, pressure={"A": TIME, "B": TIME})
UPWARD = ls.Recording.from_arrays(TIME, angle={"up": np.zeros(5)})


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: ls.replay([], VEHICLE), "no recording is given"),
        (lambda: ls.calibrate([], VEHICLE), "no recording is given"),
        (lambda: ls.diagnose([], VEHICLE), "no recording is given"),
        (lambda: ls.replay(5, VEHICLE), "recordings: got 5, expected paths of bags, or recordings"),
        (lambda: ls.replay(UPWARD, VEHICLE), "holds no input of the vehicle, expected angle 'left', angle 'right'"),
        (lambda: ls.diagnose(STOP, VEHICLE, material=np.nan), "material: got nan, expected a number from 0 to 1"),
        (lambda: ls.diagnose(STOP, VEHICLE, seed=-1), "seed: got -1, expected a whole number from 0"),
        (lambda: ls.load_vehicle(None), "vehicle: got None, expected a vehicle or the path of its file"),
        (lambda: ls.save_vehicle(ls.load_vehicle(VEHICLE), "/nowhere/x.yaml"), "/nowhere/x.yaml: cannot be written: No such file"),
        (lambda: ls.simulate("paper-rate"), "'paper-rate': is an experiment, which the command runs; expected a file or one of"),
        (lambda: ls.simulate(ls.load_vehicle(VEHICLE)), "what: got Vehicle, expected the name"),
        (lambda: ls.simulate("double-cycle", seeds=1), "seeds: got 1, expected no such option; did you mean 'seed'?"),
        (lambda: ls.simulate("double-cycle", seed=1.5), "seed: got 1.5, expected a whole number from 0"),
        (lambda: ls.simulate("double-cycle", angle_rate_Hz="x"), "angle_rate_Hz: got 'x', expected a number from 1 to 1000"),
        (lambda: ls.simulate("double-cycle", effects=[5]), "effects: got 5, expected texts"),
        (lambda: ls.replay(FOREIGN, VEHICLE), "recording: pressure: got the lines A, B, expected main_a, main_b, aux_a, aux_b"),
        (lambda: ls.replay(VEHICLE, UPWARD), "vehicle: got Recording('"),
        (lambda: ls.replay(UPWARD, VEHICLE, options={"max_gap_s": 1.0}), "options: got {'max_gap_s': 1.0}, expected Options(...)"),
        (lambda: ls.Estimator(VEHICLE).push_block([0.5], [1], [0.0], [0.0]), "channel: got float64, expected whole numbers"),
        (lambda: ls.Estimator(VEHICLE).push_block([0], [1], ["a"], [0.0]), "value: got list, expected numbers"),
        (lambda: ls.Estimator(VEHICLE).set_plan([1, 2], [0.0, 0.1]), "2 times and angles of shape (2,)"),
        (lambda: ls.Estimator(VEHICLE).restore(None), "it is not the snapshot of this model"),
        (lambda: ls.Estimator(VEHICLE).begin_at("20"), "initial temperature: got '20', expected -80 to 150 degC"),
        (lambda: ls.calibrate(STOP, VEHICLE, fix=5), "fix: got 5, expected a text or several"),
        (lambda: ls.calibrate(STOP, VEHICLE, free="kingpin"), "--free kingpin: this vehicle has no such parameter"),
        (lambda: ls.calibrate(STOP, VEHICLE, prior="friction_level"), "prior: got 'friction_level', expected a mapping"),
        (lambda: ls.calibrate(STOP, VEHICLE, prior={"friction_level": "a"}), "prior of friction_level: got 'a', expected a number"),
        (lambda: ls.diagnose(STOP, VEHICLE, without=5), "without: got 5, expected a text or several"),
        (lambda: ls.simulate("double-cycle", angle_rate_Hz=5.0).save("out", "x"), "storage: got 'x', expected mcap or sqlite3"),
        (lambda: ls.add_effects(5), "effects: got 5, expected the path of a file, or several"),
        (lambda: ls.save_vehicle("own.yaml", LAWFUL), "vehicle: got 'own.yaml', expected a vehicle, as load_vehicle gives it"),
        (lambda: ls.save_vehicle(LAWFUL, 5), "path: got 5, expected that of a file"),
        (lambda: ls.write_report({}, "out"), "diagnosis: got {}, expected what diagnose gives"),
        (lambda: ls.keep_law(LAWFUL, "mine", 5), "file: got 5, expected its path"),
        (lambda: ls.Options(max_gap_s="x"), "max_gap_s: got 'x', expected a number from 0.001 to 60"),
        (lambda: ls.keep_law(VEHICLE, "mine", "own.yaml"), "laws: got the number 1, expected a vehicle file with the key 'laws'"),
        (lambda: ls.keep_law(LAWFUL, "mine", "own.yaml", law=2), "laws: got the number 2, expected 1 to 1"),
        (lambda: ls.keep_law(LAWFUL, "end_stop", "own.yaml"), "'end_stop': there is one of this name in the catalogue"),
        (lambda: ls.keep_law(LAWFUL, "My law", "own.yaml"), "key 'id': got 'My law', expected a name of small letters"),
        (lambda: ls.keep_law(LAWFUL, "mine", "/nowhere/own.yaml"), "/nowhere/own.yaml: cannot be written: No such file"),
    ],
)
def test_what_a_program_gives_wrongly_is_an_error_of_ours(call, said: str) -> None:
    with pytest.raises(ls.LugreSteeringError, match=re.escape(said)):
        call()


def test_a_message_that_is_none_is_refused() -> None:
    estimator = ls.Estimator(VEHICLE)
    for message, said in (
        (("angle/left", 1, 0.0), "channel: got angle/left, expected 0 to"),
        ((0, 10**30, 0.0), "expected a whole number of at most 64 bits"),
        ((0, 1.5, 0.0), "stamp_ns: got 1.5"),
        ((0, 1, "fast"), "value, rate: got 'fast', nan, expected numbers"),
    ):
        with pytest.raises(ls.DataError, match=re.escape(said)):
            estimator.push(*message)


def test_results_are_compared_by_what_they_say(replay: ls.Replay) -> None:
    again = ls.replay(STOP, VEHICLE)
    assert replace(again, provenance=replay.provenance) == replay
    assert replace(replay, vehicle="another") != replay


@pytest.mark.parametrize("call", [ls.replay, ls.calibrate, ls.diagnose])
def test_a_bag_that_is_not_there_is_an_error_of_ours(call) -> None:
    with pytest.raises(ls.LugreSteeringError, match="nowhere"):
        call("nowhere/bag", VEHICLE)


# ------------------------------------------------------------------ results


def test_results_are_shown_and_drawn(diagnosis: ls.Diagnosis, calibration: ls.Calibration, replay: ls.Replay) -> None:
    plt = pytest.importorskip("matplotlib.pyplot")
    backend = plt.get_backend()
    for result, text in ((diagnosis, "end_stop"), (calibration, "friction.coulomb"), (replay, "synthetic_hidden_stop_a")):
        assert text in result._repr_html_()
        assert "<script" not in result._repr_html_()
        figure = result.plot()
        assert all(ax.lines for ax in figure.axes)
        plt.close(figure)
    assert plt.get_backend() == backend
    for result in (diagnosis, replay):
        with pytest.raises(ls.DataError, match="expected a number below 1 or one of synthetic_hidden_stop_a"):
            result.plot("other")


@pytest.fixture(scope="module")
def lawful(diagnosis: ls.Diagnosis) -> ls.Diagnosis:
    """The same with a law beside its effect."""
    law = a_law(title="a <torque>")
    traces = [replace(trace, contributions={**trace.contributions, law.id: 0.1 * trace.measured}) for trace in diagnosis.traces]
    return replace(diagnosis, laws=(law,), traces=tuple(traces))


def test_laws_are_shown_and_drawn(lawful: ls.Diagnosis) -> None:
    plt = pytest.importorskip("matplotlib.pyplot")
    assert "<td>conservative_torque</td>" in lawful._repr_html_()
    assert "a &lt;torque&gt;" in lawful._repr_html_()
    *_, added, drawn = lawful.plot().axes
    (law,) = lawful.laws
    assert {line.get_label() for line in added.lines} == {"end_stop", law.id}
    data, f = drawn.lines
    np.testing.assert_allclose(data.get_ydata(), law.f.points)
    np.testing.assert_allclose(f.get_xdata(), np.degrees(law.f.at))
    band = drawn.collections[0].get_paths()[0].vertices
    assert band[:, 1].min() == law.f.f[0] - law.f.band[0]
    assert (drawn.get_xlabel(), drawn.get_ylabel(), drawn.get_title(loc="left")) == ("angle (deg)", "f (N m)", "law_1: a <torque>")
    plt.close("all")


def test_laws_have_a_table(lawful: ls.Diagnosis) -> None:
    pytest.importorskip("pandas")
    table = lawful.to_frame("laws").set_index("law")
    assert (table.loc["law_1", "coordinate"], table.loc["law_1", "largest_Nm"], table.loc["law_1", "high"]) == ("angle", 900.0, 0.6)
    assert len(lawful.to_frame()) == len(lawful.effects[0].parameters)
    with pytest.raises(ls.DataError, match="of: got 'law', expected 'effects' or 'laws'"):
        lawful.to_frame("law")  # type: ignore[arg-type]


def test_tables_need_pandas_and_say_so(diagnosis: ls.Diagnosis, replay: ls.Replay, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    for result in (diagnosis, replay):
        with pytest.raises(ls.LugreSteeringError, match="needs pandas"):
            result.to_frame()


def test_tables_hold_the_results(diagnosis: ls.Diagnosis, calibration: ls.Calibration, replay: ls.Replay) -> None:
    pytest.importorskip("pandas")
    table = diagnosis.to_frame().set_index("parameter")
    assert table.loc["stiffness", "value"] == diagnosis.effects[0].parameters["stiffness"].value
    assert list(calibration.to_frame()["key"]) == [row.key for row in calibration.parameters]
    torques = replay.to_frame()
    assert np.nanstd(torques["residual_Nm"] - (torques["measured_Nm"] - torques["torque_Nm"])) < 1.0
    assert len(torques) == replay.bags[0].estimates


def test_a_result_never_replaces_files_of_others(diagnosis: ls.Diagnosis, calibration: ls.Calibration, tmp_path: Path) -> None:
    for result, name in ((diagnosis, "diagnosis.json"), (calibration, "calibrated.yaml")):
        (tmp_path / name).write_text("mine", encoding="utf-8")
        with pytest.raises(ls.DataError, match=name):
            result.save(tmp_path)
        assert (tmp_path / name).read_text(encoding="utf-8") == "mine"


def test_what_cannot_be_written_is_an_error_of_ours(diagnosis: ls.Diagnosis, calibration: ls.Calibration, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    for save in (diagnosis.save, calibration.save, lambda out: ls.write_report(diagnosis, out)):
        with pytest.raises(ls.LugreSteeringError, match="file/below: cannot be written: Not a directory; expected a writable folder"):
            save(tmp_path / "file" / "below")
        with pytest.raises(ls.DataError, match="folder: got 5, expected its path"):
            save(5)


def test_a_law_is_kept_by_the_library_as_by_the_command(tmp_path: Path) -> None:
    assert ls.keep_law(LAWFUL, "rising_loss", str(tmp_path / "library.yaml")) == tmp_path / "library.yaml"
    ls.save_vehicle(LAWFUL, tmp_path / "vehicle.yaml")
    run("effects", "--add", tmp_path / "vehicle.yaml", "--id", "rising_loss", "--to", tmp_path / "command.yaml")
    library, command = ((tmp_path / f"{name}.yaml").read_text() for name in ("library", "command"))
    assert command == library.replace(f"found in {LAWFUL.name}", "found in vehicle.yaml")


def test_the_form_of_the_friction_has_a_file_where_nothing_is_named(diagnosis: ls.Diagnosis, tmp_path: Path) -> None:
    form = FrictionForm("formed.yaml", 50.0, 0.4, (0.3, 0.5), 60.0, ("form of the friction: its presliding",), diagnosis.vehicle)
    (tmp_path / "formed.yaml").write_text("mine", encoding="utf-8")
    with pytest.raises(ls.DataError, match=r"formed\.yaml"):
        replace(diagnosis, friction_form=form).save(tmp_path)
    (tmp_path / "formed.yaml").unlink()
    replace(diagnosis, friction_form=form).save(tmp_path)
    assert ls.load_vehicle(tmp_path / "formed.yaml").effects == diagnosis.vehicle.effects
    told = json.loads((tmp_path / "diagnosis.json").read_text())["friction_form"]
    assert told["file"] == "formed.yaml"
    assert "vehicle" not in told
    replace(diagnosis, friction_form=replace(form, file="augmented.yaml")).save(tmp_path)  # the next one has it there
    assert not (tmp_path / "formed.yaml").exists()


# ------------------------------------------------------------------ schemas

CONTRACT = {
    "schema": "lugre_steering/diagnosis/1", "bags": ["run_a"], "verdict": "missing_physics",
    "statement": "one paragraph an engineer can act on", "noise_floor_Nm": 71.0,
    "baseline": {"rmse_Nm": 0.0, "heldout_rmse_Nm": 0.0},
    "augmented": {"rmse_Nm": 0.0, "heldout_rmse_Nm": 0.0, "improvement": 0.0, "improvement_ci95": [0.0, 0.0]},
    "effects": [{
        "id": "end_stop", "stage": "parallel_torque", "statement": "…", "p_value": 0.001,
        "parameters": {"engage_angle": {"value": 0.47, "ci95": [0.46, 0.48], "unit": "rad"}},
        "where": [{"bag": "run_a", "intervals_s": [[12.1, 16.3]], "coordinate": "steering angle", "range": [0.47, 0.52], "unit": "rad"}],
        "energy_share": 0.93, "masked_share": 0.41, "indistinguishable_from": [],
    }],
    "unexplained": {"structured": False, "description": "", "formula": None, "where": None},
    "detection_limits": {"end_stop": {"parameter": "stiffness", "smallest": 9.0e3, "unit": "N m/rad"}},
    "data_quality": [{"finding": "stuck_sensor", "topic": "…", "bag": "…", "intervals_s": [[0.0, 1.0]], "statement": "…"}],
    "next_experiment": {"manoeuvre": "…", "separates": ["…", "…"], "why": "…"},
}  # fmt: skip
"""The example of the interface contract, key by key."""


@functools.cache
def validator(schema: str) -> jsonschema.Draft202012Validator:
    """Of a schema that is one itself."""
    jsonschema.Draft202012Validator.check_schema(json.loads(schema))
    return jsonschema.Draft202012Validator(json.loads(schema))


def refusals(schema: dict, document: object) -> list[str]:
    return [error.message for error in validator(json.dumps(schema)).iter_errors(document)]


def test_the_schema_of_a_diagnosis_is_the_contract() -> None:
    schema = schema_of(ls.Diagnosis)
    assert refusals(schema, CONTRACT) == []
    assert schema["required"] == list(CONTRACT)
    nothing = {
        "verdict": "insufficient_data", "effects": [], "next_experiment": None, "detection_limits": {}, "data_quality": [],
        "augmented": {"rmse_Nm": 0.0, "heldout_rmse_Nm": None, "improvement": None, "improvement_ci95": None},
    }  # fmt: skip
    assert refusals(schema, CONTRACT | nothing) == []
    for key in CONTRACT:
        assert refusals(schema, {name: value for name, value in CONTRACT.items() if name != key})
    for key, value in (("verdict", "perhaps"), ("noise_floor_Nm", 0.0), ("bags", []), ("schema", "other"), ("statement", "short")):
        assert refusals(schema, CONTRACT | {key: value})
    (effect,) = CONTRACT["effects"]
    for key, value in (("id", "End Stop"), ("stage", "elsewhere"), ("p_value", 1.5), ("indistinguishable_from", ["x"] * 7)):
        assert refusals(schema, CONTRACT | {"effects": [effect | {key: value}]})


OTHER_SCHEMA = outside("conformance/diagnosis.schema.json")


@pytest.mark.skipif(not OTHER_SCHEMA.is_file(), reason="the contract's own schema is not here")
def test_the_contract_s_own_schema_accepts_what_ours_does(diagnosis: ls.Diagnosis) -> None:
    other = json.loads(OTHER_SCHEMA.read_text(encoding="utf-8"))
    ours = schema_of(ls.Diagnosis)
    assert set(other["required"]) == set(ours["required"])
    for document in (CONTRACT, diagnosis.json):
        assert refusals(other, document) == refusals(ours, document) == []
    (effect,) = CONTRACT["effects"]
    broken = [CONTRACT | {"effects": [{k: v for k, v in effect.items() if k != key}]} for key in effect]
    broken += [{k: v for k, v in CONTRACT.items() if k != key} for key in CONTRACT]
    for document in broken:
        assert bool(refusals(other, document)) == bool(refusals(ours, document)) is True


def test_real_results_keep_to_their_schemas(diagnosis: ls.Diagnosis, calibration: ls.Calibration, replay: ls.Replay) -> None:
    for result in (diagnosis, calibration, replay, ls.diagnose(short(), VEHICLE)):
        assert refusals(schema_of(type(result)), json.loads(result.to_json())) == []


LAW = {
    "id": "law_1", "title": "a torque", "channel": "conservative_torque", "coordinate": "angle", "memory": "none", "memory_size": 0.0,
    "form": "linear", "values": {"value": 0.0, "slope": 1500.0}, "intervals": {"slope": [1400.0, 1600.0]}, "range": [-0.6, 0.6],
    "largest_Nm": 900.0, "largest_share": 0.1, "heldout_gain": 0.5, "gain": 2000.0, "bar": 30.0, "share_of_ceiling": 0.9,
    "ties": [
        {"title": title, "channel": "gain", "coordinate": "none", "memory": "none", "memory_size": 0.0}
        for title in ("a gain", "a loss", "more")
    ],
    "nearest_listed": [],
    "f": {
        "at": [-0.6, 0.0, 0.6], "f": [-900.0, 0.0, 900.0], "band": [60.0, 10.0, 60.0], "points_at": [-0.3, 0.3], "points": [-430.0, 470.0],
    },
}  # fmt: skip
"""A law in diagnosis.json, key by key; programs read it."""


def test_a_law_keeps_its_keys_and_their_order(lawful: ls.Diagnosis) -> None:
    schema = schema_of(ls.Diagnosis)
    (told,) = replace(lawful, laws=(a_law(),)).in_words().json["laws"]
    assert json.dumps(told) == json.dumps(LAW)
    assert refusals(schema, CONTRACT | {"laws": [LAW]}) == []
    for key in LAW:
        assert refusals(schema, CONTRACT | {"laws": [{name: value for name, value in LAW.items() if name != key}]})
    for key, value in (("id", "worn_arms"), ("range", [0.0]), ("values", {"slope": "steep"}), ("ties", [{}]), ("f", {}), ("gain", None)):
        assert refusals(schema, CONTRACT | {"laws": [LAW | {key: value}]})


@pytest.fixture(scope="module")
def axis() -> ls.Simulation:
    return ls.simulate("double-cycle", LINEAR_AXIS, angle_rate_Hz=20.0, pressure_rate_Hz=20.0)


def test_a_simulation_keeps_to_its_schema(axis: ls.Simulation) -> None:
    for result in (axis, ls.simulate("double-cycle", VEHICLE, angle_rate_Hz=20.0)):
        assert result.json["schema"] == "lugre_steering/simulation/1"
        assert refusals(schema_of(ls.Simulation), json.loads(result.to_json())) == []


def test_a_linear_axis_is_told_in_its_own_units(axis: ls.Simulation) -> None:
    assert (axis.largest_angle_deg, axis.coordinate_unit, axis.torque_unit) == (None, "m", "N")
    assert axis.largest_coordinate == pytest.approx(np.abs(axis.run.truth.motion.theta).max())
    replay = ls.replay(axis.recording, LINEAR_AXIS)
    if importlib.util.find_spec("matplotlib") is not None:
        names = {each.get_ylabel() + each.get_title() for figure in (axis.plot(), replay.plot()) for each in figure.axes}
        assert not [name for name in names if "rad" in name or "N m" in name or "torque" in name]
    if importlib.util.find_spec("pandas") is not None:
        assert list(axis.to_frame()) == ["time_s", "position_left_m", "force_N", "rubber_left_degC"]
        assert list(replay.to_frame()) == ["time_s", "position_left_m", "force_N", "measured_N", "residual_N", "bag"]


def short() -> ls.Recording:
    """A recording at rest, which determines nothing."""
    time = np.arange(0.0, 12.0, 0.01)
    noise = np.random.default_rng(1).standard_normal((6, time.size))
    lines = ("main_a", "main_b", "aux_a", "aux_b")
    return ls.Recording.from_arrays(
        time,
        angle={"left": 2e-4 * noise[0], "right": 2e-4 * noise[1]},
        pressure={line: 2e6 + 1.5e4 * row for line, row in zip(lines, noise[2:], strict=True)},
    )


@pytest.mark.parametrize("name", sorted(set(FILES) - {"simulation"}))  # whose bag tells it
def test_how_it_came_about_has_the_same_key_in_all_results(name: str) -> None:
    schema = schema_of(FILES[name])
    assert schema["properties"]["provenance"] == {"anyOf": [{"$ref": "#/$defs/Provenance"}, {"type": "null"}]}
    assert "provenance" not in schema["required"]  # earlier results lack it


def test_the_schemas_are_written_on_request(tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, "-m", "lugre_steering.schemas", str(tmp_path / "new")], env=environment(), check=False)
    assert done.returncode == 0
    for name, result in FILES.items():
        assert json.loads((tmp_path / "new" / f"{name}.schema.json").read_text(encoding="utf-8")) == schema_of(result)
