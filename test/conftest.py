# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""One BLAS thread, as the command line asks for, and one for fits where tests run side by side; set before NumPy is imported."""
import os
from collections.abc import Iterator

import pytest

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ["LUGRE_STEERING_CONFIG"] = "/nowhere/defaults.yaml"  # what a developer has saved changes no test
if "PYTEST_XDIST_WORKER" in os.environ:
    os.environ.setdefault("LUGRE_STEERING_THREADS", "1")


LONGEST = (
    "test_engine_names.py", "test_rigs.py", "test_engine.py", "test_own_physics.py", "test_laws_found.py", "test_replay.py", "test_docs.py",
)  # fmt: skip
"""Files that take half a minute and more: begun last, one would keep its process busy when all others have finished."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    items.sort(key=lambda item: LONGEST.index(item.path.name) if item.path.name in LONGEST else len(LONGEST))


@pytest.fixture(scope="module", autouse=True)
def catalogue_of_the_package() -> Iterator[None]:
    """Physics that a file of tests adds is gone after it."""
    from lugre_steering.effects import registry

    known = [(table, dict(table)) for table in (registry.CATALOGUE, registry.ORIGINS)]
    files = os.environ.get(registry.VARIABLE)
    yield
    for table, before in known:
        table.clear()
        table.update(before)  # type: ignore[arg-type]
    os.environ.pop(registry.VARIABLE, None)
    if files is not None:
        os.environ[registry.VARIABLE] = files
