# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Flat records of the compiled chain: baseline parameters, state and outputs of ONE track (or joint).

Every field is a float64, so a record can be saved with ``numpy.save``, restored and compared. ``compose`` appends the
fields of the effects: ``<effect id>_<parameter>`` and ``<effect id>_<memory>``.
"""

from __future__ import annotations

import numpy as np

BASELINE_FIELDS = {
    "static_torque": "static friction torque Ms at the reference temperature [N m]",
    "coulomb_torque": "sliding friction torque Mc at the reference temperature [N m]",
    "sigma_0": "presliding stiffness at the reference temperature [N m/rad]",
    "damping_factor": "sigma_1 / sqrt(sigma_0) = 2 xi sqrt(J) [sqrt(N m) s]",
    "stribeck_speed": "Stribeck speed omega_St [rad/s]",
    "stribeck_exponent": "Stribeck exponent delta",
    "heat_capacity": "heat capacity rho c A h of the tread [J/K]; inf without rubber",
    "cooling": "lambda A of the tread [W/K]",
    "air_temperature": "air at the start of the recording [degC]",
    "rubber_temperature": "tread rubber at the start of the recording [degC]",
    "aligning_torque": "F_z e sin(theta_k), or gravity.sin_Nm [N m]",
    "gravity_cos": "gravity.cos_Nm [N m]",
    "initial_bristle": "z at the start of the recording [rad]",
    "torque_unit": "size of this machine's torques, 1 for a rubber-tracked vehicle; laws write their constants in it",
    "angle_unit": "size of its travel, likewise",
    "acceleration_unit": "size of its accelerations, likewise",
    "sides": "number of tracks that share vehicle-level torques",
    "table_low": "first temperature of the rubber table [degC]",
    "table_step": "its step [K]",
    "angle_noise": "standard deviation of one angle sample, quantisation included [rad]",
}
"""Parameters of the baseline, with what they are."""

STATE_FIELDS = (
    "time",  # since the start of the recording [s]
    "started",  # 0 before the first sample
    "theta",  # steering angle after sensor corrections [rad]
    "contact_angle",  # angle of the contact, behind linkage and backlash [rad]
    "z",  # bristle deflection [rad]
    "z_max",  # largest |bristle deflection| so far [rad]
    "temperature",  # tread rubber [degC]
    "air_temperature",  # latest ambient [degC]
    "dwell",  # time at standstill [s]
    "direction",  # sign of the last contact motion
    "torque",  # last total torque [N m]
    "load",  # the same without losses in cylinders and lines [N m]
    "heat",  # energy turned into heat by friction [J]
    "work",  # work of the friction torque [J]
    "non_passive",  # negative dissipation that was withheld from the heat [J]
    "saturated",  # steps with the temperature outside the rubber table
)

OUTPUT_FIELDS = (
    "torque",  # what the actuators must deliver at this track [N m]
    "elastic",  # sigma_0 z [N m]
    "damping",  # sigma_1 dz/dt [N m]
    "aligning",  # aligning or gravity torque [N m]
    "parallel",  # other parallel torques: stops, inertia, soil, bias [N m]
    "losses",  # cylinder and line losses [N m]
    "temperature",  # tread rubber [degC]
    "z",  # bristle deflection [rad]
)
OUTPUT = np.dtype([(name, np.float64) for name in OUTPUT_FIELDS])
BASELINE = np.dtype([(name, np.float64) for name in BASELINE_FIELDS])
STATE = np.dtype([(name, np.float64) for name in STATE_FIELDS])
LINE = np.dtype([("first", np.float64)])
"""Records of all compositions begin with these; with what those of pressure lines begin depends on the effects."""
