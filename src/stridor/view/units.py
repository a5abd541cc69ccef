"""Units of numbers for people, by their size: a usual model in kHz, ms, mm, mJ and MPa, one of order one (whose numbers
may have no unit at all) in Hz, s, m, J and Pa. Each function gives the unit in base units and its name."""

from __future__ import annotations

import math

import numpy as np

from ..typing import Array

Unit = tuple[float, str]
LONG = 1.0  # [s], [m]: from here on no thousandths
LATE = 100.0  # [s]: of a time so late thousandths are digits that no one reads
SOFT = 1e6  # [Pa]: stiffnesses of materials below are in Pa
GENTLE = 1e3  # [Pa]: pressures below are in Pa


def frequency_unit(top: float) -> Unit:
    """The unit [Hz] of frequencies up to ``top`` [Hz]; kHz of none."""
    return (1.0, "Hz") if 0.0 < top < 1e3 else (1e3, "kHz")


def frequency_words(top: float) -> str:
    """A limit of frequencies [Hz] with its unit: 40 kHz, 0.5 Hz."""
    unit, its_name = frequency_unit(top)
    return f"{top / unit:g} {its_name}"


def time_unit(span: float, end: float = 0.0) -> Unit:
    """The unit [s] of times over ``span`` [s], up to ``end`` [s]. A short span late in a run stays in ms, where s would
    need the more digits."""
    return (1.0, "s") if span >= LONG or end >= LATE else (1e-3, "ms")


def length_unit(span: float) -> Unit:
    """The unit [m] of lengths up to ``span`` [m]."""
    return (1.0, "m") if span >= LONG else (1e-3, "mm")


def gap_unit(largest: float) -> Unit:
    """The unit [m] of gaps up to ``largest`` [m]."""
    return (1e-6, "µm") if largest < 1e-3 else length_unit(largest)


def energy_unit(joules: float) -> Unit:
    """The unit [J] in which an energy is a number from 1 to 1000; mJ of nothing."""
    for unit, name in ((1e6, "MJ"), (1e3, "kJ"), (1.0, "J"), (1e-3, "mJ"), (1e-6, "µJ")):
        if joules >= unit:
            return unit, name
    return (1e-9, "nJ") if joules > 0 else (1e-3, "mJ")


def pressure_unit(largest: float) -> Unit:
    """The unit [Pa] of pressures up to ``largest`` [Pa]; MPa of nothing."""
    return (1.0, "Pa") if 0.0 < largest < GENTLE else (1e6, "MPa")


def modulus_unit(modulus: float) -> Unit:
    """The unit [Pa] of Young's modulus."""
    return (1.0, "Pa") if modulus < SOFT else (1e9, "GPa")


def most(values: Array) -> float:
    """The largest finite size among values, 0 where there is none: what a unit is chosen by."""
    sizes = np.abs(np.asarray(values, dtype=float))
    return float(sizes[np.isfinite(sizes)].max(initial=0.0))


def extent(points: Array) -> float:
    """Largest side of the box about points (k, d), 0 of none."""
    return float(np.ptp(points, axis=0).max(initial=0.0)) if len(points) else 0.0


def later_words(seconds: float, digits: int) -> str:
    """How long something takes, in so many significant digits."""
    if not math.isfinite(seconds):
        return f"{seconds} s"
    unit, its_name = time_unit(seconds)
    return f"{seconds / unit:.{digits}g} {its_name}"
