# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Errors that a user can act on: each message names the file, the key or topic, the value and what was expected."""


class LugreSteeringError(Exception):
    """Root of every error this package raises on purpose; the command line turns it into one line and exit code 2."""


class VehicleFileError(LugreSteeringError):
    """A vehicle file, or a table it points to, cannot be used as it is."""


class ImplausibleWarning(UserWarning):
    """A value in a vehicle file is possible, and unlike that of any real vehicle."""


class MapFileError(LugreSteeringError):
    """An import map, or the table it describes, cannot be used as it is."""


class BagError(LugreSteeringError):
    """A recording cannot be read, or lacks what the task needs."""


class DataError(LugreSteeringError):
    """The data are readable but do not determine what was asked for."""


class EffectError(LugreSteeringError):
    """An effect, shipped or a user's own, is not what the chain can take."""


def reason(error: Exception) -> str:
    """What an error says without number and file name, which errors of the system carry along."""
    return getattr(error, "strerror", None) or str(error)
