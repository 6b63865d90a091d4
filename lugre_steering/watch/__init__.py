# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The online watch: says when the model no longer matches the machine, keeps the window that diagnosis should get, and shows what comes."""
