# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Faults injected into synthetic recordings are found by name, topic and stretch; sound recordings have no finding.

Recordings come from the second simulator, which shares no code with the estimator; the oracle of every stretch is where the
fault was put in, the oracle of the calibration is the recording before the fault.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from outside import outside
from remembering import same_signals_once

from lugre_steering import vehicle as vehicle_file
from lugre_steering.ackermann import other_track
from lugre_steering.bag import read_recording
from lugre_steering.data.dataset import prepare
from lugre_steering.data.offsets import SKEW_RANGE_S
from lugre_steering.data.quality import inspect
from lugre_steering.data.wiring import as_well
from lugre_steering.diagnosis.case import Case as DiagnosisCase
from lugre_steering.diagnosis.engine import diagnose_recordings
from lugre_steering.errors import DataError
from lugre_steering.fitting.fit import fit
from lugre_steering.fitting.problem import Problem
from lugre_steering.proof.simulator import BagData, Case, Concealed, load_sheet, simulate_case
from lugre_steering.recording import Finding, Recording, Signal
from lugre_steering.resources import config_folder
from lugre_steering.simulate import plant
from lugre_steering.simulate.manoeuvres import BUILT_IN, Hold, Manoeuvre, Sweep, motion_of
from lugre_steering.simulate.run import sensing_of, simulate
from lugre_steering.vehicle import Contact, EffectEntry, TorqueSensor, Vehicle

Array = NDArray[np.float64]
Edit = Callable[[Signal], Signal]
Fault = Callable[[Recording], Recording]

SHEET_FILE = config_folder() / "test_vehicle.yaml"
VEHICLE = vehicle_file.load(SHEET_FILE)
SHEET = load_sheet(SHEET_FILE)
LINES = ("main_a", "main_b", "aux_a", "aux_b")
BAGS = Path(__file__).parents[2] / "bags"
CONFORMANCE = outside("conformance")
LEFT, RIGHT = "steering/left/joint_state", "steering/right/joint_state"
AIR = "steering/ambient_temperature"
PRESSURE = {line: f"steering/pressure/{line}" for line in LINES}
EVERY_LINE = ", ".join(PRESSURE.values())
RIG = Vehicle(
    schema=vehicle_file.SCHEMA, name="rig", sides=("left",), torque_sensor=TorqueSensor(noise_Nm=20.0),
    contact=Contact(
        static_torque_Nm=9000.0, coulomb_torque_Nm=8000.0, stiffness_Nm_per_deg=4000.0, stribeck_speed_deg_s=1.5
    ),
)  # fmt: skip


def recording_of(bag: BagData) -> Recording:
    angle = {side: Signal(s.time, s.value) for side, s in zip(("left", "right"), bag.angles, strict=True)}
    pressure = {line: Signal(s.time, s.value) for line, s in zip(SHEET.lines, bag.pressures, strict=True)}
    return Recording(bag.manoeuvre, 0, angle, pressure)


@pytest.fixture(scope="module", autouse=True)
def _same_signal_once() -> Iterator[None]:
    """Most faults touch one channel of the same recording: the others need no smoothing again."""
    with same_signals_once():
        yield


@pytest.fixture(scope="module")
def sound() -> Recording:
    """Nothing wrong, nothing hidden; the left track moves in most of 20 ... 30 s."""
    return recording_of(simulate_case(Case(107, manoeuvres=("loops", "chirp")), SHEET).bags[0])


@pytest.fixture(scope="module")
def reference(sound: Recording) -> Array:
    return calibration(sound)


def calibration(recording: Recording) -> Array:
    """Fitted friction level, static ratio, stiffness, Stribeck speed (logarithms, ratio); heat is too slow to judge by."""
    run = prepare(recording, VEHICLE)
    problem = Problem(VEHICLE, [run])
    x = fit(problem, np.where(run.valid, 1.0 / run.sigma, 0.0)).x
    record, table = problem.model.parameters[0][0], problem.model.rubber
    degrees = record["table_low"] + record["table_step"] * np.arange(len(table))
    stiffness, friction = (np.log(np.interp(problem.temperatures(0, x)[0], degrees, column)) for column in table.T)
    return x[:4] + np.array([friction, 0.0, stiffness, 0.0])  # as they are at the temperature of the start


def angle(side: str, edit: Edit) -> Fault:
    return lambda r: replace(r, angle={**r.angle, side: edit(r.angle[side])})


def pressure(edit: Edit, *lines: str) -> Fault:
    return lambda r: replace(r, pressure={name: edit(s) if name in lines else s for name, s in r.pressure.items()})


def scaled(factor: float) -> Edit:
    return lambda s: Signal(s.time_s, s.value * factor)


def later(delay_s: float) -> Edit:
    return lambda s: Signal(s.time_s + delay_s, s.value)


def between(start: float, end: float, change: Callable[[Array], Array]) -> Edit:
    def edit(s: Signal) -> Signal:
        inside = (s.time_s >= start) & (s.time_s < end)
        value = s.value.copy()
        value[inside] = change(value[inside])
        return Signal(s.time_s, value)

    return edit


def missing(start: float, end: float) -> Edit:
    def edit(s: Signal) -> Signal:
        keep = (s.time_s < start) | (s.time_s >= end)
        return Signal(s.time_s[keep], s.value[keep])

    return edit


def noisier(sigma: float) -> Callable[[Array], Array]:
    return lambda value: value + sigma * np.random.default_rng(5).standard_normal(value.size)


def frozen(value: Array) -> Array:
    return np.full(value.size, value[0])


def exchanged(*pairs: tuple[str, str]) -> Fault:
    swap = {a: b for pair in pairs for a, b in (pair, pair[::-1])}
    return lambda r: replace(r, pressure={line: r.pressure[swap.get(line, line)] for line in r.pressure})


def overlap(found: tuple[tuple[float, float], ...], true: list[tuple[float, float]]) -> float:
    """Intersection over union of two sets of stretches, on a grid of a millisecond."""
    a, b = np.zeros(305_000, bool), np.zeros(305_000, bool)
    for grid, stretches in ((a, found), (b, true)):
        for start, end in stretches:
            grid[round(1e3 * (start + 5.0)) : round(1e3 * (end + 5.0))] = True
    return float((a & b).sum() / (a | b).sum())


def names(findings: tuple[Finding, ...]) -> list[tuple[str, str]]:
    return [(f.finding, f.topic) for f in findings]


STRETCH = {
    "stuck angle": ("stuck_sensor", LEFT, angle("left", between(20.0, 25.0, frozen)), (20.0, 25.0)),
    "stuck pressure": ("stuck_sensor", PRESSURE["main_a"], pressure(between(60.0, 62.0, frozen), "main_a"), (60.0, 62.0)),
    "broken wire": ("stuck_sensor", PRESSURE["main_b"], pressure(between(20.0, 25.0, np.zeros_like), "main_b"), (20.0, 25.0)),
    "lost angle": ("dropout", RIGHT, angle("right", missing(30.0, 33.0)), (30.0, 33.0)),
    "lost pressure": ("dropout", PRESSURE["aux_a"], pressure(missing(30.0, 30.4), "aux_a"), (30.0, 30.4)),
    "noisy angle": ("noise_change", LEFT, angle("left", between(20.0, 26.0, noisier(math.radians(0.06)))), (20.0, 26.0)),
    "noisy pressure": ("noise_change", PRESSURE["aux_b"], pressure(between(20.0, 26.0, noisier(6e4)), "aux_b"), (20.0, 26.0)),
}  # fmt: skip


@pytest.mark.parametrize("fault", STRETCH)
def test_bad_stretches_are_found_and_left_out(fault: str, sound: Recording, reference: Array) -> None:
    name, topic, inject, stretch = STRETCH[fault]
    quality = inspect(inject(sound), VEHICLE)
    assert [f for f in names(quality.findings) if f[0] != "friction_memory_lost"] == [(name, topic)]
    (found,) = (f for f in quality.findings if f.finding == name)
    assert overlap(found.intervals_s, [stretch]) > 0.8
    assert topic in found.statement
    assert not quality.blocking
    run = prepare(quality.recording, VEHICLE)
    inside = (run.time > stretch[0] + 0.1) & (run.time < stretch[1] - 0.1)
    if fault == "noisy pressure":  # it is measured still, and weighs less
        assert run.valid[inside].all()
        assert np.median(run.sigma[inside]) > 1.5 * np.median(run.sigma[~inside])
    else:
        assert not run.valid[inside].any()
    np.testing.assert_allclose(calibration(quality.recording), reference, atol=0.03)


def test_ripple_that_grows_with_the_load_is_no_change_of_the_noise(sound: Recording) -> None:
    time = sound.pressure["main_a"].time_s
    swing = np.sin(2.0 * np.pi * 31.0 * time)
    rippling = replace(
        sound, pressure={line: Signal(s.time_s, s.value * (1.0 + 0.02 * swing)) for line, s in sound.pressure.items()}
    )
    quality = inspect(rippling, VEHICLE)
    assert "noise_change" not in {finding.finding for finding in quality.findings}
    assert prepare(quality.recording, VEHICLE).valid.all()


GAPS = {
    "begun to turn": (0.6, lambda t: np.maximum(t - 20.1, 0.0), False),
    "stopped": (0.6, lambda t: np.minimum(t - 20.4, 0.0), False),
    "stood": (0.6, lambda t: np.where(t < 19.5, t - 19.5, np.where(t > 21.0, t - 21.0, 0.0)), False),
    "went on for long": (3.0, lambda t: t - 20.0, False),
    "turned back": (0.6, lambda t: np.abs(t - 20.3), True),
    "turned to and fro": (3.0, lambda t: t - 20.0 - 2.0 * np.clip(t - 20.5, 0.0, 1.0), True),
}


@pytest.mark.parametrize("motion", GAPS)
def test_friction_is_unknown_only_where_a_track_may_have_turned_both_ways(motion: str) -> None:
    """Wherever the path turned one way, the bristle is as if it had been seen."""
    length, path, lost = GAPS[motion]
    time = np.arange(0.0, 40.0, 0.01)
    kept = (time < 20.0) | (time > 20.0 + length)
    seen = time[kept], 0.01 * np.asarray(path(time))[kept]
    assert VEHICLE.hydraulics is not None
    pressure = {line: 5e6 + 1e6 * np.sin(time + i) for i, line in enumerate(VEHICLE.hydraulics.lines)}
    recording = Recording.from_arrays(time, angle=dict.fromkeys(VEHICLE.sides, seen), pressure=pressure)
    found = {f.finding for f in inspect(recording, VEHICLE).findings}
    assert "dropout" in found
    assert ("friction_memory_lost" in found) == lost


@pytest.mark.parametrize("channel", ["angle", "pressure"])
def test_spikes_are_removed(channel: str, sound: Recording, reference: Array) -> None:
    signal = sound.angle["left"] if channel == "angle" else sound.pressure["aux_b"]
    size = math.radians(1.0) if channel == "angle" else 4e5  # a hundredth of the range
    at = np.arange(300, signal.value.size - 300, 613)
    at = np.sort(np.concatenate([at, at[::3] + 1]))  # some last two samples
    value = signal.value.copy()
    value[at] += size * np.random.default_rng(2).choice([-1.0, 1.0], at.size)
    edit: Edit = lambda s: Signal(s.time_s, value)  # noqa: E731
    bad = (angle("left", edit) if channel == "angle" else pressure(edit, "aux_b"))(sound)
    quality = inspect(bad, VEHICLE)
    (found,) = quality.findings
    assert (found.finding, found.topic) == ("spikes", LEFT if channel == "angle" else PRESSURE["aux_b"])
    assert overlap(found.intervals_s, [(signal.time_s[i] - 0.005, signal.time_s[i] + 0.005) for i in at]) > 0.8
    kept = quality.recording.angle["left"] if channel == "angle" else quality.recording.pressure["aux_b"]
    np.testing.assert_array_equal(kept.time_s, np.delete(signal.time_s, at))
    np.testing.assert_allclose(calibration(quality.recording), reference, atol=0.03)


@pytest.mark.parametrize("channel", ["angle", "pressure"])
def test_a_limit_of_the_sensor_is_found(channel: str, sound: Recording, reference: Array) -> None:
    signal = sound.angle["left"] if channel == "angle" else sound.pressure["main_a"]
    limit = 0.75 * float(signal.value.max())
    cut: Edit = lambda s: Signal(s.time_s, np.minimum(s.value, limit))  # noqa: E731
    quality = inspect((angle("left", cut) if channel == "angle" else pressure(cut, "main_a"))(sound), VEHICLE)
    wanted = ("clipped_angle", LEFT) if channel == "angle" else ("saturation", PRESSURE["main_a"])
    assert [f for f in names(quality.findings) if f[0] != "friction_memory_lost"] == [wanted]
    beyond = signal.value >= limit
    true = [(t - 0.005, t + 0.005) for t in signal.time_s[beyond]]
    assert overlap(quality.findings[0].intervals_s, true) > 0.8
    kept = quality.recording.angle["left"] if channel == "angle" else quality.recording.pressure["main_a"]
    assert (kept.value >= limit).mean() < 0.01 * beyond.mean()
    np.testing.assert_allclose(calibration(quality.recording)[:3], reference[:3], atol=0.03)


def test_pressure_at_the_range_of_its_sensor(sound: Recording) -> None:
    low = VEHICLE.replace(sensors=replace(VEHICLE.sensors, pressure_range_Pa=8e6))
    cut: Edit = lambda s: Signal(s.time_s, np.minimum(s.value, 8e6))  # noqa: E731
    findings = inspect(pressure(cut, "main_b")(sound), low).findings
    assert ("saturation", PRESSURE["main_b"]) in names(findings)


def test_a_dead_line_is_stuck_all_the_time(sound: Recording) -> None:
    (found,) = inspect(pressure(scaled(0.0), "main_b")(sound), VEHICLE).findings
    assert (found.finding, found.topic) == ("stuck_sensor", PRESSURE["main_b"])
    assert "switched off or a broken wire" in found.statement
    stands = inspect(angle("left", between(20.0, 25.0, frozen))(sound), VEHICLE).findings
    assert "replace the sensor" in next(f.statement for f in stands if f.finding == "stuck_sensor")
    assert overlap(found.intervals_s, [(0.0, float(sound.pressure["main_b"].time_s[-1]))]) > 0.99
    assert found.intervals_s[0][0] == sound.pressure["main_b"].time_s[0]


def test_the_reason_why_nothing_of_a_channel_is_left_is_told_first(sound: Recording) -> None:
    told = diagnose_recordings([pressure(scaled(0.0), "main_b")(sound)], VEHICLE).statement
    assert told.startswith("The data must be put right first. ")
    assert told.index("switched off or a broken wire") < told.index("samples that can be used")
    lost = replace(sound, pressure={line: signal for line, signal in sound.pressure.items() if line != "main_b"})
    assert "The data do not allow a diagnosis" in diagnose_recordings([lost], VEHICLE).statement


def test_a_large_drift_of_a_zero(sound: Recording) -> None:
    drifting = pressure(lambda s: Signal(s.time_s, s.value + 6e3 * s.time_s), "aux_a")
    quality = inspect(drifting(sound), VEHICLE)
    assert names(quality.findings) == [("zero_drift", PRESSURE["aux_a"])]
    assert not quality.blocking
    assert "pressure_drift" in quality.findings[0].statement
    bar = float(quality.findings[0].statement.split("drifts by ")[1].split(" bar")[0])
    assert bar == pytest.approx(6e3 * float(sound.angle["left"].time_s[-1]) / 1e5, rel=0.15)


def returning(recording: Recording) -> Recording:
    """All lines under the pressure of the oil that returns, which rises with the square of the rate: 8 bar at 9 deg/s."""
    left = recording.angle["left"]
    rate = np.convolve(np.gradient(left.value, left.time_s), np.full(25, 0.04), mode="same")
    back = 8e5 * (rate / math.radians(9.0)) ** 2
    lines = {name: Signal(s.time_s, s.value + np.interp(s.time_s, left.time_s, back)) for name, s in recording.pressure.items()}
    return replace(recording, pressure=lines)


def test_the_pressure_of_returning_oil_is_no_drift_of_a_zero() -> None:
    rates = (9.0, 9.0, 9.0, 6.0, 6.0, 4.0)
    slower = Manoeuvre("slower", "", (Hold(2.0), *(Sweep(28.0 * (-1.0) ** i, rate, 2.0) for i, rate in enumerate(rates))))
    made = simulate(VEHICLE, motion_of(slower, VEHICLE), sensing_of(VEHICLE))
    signals = {channel.name: signal for channel, signal in made.signals.items()}
    sides = {side: signals[side] for side in ("left", "right")}
    returned = returning(Recording("slower", 0, sides, {line: signals[line] for line in LINES}))
    assert "zero_drift" not in {finding.finding for finding in inspect(returned, VEHICLE).findings}
    # A zero that does drift beside it still shows.
    drifting = pressure(lambda s: Signal(s.time_s, s.value + 25e3 * s.time_s), "aux_a")(returned)
    assert [f.topic for f in inspect(drifting, VEHICLE).findings if f.finding == "zero_drift"] == [PRESSURE["aux_a"]]


BLOCKING: dict[str, tuple[str, str, Fault, str]] = {
    "left sign": ("sign_flipped", LEFT, angle("left", scaled(-1.0)), ""),
    "right sign": ("sign_flipped", RIGHT, angle("right", scaled(-1.0)), ""),
    "both signs": (
        "sign_flipped", f"{LEFT}, {RIGHT}", lambda r: angle("left", scaled(-1.0))(angle("right", scaled(-1.0))(r)), "",
    ),
    "left in degrees": ("unit_suspect", LEFT, angle("left", scaled(180.0 / math.pi)), "0.0174533"),
    "pressures in bar": ("unit_suspect", EVERY_LINE, pressure(scaled(1e-5), *LINES), "bar (multiply by 100000)"),
    "pressures in MPa": ("unit_suspect", EVERY_LINE, pressure(scaled(1e-6), *LINES), "MPa (multiply by 1e+06)"),
    "pressures in kPa": ("unit_suspect", EVERY_LINE, pressure(scaled(1e-3), *LINES), "kPa (multiply by 1000)"),
    "one line in bar": ("unit_suspect", PRESSURE["aux_a"], pressure(scaled(1e-5), "aux_a"), "bar"),
    "main lines": ("swapped_lines", f"{PRESSURE['main_a']}, {PRESSURE['main_b']}", exchanged(("main_a", "main_b")), ""),
    "auxiliary lines": ("swapped_lines", f"{PRESSURE['aux_a']}, {PRESSURE['aux_b']}", exchanged(("aux_a", "aux_b")), ""),
    "across circuits": ("swapped_lines", f"{PRESSURE['main_b']}, {PRESSURE['aux_a']}", exchanged(("main_b", "aux_a")), ""),
    "both circuits": ("swapped_lines", EVERY_LINE, exchanged(("main_a", "main_b"), ("aux_a", "aux_b")), ""),
    "sides": (
        "swapped_angles", f"{LEFT}, {RIGHT}",
        lambda r: replace(r, angle={"left": r.angle["right"], "right": r.angle["left"]}), "",
    ),
    "pressures late": ("clock_skew", EVERY_LINE, pressure(later(0.15), *LINES), "too late"),
    "pressures early": ("clock_skew", EVERY_LINE, pressure(later(-1.2), *LINES), "too early"),
}  # fmt: skip


@pytest.mark.parametrize("fault", BLOCKING)
def test_wrong_wiring_stops_the_diagnosis(fault: str, sound: Recording) -> None:
    name, topic, inject, said = BLOCKING[fault]
    quality = inspect(inject(sound), VEHICLE)
    assert names(quality.findings) == [(name, topic)]
    assert quality.blocking == quality.findings
    assert said in quality.findings[0].statement
    start, end = float(sound.angle["left"].time_s[0]), float(sound.angle["left"].time_s[-1])
    assert overlap(quality.findings[0].intervals_s, [(start, end)]) > 0.8
    # The plugs, or the vehicle file: which of them is wrong no recording shows. Clocks stand in no vehicle file.
    doubted = DiagnosisCase(VEHICLE, [quality]).miswired()
    assert [sheet.finding for sheet in doubted] == ([] if name == "clock_skew" else ["wrong_sheet"])
    assert all(topic in suspect.key for sheet in doubted for suspect in sheet.suspects)
    assert all(sheet.suspects and quality.findings[0].statement in sheet.statement for sheet in doubted)


def flipped(side: str) -> Fault:
    return angle(side, scaled(-1.0))


MAIN, AUX = (("main_a", "main_b"), ("aux_a", "aux_b"))
MAIN_TOPICS, AUX_TOPICS = (", ".join(PRESSURE[line] for line in pair) for pair in (MAIN, AUX))
TWICE: dict[str, tuple[Fault, Fault, set[tuple[str, str]]]] = {
    "sign and main lines": (flipped("left"), exchanged(MAIN), {("sign_flipped", LEFT), ("swapped_lines", MAIN_TOPICS)}),
    "sign and auxiliary lines": (flipped("right"), exchanged(AUX), {("sign_flipped", RIGHT), ("swapped_lines", AUX_TOPICS)}),
    "sign and plugs across": (
        flipped("right"), exchanged(("main_b", "aux_a")),
        {("sign_flipped", RIGHT), ("swapped_lines", f"{PRESSURE['main_b']}, {PRESSURE['aux_a']}")},
    ),
    "both signs and main lines": (
        lambda r: flipped("left")(flipped("right")(r)), exchanged(MAIN),
        {("sign_flipped", f"{LEFT}, {RIGHT}"), ("swapped_lines", MAIN_TOPICS)},
    ),
    "sign and unit": (flipped("left"), pressure(scaled(1e-5), *LINES), {("sign_flipped", LEFT), ("unit_suspect", EVERY_LINE)}),
    "sign and unit of one line": (
        flipped("right"), pressure(scaled(1e-6), "main_a"), {("sign_flipped", RIGHT), ("unit_suspect", PRESSURE["main_a"])},
    ),
    "unit and lines": (
        pressure(scaled(1e-5), *LINES), exchanged(MAIN), {("unit_suspect", EVERY_LINE), ("swapped_lines", MAIN_TOPICS)},
    ),
    "sign, then sides": (
        flipped("left"), lambda r: replace(r, angle={"left": r.angle["right"], "right": r.angle["left"]}),
        {("sign_flipped", RIGHT), ("swapped_angles", f"{LEFT}, {RIGHT}")},  # the flipped sensor sits at the right input now
    ),
}  # fmt: skip


@pytest.mark.parametrize("faults", TWICE)
def test_two_faults_at_once_are_both_named(faults: str, sound: Recording) -> None:
    first, second, expected = TWICE[faults]
    quality = inspect(second(first(sound)), VEHICLE)
    assert set(names(quality.findings)) == expected
    assert quality.blocking == quality.findings
    for finding in quality.findings:
        assert "together with another fault" in finding.statement


def test_what_a_mirror_cannot_tell_is_said(sound: Recording) -> None:
    """Both signs flipped and all lines exchanged: the mirrored vehicle, as with exchanged angle sensors."""
    (found,) = inspect(exchanged(MAIN, AUX)(flipped("left")(flipped("right")(sound))), VEHICLE).findings
    assert found.finding == "swapped_angles"
    assert "More than one wiring fault is possible" in found.statement


@pytest.mark.parametrize(
    ("third", "name"), [(later(-1.2), "wiring_suspect"), (scaled(1e-5), "unit_suspect"), (scaled(1e-3), "unit_suspect")]
)
def test_more_faults_than_can_be_told_are_no_single_one(third: Edit, name: str, sound: Recording) -> None:
    """Three at once: no channel is singled out."""
    bad = pressure(third, *LINES)(exchanged(MAIN)(flipped("right")(sound)))
    (found,) = inspect(bad, VEHICLE).findings
    assert found.finding == name
    assert set(PRESSURE.values()) <= set(found.topic.split(", "))
    assert "ore than one wiring fault is possible" in found.statement


def one_sensor_recording(vehicle: Vehicle) -> Recording:
    sweeps = Manoeuvre("one", "", (Hold(2.0), *(Sweep(20.0 * (-1.0) ** i, 4.0 + i, 2.0) for i in range(5))))
    made = simulate(vehicle, motion_of(sweeps, vehicle), sensing_of(vehicle))
    signals = {channel.name: signal for channel, signal in made.signals.items()}
    return Recording(
        "one", 0, both_from(vehicle, signals["right"]), {line: signals[line] for line in ("main_a", "main_b")}
    )


def both_from(vehicle: Vehicle, right: Signal) -> dict[str, Signal]:
    """As reading does: the left angle from the right one."""
    ratio = next(channel.ackermann for channel in vehicle.channels if channel.name == "left")
    return {"left": Signal(right.time_s, other_track(right.value, right.value, ratio)[0]), "right": right}


@pytest.mark.parametrize("fault", ["none", "sign", "lines", "degrees", "sign and unit"])
def test_wiring_of_one_angle_sensor_and_one_pressure_pair(fault: str) -> None:
    vehicle = vehicle_file.load(config_folder() / "one_angle_sensor_example.yaml")
    recording = one_sensor_recording(vehicle)
    if "sign" in fault:
        recording = replace(recording, angle=both_from(vehicle, scaled(-1.0)(recording.angle["right"])))
    if fault == "degrees":
        recording = replace(recording, angle=both_from(vehicle, scaled(180.0 / math.pi)(recording.angle["right"])))
    if fault == "lines":
        recording = exchanged(("main_a", "main_b"))(recording)
    if "unit" in fault:
        recording = pressure(scaled(1e-5), "main_a", "main_b")(recording)
    findings = inspect(recording, vehicle).findings
    both = f"{PRESSURE['main_a']}, {PRESSURE['main_b']}"
    expected = {
        "none": [], "sign": [("sign_flipped", RIGHT)], "lines": [("sign_flipped", RIGHT)], "degrees": [("unit_suspect", RIGHT)],
        "sign and unit": [("sign_flipped", RIGHT), ("unit_suspect", both)],
    }  # fmt: skip
    assert [f for f in names(findings) if f[0] in ("sign_flipped", "unit_suspect", "swapped_lines")] == expected[fault]
    if fault in ("sign", "lines"):  # with one sensor no geometry tells them apart
        assert f"{PRESSURE['main_a']} and {PRESSURE['main_b']} are exchanged" in findings[0].statement


@pytest.mark.parametrize("skew_s", [0.15, -0.3])
def test_the_size_of_a_skew(skew_s: float, sound: Recording) -> None:
    (found,) = inspect(pressure(later(skew_s), *LINES)(sound), VEHICLE).findings
    seconds = float(found.statement.split("stamped ")[1].split(" s")[0])
    assert seconds == pytest.approx(abs(skew_s), abs=0.04)


@pytest.mark.parametrize("prefix", ["", "/", "/robot/"])
def test_one_angle_in_degrees_that_reading_refused(prefix: str, sound: Recording) -> None:
    """Reading leaves out angles beyond half a turn; what is left looks small, the count does not."""
    degrees = scaled(180.0 / math.pi)(sound.angle["left"])
    keep = np.abs(degrees.value) <= math.pi
    rejected = {prefix + LEFT: {"absurd": int((~keep).sum())}}
    bad = replace(angle("left", lambda s: Signal(s.time_s[keep], degrees.value[keep]))(sound), rejected=rejected)
    quality = inspect(bad, VEHICLE)
    assert ("unit_suspect", LEFT) in names(quality.blocking)
    assert ("rejected_samples", LEFT) in names(quality.findings)


def test_air_in_kelvin_that_reading_refused(sound: Recording) -> None:
    (found,) = inspect(replace(sound, rejected={"/" + AIR: {"absurd": 54}}), VEHICLE).findings
    assert (found.finding, found.topic) == ("rejected_samples", AIR)
    assert "kelvin" in found.statement


def test_a_missing_line_is_told_by_its_topic(sound: Recording) -> None:
    poor = replace(sound, pressure={line: signal for line, signal in sound.pressure.items() if line != "aux_a"})
    with pytest.raises(DataError, match=r"pressure/aux_a .topic 'steering/pressure/aux_a'.: got nothing"):
        prepare(poor, VEHICLE)


def test_small_angles_in_degrees() -> None:
    """Below a quarter turn by number: the nominal model tells."""
    small = Manoeuvre("small", "", (Hold(2.0), *(Sweep(1.2 * (-1.0) ** i, 0.5, 1.0) for i in range(6))))
    made = simulate(VEHICLE, motion_of(small, VEHICLE), sensing_of(VEHICLE))
    signals = {channel.name: signal for channel, signal in made.signals.items()}
    recording = Recording(
        "small", 0, {side: signals[side] for side in VEHICLE.sides}, {line: signals[line] for line in LINES}
    )
    assert inspect(recording, VEHICLE).findings == ()
    degrees = scaled(180.0 / math.pi)
    quality = inspect(angle("left", degrees)(angle("right", degrees)(recording)), VEHICLE)
    assert names(quality.findings) == [("unit_suspect", f"{LEFT}, {RIGHT}")]


@pytest.mark.parametrize("level_Pa", [0.0, 7e5])
def test_a_torque_that_never_comes_names_no_unit(level_Pa: float, sound: Recording) -> None:
    """A pump that is off: noise of the sensors about zero or a level, and steering by hand."""
    random = np.random.default_rng(4)
    idle: Edit = lambda s: Signal(s.time_s, level_Pa + 1.5e4 * random.standard_normal(s.time_s.size))  # noqa: E731
    (found,) = inspect(pressure(idle, *LINES)(sound), VEHICLE).blocking
    assert found.topic == EVERY_LINE
    assert found.finding == "dead_sensor"


ONE_WAY = Manoeuvre("one-way", "", (Hold(2.0), Sweep(10.0, 4.0, 2.0), Sweep(20.0, 2.0, 2.0), Sweep(28.0, 6.0, 5.0)))
TURN = Manoeuvre("turn", "", (Hold(2.0), Sweep(28.0, 6.0, 3.0)))


def made_by(manoeuvre: Manoeuvre, *effects: str) -> Recording:
    """A sound recording of a vehicle with hidden effects."""
    motion, sensing = motion_of(manoeuvre, VEHICLE), replace(sensing_of(VEHICLE), pressure_rate_Hz=50.0)
    made = simulate(plant.with_effects(VEHICLE, effects), motion, sensing)
    signals = {channel.name: signal for channel, signal in made.signals.items()}
    angles, lines = ({name: signals[name] for name in named} for named in (VEHICLE.sides, LINES))
    return Recording(manoeuvre.name, 0, angles, lines)


def test_an_idle_line_is_in_no_other_unit_for_a_little_less_error() -> None:
    idle: Edit = lambda s: Signal(s.time_s, s.value - 7e5)  # noqa: E731
    recording = pressure(idle, *LINES)(made_by(TURN, "end_stop:stiffness=1.7e5,engage_angle=0.4"))
    little = pressure(lambda s: Signal(s.time_s, 2e-4 * recording.pressure["main_b"].value), "aux_a")(recording)
    assert inspect(little, VEHICLE).findings == ()


def test_angles_that_obey_the_geometry_are_in_no_other_unit(sound: Recording) -> None:
    """All pressures too low by the same factor look like the torque of one track."""
    findings = inspect(pressure(scaled(0.3), *LINES)(sound), VEHICLE).findings
    assert [finding for finding in findings if "joint_state" in finding.topic] == []


@pytest.mark.parametrize(
    ("manoeuvre", "effect"),
    [
        (BUILT_IN["double-cycle"], "pressure_lag:tau=0.15"),
        (BUILT_IN["double-cycle"], "pressure_lag:tau=0.4"),
        (BUILT_IN["double-cycle"], "time_delay:delay=0.09"),
        (BUILT_IN["slow-sweeps"], "cylinder_friction:coulomb=3000,load_share=0.05,holding=0.5"),
        (ONE_WAY, "surface_patch:change=-0.2,angle_low=0.1,angle_high=0.3"),
    ],
)
def test_physics_is_no_clock(manoeuvre: Manoeuvre, effect: str) -> None:
    """Effects of the catalogue that shift the torque, or its weak slopes, are left for the diagnosis to name."""
    assert inspect(made_by(manoeuvre, effect), VEHICLE).findings == ()


@pytest.mark.parametrize("skew_s", [-0.3, 0.3])
@pytest.mark.parametrize("manoeuvre", [BUILT_IN["double-cycle"], BUILT_IN["slow-sweeps"], TURN])
def test_a_skew_in_other_manoeuvres(manoeuvre: Manoeuvre, skew_s: float) -> None:
    (found,) = inspect(pressure(later(skew_s), *LINES)(made_by(manoeuvre)), VEHICLE).blocking
    assert found.finding == "clock_skew"
    assert float(found.statement.split("stamped ")[1].split(" s")[0]) == pytest.approx(0.3, abs=0.04)


@pytest.mark.parametrize(("manoeuvre", "skew_s"), [(TURN, 1.1), (BUILT_IN["slow-sweeps"], SKEW_RANGE_S)])
def test_a_skew_at_the_end_of_the_search_is_a_lower_bound(manoeuvre: Manoeuvre, skew_s: float) -> None:
    (found,) = inspect(pressure(later(skew_s), *LINES)(made_by(manoeuvre)), VEHICLE).findings
    assert found.finding == "clock_skew"
    assert 0.9 * skew_s < float(found.statement.split("stamped at least ")[1].split(" s")[0]) <= skew_s


@pytest.mark.parametrize("skew_s", [SKEW_RANGE_S + 0.5, 10.0])
def test_a_skew_beyond_the_search_is_told_as_one_possibility(skew_s: float) -> None:
    findings = inspect(pressure(later(skew_s), *LINES)(made_by(BUILT_IN["double-cycle"])), VEHICLE).findings
    assert any("clocks more than 5 s apart" in finding.statement for finding in findings)


def test_what_reading_found_is_kept(sound: Recording) -> None:
    damaged = Finding("damaged_bag", "", "a chunk is damaged")
    bad = replace(sound, findings=(damaged,), rejected={LEFT: {"not_finite": 3, "zero_stamp": 2}})
    found = inspect(bad, VEHICLE).findings
    assert names(found) == [("damaged_bag", ""), ("rejected_samples", LEFT)]
    assert "5 messages" in found[1].statement
    assert "3 not finite" in found[1].statement


def test_time_without_memory_of_friction_is_counted_once(sound: Recording) -> None:
    """A logger that drops 0.4 s of every 2 s: the next gap comes before friction has forgotten the last one."""
    holes: Edit = lambda s: Signal(s.time_s[s.time_s % 2.0 > 0.4], s.value[s.time_s % 2.0 > 0.4])  # noqa: E731
    findings = inspect(angle("left", holes)(angle("right", holes)(sound)), VEHICLE).findings
    lost = [f for f in findings if f.finding == "friction_memory_lost"]
    assert lost
    for finding in lost:
        ends = np.array(finding.intervals_s)
        assert (ends[1:, 0] > ends[:-1, 1]).all()
        said = float(finding.statement.split("not used for ")[1].split(" s")[0])
        assert said <= sound.angle["left"].time_s[-1]


def test_a_slow_logger_has_no_gaps(sound: Recording) -> None:
    slow: Edit = lambda s: Signal(s.time_s[::100], s.value[::100])  # noqa: E731
    every = pressure(slow, *LINES)(angle("left", slow)(angle("right", slow)(sound)))
    assert np.median(np.diff(every.angle["left"].time_s)) > 0.5
    quality = inspect(every, VEHICLE)
    assert not [f for f in quality.findings if f.finding in ("friction_memory_lost", "dropout")]
    assert quality.recording.pressure["main_a"].time_s.size == every.pressure["main_a"].time_s.size


def test_a_hole_in_one_angle_beside_a_slow_other_one(sound: Recording) -> None:
    """The other side has no sample in the hole: nothing says that it was parked."""
    slow = {side: Signal(s.time_s[::50], s.value[::50]) if side == "right" else s for side, s in sound.angle.items()}
    turning = int(np.argmax(np.abs(sound.angle["left"].value)))
    at = float(sound.angle["left"].time_s[turning])
    hole = angle("left", missing(at - 1.0, at + 1.0))(replace(sound, angle=slow))
    assert ("friction_memory_lost", LEFT) in names(inspect(hole, VEHICLE).findings)


def test_a_delay_that_the_vehicle_file_knows_is_no_skew(sound: Recording) -> None:
    late = pressure(later(0.2), *LINES)(sound)
    assert "clock_skew" in {finding for finding, _ in names(inspect(late, VEHICLE).blocking)}
    knowing = VEHICLE.replace(effects=(EffectEntry("time_delay", {"delay": 0.2}),))
    assert names(inspect(late, knowing).blocking) == []


def test_absolute_pressures_in_bar(sound: Recording) -> None:
    absolute = VEHICLE.replace(sensors=replace(VEHICLE.sensors, pressure_reference="absolute"))
    bar = pressure(lambda s: Signal(s.time_s, (s.value + 101_325.0) / 1e5), *LINES)(sound)
    (fault,) = inspect(bar, absolute).blocking
    assert fault.finding == "unit_suspect"
    assert "bar" in fault.statement


def test_rates_go_with_their_angles(sound: Recording) -> None:
    rates = {"left": Signal(sound.angle["left"].time_s, np.zeros(sound.angle["left"].value.size))}
    bad = angle("left", between(20.0, 25.0, frozen))(replace(sound, rate=rates))
    kept = inspect(bad, VEHICLE).recording.rate["left"]
    assert not ((kept.time_s > 20.0) & (kept.time_s < 25.0)).any()
    assert kept.time_s.size > 0.9 * rates["left"].time_s.size


def test_torque_unknown_after_a_gap_is_said_and_not_used(sound: Recording) -> None:
    """The track turns back in it."""
    quality = inspect(angle("left", between(23.0, 28.0, frozen))(sound), VEHICLE)
    (memory,) = (f for f in quality.findings if f.finding == "friction_memory_lost")
    (start, end) = memory.intervals_s[0]
    turned = np.abs(np.diff(np.interp(np.arange(28.0, end, 0.2), *_arrays(sound.angle["left"])))).sum()
    presliding_deg = 0.75 * _lever() / VEHICLE.friction.stiffness_Nm_per_deg  # type: ignore[union-attr]
    assert math.degrees(turned) == pytest.approx(5.0 * presliding_deg, rel=0.1)
    run = prepare(quality.recording, VEHICLE)
    assert not run.valid[(run.time > start + 0.1) & (run.time < end - 0.1)].any()


def _arrays(signal: Signal) -> tuple[Array, Array]:
    return signal.time_s, signal.value


def _lever() -> float:
    """Sum of roller loads times radii [N m], from the sheet as the second simulator reads it."""
    return float(np.sum(SHEET.roller_load_N * np.hypot(SHEET.roller_x_m, SHEET.hinge_offset_m)))


@pytest.mark.parametrize("noise", ["white", "coloured", "ripple"])
def test_silent_on_sound_recordings(noise: str) -> None:
    for bag in simulate_case(Case(7, noise=noise, manoeuvres=("sweeps", "decaying")), SHEET).bags:  # type: ignore[arg-type]
        assert inspect(recording_of(bag), VEHICLE).findings == ()


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("backlash", "time_delay"), ("linkage_compliance", "pressure_lag"), ("end_stop", "relief_saturation"),
        ("cylinder_friction", "pressure_drift"),
    ],
)  # fmt: skip
def test_silent_on_hidden_physics(first: str, second: str) -> None:
    case = Case(41, (Concealed(first, 2.0), Concealed(second, 2.0)), noise="ripple", manoeuvres=("decaying", "chirp"))
    for bag in simulate_case(case, SHEET).bags:
        assert inspect(recording_of(bag), VEHICLE).findings == ()


@pytest.mark.parametrize(
    ("bag", "start_s", "lasts_s"),
    [
        ("synthetic_double_cycle", 30.0, 5.0), ("synthetic_hidden_stop_b", 16.0, 5.0), ("synthetic_hidden_stop_b", 20.5, 5.0),
        ("synthetic_hidden_stop_b", 51.0, 10.0),
    ],
)  # fmt: skip
def test_nobody_is_accused_by_a_recording_begun_in_mid_sweep(bag: str, start_s: float, lasts_s: float) -> None:
    """Nobody knows how the bristles stood at its start."""

    def cut(signals: dict[str, Signal]) -> dict[str, Signal]:
        kept = {name: (s, (s.time_s >= start_s) & (s.time_s < start_s + lasts_s)) for name, s in signals.items()}
        return {name: Signal(s.time_s[use], s.value[use]) for name, (s, use) in kept.items()}

    whole = read_recording(BAGS / bag, VEHICLE.channels)
    assert inspect(replace(whole, angle=cut(whole.angle), pressure=cut(whole.pressure), rate={}), VEHICLE).blocking == ()


@pytest.mark.skipif(not CONFORMANCE.exists(), reason="conformance recordings are not beside the project")
@pytest.mark.parametrize("bag", ["baseline_clean", "baseline_noisy"])
def test_silent_on_the_conformance_recordings(bag: str) -> None:
    assert inspect(read_recording(CONFORMANCE / bag, VEHICLE.channels), VEHICLE).findings == ()


@pytest.mark.parametrize(("angle_deg", "pressure_Pa"), [(0.0, 0.0), (0.0055, 763.0), (0.1, 5e4)])
@pytest.mark.parametrize("noise", [0.0, 0.3])
def test_parked_values_repeat_without_being_stuck(angle_deg: float, pressure_Pa: float, noise: float) -> None:
    """Noise-free, or coarser than the noise: held angles and pressures stand still for seconds."""
    held = Manoeuvre("held", "", (Hold(4.0), *(Sweep(20.0 * (-1.0) ** i, 8.0, 4.0) for i in range(5))))
    sensing = replace(
        sensing_of(VEHICLE), angle_resolution_deg=angle_deg, pressure_resolution_Pa=pressure_Pa,
        angle_noise_deg=noise * angle_deg, pressure_noise_Pa=noise * pressure_Pa,
    )  # fmt: skip
    made = simulate(VEHICLE, motion_of(held, VEHICLE), sensing)
    signals = {channel.name: signal for channel, signal in made.signals.items()}
    recording = Recording(
        "held", 0, {side: signals[side] for side in VEHICLE.sides}, {line: signals[line] for line in LINES}
    )
    assert {f.finding for f in inspect(recording, VEHICLE).findings} <= {"sensor_worse_than_sheet"}


def rig_recording() -> Recording:
    sweeps = Manoeuvre("rig", "", (Hold(2.0), *(Sweep(15.0 * (-1.0) ** i, 4.0 + i, 2.0) for i in range(6))))
    made = simulate(RIG, motion_of(sweeps, RIG), sensing_of(RIG))
    signals = {channel.name: signal for channel, signal in made.signals.items()}
    return Recording("rig", 0, {"left": signals["left"]}, {}, measured_torque=signals["torque"])


@pytest.mark.parametrize(
    ("edit", "name"),
    [(None, None), (scaled(-1.0), "sign_flipped"), (scaled(1e-3), "unit_suspect"), (later(0.3), "clock_skew")],
)
def test_a_torque_sensor(edit: Edit | None, name: str | None) -> None:
    recording = rig_recording()
    assert recording.measured_torque is not None
    if edit is not None:
        recording = replace(recording, measured_torque=edit(recording.measured_torque))
    found = inspect(recording, RIG).findings
    assert names(found) == ([] if name is None else [(name, "steering/measured_torque")])
    if name == "sign_flipped":
        assert f"{LEFT}: the sign is flipped" in found[0].statement  # the data cannot tell which of the two


def test_pulses_with_a_tail_are_physics() -> None:
    """A drive that pushes: up in one sample, down over fifteen (as real drives do); nothing to remove."""
    recording = rig_recording()
    torque = recording.measured_torque
    assert torque is not None
    pulse = np.zeros(torque.value.size)
    pulse[200::150] = 1.0
    pushed = torque.value + 3000.0 * np.convolve(pulse, np.linspace(1.0, 0.0, 15))[: pulse.size]
    found = inspect(replace(recording, measured_torque=Signal(torque.time_s, pushed)), RIG)
    assert {f.finding for f in found.findings} <= {"sensor_worse_than_sheet"}
    assert found.recording.measured_torque is not None
    assert found.recording.measured_torque.time_s.size == torque.time_s.size


@pytest.mark.parametrize("left", [0, 5])
def test_too_little_data_is_no_error(left: int, sound: Recording) -> None:
    short = angle("left", lambda s: Signal(s.time_s[:left], s.value[:left]))(sound)
    assert not inspect(short, VEHICLE).blocking
    assert inspect(Recording("empty", 0, {}, {}), VEHICLE).findings == ()


def test_many_explanations_are_counted_and_not_all_told() -> None:
    assert as_well([]) == ""
    assert as_well([(0.2, "lines a and b are exchanged")]) == " The same data would come from this: lines a and b are exchanged."
    many = as_well([(0.2 - 0.01 * i, f"plug {i} is wrong") for i in range(20)])
    assert many.startswith(" The same data would come from this: plug 19 is wrong.")
    assert "plug 0 " not in many
    assert "17 more would show the same" in many
    assert "arms and bores" in many
