# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Flat records of the compiled chain: parameters, state and outputs of ONE track (or joint).

Every field is a float64, so a record can be saved with ``numpy.save``, restored and compared. An effect's parameters
are the fields ``<effect id>_<parameter>``; they are zero (neutral) unless a catalogue entry is applied.
"""

from __future__ import annotations

import numpy as np

ELEMENTS = 6
"""Parallel bristle elements of the distributed contact."""

BASELINE_FIELDS = (
    "static_torque",  # Ms at the reference temperature [N m]
    "coulomb_torque",  # Mc at the reference temperature [N m]
    "sigma_0",  # presliding stiffness at the reference temperature [N m/rad]
    "damping_factor",  # sigma_1 / sqrt(sigma_0) = 2 xi sqrt(J) [sqrt(N m) s]
    "stribeck_speed",  # omega_St [rad/s]
    "stribeck_exponent",  # delta
    "heat_capacity",  # rho c A h [J/K]; inf without rubber
    "cooling",  # lambda A [W/K]
    "air_temperature",  # at the start of the recording [degC]
    "rubber_temperature",  # at the start of the recording [degC]
    "aligning_torque",  # F_z e sin(theta_k), or gravity.sin_Nm [N m]
    "gravity_cos",  # gravity.cos_Nm [N m]
    "initial_bristle",  # z at the start of the recording [rad]
    "sides",  # number of tracks that share vehicle-level torques
    "table_low",  # first temperature of the rubber table [degC]
    "table_step",  # its step [K]
    "angle_noise",  # standard deviation of one angle sample, quantisation included [rad]
)

EFFECT_FIELDS = (
    # motion
    "angle_offset_offset", "angle_scale_scale", "backlash_width",
    "backlash_softness", "linkage_compliance_compliance",
    "linkage_compliance_stiffening",
    # contact
    "direction_asymmetry_asymmetry", "surface_patch_change", "surface_patch_angle_low", "surface_patch_angle_high",
    "surface_patch_time_start", "surface_patch_time_end", "wear_polishing_amount", "wear_polishing_slip_scale",
    "static_ageing_rate", "static_ageing_dwell", "static_ageing_slip_scale", "stress_relaxation_per_decade",
    "stress_relaxation_onset",
    "stress_relaxation_recovery_angle", "payne_softening_amplitude", "payne_softening_angle",
    "mullins_softening_amplitude", "mullins_softening_width", "viscous_friction_sigma_2", "viscous_friction_thinning",
    "distributed_contact_spread",
    # thermal
    "heat_partition_ground_share", "carcass_heat_sink_conductance", "carcass_heat_sink_capacity",
    "flash_temperature_resistance", "flash_temperature_saturation_power", "flash_temperature_time_constant",
    "ambient_drift_rate",
    # parallel torque
    "end_stop_engage_angle", "end_stop_stiffness", "end_stop_cubic_stiffness", "end_stop_loss",
    "end_stop_damping", "end_stop_shift",
    "yaw_inertia_inertia", "kingpin_jacking_amplitude", "kingpin_jacking_second_harmonic",
    "kingpin_jacking_even", "slope_bias_torque",
    "soil_shear_torque", "soil_shear_span", "soil_shear_growth",
    # measurement: torque the actuators must deliver on top
    "cylinder_friction_coulomb", "cylinder_friction_load_share", "cylinder_friction_viscous",
    "cylinder_friction_holding", "cylinder_friction_breakaway",
    "cylinder_friction_rate_scale", "line_loss_linear_b", "line_loss_quadratic_c",
    "back_pressure_torque",
    "back_pressure_flow",
    "back_pressure_rate_scale", "relief_saturation_ceiling", "relief_saturation_arm_slope",
    "relief_saturation_arm_curvature", "trapped_pressure_share", "trapped_pressure_time_constant",
    "trapped_pressure_refill_time",
)  # fmt: skip

PARAMETERS = np.dtype([(name, np.float64) for name in BASELINE_FIELDS + EFFECT_FIELDS])

STATE = np.dtype(
    [
        ("time", np.float64),  # since the start of the recording [s]
        ("started", np.float64),  # 0 before the first sample
        ("theta", np.float64),  # steering angle after sensor corrections [rad]
        ("contact_angle", np.float64),  # angle of the contact, behind linkage and backlash [rad]
        ("z", np.float64),  # bristle deflection [rad]
        ("elements", np.float64, (ELEMENTS,)),  # bristles of the distributed contact [rad]
        ("element_shares", np.float64, (ELEMENTS,)),  # their shares of the stiffness, set at the start
        ("temperature", np.float64),  # tread rubber [degC]
        ("carcass_temperature", np.float64),  # second thermal node [degC]
        ("flash_power", np.float64),  # low-passed friction power [W]
        ("air_temperature", np.float64),  # latest ambient [degC]
        ("slip", np.float64),  # accumulated |contact angle| [rad]
        ("dwell", np.float64),  # time at standstill [s]
        ("age", np.float64),  # mean age of the contacts [s]
        ("relaxed", np.float64),  # relaxed share of the elastic torque
        ("direction", np.float64),  # sign of the last contact motion
        ("since_reversal", np.float64),  # contact angle since the last reversal [rad]
        ("z_max", np.float64),  # largest |bristle deflection| so far [rad]
        ("stop_loading", np.float64),  # 1 end stop loading ... 0 unloading
        ("berm_left", np.float64),  # farthest push of the soil, positive side [rad]
        ("berm_right", np.float64),  # farthest push of the soil, negative side [rad]
        ("leaked", np.float64),  # how far trapped oil has leaked away, 0 ... 1
        ("seal", np.float64),  # cylinder seal deflection, -1 ... 1
        ("torque", np.float64),  # last total torque [N m]
        ("load", np.float64),  # the same without losses in cylinders and lines [N m]
        ("heat", np.float64),  # energy turned into heat by friction [J]
        ("work", np.float64),  # work of the friction torque [J]
        ("non_passive", np.float64),  # negative dissipation that was withheld from the heat [J]
        ("saturated", np.float64),  # steps with the temperature outside the rubber table
    ]
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
