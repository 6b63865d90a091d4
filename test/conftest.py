# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""One BLAS thread, as the command line asks for, and one for fits where tests run side by side; set before NumPy is imported."""
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ["LUGRE_STEERING_CONFIG"] = "/nowhere/defaults.yaml"  # what a developer has saved changes no test
if "PYTEST_XDIST_WORKER" in os.environ:
    os.environ.setdefault("LUGRE_STEERING_THREADS", "1")
