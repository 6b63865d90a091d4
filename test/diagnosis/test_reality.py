# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The sheet, the sensors, the clocks and the weather come before physics: each is put into a recording and must be told as itself."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from remembering import same_signals_once
from small_problem import effect

from lugre_steering.calibration.coverage import QUICK, record
from lugre_steering.data.dataset import prepare, with_hydraulics
from lugre_steering.data.dead import inspect_dead
from lugre_steering.data.pieces import LONGEST_S, PIECE_S, in_pieces
from lugre_steering.data.quality import inspect
from lugre_steering.data.sensing import louder, own_noise, sensed, white_noise
from lugre_steering.data.stamps import evened
from lugre_steering.diagnosis.conclude.left_out import left_out
from lugre_steering.diagnosis.engine import diagnose_recordings
from lugre_steering.diagnosis.finished import Finished
from lugre_steering.diagnosis.search.search import Search
from lugre_steering.fitting import clocks, sheet
from lugre_steering.fitting.clocks import synchronised
from lugre_steering.fitting.entries import circuits
from lugre_steering.fitting.fit import fit
from lugre_steering.fitting.noise import Noise
from lugre_steering.fitting.problem import Effects, Problem
from lugre_steering.fitting.sheet import (
    Suspect,
    WrongSheet,
    form_instead,
    physics_beside,
    physics_instead,
    wrong_entry,
    wrong_sheet,
)
from lugre_steering.fitting.split import split
from lugre_steering.fitting.weather import weather_findings
from lugre_steering.online import sheet_words
from lugre_steering.recording import Array, Recording, Signal
from lugre_steering.simulate.command import load_vehicle, simulation
from lugre_steering.vehicle import EffectEntry, Vehicle

VEHICLE = load_vehicle(None)
Change = Callable[[Array], Array]


@pytest.fixture(scope="module", autouse=True)
def _same_signal_once() -> Iterator[None]:
    """Most mistakes are those of a sheet, beside the same signals."""
    with same_signals_once():
        yield


@cache
def sound() -> tuple[Recording, ...]:
    return tuple(record(VEHICLE, QUICK, 5))


def with_load(factor: float) -> Vehicle:
    assert VEHICLE.axle is not None
    return VEHICLE.replace(axle=replace(VEHICLE.axle, load_N=factor * VEHICLE.axle.load_N))


def changed(recording: Recording, angle: Change | None = None, pressure: Change | None = None) -> Recording:
    def of(signal: Signal, change: Change | None) -> Signal:
        return signal if change is None else Signal(signal.time_s, change(signal.value))

    return replace(
        recording, angle={side: of(s, angle) for side, s in recording.angle.items()},
        pressure={line: of(s, pressure) for line, s in recording.pressure.items()},
    )  # fmt: skip


@pytest.mark.parametrize("rate_Hz", [20.0, 100.0])
def test_late_stamps_go_back_to_their_clock(rate_Hz: float) -> None:
    """A sine sampled evenly; messages up to 6 ms late, stamped to a millisecond, one in five lost."""
    random = np.random.default_rng(1)
    even = np.arange(0.0, 40.0, 1.0 / rate_Hz)
    stamps = np.round(even + random.uniform(0.0, 0.006, even.size), 3)
    kept = random.random(even.size) > 0.2
    found, scatter = evened(Signal(stamps[kept], np.sin(even[kept])))
    off = found.time_s - even[kept]
    assert scatter == pytest.approx(0.006 / np.sqrt(12.0), rel=0.2)
    assert np.std(off) < 2e-4
    assert np.mean(off) == pytest.approx(0.003, abs=3e-4)


def test_truly_uneven_sampling_keeps_its_stamps() -> None:
    random = np.random.default_rng(2)
    instants = np.arange(0.0, 40.0, 0.01) + random.uniform(0.0, 0.004, 4000)
    signal = Signal(instants, np.sin(3.0 * instants))
    assert evened(signal)[0] is signal


@pytest.mark.parametrize(("noise", "step"), [(0.03, 0.005), (0.03, 0.02), (0.001, 0.1)])
def test_noise_and_steps_are_measured(noise: float, step: float) -> None:
    random, time = np.random.default_rng(3), np.arange(0.0, 60.0, 0.01)
    truth = 20.0 * np.sin(0.4 * time)
    value = np.round((truth + noise * random.standard_normal(time.size)) / step) * step
    found = sensed(Signal(time, value))
    assert found.resolution == pytest.approx(step, rel=1e-6)
    assert 0.9 < found.sigma() / float(np.std(value - truth)) < 1.5  # steps as wide as the motion between samples look rougher


def shifted(*late_s: float) -> list[Recording]:
    """The sound recordings with pressures stamped late, each by its own time."""
    return [
        replace(r, pressure={line: Signal(s.time_s + late, s.value) for line, s in r.pressure.items()})
        for r, late in zip(sound(), late_s, strict=True)
    ]


def test_offsets_between_clocks_are_measured_and_taken_out() -> None:
    late_s = (0.02, -0.012)
    apart = shifted(*late_s)
    told = synchronised(apart, VEHICLE)
    problem, findings = told.problem, told.findings
    np.testing.assert_allclose(told.late, late_s, atol=1e-3)
    assert len(findings) == len(apart)
    for recording, run, late in zip(apart, problem.runs, late_s, strict=True):
        said = float(findings[recording.name].statement.split("stamped ")[1].split(" ms")[0])
        assert said == pytest.approx(1e3 * abs(late), abs=1.0)
        assert ("too late" in findings[recording.name].statement) == (late > 0.0)
        assert run.time.size > 0
    assert synchronised(sound(), VEHICLE).findings == {}


def test_a_delay_that_every_recording_shows_is_left_for_its_name() -> None:
    told = synchronised(shifted(0.02, 0.02), VEHICLE)
    problem = told.problem
    assert told.findings == {}
    np.testing.assert_array_equal(problem.measured, Problem(VEHICLE, [prepare(r, VEHICLE) for r in shifted(0.02, 0.02)]).measured)


@pytest.mark.parametrize(("name", "value"), [("linkage_compliance", {"compliance": 5e-7}), ("backlash", {"width": 0.003})])
def test_what_makes_the_torque_late_is_no_clock(name: str, value: dict[str, float]) -> None:
    """A spring or play before the contact: the torque comes late after each reversal, more so in one drive than in another."""
    told = synchronised(record(VEHICLE.replace(effects=(EffectEntry(name, value),)), QUICK, 5), VEHICLE)
    np.testing.assert_array_equal(told.late, 0.0)
    assert told.findings == {}


def test_clocks_are_known_as_well_as_they_were_measured() -> None:
    """Sound ones to a millisecond, as they wander, better where all recordings agree; not at all where a lag that is known hides them."""

    def known(*late_s: float, vehicle: Vehicle = VEHICLE) -> list[float]:
        return [run.clock_s for run in synchronised(shifted(*late_s), vehicle).problem.runs]

    lag = VEHICLE.replace(effects=(EffectEntry("pressure_lag", {"tau": 0.02}),))
    assert known(0.0, 0.0) == [1e-3, 1e-3]
    assert max(known(0.02, 0.02)) < 0.5e-3
    assert known(0.02, -0.012, vehicle=lag) == pytest.approx([5e-3, 5e-3])


def test_a_delay_between_devices_that_stamp_on_receipt_is_told_of_their_clocks() -> None:
    """Stamps that come late by chance do not know when the devices measured, so that all recordings may show the same delay."""
    rng = np.random.default_rng(5)

    def received(signals: dict[str, Signal]) -> dict[str, Signal]:
        late = {name: np.maximum.accumulate(s.time_s + rng.exponential(1.5e-3, s.time_s.size)) for name, s in signals.items()}
        return {name: Signal(late[name], s.value) for name, s in signals.items()}

    told = synchronised([replace(r, angle=received(r.angle), pressure=received(r.pressure)) for r in shifted(0.02, 0.02)], VEHICLE)
    np.testing.assert_allclose(told.late, (0.02, 0.02), atol=1.5e-3)
    assert len(told.findings) == 2
    assert all(run.on_receipt for run in told.problem.runs)


@pytest.mark.parametrize(
    ("late_s", "deviation_s", "alike"),
    [
        ((0.02, 0.021), 2e-4, True), ((0.02, 0.021), 2e-3, True), ((0.02, 0.021), 2e-2, False), ((0.034, 0.023), 2e-3, False),
        ((0.02, 0.0), 2e-4, False),
    ],
)  # fmt: skip
def test_agreement_that_comes_by_chance_is_no_delay_of_the_machine(late_s: tuple[float, float], deviation_s: float, alike: bool) -> None:
    """Clocks lie anywhere within some tens of milliseconds: known no better than that, two of them always agree."""
    assert clocks._alike(np.array(late_s), np.full(2, deviation_s)) == alike


def searched(used: list[Recording], named: Effects = ()) -> Finished:
    """A search of recordings of VEHICLE that came to ``named``."""
    problem = Problem(VEHICLE, [prepare(r, VEHICLE) for r in used])
    sigma = np.concatenate([run.sigma for run in problem.runs])
    roles, noise = split(problem), Noise(sigma, np.zeros((1, sigma.size)), 0.0)
    models = [fit(problem, np.where(roles.fit, 1.0 / sigma, 0.0), effects) for effects in ((), named)]
    return Finished(problem, noise, roles, Search(*models, (), (), ()))


def unplugged(recording: Recording, lasts_s: float) -> Recording:
    """A cable that is off for a while in the middle."""

    def off(signal: Signal) -> Signal:
        return Signal(signal.time_s, np.where(np.abs(signal.time_s - 0.5 * signal.time_s[-1]) < 0.5 * lasts_s, 0.0, signal.value))

    return replace(recording, pressure={line: off(s) if line == "main_a" else s for line, s in recording.pressure.items()})


@pytest.mark.parametrize(("lasts_s", "told"), [(0.5, False), (6.0, True)])
def test_what_is_left_out_is_weighed_where_it_is_much(lasts_s: float, told: bool) -> None:
    """Those samples are not used, and with them the model would err by much more."""
    raw = [unplugged(r, lasts_s) for r in sound()]
    used = [inspect(r, VEHICLE).recording for r in raw]
    found = left_out(searched(used), (), raw, used, np.zeros(len(raw)), 1)
    assert bool(found) == told
    for recording, finding in zip(raw, found.values(), strict=False):
        share = lasts_s / float(recording.angle["left"].time_s[-1])
        said, worse, better = (float(n) for n in re.findall(r"([\d.]+)(?: %| N m)", finding.statement))
        assert said / 100.0 == pytest.approx(share, abs=0.02)
        assert worse > 10.0 * better
    of_pieces = left_out(searched(used), (), raw, used, None, 1)
    assert all("was not examined" in finding.statement for finding in of_pieces.values())
    assert of_pieces.keys() == found.keys()


@pytest.mark.parametrize("spoiled", [False, True])
def test_a_name_stands_or_falls_with_what_is_left_out(spoiled: bool) -> None:
    """Viscous friction that is there: sound samples that were left out speak for it, those of a cable that was off hide it."""
    viscous = EffectEntry("viscous_friction", {"sigma_2": 8000.0})
    real = record(VEHICLE.replace(effects=(viscous,)), QUICK, 5)
    raw = [unplugged(r, 6.0) if spoiled else r for r in real]
    used = [inspect(unplugged(r, 6.0), VEHICLE).recording for r in real]
    named = [effect("viscous_friction", sigma_2=4000.0)]
    found = left_out(searched(used, named), named, raw, used, np.zeros(len(raw)), 1)
    assert found
    assert all(("would not stand" in finding.statement) == spoiled for finding in found.values())


def test_a_hot_start_is_weather() -> None:
    assert VEHICLE.initial is not None
    hot = VEHICLE.replace(initial=replace(VEHICLE.initial, rubber_temperature_degC=45.0, air_temperature_degC=25.0))
    problem = synchronised(record(hot, QUICK, 6), VEHICLE).problem
    assert wrong_sheet(problem) is None
    found = fit(problem, problem.valid / np.concatenate([run.sigma for run in problem.runs]))
    findings = weather_findings(problem, found)
    assert len(findings) == len(problem.runs)
    for bag in range(len(problem.runs)):
        assert problem.temperatures(bag, found.x)[0] == pytest.approx(45.0, abs=12.0)


def test_rubber_may_be_as_hot_as_an_hour_of_steering_makes_it() -> None:
    """As it is where a piece of a long recording begins."""
    assert VEHICLE.initial is not None
    hot = VEHICLE.replace(initial=replace(VEHICLE.initial, rubber_temperature_degC=80.0))
    problem = Problem(VEHICLE, [prepare(r, VEHICLE) for r in record(hot, QUICK, 6)], ())
    found = fit(problem, problem.sensor_weight)
    for bag in range(len(problem.runs)):
        rubber, air = problem.temperatures(bag, found.x)
        assert rubber == pytest.approx(80.0, abs=3.0)
        assert air == pytest.approx(VEHICLE.initial.air_temperature_degC, abs=15.0)


@pytest.mark.parametrize(("factor", "times"), [(10.0, 0.1), (0.1, 10.0), (3.0, 0.33)])
def test_a_wrong_load_is_told_first(factor: float, times: float) -> None:
    result = diagnose_recordings(sound()[:1], with_load(factor)).json
    assert (result["verdict"], result["effects"]) == ("insufficient_data", [])
    (entry,) = [f for f in result["data_quality"] if f["finding"] == "wrong_sheet"]
    assert "axle.load_N" in [suspect["key"] for suspect in entry["suspects"][:3]]
    load = next(suspect for suspect in entry["suspects"] if suspect["key"] == "axle.load_N")
    assert load["factor"] == pytest.approx(times, rel=0.25)


def test_physics_that_leaves_less_than_a_suspected_entry_is_named_instead() -> None:
    """A heat path left out drives friction and capacity far from the sheet; a mistyped load does too, and no name excuses it."""
    warmed = VEHICLE.replace(effects=(EffectEntry("heat_partition", {"ground_share": 0.7}),))
    problem, mistyped = (synchronised(record(warmed, QUICK, 6), sheet).problem for sheet in (VEHICLE, with_load(0.5)))
    named = [effect("heat_partition", ground_share=0.5)]

    def suspected(cost: float, stuck: bool = False, rest: float = 0.5) -> WrongSheet:
        return WrongSheet(1.0, (Suspect("axle.load_N", 1.2, 0.01, cost),), stuck=stuck, rest=rest)

    assert physics_instead(problem, named, suspected(1e9))
    assert not physics_instead(problem, named, suspected(0.0))
    assert physics_instead(problem, named, suspected(1e9, stuck=True))  # though recalibration alone stops at its bounds
    assert not physics_instead(problem, named, suspected(1e9, stuck=True, rest=0.01))  # another entry explains all
    assert not physics_instead(problem, [], suspected(1e9))
    assert not physics_instead(mistyped, named, suspected(1e9))
    assert not physics_instead(mistyped, named, suspected(1e9, stuck=True))


def test_entries_that_are_as_good_as_the_third_are_told_beside_it() -> None:
    costs = {"axle.load_N": 100.0, "friction.coulomb": 101.0, "knuckle_m": 102.0, "bore_m": 110.0, "rod_m": 113.0}
    told = WrongSheet(1.8, tuple(Suspect(key, 0.8, 0.06, cost) for key, cost in costs.items())).statement
    assert [key in told for key in costs] == [True, True, True, True, False]
    assert "rod_m" not in WrongSheet(1.8, (Suspect("axle.load_N", 0.8, 0.06, 100.0),)).statement


def test_friction_of_another_form_is_no_wrong_sheet() -> None:
    """A presliding twice as soft takes the stiffness far off its sheet, unless the form of the friction law is free to be what does it."""
    assert VEHICLE.friction is not None
    soft = VEHICLE.replace(friction=replace(VEHICLE.friction, stiffness_Nm_per_deg=0.5 * VEHICLE.friction.stiffness_Nm_per_deg))
    problem = synchronised(record(soft, QUICK, 6), VEHICLE).problem
    form = 2.0 * (Problem(soft, problem.runs).predict_all(problem.start()) - problem.predict_all(problem.start()))
    free = problem.bent([form[:, None]])
    suspected = WrongSheet(1.0, (Suspect("axle.load_N", 1.2, 0.01, 1e9),), stuck=False, rest=0.5)
    assert not form_instead(fit(problem, problem.sensor_weight), problem, suspected)
    assert form_instead(fit(free, free.sensor_weight), free, suspected)
    assert not form_instead(fit(free, free.sensor_weight), free, replace(suspected, stuck=True))


@pytest.mark.parametrize("load", [0.5, 2.0])
def test_physics_is_told_beside_a_mistyped_load(load: float) -> None:
    """Viscous friction that is there is there with any load; nothing is named where the load is all that is wrong."""
    viscous, standin = effect("viscous_friction", sigma_2=4000.0), effect("heat_partition", ground_share=0.5)
    for hidden in (False, True):
        real = VEHICLE.replace(effects=(EffectEntry("viscous_friction", {"sigma_2": 8000.0}),) if hidden else ())
        problem = synchronised(record(real, QUICK[:1], 6), with_load(load)).problem
        wrong = wrong_sheet(problem)
        assert wrong is not None
        assert not wrong.stuck
        assert physics_beside(problem, [viscous], wrong) == hidden
        assert not physics_beside(problem, [standin], wrong)
        assert not physics_beside(problem, [], wrong)
        assert not physics_beside(problem, [viscous], replace(wrong, stuck=True))


def mistyped(*names: str) -> Vehicle:
    assert VEHICLE.hydraulics is not None
    cylinders = VEHICLE.hydraulics.cylinders
    typed = {name: replace(cylinders[name], bore_m=1.1 * cylinders[name].bore_m) for name in names}
    return VEHICLE.replace(hydraulics=replace(VEHICLE.hydraulics, cylinders={**cylinders, **typed}))


def test_the_bore_of_one_cylinder_is_found() -> None:
    found = wrong_entry(synchronised(sound(), mistyped("left_main")).problem)
    assert found is not None
    assert found.suspects[0].key == "hydraulics.cylinders.left_main.bore_m"
    assert found.suspects[0].factor == pytest.approx(1.0 / 1.1, rel=0.02)


@pytest.mark.parametrize("noise", [1e-4, 1e-2])
def test_the_noise_of_a_slow_channel_is_not_its_motion(noise: float) -> None:
    """10 Hz, and a start or a stop in nearly every second: up to 0.05 rad between samples, of which not thrice the noise is left."""
    rng = np.random.default_rng(4)
    time = np.arange(0.0, 120.0, 0.1)
    rate = np.repeat(rng.uniform(-0.5, 0.5, 120) * (rng.random(120) > 0.4), 10)
    seen = np.cumsum(rate) * 0.1 + 0.1 * np.sin(4.0 * time) + noise * rng.standard_normal(time.size)
    assert 0.7 * noise < own_noise(Signal(time, seen)) < 2.5 * noise


def test_the_noise_of_a_torque_is_not_its_jumps_at_reversals() -> None:
    """Friction of 1 N m without presliding at 100 Hz, reversed three times a second: a fifth of the differences hold a jump. Then half of
    the time with three times the noise."""
    rng, time = np.random.default_rng(4), np.arange(0.0, 60.0, 0.01)
    signal = Signal(time, np.sign(np.sin(3.0 * np.pi * time)) + 0.02 * rng.standard_normal(time.size))
    assert white_noise(signal) > 0.1
    assert 0.018 < sensed(signal, jumps=True).noise < 0.028
    assert (louder(signal, 0.02, by_level=True, jumps=True) == 1.0).all()
    rough = replace(signal, value=signal.value + (time > 30.0) * 0.06 * rng.standard_normal(time.size))
    assert louder(rough, 0.02, by_level=True, jumps=True)[time > 32.0].min() > 1.5


def other_cylinders(changed: dict[str, dict[str, Any]]) -> Vehicle:
    assert VEHICLE.hydraulics is not None
    cylinders = VEHICLE.hydraulics.cylinders
    wrong = {name: replace(cylinders[name], **fields) for name, fields in changed.items()}
    return VEHICLE.replace(hydraulics=replace(VEHICLE.hydraulics, cylinders={**cylinders, **wrong}))


def pivots_of(name: str) -> dict[str, Any]:
    assert VEHICLE.hydraulics is not None
    cylinder = VEHICLE.hydraulics.cylinders[name]
    return {"chassis_m": cylinder.chassis_m, "knuckle_m": cylinder.knuckle_m}


@pytest.mark.parametrize(
    ("wrong", "key", "factor"),
    [
        (lambda: with_friction(stribeck_speed_deg_s=1.5 * np.pi / 180.0), "friction.stribeck_speed_deg_s", 180.0 / np.pi),
        (lambda: with_friction(stribeck_speed_deg_s=1.5 * 6.0), "friction.stribeck_speed_deg_s", 1.0 / 6.0),
        (lambda: with_friction(stiffness_Nm_per_deg=5393.7 * 57.3), "friction.stiffness_Nm_per_deg", 1.0 / 57.3),
        (lambda: with_friction(static=1.4), "friction.static", 0.85 / 1.4),
        (lambda: other_cylinders({"right_aux": {"bore_m": 0.04, "rod_m": 0.02}}), "hydraulics.cylinders.right_aux.bore_m and .rod_m", 2.0),
        (lambda: other_cylinders({"right_aux": {"bore_m": 0.04}}), "hydraulics.cylinders.right_aux.bore_m", 2.0),
        (lambda: other_cylinders({"left_main": {"knuckle_m": (-0.377, 0.06)}}), "hydraulics.cylinders.left_main.knuckle_m (x)", 1.0 / 1.3),
        (lambda: other_cylinders({"left_main": {"chassis_m": (-0.62, -0.44)}}), "hydraulics.cylinders.left_main.chassis_m (y)", 1.5),
        (
            lambda: other_cylinders({"left_main": pivots_of("left_aux"), "left_aux": pivots_of("left_main")}),
            "hydraulics.cylinders: chassis_m and .knuckle_m of left_main and left_aux exchanged", None,
        ),
        (
            lambda: other_cylinders({"right_main": {"bore_m": 0.08, "rod_m": 0.04}, "right_aux": {"bore_m": 0.09, "rod_m": 0.045}}),
            "hydraulics.cylinders: bore_m and .rod_m of right_main and right_aux exchanged", None,
        ),
    ],
)  # fmt: skip
def test_whatever_entry_is_wrong_is_among_the_first_suspects(wrong: Callable[[], Vehicle], key: str, factor: float | None) -> None:
    """Units, radii for diameters, a coordinate of a pivot, what two cylinders exchanged; of a stiffness, which moves little, units only.

    One recording is enough for friction, two tell cylinders apart.
    """
    found = wrong_entry(synchronised(sound()[: 1 if "friction" in key else 2], wrong()).problem)
    assert found is not None
    (told,) = (suspect for suspect in found.suspects[:3] if suspect.key == key)
    error = 0.25 if "stiffness" in key else 0.05
    assert told.factor == (None if factor is None else pytest.approx(factor, rel=error))
    assert told.puts_right


def with_friction(**entries: float) -> Vehicle:
    assert VEHICLE.friction is not None
    return VEHICLE.replace(friction=replace(VEHICLE.friction, **entries))


@pytest.mark.parametrize(("lever", "blamed"), [(10.0, True), (-3.0, True), (0.1, False)])
def test_a_name_that_only_takes_back_what_an_entry_claims_is_that_entry(lever: float, blamed: bool) -> None:
    """A lever arm ten times too long needs a jacking torque of the other sign; one too short lacks what a kingpin may well do."""
    assert VEHICLE.axle is not None
    true = VEHICLE.axle.kingpin_lever_arm_m
    problem = synchronised(sound(), VEHICLE.replace(axle=replace(VEHICLE.axle, kingpin_lever_arm_m=lever * true))).problem
    lacking = problem.sheet["aligning_torque"] * (1.0 / lever - 1.0)
    found = wrong_entry(problem, [effect("kingpin_jacking", amplitude=lacking)])
    assert (found is not None) == blamed
    if found is not None:
        assert found.suspects[0].key == "axle.kingpin_lever_arm_m"
        assert found.suspects[0].factor == pytest.approx(1.0 / lever, abs=0.03)


@pytest.mark.parametrize(("taken", "rival", "blamed"), [(0.95, 1.0, True), (0.5, 1.0, False), (0.95, 0.01, False)])
def test_an_entry_that_claims_too_much_takes_what_names_do_or_is_not_blamed(
    taken: float, rival: float, blamed: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where far more is left than either takes, as of friction of another form, next to the same is left by both; nor where the freedoms of
    that form leave far less: then both only make up for it."""
    arms, form = {"linear": 0.0, "quadratic": 0.1}, EffectEntry("payne_softening", {"angle": 0.02, "amplitude": 0.4})
    problem = synchronised(record(VEHICLE.replace(effects=(EffectEntry("moment_arm_error", arms), form)), QUICK, 5), VEHICLE).problem
    thin, _ = sheet.thinned(problem)
    name = [effect("moment_arm_error", **arms)]
    alone, named = sheet._fitted(thin), fit(thin, thin.sensor_weight, name, robust=True)
    assert alone.cost - named.cost < 0.1 * named.cost  # as it is there
    entry = sheet.Suspect("axle.kingpin_lever_arm_m", 0.0, 0.1, alone.cost - taken * (alone.cost - named.cost), claims_more=True)
    monkeypatch.setattr(sheet, "_levels", lambda *_: [sheet._Tried(entry, 0.0, False)])
    monkeypatch.setattr(sheet, "_geometries", lambda *_: [])
    assert (sheet.wrong_entry(problem, name, rival=rival) is not None) == blamed


def test_arms_of_two_cylinders_exchanged_are_told_though_the_torque_is_nothing_like_the_model() -> None:
    exchanged = other_cylinders({"left_main": pivots_of("left_aux"), "left_aux": pivots_of("left_main")})
    result = diagnose_recordings(sound(), exchanged).json
    (entry,) = [f for f in result["data_quality"] if f["finding"] == "wrong_sheet"]
    assert "chassis_m and .knuckle_m of left_main and left_aux exchanged" in entry["suspects"][0]["key"]
    assert result["effects"] == []


def test_physics_that_explains_all_is_no_wrong_arm_though_sensors_are_quieter_than_the_sheet_says() -> None:
    """An error of all arms looks like a wrong bore of one cylinder, but for what noise as large as the sheet's would hide."""
    linear = {"linear": -0.08, "quadratic": 0.0}
    problem = synchronised(record(VEHICLE.replace(effects=(EffectEntry("moment_arm_error", linear),)), QUICK, 5), VEHICLE).problem
    loud = Problem(problem.vehicle, [replace(run, sigma=3.0 * run.sigma) for run in problem.runs], problem.calibrations)
    assert wrong_entry(loud) is not None
    assert wrong_entry(loud, [effect("moment_arm_error", **linear)]) is None


@pytest.mark.parametrize(("factor", "told"), [(0.5, 1.4), (2.0, 0.5)])
def test_arms_that_are_all_measured_from_the_wrong_place_are_suspected_first(factor: float, told: float) -> None:
    """A factor of the knuckle pivots, as coarsely as it is tried: with levers twice as long all pressures do twice the work."""
    assert VEHICLE.hydraulics is not None
    cylinders = VEHICLE.hydraulics.cylinders.items()
    wrong = {name: replace(c, knuckle_m=(factor * c.knuckle_m[0], factor * c.knuckle_m[1])) for name, c in cylinders}
    found = wrong_sheet(synchronised(sound(), VEHICLE.replace(hydraulics=replace(VEHICLE.hydraulics, cylinders=wrong))).problem)
    assert found is not None
    assert (found.suspects[0].key, found.suspects[0].factor) == ("knuckle_m of all cylinders", told)


def test_a_level_far_off_is_no_fault_of_the_wiring() -> None:
    """A fifth of the torque that the sheet expects: a flipped sign and two exchanged lines together would show much the same."""
    assert VEHICLE.friction is not None
    friction = replace(VEHICLE.friction, static=5.0 * VEHICLE.friction.static, coulomb=5.0 * VEHICLE.friction.coulomb)
    assert not any(inspect(recording, VEHICLE.replace(friction=friction)).blocking for recording in sound())


def test_exchanged_lines_of_one_cylinder_are_found() -> None:
    assert VEHICLE.hydraulics is not None
    cylinders = VEHICLE.hydraulics.cylinders
    exchanged = replace(cylinders["left_aux"], cap=cylinders["left_aux"].rod, rod=cylinders["left_aux"].cap)
    wrong = VEHICLE.replace(hydraulics=replace(VEHICLE.hydraulics, cylinders={**cylinders, "left_aux": exchanged}))
    found = wrong_entry(synchronised(sound()[:1], wrong).problem)
    assert found is not None
    assert found.suspects[0].key == "hydraulics.cylinders.left_aux.cap and .rod exchanged"
    assert found.suspects[0].relative_error < 0.01


def test_the_bores_of_one_circuit_are_found_where_it_does_not_always_bear_the_same_share() -> None:
    """Always the same share would be another level of friction, within what recalibration may do."""
    wrong, runs = mistyped("left_main", "right_main"), []
    for run in synchronised(sound(), VEHICLE).problem.runs:
        parts = run.torque_per_line * run.pressure
        main, rest = parts[:2].sum(axis=0), parts[2:].sum(axis=0)
        more = 1.0 + 0.3 * np.sin(run.time)
        less = np.where(np.abs(rest) > 1.0, (main + rest - more * main) / np.where(rest == 0.0, 1.0, rest), 1.0)
        pressure = np.vstack([more * run.pressure[:2], less * run.pressure[2:]])
        runs.append(with_hydraulics(replace(run, pressure=pressure), wrong))
    found = wrong_entry(Problem(wrong, runs))
    assert found is not None
    # The bores of one circuit too wide or those of the other too narrow, and all of them then: the tracks feel the same.
    assert found.suspects[0].key in {f"hydraulics.cylinders.left_{c}.bore_m and right_{c}.bore_m" for c in ("main", "aux")}
    assert wrong_entry(synchronised(sound(), wrong).problem) is None


def test_cylinders_on_common_lines_are_one_circuit() -> None:
    assert VEHICLE.hydraulics is not None
    assert circuits(VEHICLE.hydraulics) == [("left_main", "right_main"), ("left_aux", "right_aux")]
    joined = {name: replace(cylinder, cap="main_a") for name, cylinder in VEHICLE.hydraulics.cylinders.items()}
    assert circuits(replace(VEHICLE.hydraulics, cylinders=joined)) == []


def test_the_right_sheet_is_not_suspected() -> None:
    problem = synchronised(sound(), VEHICLE).problem
    assert wrong_sheet(problem) is None
    assert wrong_entry(problem) is None


@pytest.mark.parametrize(("share", "told"), [(0.03, False), (0.3, True)])
def test_exchanged_plugs_are_told_where_no_other_friction_does_as_much(share: float, told: bool) -> None:
    """Two lines that bear nearly the same: exchanged, they miss the torque by a given share of it."""
    recording, lines = sound()[0], ("main_a", "aux_a")
    run = prepare(recording, VEHICLE)
    gains = dict(zip(VEHICLE.hydraulics.lines, run.gains.sum(axis=0), strict=True))  # type: ignore[union-attr]
    first, second = (gains[line] for line in lines)
    borne = sum(np.interp(run.time, recording.pressure[x].time_s, recording.pressure[x].value) * gains[x] for x in lines)
    missed = share * float(np.std(run.measured)) * np.sqrt(2.0) * np.sin(run.time)
    same, apart = borne / (first + second), missed / (first**2 - second**2)
    pressures = dict(zip(lines, (same - first * apart, same + second * apart), strict=True))
    exchanged = {line: Signal(run.time, value) for line, value in pressures.items()}
    findings = inspect(replace(recording, pressure={**recording.pressure, **exchanged}), VEHICLE).findings
    assert any(finding.finding == "swapped_lines" for finding in findings) == told


def noise(size: float, level: float = 0.0) -> Change:
    return lambda value: level + size * np.random.default_rng(7).standard_normal(value.size)


def half_way(size: float) -> Change:
    """Noise of a sensor that stays where it is from the middle of the recording on."""
    return lambda value: np.where(np.arange(value.size) < value.size // 2, value, noise(size, float(value[value.size // 2]))(value))


DEAD: dict[str, tuple[Callable[[Recording], Recording], str, str]] = {
    "constant pressures": (lambda r: changed(r, pressure=lambda v: np.full(v.size, 5e6)), "dead_sensor", "pressure"),
    "quiet pressures": (lambda r: changed(r, pressure=noise(1.5e4, 5e6)), "dead_sensor", "pressure"),
    "pressures of noise": (lambda r: changed(r, pressure=noise(2e6, 5e6)), "dead_sensor", "pressure"),
    "one quiet pressure": (
        lambda r: replace(r, pressure={**r.pressure, "main_a": changed(r, pressure=noise(1.5e4, 2e6)).pressure["main_a"]}),
        "dead_sensor", "main_a",
    ),
    "frozen angle": (
        lambda r: replace(r, angle={**r.angle, "left": changed(r, angle=noise(2e-4, 0.1)).angle["left"]}), "dead_sensor", "left",
    ),
    "angle frozen half-way": (
        lambda r: replace(r, angle={**r.angle, "right": changed(r, angle=half_way(2e-4)).angle["right"]}), "dead_sensor", "right",
    ),
    "angles frozen half-way": (lambda r: changed(r, angle=half_way(2e-4)), "dead_sensor", "left"),
    "pressure quiet half-way": (
        lambda r: replace(r, pressure={**r.pressure, "aux_b": changed(r, pressure=half_way(1.5e4)).pressure["aux_b"]}),
        "dead_sensor", "aux_b",
    ),
    "one constant pressure": (
        lambda r: replace(r, pressure={**r.pressure, "aux_a": changed(r, pressure=noise(0.0, 2e6)).pressure["aux_a"]}),
        "stuck_sensor", "aux_a",
    ),
    "two constant pressures": (
        lambda r: replace(
            r, pressure={**r.pressure, **{line: changed(r, pressure=noise(0.0, 2e6)).pressure[line] for line in ("aux_a", "aux_b")}}
        ), "stuck_sensor", "aux_b",
    ),
    "one constant angle": (
        lambda r: replace(r, angle={**r.angle, "left": changed(r, angle=noise(0.0, 0.1)).angle["left"]}), "dead_sensor", "left",
    ),
    "one angle twice": (lambda r: replace(r, angle=dict.fromkeys(r.angle, r.angle["left"])), "copied_sensor", "right"),
    "rough angles": (lambda r: changed(r, angle=lambda v: v + noise(np.radians(0.5))(v)), "noisy_sensor", "left"),
    "angles clipped at zero": (lambda r: changed(r, angle=lambda v: np.maximum(v, 0.0)), "dead_sensor", "left"),
    "zeros far off": (lambda r: changed(r, angle=lambda v: v + np.radians(10.0)), "angle_zero", "left"),
}  # fmt: skip


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("fault", DEAD)
def test_dead_sensors_stop_the_diagnosis(fault: str) -> None:
    """One recording is enough, but where a pressure is quiet rather than still."""
    break_it, finding, topic = DEAD[fault]
    result = diagnose_recordings([break_it(r) for r in sound()[: 2 if "quiet pressure" in fault else 1]], VEHICLE).json
    assert (result["verdict"], result["effects"]) == ("insufficient_data", [])
    assert any(f["finding"] == finding and topic in f["topic"] for f in result["data_quality"])


def test_a_copy_that_is_late_now_and_then_is_told_though_nothing_of_it_can_be_used() -> None:
    recording = sound()[1]
    left = recording.angle["left"]
    count = left.time_s.size
    late = (np.random.default_rng(3).random(count) < 0.5) & (np.arange(count) < 0.7 * count)
    copy = Signal(left.time_s, left.value[np.maximum(np.arange(count) - late, 0)])
    found = inspect(replace(recording, angle={"left": left, "right": copy}), VEHICLE).findings
    assert {"friction_memory_lost", "copied_sensor"} <= {f.finding for f in found}
    assert "copied_sensor" not in {f.finding for f in inspect(recording, VEHICLE).findings}


@pytest.mark.parametrize("rate_Hz", [20.0, 50.0, 100.0, 500.0])
def test_noise_is_told_as_that_of_one_sample(rate_Hz: float) -> None:
    """However many of them are averaged for the clock of the pressures: the spread of the noise that is added, counted by itself."""
    size = float(np.radians(1.2))
    recording = simulation("double-cycle", VEHICLE, {"angle_rate_Hz": rate_Hz, "pressure_rate_Hz": 50.0}).recording
    rough = changed(recording, angle=lambda v: v + noise(size)(v))
    spread = float(np.std(rough.angle["left"].value - recording.angle["left"].value))
    said = next(f.statement for f in inspect(rough, VEHICLE).findings if f.finding == "noisy_sensor")
    told = re.search(r"noise of ([0-9.]+) deg per sample", said)
    assert told is not None
    assert float(told[1]) == pytest.approx(np.degrees(spread), rel=0.1)


def test_sound_channels_are_alive() -> None:
    assert all(inspect_dead(recording, VEHICLE) == () for recording in sound())


def test_a_sensor_that_dies_is_told_with_its_instant() -> None:
    recording = DEAD["angle frozen half-way"][0](sound()[0])
    (found,) = inspect_dead(recording, VEHICLE)
    time = recording.angle["right"].time_s
    ((start, end),) = found.intervals_s
    assert start == pytest.approx(float(time[time.size // 2]), abs=1.0)
    assert end == pytest.approx(float(time[-1]), abs=0.1)
    assert f"from {start:.1f} s on" in found.statement


@pytest.mark.parametrize("manoeuvre", ["hold-and-rest", "varied-rates"])
def test_a_part_in_which_little_happens_is_not_dead(manoeuvre: str) -> None:
    """Held, parked, or one sweep at one torque: nothing must have moved there that did not."""
    recording = simulation(manoeuvre, VEHICLE, {}).recording

    def part(signal: Signal, start: float) -> Signal:
        inside = (signal.time_s >= start) & (signal.time_s < start + 5.0)
        return Signal(signal.time_s[inside], signal.value[inside])

    for start in np.arange(0.0, float(recording.angle["left"].time_s[-1]) - 5.0, 2.5):
        cut = replace(
            recording, angle={side: part(s, start) for side, s in recording.angle.items()},
            pressure={line: part(s, start) for line, s in recording.pressure.items()},
        )  # fmt: skip
        assert inspect_dead(cut, VEHICLE) == ()


def test_a_line_at_the_pressure_of_the_supply_is_alive() -> None:
    """Its counterpart does the work of both."""

    def supplied(recording: Recording) -> Recording:
        both = {line: recording.pressure[line] for line in ("main_a", "main_b")}
        time = both["main_a"].time_s
        apart = both["main_b"].value - np.interp(both["main_b"].time_s, time, both["main_a"].value)
        held = {"main_a": Signal(time, noise(1.5e4, 2e7)(time)), "main_b": Signal(both["main_b"].time_s, 2e7 + apart)}
        return replace(recording, pressure={**recording.pressure, **held})

    assert all(inspect_dead(supplied(recording), VEHICLE) == () for recording in sound())


def test_a_part_of_one_sweep_is_in_no_other_unit() -> None:
    def part(signal: Signal) -> Signal:
        inside = (signal.time_s > start) & (signal.time_s < start + 1.2)
        return Signal(signal.time_s[inside], signal.value[inside])

    recording = sound()[0]
    angle = recording.angle["left"]
    moving = np.abs(np.gradient(angle.value, angle.time_s)) > np.radians(5.0)
    start = float(angle.time_s[np.flatnonzero(moving)[0]]) + 0.8
    cut = replace(
        recording, angle={side: part(s) for side, s in recording.angle.items()},
        pressure={line: part(s) for line, s in recording.pressure.items()},
    )  # fmt: skip
    assert inspect(cut, VEHICLE).blocking == ()


def test_three_hours_are_cut_into_pieces() -> None:
    time = np.arange(0.0, 3.0 * 3600.0, 0.5)
    long = Recording("long", 0, {"left": Signal(time, np.sin(0.01 * time))}, {"main_a": Signal(time, time)})
    pieces, findings = in_pieces([long])
    assert sum(float(np.ptp(p.angle["left"].time_s)) for p in pieces) < LONGEST_S
    assert all(float(np.ptp(p.angle["left"].time_s)) == pytest.approx(PIECE_S, abs=1.0) for p in pieces)
    assert "93 % of it is not" in findings["long"].statement
    assert in_pieces([pieces[0]]) == ([pieces[0]], {})


def test_replay_tells_a_sheet_from_sums() -> None:
    estimate = 1e4 * np.sin(np.arange(1000.0))
    for times, told in ((1.0, False), (1.3, False), (9.8, True), (0.2, True), (1e-5, False)):
        measured = times * estimate
        said = sheet_words(
            float(np.sum((measured - estimate) ** 2)), float(np.sum(estimate**2)), float(np.sum(measured**2)), VEHICLE
        )
        assert (said is not None) == told
        assert said is None or f"{times:.2g} times" in said
