"""LU factors of dense matrices."""

from __future__ import annotations

import warnings
from typing import Any

import scipy.linalg as sl


def lu_factors(matrix: Any, *, check_finite: bool = True) -> tuple[Any, Any]:
    """What `scipy.linalg.lu_factor` gives, without a warning.

    A matrix that is exactly singular, as any is at an eigenvalue, shows as a zero pivot and in infinite or NaN answers,
    which callers look for; newer versions of SciPy warn of it, too.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sl.LinAlgWarning)
        return sl.lu_factor(matrix, check_finite=check_finite)
