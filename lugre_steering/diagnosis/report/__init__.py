# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The report of a diagnosis: page, pictures, and how effects are shown in them."""
