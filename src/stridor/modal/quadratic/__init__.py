"""Quadratic eigenvalue problems of sparse matrices that need have no structure at all."""

from .band import band_modes, is_stiff
from .count import undamped_count
from .find import Completeness, RegionModes, find_modes
from .problem import Quadratic
from .region import Disc, Region

__all__ = [
    "Completeness",
    "Disc",
    "Quadratic",
    "Region",
    "RegionModes",
    "band_modes",
    "find_modes",
    "is_stiff",
    "undamped_count",
]
