"""What moves through the loop besides the contacts: fields of the path, rows in use, records."""

from __future__ import annotations

from typing import NamedTuple

from ....typing import Array, IntArray


class Fields(NamedTuple):
    """State of the path: u, q and the free increment d (n,) each, in modal coordinates or freedoms;
    constant (n,): its part from loads and supports, coefficients (aux,) that made it, buffer (n,)."""

    u: Array
    q: Array
    d: Array
    constant: Array
    coefficients: Array
    buffer: Array


class ModalRows(NamedTuple):
    """Active rows on modes: values (a + 1, n), a zero row at the end. met (k,): for each block of modes the rows that
    push on it or read it, with offsets at (b + 1,)."""

    values: Array
    met: IntArray
    at: IntArray


class Record(NamedTuple):
    """Decimated output: contacts (r, m, 6), watch (r, w, 3) of u, v, a, energies (r, 7), kept (1,) how many."""

    every: int
    contacts: Array
    watch: Array
    energies: Array
    kept: IntArray
    watch_rows: Array  # (w, n) in the path's coordinates
    watch_lift: Array  # (w, p)
