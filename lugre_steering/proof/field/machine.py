# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Machines of other sizes, with one to four circuits and other linkages: what is true, and the sheet that comes with them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lugre_steering.proof.field.friction import Cells, Ground
from lugre_steering.proof.field.rubber import Rubber, draw_rubber

Array = NDArray[np.float64]

DEG = float(np.pi / 180.0)
SIDES = ("left", "right")
OFF_SHEET = 0.15
"""Friction, stiffness and thermal values differ from the sheet by up to this share."""
ALONG, ACROSS = 3, 2
"""Cells of one roller's footprint."""


@dataclass(frozen=True)
class Ram:
    """A hydraulic cylinder of one side: pivots as complex numbers x + iy [m] from that side's hinge, diameters [m], circuit."""

    side: int
    circuit: int
    chassis: complex
    knuckle: complex
    bore_m: float
    rod_m: float

    def lever(self, angle: Array) -> Array:
        """Lengthening per angle dL/dtheta [m], exact."""
        turned = self.knuckle * np.exp(1j * angle)
        reach = turned - self.chassis
        return np.asarray(np.imag(np.conj(turned) * reach) / np.abs(reach))

    @property
    def cap_pushes_left(self) -> bool:
        return bool(self.lever(np.zeros(1))[0] > 0.0)


@dataclass(frozen=True)
class Machine:
    """One drawn machine (SI): what its sheet says of it, and the angle to which it steers."""

    load_N: float
    wheelbase_m: float
    kingpin_distance_m: float
    kingpin_inclination: float
    kingpin_lever_m: float
    track_weight_N: float
    width_m: float
    hinge_offset_m: float
    roller_x_m: Array
    roller_share: Array
    inertia_kgm2: float
    static: float
    sliding: float
    yield_angle: float
    stribeck_speed: float
    tread_m: float
    area_m2: float
    transfer_W_m2K: float
    limit: float
    ackermann_share: float
    rubber: Rubber
    rams: tuple[Ram, ...]
    circuit_share: Array
    reference_degC: float = 15.0

    @property
    def track_load(self) -> float:
        return 0.5 * self.load_N + self.track_weight_N

    @property
    def lever_sum(self) -> float:
        """Load times radius of all rollers of one track."""
        return float(np.sum(self.track_load * self.roller_share * np.hypot(self.roller_x_m, self.hinge_offset_m)))

    @property
    def lines(self) -> tuple[str, ...]:
        """Line 2 j of circuit j pushes to the left, line 2 j + 1 to the right."""
        return tuple(f"{'abcd'[j]}{end}" for j in range(self.circuit_share.size) for end in (1, 2))

    def chambers(self, ram: Ram) -> tuple[str, str]:
        """Lines at the cap and at the rod."""
        left, right = self.lines[2 * ram.circuit], self.lines[2 * ram.circuit + 1]
        return (left, right) if ram.cap_pushes_left else (right, left)


def draw_machine(rng: np.random.Generator) -> Machine:
    """Any machine from a small carrier to a heavy crane; lengths grow with the cube root of the load."""
    load = float(np.exp(rng.uniform(np.log(2.0e4), np.log(2.2e5))))
    size = (load / 9.0e4) ** (1.0 / 3.0)
    rollers = int(rng.integers(3, 7))
    half = 0.68 * size * rng.uniform(0.85, 1.15)
    share = rng.uniform(0.8, 1.2, rollers)
    spread = np.linspace(-half, half, rollers) + rng.uniform(-0.02, 0.02, rollers) * size
    circuits = int(rng.integers(1, 5))
    machine = Machine(
        load_N=round(load, -2), wheelbase_m=round(3.6 * size * rng.uniform(0.85, 1.2), 2),
        kingpin_distance_m=round(2.1 * size * rng.uniform(0.9, 1.1), 2), kingpin_inclination=round(rng.uniform(3.0, 9.0), 1) * DEG,
        kingpin_lever_m=round(0.09 * size * rng.uniform(0.5, 1.5), 3), track_weight_N=round(load * rng.uniform(0.05, 0.09), -1),
        width_m=round(0.45 * size * rng.uniform(0.8, 1.2), 2), hinge_offset_m=round(0.46 * size * rng.uniform(0.6, 1.2), 3),
        roller_x_m=np.round(spread, 3), roller_share=share / share.sum(),
        inertia_kgm2=round(95.0 * size**5 * rng.uniform(0.7, 1.4), 1), static=0.0, sliding=0.0,
        yield_angle=rng.uniform(3.5, 6.0) * DEG, stribeck_speed=round(rng.uniform(1.0, 2.5), 2) * DEG,
        tread_m=round(rng.uniform(0.009, 0.016), 4), area_m2=round(0.42 * size**2 * rng.uniform(0.8, 1.2), 3),
        transfer_W_m2K=round(rng.uniform(12.0, 25.0), 1), limit=rng.uniform(16.0, 27.0) * DEG,
        ackermann_share=rng.uniform(0.7, 1.0), rubber=draw_rubber(rng), rams=(),
        circuit_share=(lambda s: s / s.sum())(rng.uniform(0.7, 1.3, circuits)),
    )  # fmt: skip
    sliding = round(rng.uniform(0.55, 0.8), 2)
    machine = _with(machine, sliding=sliding, static=round(sliding * rng.uniform(1.08, 1.18), 2))
    return _with(machine, rams=_linkage(machine, size, rng))


def _with(machine: Machine, **changes: Any) -> Machine:
    return Machine(**{**machine.__dict__, **changes})


def _linkage(machine: Machine, size: float, rng: np.random.Generator) -> tuple[Ram, ...]:
    """A ram per side and circuit, before or behind the hinge, sized for 7 to 11 MPa while sliding; left and right mirrored."""
    rams: list[Ram] = []
    needed = machine.sliding * machine.lever_sum / machine.circuit_share.size
    for circuit in range(machine.circuit_share.size):
        tried = [_ram(size, circuit, needed, rng) for _ in range(60)]
        ram = max(tried, key=lambda r: _evenness(r, 1.3 * machine.limit))
        rams += [ram, Ram(1, circuit, ram.chassis.conjugate(), ram.knuckle.conjugate(), ram.bore_m, ram.rod_m)]
    return tuple(rams)


def _ram(size: float, circuit: int, torque: float, rng: np.random.Generator) -> Ram:
    ahead, outward = (1.0 if circuit % 2 else -1.0), rng.choice([-1.0, 1.0])
    knuckle = size * complex(ahead * rng.uniform(0.24, 0.36), -outward * rng.uniform(0.0, 0.12))
    chassis = size * complex(ahead * rng.uniform(0.5, 0.8), -outward * rng.uniform(0.5, 0.85))
    bore = round(float(np.sqrt(torque / (rng.uniform(7e6, 11e6) * 0.85 * abs(knuckle)) * 4.0 / np.pi)), 3)
    return Ram(0, circuit, _millimetres(chassis), _millimetres(knuckle), bore, round(bore * rng.uniform(0.4, 0.6), 3))


def _evenness(ram: Ram, limit: float) -> float:
    """Smallest over largest lever within the limit: below zero the ram would pass its dead centre."""
    lever = ram.lever(np.linspace(-limit, limit, 41)) * (1.0 if ram.cap_pushes_left else -1.0)
    return float(lever.min() / lever.max())


def _millimetres(place: complex) -> complex:
    return complex(round(place.real, 3), round(place.imag, 3))


def track_angles(machine: Machine, mean: Array) -> Array:
    """Left and right angle (2, n) [rad]: a trapeze that comes near Ackermann's geometry, never quite."""
    ratio = machine.ackermann_share * 0.5 * machine.kingpin_distance_m / machine.wheelbase_m
    return np.stack([np.arctan(np.tan(mean) / (1.0 - ratio * np.tan(mean))), np.arctan(np.tan(mean) / (1.0 + ratio * np.tan(mean)))])


def draw_ground(machine: Machine, rubber_degC: float, air_degC: float, rng: np.random.Generator) -> Ground:
    """True friction of the machine on its ground: near the sheet in size, of another form."""

    def near(value: float, off: float = OFF_SHEET) -> float:
        return value * (1.0 + rng.uniform(-off, off))

    sliding = near(machine.sliding) * machine.lever_sum
    number = rng.uniform(6.0, 40.0, 3)
    amplitude = rng.uniform(0.01, 0.02) * np.sqrt(2.0 / 3.0) * np.ones(3)  # 1 to 2 % root mean square together
    return Ground(
        sliding_Nm=sliding, static_ratio=1.0 + near(machine.static / machine.sliding - 1.0, 0.3),
        stiffness_Nm_rad=near(machine.sliding * machine.lever_sum / machine.yield_angle),
        stribeck_speed=near(machine.stribeck_speed), stribeck_exponent=float(rng.uniform(0.5, 2.0)),
        sharpness=float(np.exp(rng.uniform(np.log(0.75), np.log(1.5)))), rate_strengthening=float(rng.uniform(0.01, 0.04)),
        direct_share=float(rng.uniform(0.0, 0.3)), follow_angle=float(rng.uniform(0.1, 0.5)) * DEG,
        quick_share=float(rng.uniform(0.04, 0.15)), quick_time=float(rng.uniform(0.03, 0.1)),
        waves=np.stack([amplitude, number, rng.uniform(0.0, 2.0 * np.pi, 3)], axis=1),
        heat_capacity_J_K=near(1120.0 * 1750.0 * machine.area_m2 * machine.tread_m),
        heat_loss_W_K=near(machine.transfer_W_m2K * machine.area_m2), rubber_degC=rubber_degC, air_degC=air_degC,
        aligning_Nm=machine.track_load * machine.kingpin_lever_m * np.sin(machine.kingpin_inclination),
    )  # fmt: skip


def draw_cells(machine: Machine, rng: np.random.Generator) -> Cells:
    """Cells of a track: strength as load times radius; stiffness mostly as real contact area, a part as plain area.

    Pressure under a roller is a parabola along the track, higher towards one edge by up to a tenth.
    """
    pitch = float(np.min(np.diff(machine.roller_x_m)))
    along = (np.arange(ALONG) + 0.5) / ALONG - 0.5
    parabola = 1.0 - (2.0 * along) ** 2 * 0.8
    across = ((np.arange(ACROSS) + 0.5) / ACROSS - 0.5) * machine.width_m
    edge = rng.uniform(-0.1, 0.1)
    strength, area = [], []
    for x, share in zip(machine.roller_x_m, machine.roller_share, strict=True):
        for a, p in zip(along, parabola, strict=True):
            for b in across:
                radius = np.hypot(x + a * pitch, machine.hinge_offset_m + b)
                strength.append(share * p / parabola.sum() / ACROSS * (1.0 + edge * np.sign(b)) * radius)
                area.append(radius**2)
    s, k = np.array(strength) / np.sum(strength), np.array(area) / np.sum(area)
    plain = rng.uniform(0.0, 0.25)
    mixed = s ** (1.0 - plain) * k**plain
    return Cells(s, mixed / mixed.sum())


def sheet_of(machine: Machine, sensors: dict[str, float], rubber_degC: float, air_degC: float) -> dict[str, Any]:
    """The vehicle file that the maker and the test crew would write, right in all that can be measured."""
    cylinders = {}
    for ram in machine.rams:
        cap, rod = machine.chambers(ram)
        cylinders[f"{SIDES[ram.side]}_{'abcd'[ram.circuit]}"] = {
            "side": SIDES[ram.side], "chassis_m": [ram.chassis.real, ram.chassis.imag],
            "knuckle_m": [ram.knuckle.real, ram.knuckle.imag], "bore_m": ram.bore_m, "rod_m": ram.rod_m, "cap": cap, "rod": rod,
        }  # fmt: skip
    share = [round(float(value), 4) for value in machine.roller_share]
    share[0] = round(1.0 - sum(share[1:]), 4)
    return {
        "schema": "lugre_steering/vehicle/1", "name": f"carrier, front axle {machine.load_N / 1e3:.0f} kN",
        "axle": {
            "load_N": machine.load_N, "wheelbase_m": machine.wheelbase_m, "kingpin_distance_m": machine.kingpin_distance_m,
            "kingpin_inclination_deg": round(machine.kingpin_inclination / DEG, 2), "kingpin_lever_arm_m": machine.kingpin_lever_m,
        },
        "track": {
            "weight_N": machine.track_weight_N, "width_m": machine.width_m, "hinge_offset_m": machine.hinge_offset_m,
            "rollers": {"x_m": [float(x) for x in machine.roller_x_m], "load_share": share},
            "ground_pressure_exponent": 3.0, "yaw_inertia_kgm2": machine.inertia_kgm2, "damping_ratio": 0.5,
        },
        "friction": {
            "pavement": "dry_concrete", "static": machine.static, "coulomb": machine.sliding,
            "stiffness_Nm_per_deg": round(machine.sliding * machine.lever_sum / machine.yield_angle * DEG, 1),
            "stribeck_speed_deg_s": round(machine.stribeck_speed / DEG, 3), "stribeck_exponent": 2.0,
            "reference_temperature_degC": machine.reference_degC,
        },
        "rubber": {
            "dma_csv": "rubber.csv", "dma_frequency_Hz": 10.0, "density_kg_m3": 1120.0, "specific_heat_J_kgK": 1750.0,
            "tread_thickness_m": machine.tread_m, "contact_area_m2": machine.area_m2, "heat_transfer_W_m2K": machine.transfer_W_m2K,
        },
        "initial": {"rubber_temperature_degC": round(rubber_degC, 1), "air_temperature_degC": round(air_degC, 1)},
        "hydraulics": {"lines": list(machine.lines), "cylinders": cylinders},
        "sensors": sensors, "effects": [],
    }  # fmt: skip
