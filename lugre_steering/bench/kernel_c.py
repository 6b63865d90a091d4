# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The baseline of one track as a hand-written C loop, the yardstick of the Numba kernel."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from lugre_steering.chain.layout import BASELINE_FIELDS
from lugre_steering.chain.step import Records
from lugre_steering.recording import Array

SOURCE = r"""
#include <math.h>

struct parameters { FIELDS };

void run(long n, const double *time, const double *theta, const double *omega, const struct parameters *p,
         long rows, const double *rubber, double *torque)
{
    double z = p->initial_bristle, temperature = p->rubber_temperature;
    double last_theta = theta[0], last_time = time[0];
    for (long i = 0; i < n; i++) {
        double dt = time[i] - last_time, d_theta = theta[i] - last_theta, speed = fabs(omega[i]);
        last_time = time[i];
        last_theta = theta[i];

        double position = (temperature - p->table_low) * (1.0 / p->table_step);
        long row = position > 0.0 ? (long)position : 0;
        if (row > rows - 2) row = rows - 2;
        double weight = fmin(fmax(position - row, 0.0), 1.0);
        const double *a = rubber + 2 * row;
        double stiffness = p->sigma_0 * (a[0] + weight * (a[2] - a[0]));
        double friction = a[1] + weight * (a[3] - a[1]);

        double ratio = speed / p->stribeck_speed;
        double power = p->stribeck_exponent == 2.0 ? ratio * ratio : pow(ratio, p->stribeck_exponent);
        double g = friction * (p->coulomb_torque + (p->static_torque - p->coulomb_torque) * exp(-power));
        double z_ss = copysign(g / stiffness, d_theta);
        double z_next = z_ss + (z - z_ss) * exp(-stiffness * fabs(d_theta) / g);
        double sigma_1 = p->damping_factor * sqrt(stiffness);
        double rate = omega[i] - speed * z_next * stiffness / g;

        double work = g * (fabs(d_theta) + copysign(1.0, d_theta) * (z - z_next)) + sigma_1 * omega[i] * (z_next - z);
        double heat = fmax(work - 0.5 * stiffness * (z_next * z_next - z * z), 0.0);
        double k = 0.5 * p->cooling * dt / p->heat_capacity;
        if (k > 0.1) {
            double decay = exp(-2.0 * k);
            temperature = p->air_temperature + (temperature - p->air_temperature) * decay
                          + heat / p->heat_capacity * (1.0 - decay) / (2.0 * k);
        } else {
            double share = 1.0 / (1.0 + k), warmth = 1.0 / p->heat_capacity;
            temperature = temperature * ((1.0 - k) * share) + 2.0 * k * share * p->air_temperature + heat * (warmth * share);
        }
        z = z_next;
        torque[i] = stiffness * z_next + sigma_1 * rate + p->aligning_torque * sin(theta[i])
                    + p->gravity_cos * cos(theta[i]);
    }
}
""".replace("FIELDS", " ".join(f"double {name};" for name in BASELINE_FIELDS))


class CLoop:
    """The compiled loop; ``None`` from ``build`` when there is no C compiler."""

    def __init__(self, library: ctypes.CDLL) -> None:
        self._library = library

    @classmethod
    def build(cls) -> CLoop | None:
        """Compile with gcc -O3 for this machine."""
        gcc = shutil.which("gcc")
        if gcc is None:
            return None
        with tempfile.TemporaryDirectory() as folder:
            source, library = Path(folder) / "kernel.c", Path(folder) / "kernel.so"
            source.write_text(SOURCE, encoding="ascii")
            command = [gcc, "-O3", "-march=native", "-shared", "-fPIC", "-o", str(library), str(source), "-lm"]
            subprocess.run(command, check=True, capture_output=True)
            return cls(ctypes.CDLL(str(library)))

    def torque_side(self, p: Records, rubber: Array, time: Array, theta: Array, omega: Array) -> Array:
        """Torque [N m] (n,) of one track, baseline only."""
        torque = np.empty(time.size)
        parameters = np.array([float(p[name][0]) for name in BASELINE_FIELDS])
        pointers = [ctypes.c_void_p(array.ctypes.data) for array in (time, theta, omega, parameters, rubber, torque)]
        self._library.run(
            ctypes.c_long(time.size), *pointers[:4], ctypes.c_long(rubber.shape[0]), pointers[4], pointers[5]
        )
        return torque
