"""What eigenvalues λ say in the field's words."""

from __future__ import annotations

import numpy as np

from ..typing import Array, ComplexArray


class Rates:
    """Frequencies, growth rates and damping ratios, of the shape that ``eigenvalues`` [1/s] has."""

    eigenvalues: ComplexArray

    @property
    def frequency_hz(self) -> Array:
        """Im λ / 2π."""
        return self.eigenvalues.imag / (2 * np.pi)

    @property
    def growth_rate(self) -> Array:
        """Re λ [1/s], positive when unstable."""
        return self.eigenvalues.real

    @property
    def damping_ratio(self) -> Array:
        """−Re λ/|λ|; 0 of λ = 0, NaN where λ is not known."""
        size = np.abs(self.eigenvalues)
        return -np.divide(self.eigenvalues.real, size, out=np.zeros_like(size), where=size != 0)
