"""Shared by all tests. Its presence also lets them import `benches` from this folder."""

from hypothesis import HealthCheck, settings

# A first call compiles; a slow machine is no failure.
settings.register_profile(
    "stridor", deadline=None, suppress_health_check=[HealthCheck.too_slow], derandomize=True
)
settings.load_profile("stridor")
