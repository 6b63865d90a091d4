# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The third simulator: other machines, friction that is not LuGre, and recordings as dirty as the field's.

It shares no law with the estimator's chain nor with the second simulator.
"""
