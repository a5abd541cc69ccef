"""Any system with a lumped mass: contact over surfaces, many freedoms, imported matrices; assembled sparse matrices."""

from .limit import step_limit_assembled
from .stepper import SparseStepper, sparse_stepper

__all__ = ["SparseStepper", "sparse_stepper", "step_limit_assembled"]
