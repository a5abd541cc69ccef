"""Any system with a lumped mass: contact over surfaces, many freedoms, imported matrices; assembled sparse matrices."""

from .limit import step_limit_assembled
from .stepper import SparseStepper, reason_for, sparse_stepper

__all__ = ["SparseStepper", "reason_for", "sparse_stepper", "step_limit_assembled"]
