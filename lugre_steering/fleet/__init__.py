# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Many recordings of many vehicles: examined one by one, judged together."""
