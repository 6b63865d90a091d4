# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Cases of the third simulator: a machine, its ground, its drives and its sensors, all drawn from one seed.

Nothing of the truth enters the bags or the sheet. Two cases of one seed and kind share machine, drives and sensor noise.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray
from rosbags.rosbag2 import StoragePlugin

from lugre_steering.proof.bagfile import Topic, write_bag
from lugre_steering.proof.field import hidden as physics
from lugre_steering.proof.field import hydraulics, machine, motion, rubber, sheets
from lugre_steering.proof.field.dirt import STATED, Dirt, draw_clean, draw_dirt, sense
from lugre_steering.proof.field.friction import Cells, Ground, Inside, Turned, turn_track
from lugre_steering.proof.generator import Law, Modulation, Scene, draw_law, modulate
from lugre_steering.proof.made import Hidden, Probe, Wanted, active_intervals, seen_variance, unit
from lugre_steering.proof.sensors import NoiseKind, Samples

Array = NDArray[np.float64]

EPOCH_S = 1_760_000_000
PERIOD_S = 0.01
SHAPE_SHARE = 0.01
"""Ratios count this share of the torque's root mean square as noise: no law is true to less than a percent, so an effect
below that cannot be told from the friction's own shape. Chosen beforehand."""
FASTER, FURTHER = 1.5, 1.1
"""The manoeuvre that nobody recorded."""
DIRTY_KINDS = ("dirty", "single")
WARM_KINDS = ("dirty", "single", "sheet")
LAW = "law"


@dataclass(frozen=True)
class Drive:
    """One bag's motion: mean angle (n,) on the fine grid and the temperatures at its start [degC]; ``name`` of the style."""

    name: str
    mean: Array
    rubber_degC: float
    air_degC: float


@dataclass(frozen=True)
class Setting:
    """All that a case has before anything is hidden."""

    seed: int
    machine: machine.Machine
    ground: Ground
    cells: tuple[Cells, Cells]
    ratios: rubber.Ratios
    valves: hydraulics.Valves
    dirt: Dirt
    drives: tuple[Drive, ...]
    sheet: dict[str, Any]
    zero_rad: float
    law: Law
    mistake: str = ""
    suspects: tuple[str, ...] = ()

    @property
    def torque_scale(self) -> float:
        return 2.0 * self.ground.sliding_Nm


def draw_setting(seed: int, kind: str, noise: NoiseKind, which: int = 0) -> Setting:
    """The machine, ground, sensors and drives of a case; ``which`` chooses among wrong sheets."""
    rng = np.random.default_rng((seed, 3))
    drawn = machine.draw_machine(rng)
    warm = kind in WARM_KINDS
    air = rng.uniform(-20.0, 50.0) if warm else rng.uniform(5.0, 30.0)
    above = [rng.uniform(0.0, 30.0) if warm and rng.random() < 0.6 else 0.0 for _ in range(2)]
    dirt = draw_dirt(noise, rng) if kind in DIRTY_KINDS else draw_clean(noise, rng)
    durations = np.exp(rng.uniform(np.log(30.0), np.log(400.0), 2)) if kind in DIRTY_KINDS else rng.uniform(80.0, 150.0, 2)
    drives = tuple(
        Drive(f"strokes {i + 1}", motion.draw_mean(drawn.limit, float(duration), rng), air + warmth, air)
        for i, (duration, warmth) in enumerate(zip(durations, above, strict=True))
    )
    stated = (15.0, 15.0) if warm else (air, air)
    sheet = machine.sheet_of(drawn, dict(STATED), *stated)  # type: ignore[arg-type]
    setting = Setting(
        seed=seed, machine=drawn, ground=machine.draw_ground(drawn, air, air, rng),
        cells=(machine.draw_cells(drawn, rng), machine.draw_cells(drawn, rng)), ratios=rubber.ratios(drawn.rubber, drawn.reference_degC),
        valves=hydraulics.Valves(rng.uniform(0.0, 0.12), rng.uniform(0.0, 6e5)), dirt=dirt, drives=drives, sheet=sheet, zero_rad=0.0,
        law=draw_law(rng),
    )  # fmt: skip
    if kind != "sheet":
        return setting
    wrong = sheets.mistaken(sheet, which, rng)
    zero = float(rng.choice([-1.0, 1.0]) * rng.uniform(4.0, 10.0)) * motion.DEG if wrong.what == sheets.ANGLE_ZERO else 0.0
    return replace(setting, sheet=wrong.sheet, zero_rad=zero, mistake=wrong.what, suspects=wrong.suspects)


@dataclass(frozen=True)
class Bag:
    """One bag and its truth, see ``made.BagTruth``."""

    manoeuvre: str
    angles: tuple[Samples, ...]
    pressures: tuple[Samples, ...]
    time: Array
    clean_angles: Array
    torque: Array
    torque_without: Array
    effect_torque: dict[str, Array]
    intervals: dict[str, list[tuple[float, float]]]


class Rig:
    """One motion of a setting: runs it with any hidden effects, each contact run once."""

    def __init__(self, setting: Setting, measured: Array, step: float, rubber_degC: float, air_degC: float) -> None:
        self.setting, self.measured, self.step = setting, measured, step
        self.ground = setting.ground._replace(rubber_degC=rubber_degC, air_degC=air_degC)
        self.time = np.arange(measured.shape[1], dtype=np.float64) * np.float64(step)
        self.gain = hydraulics.gains(setting.machine, measured)
        self._tracks: dict[tuple[str, ...], list[Turned]] = {}

    def torque(self, hidden: Sequence[Hidden]) -> Array:
        """Total torque (n,) [N m] that noise-free sensors would show."""
        return hydraulics.torque_of(self.pressures(hidden), self.gain)

    def pressures(self, hidden: Sequence[Hidden]) -> Array:
        """Line pressures (lines, n) [Pa] as noise-free sensors see them."""
        angle, arm = self.measured, None
        for effect in hidden:
            on = _onset(self.time, effect.start_s)
            if effect.id == "angle_offset":
                angle = angle - on * effect.values["offset"]
            elif effect.id == "moment_arm_error":
                arm = 1.0 + on * (effect.values["a"] * np.sin(angle) + 2.0 * effect.values["b"] * (1.0 - np.cos(angle)))
        rate = np.gradient(angle, self.step, axis=1)
        torque = self._through_parallel(angle, rate, hidden).sum(axis=0)
        mean = rate.mean(axis=0)
        for effect in hidden:
            if effect.id in physics.LOSS_LAWS:
                torque = torque + _onset(self.time, effect.start_s) * physics.LOSS_LAWS[effect.id](torque, mean, effect.values)
        seen = hydraulics.pressures(
            self.setting.machine, torque, hydraulics.gains(self.setting.machine, angle, arm), self.setting.valves, mean
        )
        for effect in hidden:
            if effect.id in physics.SENSING_LAWS:
                on = _onset(self.time, effect.start_s)
                seen = seen + on * (physics.SENSING_LAWS[effect.id](seen, self.time, effect.values) - seen)
        return seen

    def _through_parallel(self, angle: Array, rate: Array, hidden: Sequence[Hidden]) -> Array:
        """Torque of both tracks (2, n) with all that acts beside the contact."""
        acceleration = np.gradient(rate, self.step, axis=1)
        law = next((effect for effect in hidden if effect.id == LAW), None)
        change = None if law is None else self._modulation(angle, rate, acceleration, law)
        tracks = self._contact(angle, hidden, change)
        sides = np.stack([track.friction + track.aligning for track in tracks])
        for effect in hidden:
            if effect.id in physics.PARALLEL_LAWS:
                part = physics.PARALLEL_LAWS[effect.id](angle, rate, acceleration, effect.values)
                sides = sides + _onset(self.time, effect.start_s) * part
        return sides if change is None else sides + change.torque

    def _modulation(self, angle: Array, rate: Array, acceleration: Array, law: Hidden) -> Modulation:
        plain = self._contact(angle, [], None)
        scene = Scene(
            self.time, angle, rate, acceleration, np.stack([t.friction + t.aligning for t in plain]),
            np.stack([t.temperature for t in plain]), self.setting.machine.limit, self.setting.torque_scale,
        )  # fmt: skip
        return modulate(self.setting.law, law.values["strength"], scene)

    def _contact(self, angle: Array, hidden: Sequence[Hidden], change: Modulation | None) -> list[Turned]:
        before = [effect for effect in hidden if effect.id in physics.CONTACT or effect.id in physics.ANGLE]
        key = (*(effect.id for effect in before), *([LAW] if change is not None else []))
        if key not in self._tracks:
            inside, ones = _inside(before, self.ground), np.ones(angle.shape)
            level, stiffness = (ones, ones) if change is None else (change.level, change.stiffness)
            self._tracks[key] = [
                turn_track(
                    np.ascontiguousarray(side), self.step, self.ground, self.setting.ratios, cells, inside, np.ascontiguousarray(a),
                    np.ascontiguousarray(b),
                )
                for side, cells, a, b in zip(angle, self.setting.cells, level, stiffness, strict=True)
            ]  # fmt: skip
        return self._tracks[key]


def _onset(time: Array, start_s: float) -> Array:
    return np.asarray(0.5 - 0.5 * np.cos(np.pi * np.clip(time - start_s, 0.0, 1.0)))


def _inside(effects: Sequence[Hidden], ground: Ground) -> Inside:
    fields: dict[str, float] = {}
    for effect in effects:
        if effect.id in physics.CONTACT:
            fields |= {f"{effect.id}_{name}": value for name, value in effect.values.items()}
            fields[f"{effect.id}_from"] = effect.start_s
    for name, size in (("conductance", ground.heat_loss_W_K), ("capacity", ground.heat_capacity_J_K)):
        if f"carcass_heat_sink_{name}" in fields:
            fields[f"carcass_heat_sink_{name}"] *= size
    if "viscous_friction_at_6_deg_s" in fields:
        fields["viscous_friction_at_6_deg_s"] *= 0.5  # drawn for both tracks
    return Inside(**fields)


@dataclass(frozen=True)
class FieldCase:
    """Both bags of a case (see ``made.Made``)."""

    setting: Setting
    hidden: tuple[Hidden, ...]
    bags: tuple[Bag, ...]

    @property
    def limit(self) -> float:
        return self.setting.machine.limit

    def noise_variance(self, bag: int) -> float:
        """Sensor noise, and what no friction law is true to (SHAPE_SHARE)."""
        return self.seen_noise_variance(bag) + float(np.mean((SHAPE_SHARE * self.bags[bag].torque) ** 2))

    def seen_noise_variance(self, bag: int) -> float:
        """Variance of the torque that the sensors show on a common clock about the noise-free one [N2 m2], skews included."""
        machine_ = self.setting.machine
        return seen_variance(
            self.bags[bag], 0.2 * PERIOD_S, lambda seen, angles: hydraulics.torque_of(seen, hydraulics.gains(machine_, angles))
        )

    def tangents(self) -> Array:
        return self._tangents

    @cached_property
    def _tangents(self) -> Array:
        still = self._plain(self.setting.ground)
        names = ("sliding_Nm", "static_ratio", "stiffness_Nm_rad", "stribeck_speed", "heat_capacity_J_K", "heat_loss_W_K")
        moved = [self._plain(self.setting.ground._replace(**{name: 1.01 * getattr(self.setting.ground, name)})) for name in names]
        return np.stack([unit(row - still) for row in moved], axis=1)

    def _plain(self, ground: Ground) -> Array:
        """Torque of all bags in one row for another ground, nothing hidden."""
        setting, rows = replace(self.setting, ground=ground), []
        for bag, drive in zip(self.bags, setting.drives, strict=True):
            rig = Rig(setting, bag.clean_angles, PERIOD_S, drive.rubber_degC, drive.air_degC)
            rows.append(rig.torque([]))
        return np.concatenate(rows)

    def told(self, effect: Hidden) -> dict[str, float | str]:
        if effect.id == LAW:
            return {**effect.values, **self.setting.law.told()}
        lines = self.setting.machine.lines
        return {key: lines[int(value)] if key == "line" else value for key, value in effect.values.items()}

    def probe(self, angles: Array, step: float) -> Probe:
        drive = self.setting.drives[0]
        rig = Rig(self.setting, angles, step, drive.rubber_degC, drive.air_degC)
        always = [effect._replace(start_s=-1e9) for effect in self.hidden]
        return Probe(
            rig.torque(always), {effect.id: rig.torque([h for h in always if h.id != effect.id]) for effect in always}
        )

    def write(self, seen: Path, unseen: Path) -> list[Path]:
        """Bags, sheet and rubber table into ``seen``; the truth, and of a law an unseen manoeuvre, into ``unseen``."""
        for folder in (seen / "bags", unseen):
            folder.mkdir(parents=True, exist_ok=True)
        (seen / "vehicle.yaml").write_text(yaml.safe_dump(self.setting.sheet, sort_keys=False), encoding="utf-8")
        (seen / "rubber.csv").write_text(rubber.table(self.setting.machine.rubber), encoding="utf-8")
        paths = []
        for i, (letter, bag) in enumerate(zip("ab", self.bags, strict=True)):
            paths.append(seen / "bags" / f"run_{letter}")
            self._write(paths[-1], bag, i)
        truth = {effect.id: self.told(effect) for effect in self.hidden}
        (unseen / "truth.json").write_text(json.dumps(truth, indent=1), encoding="utf-8")
        if any(effect.id == LAW for effect in self.hidden):
            drive = self.setting.drives[0]
            quick = replace(drive, name="unseen", mean=motion.hurried(drive.mean, FASTER, FURTHER))
            bag = _bag(self.setting, quick, self.hidden, np.random.default_rng((self.setting.seed, 50)))
            self._write(unseen / "run_unseen", bag, 0)
            np.savez_compressed(unseen / "run_unseen_truth.npz", time=bag.time, torque=bag.torque, torque_without=bag.torque_without)
        return paths

    def _write(self, path: Path, bag: Bag, index: int) -> None:
        setting, dirt = self.setting, self.setting.dirt
        topics = [
            Topic(f"/steering/{side}/joint_state", "angle", f"{side}_track_steer_joint", samples)
            for side, samples in zip(machine.SIDES, bag.angles, strict=True)
        ]
        topics += [
            Topic(f"/steering/pressure/{line}", "pressure", "", samples)
            for line, samples in zip(setting.machine.lines, bag.pressures, strict=True)
        ]
        if dirt.air_topic:
            at = np.arange(0.0, bag.time[-1], 1.0)
            air = np.round(np.full(at.size, setting.drives[index].air_degC), 1)
            topics.append(Topic("/steering/ambient_temperature", "temperature", "", Samples(at, air)))
        plugin = StoragePlugin.SQLITE3 if setting.seed % 3 == 0 else StoragePlugin.MCAP
        write_bag(path, topics, EPOCH_S + 1000 * (setting.seed % 1000) + 500 * index, plugin)


def simulate(setting: Setting, wanted: Sequence[Wanted]) -> FieldCase:
    """Both bags of a setting with the wanted effects hidden in them."""
    rng = np.random.default_rng((setting.seed, 4))
    hidden = tuple(_drawn(setting, one, rng) for one in wanted)
    bags = []
    for i, drive in enumerate(setting.drives):
        here = [effect for effect in hidden if effect.only_bag in (None, i)]
        bags.append(_bag(setting, drive, here, np.random.default_rng((setting.seed, 30 + i))))
    return FieldCase(setting, hidden, tuple(bags))


def _drawn(setting: Setting, wanted: Wanted, rng: np.random.Generator) -> Hidden:
    start = -1e9 if wanted.from_time_s is None else wanted.from_time_s
    if wanted.id == LAW:
        return Hidden(LAW, {"strength": wanted.strength}, wanted.only_bag, start)
    drawn = physics.draw(
        wanted.id, wanted.strength, wanted.barely, setting.torque_scale, setting.machine.limit, len(setting.machine.lines), rng
    )
    return drawn._replace(only_bag=wanted.only_bag, start_s=start)


def _bag(setting: Setting, drive: Drive, hidden: Sequence[Hidden], rng: np.random.Generator) -> Bag:
    """Run a drive and let the sensors see it; a cut recording begins in the middle of a motion."""
    measured = machine.track_angles(setting.machine, drive.mean)
    rig = Rig(setting, measured, motion.STEP_S, drive.rubber_degC, drive.air_degC)
    cut = slice(int(setting.dirt.cut_share * measured.shape[1]), None)
    clean = rig.pressures(hidden)[:, cut]
    gain = rig.gain[:, cut]
    time = rig.time[cut] - rig.time[cut][0]
    every = round(PERIOD_S / motion.STEP_S)
    torque = hydraulics.torque_of(clean, gain)[::every]
    plain = rig.torque([])[cut][::every] if hidden else torque
    added = {
        effect.id: torque - (rig.torque([h for h in hidden if h is not effect])[cut][::every] if len(hidden) > 1 else plain)
        for effect in hidden
    }
    angles, seen = sense(time, measured[:, cut] + setting.zero_rad, clean, setting.dirt, rng)
    coarse = time[::every]
    return Bag(
        drive.name, angles, seen, coarse, measured[:, cut][:, ::every], torque, plain, added,
        {name: active_intervals(coarse, part) for name, part in added.items()},
    )  # fmt: skip
