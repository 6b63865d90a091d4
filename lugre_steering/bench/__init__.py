# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Benchmarks: ``python -m lugre_steering.bench [name] [options]``; ``--help`` names them."""
