"""Sparse direct solvers behind one small interface: factorise once, solve many times.

Whichever program does the work, answers are refined to a small backward error and a singular matrix is an error.
"""

from .backends import available, join
from .factor import Factor, SingularMatrix, factorise
from .inertia import counting_factor, negative_eigenvalues
from .nearby import Nearby

__all__ = [
    "Factor",
    "Nearby",
    "SingularMatrix",
    "available",
    "counting_factor",
    "factorise",
    "join",
    "negative_eigenvalues",
]
