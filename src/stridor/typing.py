"""Array types shared by all layers: what they hold, not how wide. Everything computes in double precision."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]
ComplexArray = NDArray[np.complexfloating[Any, Any]]
IntArray = NDArray[np.integer[Any]]
BoolArray = NDArray[np.bool_]
Sparse = Any  # scipy.sparse.csr_array; SciPy ships no types
