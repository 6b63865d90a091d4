# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The second simulator: recordings of a drawn vehicle with known hidden physics, made without the estimator's code.

A case is two bags of one vehicle. It is a pure function of the sheet and of ``Case``; two cases that differ only in
their effects share vehicle, manoeuvres and sensor noise. Nothing about the effects enters the bags; the truth is
written apart.
"""

from __future__ import annotations

import json
import shutil
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.rosbag2 import StoragePlugin

from lugre_steering.proof import conceal, hydraulics, manoeuvres
from lugre_steering.proof.bagfile import Topic, write_bag
from lugre_steering.proof.conceal import EFFECT_IDS, UNLISTED_IDS, Concealed, FineMotion
from lugre_steering.proof.contact import HiddenContact, Patches, TrackSeries, patches, run_track
from lugre_steering.proof.generator import Law, Modulation, Scene, draw_law, modulate
from lugre_steering.proof.made import Hidden, Probe, active_intervals, removable_of, unit
from lugre_steering.proof.rubber import rubber_table
from lugre_steering.proof.sensors import PERIOD_S, Habits, NoiseKind, Samples, draw_habits, sense_angle, sense_pressures
from lugre_steering.proof.vehicle_draw import Sheet, TrueVehicle, draw_vehicle, load_sheet

__all__ = [
    "EFFECT_IDS", "UNLISTED_IDS", "BagData", "Case", "CaseData", "Concealed", "load_sheet", "noise_variance",
    "removable_variance", "simulate_case", "tangents", "write_case",
]

Array = NDArray[np.float64]

EPOCH_S = 1_790_000_000
LAW = "law"
FASTER, FURTHER = 1.5, 1.1  # the manoeuvre that nobody recorded
_FINE = round(PERIOD_S / manoeuvres.STEP_S)


@dataclass(frozen=True)
class Case:
    """A recipe: everything is drawn from ``seed``; ``parameter_spread`` is how far true values leave the sheet.

    ``law``: strength of a generated law (``generator``) to hide as well.
    """

    seed: int
    effects: tuple[Concealed, ...] = ()
    noise: NoiseKind = "white"
    manoeuvres: tuple[str, str] | None = None
    parameter_spread: float = 0.15
    law: float | None = None


@dataclass(frozen=True)
class BagData:
    """One bag and its truth. ``angles`` left, right; ``pressures`` in the sheet's order of lines.

    On the clean 100 Hz grid ``time`` (n,) [s]: the torque [N m] that noise-free sensors would show with every effect,
    with none, and the part that each effect adds. ``intervals`` [s]: where each effect acts, holds included.
    """

    manoeuvre: str
    angles: tuple[Samples, ...]
    pressures: tuple[Samples, ...]
    time: Array
    clean_angles: Array
    torque: Array
    torque_without: Array
    effect_torque: dict[str, Array]
    intervals: dict[str, list[tuple[float, float]]]


@dataclass(frozen=True)
class CaseData:
    """Both bags of a case with the vehicle and the effects that made them."""

    case: Case
    sheet: Sheet
    vehicle: TrueVehicle
    patches: tuple[Patches, Patches]
    hidden: tuple[Hidden, ...]
    bags: tuple[BagData, ...]
    law: Law
    line_share: Array
    return_flow_Pas: float
    habits: Habits


@dataclass(frozen=True)
class _Bench:
    """What the runs of one bag have in common: clean measured angles (2, n) and the habits of its hydraulics."""

    sheet: Sheet
    patches: tuple[Patches, Patches]
    time: Array
    measured: Array
    line_share: Array
    return_flow_Pas: float
    seed: tuple[int, int]
    law: Law


def simulate_case(case: Case, sheet: Sheet) -> CaseData:
    """Simulate both bags of a case, with, without, and (for pairs) with all but each of its effects."""
    vehicle_rng, effect_rng, logger_rng = (np.random.default_rng((case.seed, k)) for k in range(3))
    vehicle = draw_vehicle(sheet, vehicle_rng, case.parameter_spread)
    both = (patches(sheet, vehicle_rng), patches(sheet, vehicle_rng))
    share = np.array([vehicle_rng.uniform(0.9, 1.0) if line.startswith("aux") else 1.0 for line in sheet.lines])
    flow = vehicle_rng.uniform(0.0, 8e5)
    hidden = tuple(_place_patch(conceal.draw(wanted, effect_rng), effect_rng) for wanted in case.effects)
    if case.law is not None:
        hidden = (*hidden, Hidden(LAW, {"strength": case.law}, None, -1e9))
    law, habits = draw_law(np.random.default_rng((case.seed, 5))), draw_habits(logger_rng)
    kinds = case.manoeuvres or tuple(str(kind) for kind in logger_rng.choice(list(manoeuvres.KINDS), 2, replace=False))
    benches: list[_Bench] = []
    for index, kind in enumerate(kinds):
        mean = manoeuvres.mean_angle(kind, np.random.default_rng((case.seed, 10 + index)))
        benches.append(_bench(sheet, both, mean, share, flow, (case.seed, 20 + index), law))
    hidden = tuple(_set_ceiling(effect, vehicle, benches) for effect in hidden)
    bags = []
    for index, (kind, bench) in enumerate(zip(kinds, benches, strict=True)):
        rng = np.random.default_rng((case.seed, 30 + index))
        here = [effect for effect in hidden if effect.only_bag in (None, index)]
        bags.append(_bag(kind, bench, vehicle, here, case.noise, habits, rng))
    return CaseData(case, sheet, vehicle, both, hidden, tuple(bags), law, share, flow, habits)


def _bench(
    sheet: Sheet, both: tuple[Patches, Patches], mean: Array, share: Array, flow: float, seed: tuple[int, int], law: Law
) -> _Bench:
    angles = manoeuvres.ackermann(mean, sheet.wheelbase_m, sheet.kingpin_distance_m)
    time = np.arange(mean.size, dtype=np.float64) * np.float64(manoeuvres.STEP_S)
    return _Bench(sheet, both, time, angles, share, flow, seed, law)


def unseen_bag(data: CaseData) -> BagData:
    """The motion of the first bag quicker and wider, with all that is hidden: what nobody recorded."""
    rng = np.random.default_rng((data.case.seed, 10))
    mean = manoeuvres.mean_angle(data.bags[0].manoeuvre, rng)
    mean = FURTHER * np.interp(np.arange(0.0, mean.size - 1.0, FASTER), np.arange(mean.size), mean)
    bench = _bench(data.sheet, data.patches, mean, data.line_share, data.return_flow_Pas, (data.case.seed, 40), data.law)
    return _bag("unseen", bench, data.vehicle, list(data.hidden), data.case.noise, data.habits, np.random.default_rng((data.case.seed, 50)))


def probe(data: CaseData, angles: Array) -> Probe:
    """The case's vehicle with everything hidden, from the start and in every bag, on other angles (2, n) [rad] at STEP_S."""
    time = np.arange(angles.shape[1], dtype=np.float64) * np.float64(manoeuvres.STEP_S)
    bench = _Bench(data.sheet, data.patches, time, angles, data.line_share, data.return_flow_Pas, (data.case.seed, 41), data.law)
    always, tracks = [effect._replace(start_s=-1e9) for effect in data.hidden], dict[tuple[str, ...], tuple[TrackSeries, ...]]()
    gain = hydraulics.line_gain(data.sheet, angles)

    def torque(hidden: list[Hidden]) -> Array:
        return hydraulics.torque_of(_pressures(bench, data.vehicle, hidden, tracks), gain)

    return Probe(torque(always), {effect.id: torque([h for h in always if h is not effect]) for effect in always})


def _place_patch(effect: Hidden, rng: np.random.Generator) -> Hidden:
    """Give a surface patch its window: mostly an angle window, sometimes a stretch of time (rad or s, and its edge)."""
    if effect.id != "surface_patch":
        return effect
    if effect.values["low"] > 0.0:  # already placed at the edge
        return effect._replace(values={**effect.values, "high": 1.0, "edge": 0.012})
    in_time = rng.random() < 0.4
    low, high = (rng.uniform(25.0, 40.0), rng.uniform(55.0, 70.0)) if in_time else np.deg2rad(
        rng.choice([[3.0, 14.0], [-15.0, -4.0], [-8.0, 5.0], [9.0, 22.0]]) + rng.uniform(-2.0, 2.0)
    )
    window = {"low": float(low), "high": float(high), "edge": 0.8 if in_time else 0.012, "in_time": float(in_time)}
    return effect._replace(values={**effect.values, **window})


def _set_ceiling(effect: Hidden, vehicle: TrueVehicle, benches: list[_Bench]) -> Hidden:
    """Put a relief valve a little below the highest pressure of the case."""
    if effect.id != "relief_saturation":
        return effect
    peak = max(float(_pressures(bench, vehicle, [], {}).max()) for bench in benches)
    return effect._replace(values={**effect.values, "ceiling": peak * (1.0 - effect.values["margin"])})


def _bag(
    kind: str, bench: _Bench, vehicle: TrueVehicle, hidden: list[Hidden], noise: NoiseKind, habits: Habits,
    rng: np.random.Generator,
) -> BagData:
    tracks: dict[tuple[str, ...], tuple[TrackSeries, ...]] = {}
    gain = hydraulics.line_gain(bench.sheet, bench.measured)
    pressures = _pressures(bench, vehicle, hidden, tracks)
    torque = hydraulics.torque_of(pressures, gain)[::_FINE]
    plain = hydraulics.torque_of(_pressures(bench, vehicle, [], tracks), gain)[::_FINE]
    time = bench.time[::_FINE]
    added = {}
    for effect in hidden:
        others = [h for h in hidden if h is not effect]
        without = hydraulics.torque_of(_pressures(bench, vehicle, others, tracks), gain)[::_FINE] if others else plain
        added[effect.id] = torque - without
    return BagData(
        manoeuvre=kind,
        angles=tuple(sense_angle(bench.sheet, bench.time, angle, habits, rng) for angle in bench.measured),
        pressures=tuple(sense_pressures(bench.sheet, bench.time, pressures, noise, habits, rng)),
        time=time,
        clean_angles=bench.measured[:, ::_FINE],
        torque=torque,
        torque_without=plain,
        effect_torque=added,
        intervals={name: active_intervals(time, part) for name, part in added.items()},
    )


def _pressures(
    bench: _Bench, vehicle: TrueVehicle, hidden: list[Hidden], tracks: dict[tuple[str, ...], tuple[TrackSeries, ...]]
) -> Array:
    """Noise-free pressures (lines, n) [Pa] as the line sensors see them; ``tracks`` remembers contact runs."""
    time, step = bench.time, manoeuvres.STEP_S
    angle, arm_factor = bench.measured, None
    for effect in hidden:
        on = conceal.gate(time, effect.start_s)
        if effect.id == "angle_offset":
            angle = angle - on * effect.values["offset"]
        elif effect.id == "angle_scale":
            angle = angle / (1.0 + on * effect.values["scale"])
        elif effect.id == "moment_arm_error":
            arm_factor = 1.0 + on * (effect.values["a"] * bench.measured + effect.values["b"] * bench.measured**2)
    rate = np.gradient(angle, step, axis=1)
    motion = FineMotion(time, angle, rate, np.gradient(rate, step, axis=1))
    law = next((effect for effect in hidden if effect.id == LAW), None)
    change = None if law is None else _modulation(bench, vehicle, motion, law, tracks)
    sides = np.stack([track.friction + track.aligning for track in _contact(bench, vehicle, angle, hidden, change, tracks)])
    if change is not None:
        sides = sides + change.torque
    for effect in hidden:
        if effect.id in conceal.PARALLEL_LAWS:
            chance = np.random.default_rng(bench.seed)
            part = conceal.PARALLEL_LAWS[effect.id](motion, effect.values, chance)
            sides = sides + conceal.gate(time, effect.start_s) * part
    torque = sides.sum(axis=0)
    for effect in hidden:
        if effect.id in conceal.LOSS_LAWS:
            loss = conceal.LOSS_LAWS[effect.id](torque, motion, effect.values)
            torque = torque + conceal.gate(time, effect.start_s) * loss
    gain = hydraulics.line_gain(bench.sheet, angle, arm_factor)
    flow = bench.return_flow_Pas * np.abs(motion.rate.mean(axis=0))
    pressures = hydraulics.line_pressures(torque, gain, bench.line_share, flow)
    for effect in hidden:
        if effect.id == "relief_saturation":  # opens softly: the valve needs some 0.1 MPa to pass its flow
            over = np.logaddexp(0.0, (pressures - effect.values["ceiling"]) / 1e5) * 1e5
            pressures = pressures - conceal.gate(time, effect.start_s) * over
        elif effect.id in conceal.SENSING:
            pressures = conceal.sensed(pressures, time, effect)
    return pressures


def _contact(
    bench: _Bench, vehicle: TrueVehicle, angle: Array, hidden: list[Hidden], change: Modulation | None,
    tracks: dict[tuple[str, ...], tuple[TrackSeries, ...]],
) -> tuple[TrackSeries, ...]:  # fmt: skip
    """Both contacts with what is hidden before and in them; each combination is run once."""
    before = [h for h in hidden if h.id in conceal.ANGLE or h.id in conceal.CONTACT]
    key = (*(h.id for h in before), *([LAW] if change is not None else []))
    if key not in tracks:
        fields: dict[str, float] = {}
        for effect in before:
            if effect.id in conceal.CONTACT:
                fields |= {f"{effect.id}_{name}": value for name, value in effect.values.items()}
                fields[f"{effect.id}_from"] = effect.start_s
        inside, rubber, step = HiddenContact(**fields), rubber_table(vehicle.reference_degC), manoeuvres.STEP_S
        factors = [()] * 2 if change is None else list(zip(change.level, change.stiffness, strict=True))
        tracks[key] = tuple(
            run_track(np.ascontiguousarray(side), step, vehicle, rubber, cells, inside, *map(np.ascontiguousarray, factor))
            for side, cells, factor in zip(angle, bench.patches, factors, strict=True)
        )
    return tracks[key]


def _modulation(
    bench: _Bench, vehicle: TrueVehicle, motion: FineMotion, law: Hidden, tracks: dict[tuple[str, ...], tuple[TrackSeries, ...]]
) -> Modulation:
    """What the generated law does to both tracks, from their torque without it."""
    plain = _contact(bench, vehicle, motion.angle, [], None, tracks)
    torque = np.stack([track.friction + track.aligning for track in plain])
    scene = Scene(
        motion.time, motion.angle, motion.rate, motion.acceleration, torque, np.stack([track.temperature for track in plain]),
        manoeuvres.LIMIT_RAD, 2.0 * vehicle.coulomb_torque_Nm,
    )  # fmt: skip
    return modulate(bench.law, law.values["strength"], scene)


def removable_variance(bag: BagData) -> float:
    """Mean square [N2 m2] of what the effects add to the noise-free torque of a bag: what a perfect diagnosis removes.

    Not taken about its mean: the baseline has no free constant, so a constant torque is error that can be removed.
    """
    return removable_of(bag)


def noise_variance(data: CaseData, bag: BagData) -> float:
    """Variance [N2 m2] of the measured cylinder torque about the noise-free one: pressure noise, ripple included."""
    gain = hydraulics.line_gain(data.sheet, bag.clean_angles)
    seen = np.stack([np.interp(bag.time, samples.time, samples.value) for samples in bag.pressures])
    return float(np.var(hydraulics.torque_of(seen, gain) - bag.torque))


_CALIBRATED = (
    "static_torque_Nm", "coulomb_torque_Nm", "stiffness_Nm_rad", "stribeck_speed_rad_s", "heat_capacity_J_K",
    "heat_loss_W_K",
)


def tangents(data: CaseData) -> Array:
    """Changes of the baseline's torque with each of its calibrated parameters, as unit columns (n, parameters)."""
    nothing_moved = _baseline(data, data.vehicle)
    columns = []
    for name in _CALIBRATED:
        moved = data.vehicle._replace(**{name: 1.01 * getattr(data.vehicle, name)})
        columns.append(_baseline(data, moved) - nothing_moved)
    return np.stack([unit(column) for column in columns], axis=1)


def _baseline(data: CaseData, vehicle: TrueVehicle) -> Array:
    """Torque of all bags in one row, nothing hidden, for another vehicle on the same clean angles."""
    rubber = rubber_table(vehicle.reference_degC)
    torques = []
    for bag in data.bags:
        torque = np.zeros(bag.time.size)
        for angle, cells in zip(bag.clean_angles, data.patches, strict=True):
            track = run_track(np.ascontiguousarray(angle), PERIOD_S, vehicle, rubber, cells, HiddenContact())
            torque += track.friction + track.aligning
        torques.append(torque)
    return np.concatenate(torques)


def write_case(data: CaseData, folder: Path, truth_folder: Path, name: str = "run") -> list[Path]:
    """Write ``folder/bags/<name>_a``, ``_b`` and ``folder/vehicle.yaml`` with its table; the truth to ``truth_folder``.

    Storage is mcap or sqlite3 by the seed. ``truth.json`` holds values and intervals, ``truth.npz`` the clean torques.
    """
    bags = folder / "bags"
    truth: dict[str, Any] = {}
    bags.mkdir(parents=True, exist_ok=True)
    truth_folder.mkdir(parents=True, exist_ok=True)
    sheet_file, table = data.sheet.files
    shutil.copyfile(sheet_file, folder / "vehicle.yaml")
    shutil.copyfile(table, folder / table.name)
    plugin = StoragePlugin.SQLITE3 if data.case.seed % 3 == 0 else StoragePlugin.MCAP
    epoch_s = EPOCH_S + 1000 * (data.case.seed % 1000)
    paths = []
    for letter, bag in zip("ab", data.bags, strict=True):
        path = bags / f"{name}_{letter}"
        _write_bag(path, data.sheet, bag, epoch_s + (500 if letter == "b" else 0), plugin)
        paths.append(path)
        truth[f"{letter}_time"] = bag.time
        truth[f"{letter}_torque"] = bag.torque
        truth[f"{letter}_torque_without"] = bag.torque_without
        truth |= {f"{letter}_{effect}": part for effect, part in bag.effect_torque.items()}
    if data.case.law is not None:
        bag = unseen_bag(data)
        _write_bag(truth_folder / f"{name}_unseen", data.sheet, bag, epoch_s + 900, plugin)
        truth |= {"unseen_time": bag.time, "unseen_torque": bag.torque, "unseen_torque_without": bag.torque_without}
    np.savez_compressed(truth_folder / "truth.npz", **truth)
    (truth_folder / "truth.json").write_text(json.dumps(_truth(data, name), indent=1), encoding="utf-8")
    return paths


def _truth(data: CaseData, name: str) -> dict[str, object]:
    return {
        "synthetic": True,
        "case": asdict(data.case),
        "vehicle": data.vehicle._asdict(),
        "effects": [
            {
                "id": effect.id,
                "parameters": {key: _quantity(data, effect, key) for key in effect.values},
                **({"law": asdict(data.law)} if effect.id == LAW else {}),
                "only_bag": effect.only_bag,
                "start_s": max(effect.start_s, 0.0),
            }
            for effect in data.hidden
        ],
        "bags": {
            f"{name}_{letter}": {
                "manoeuvre": bag.manoeuvre,
                "duration_s": float(bag.time[-1]),
                "intervals_s": bag.intervals,
                "removable_variance": removable_variance(bag),
                "noise_variance": noise_variance(data, bag),
            }
            for letter, bag in zip("ab", data.bags, strict=True)
        },
    }


def _quantity(data: CaseData, effect: Hidden, key: str) -> dict[str, object]:
    if key == "line":
        return {"value": data.sheet.lines[int(effect.values[key])], "unit": "name"}
    if effect.id == LAW:
        return {"value": effect.values[key], "unit": "1"}
    measure = "Pa" if key == "ceiling" else conceal.CATALOGUE[effect.id][key].unit
    return {"value": effect.values[key], "unit": measure}


def _write_bag(path: Path, sheet: Sheet, bag: BagData, epoch_s: int, plugin: StoragePlugin) -> None:
    topics = [
        Topic(f"/steering/{side}/joint_state", "angle", f"{side}_track_steer_joint", samples)
        for side, samples in zip(("left", "right"), bag.angles, strict=True)
    ]
    topics += [
        Topic(f"/steering/pressure/{line}", "pressure", "", samples) for line, samples in zip(sheet.lines, bag.pressures, strict=True)
    ]
    write_bag(path, topics, epoch_s, plugin)
