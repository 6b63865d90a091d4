# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A steering axle in closed loop: valve, cylinders and tracks, and the angle controller that a torque can be fed forward to.

Friction is the third simulator's (``proof.field``), which is not of the estimator's form. Each side has a proportional valve (second
order, dead band, flow by the root of the pressure drop), a cylinder with leakage and oil and hoses that give, and a controller:
proportional-integral on the angle, and the valve opening that the planned rate needs. A torque fed forward is the load
pressure to come: it sets the opening for the pressure drop that is left, the leakage, and what the oil takes up. The seals of the
cylinders may rub, as those do that the third simulator hides.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numba import njit

from lugre_steering.proof.field.friction import Cells, Ground, Inside, Standing, standing, turn_step
from lugre_steering.proof.field.machine import Machine
from lugre_steering.proof.field.rubber import Ratios
from lugre_steering.recording import Array

STEP_S = 2.5e-4
SEAL_RAD_S = 0.1 * np.pi / 180.0
P_GAIN, I_GAIN = 5.0, 3.0
"""Of the angle controller [1/s, 1/s2]."""


class Hydraulics(NamedTuple):
    """One side (SI): displacement [m3/rad], supply [Pa], largest flow [m3/s], compliance of oil and hoses [m3/Pa], leakage [m3/s/Pa],
    natural frequency [rad/s] and damping ratio of the valve, dead band (share of its stroke), inertia [kg m2]; a rubber stop from
    an angle [rad] on, with a stiffness [N m/rad]; friction of the seals [N m], and as a share of the load."""

    displacement: float
    supply: float
    flow: float
    compliance: float
    leakage: float
    valve_frequency: float
    valve_damping: float
    dead_band: float
    inertia: float
    stop_angle: float
    stop_stiffness: float
    seal: float = 0.0
    seal_share: float = 0.0


def hydraulics_of(machine: Machine, gain: Array) -> Hydraulics:
    """Typical of the machine's size: sized for 12 MPa at rest friction; ``gain`` (lines,) torque per pressure at straight ahead."""
    displacement = 0.25 * float(np.abs(gain).sum())
    supply = 2.2 * machine.static * machine.lever_sum / displacement
    return Hydraulics(
        displacement=displacement, supply=supply, flow=0.9 * displacement, compliance=0.05 * displacement / supply,
        leakage=0.02 * displacement / supply, valve_frequency=90.0, valve_damping=0.7, dead_band=0.02, inertia=machine.inertia_kgm2,
        stop_angle=0.75 * machine.limit, stop_stiffness=2.0 * machine.sliding * machine.lever_sum,
    )  # fmt: skip


@njit(cache=True)
def _advance(s, command, duration, h, par, track, ground, rubber, cells, hide):
    """One side for ``duration`` [s] with a valve command held; ``s``: angle, rate, load pressure, spool, spool rate, energy."""
    for _ in range(round(duration / h)):
        pull = par.valve_frequency**2 * (command - s[3]) - 2.0 * par.valve_damping * par.valve_frequency * s[4]
        s[4] += h * pull
        s[3] = min(max(s[3] + h * s[4], -1.0), 1.0)
        open_ = np.sign(s[3]) * max(abs(s[3]) - par.dead_band, 0.0)
        left = max(1.0 - np.sign(open_) * s[2] / par.supply, 0.0)
        flow = par.flow * open_ * np.sqrt(left)
        s[5] += h * par.supply * abs(flow)
        friction = turn_step(s[0], s[1], h, track, ground, rubber, cells, hide)
        beyond = abs(s[0]) - par.stop_angle
        stop = np.sign(s[0]) * par.stop_stiffness * beyond * (1.0 + 8.0 * beyond) if beyond > 0.0 else 0.0
        # ``hidden.cylinder_friction``, as a damper of this moment: its sign changes within 0.1 deg/s.
        seal = par.seal + par.seal_share * abs(s[2] * par.displacement)
        x = abs(s[1]) / SEAL_RAD_S
        damper = seal / SEAL_RAD_S / np.sqrt(1.0 + x * x) * (0.95 + 0.1 / (1.0 + 0.1 * x))
        # Implicit in rate and pressure together: the oil is stiff.
        free = s[1] + h / par.inertia * (-friction - stop)
        drawn = s[2] + h / par.compliance * (flow - par.leakage * s[2])
        coupling = h * h * par.displacement**2 / (par.inertia * par.compliance)
        s[1] = (free + h / par.inertia * par.displacement * drawn) / (1.0 + coupling + h / par.inertia * damper)
        s[2] = min(max(drawn - h / par.compliance * par.displacement * s[1], -1.2 * par.supply), 1.2 * par.supply)
        s[0] += h * s[1]


@dataclass
class Side:
    """One side with its controller."""

    par: Hydraulics
    ground: Ground
    rubber: Ratios
    cells: Cells
    state: Array = field(default_factory=lambda: np.zeros(6))
    integral: float = 0.0
    last_Pa: float = 0.0

    def __post_init__(self) -> None:
        self.track: Standing = standing(self.cells, self.ground)

    @property
    def angle(self) -> float:
        return float(self.state[0])

    @property
    def load(self) -> float:
        """Torque [N m] of the cylinders, as their pressures show it."""
        return float(self.state[2]) * self.par.displacement

    def command(self, wanted: float, rate: float, torque: float, period_s: float) -> float:
        """Valve command (-1 ... 1) for a wanted angle [rad] and rate [rad/s], with a torque [N m] fed forward."""
        par = self.par
        load = min(max(torque / par.displacement, -0.95 * par.supply), 0.95 * par.supply)
        flow = par.displacement * rate + par.leakage * load + par.compliance * (load - self.last_Pa) / period_s
        self.last_Pa = load
        open_ = flow / (par.flow * np.sqrt(1.0 - np.sign(flow) * load / par.supply))
        error = wanted - self.angle
        self.integral = min(max(self.integral + I_GAIN * error * period_s, -0.3), 0.3)
        open_ += (P_GAIN * error + self.integral) * par.displacement / par.flow
        return float(min(max(open_ + np.sign(open_) * par.dead_band, -1.0), 1.0))

    def advance(self, command: float, period_s: float) -> None:
        """Let the side move for one period."""
        _advance(
            self.state, command, period_s, STEP_S, self.par, self.track, self.ground, self.rubber, self.cells, Inside()
        )
