"""Shared by all tests. Its presence also lets them import `benches` from this folder."""

import gc

from hypothesis import HealthCheck, settings

# A first call compiles; a slow machine is no failure.
settings.register_profile(
    "stridor", deadline=None, suppress_health_check=[HealthCheck.too_slow], derandomize=True
)
settings.load_profile("stridor")


def pytest_collection_finish() -> None:
    """What is loaded by now stays, and little of what tests make is cyclic: garbage is looked for less often."""
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)
