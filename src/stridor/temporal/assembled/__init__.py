"""The temporal approach on assembled sparse matrices, for contact over surfaces and for many freedoms."""

from .limit import step_limit_assembled
from .march import simulate_assembled

__all__ = ["simulate_assembled", "step_limit_assembled"]
