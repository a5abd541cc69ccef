"""The same step on the freedoms themselves, compiled: any damping, any mass."""

from __future__ import annotations

from ....kernels import njit
from ....typing import Array, IntArray
from ...arithmetic import FAST
from ...beta2 import Scheme
from .layout import Fields, NodalRows
from .operators import NodalArrays


@njit(cache=True)
def _csr_form(ptr: IntArray, col: IntArray, val: Array, x: Array, y: Array) -> float:  # pragma: no cover
    total = 0.0
    for i in range(x.shape[0]):
        row = 0.0
        for p in range(ptr[i], ptr[i + 1]):
            row += val[p] * y[col[p]]
        total += x[i] * row
    return total


@njit(cache=True)
def nodal_energies(nodal: NodalArrays, scheme: Scheme, u: Array, q: Array, buffer: Array) -> tuple[float, float]:
    # pragma: no cover - compiled
    """Kinetic and elastic energy at t_{n−1/2}: ½ qᵀMq and ½ u_nᵀKu_{n−1}; buffer (n,) is work space."""
    dt = scheme.step
    damped = _csr_form(nodal.c_ptr, nodal.c_col, nodal.c_val, q, q)
    kinetic = (_csr_form(nodal.m_ptr, nodal.m_col, nodal.m_val, q, q) + 0.5 * dt * dt * damped) / dt
    for i in range(u.shape[0]):
        buffer[i] = u[i] - dt * q[i]
    elastic = _csr_form(nodal.k_ptr, nodal.k_col, nodal.k_val, u, buffer) / nodal.load_gain
    return 0.5 * kinetic, 0.5 * elastic


@njit(cache=True, fastmath=FAST)
def nodal_pass(
    nodal: NodalArrays, scheme: Scheme, rows: NodalRows, force: Array, fields: Fields, predicted: Array
) -> float:  # pragma: no cover - compiled
    """The same step on freedoms: banded solve with M + β2ΔtC; returns vᵀCv at t_n."""
    u, q, d, velocity = fields.u, fields.q, fields.d, fields.buffer
    size = u.shape[0]
    two_b = 2.0 * scheme.beta2 / scheme.step
    for f in range(rows.answers.shape[1]):
        if force[f] != 0.0:
            for i in range(size):
                d[i] += force[f] * rows.answers[i, f]
    for i in range(size):
        velocity[i] = (q[i] + two_b * d[i]) / scheme.s
        q[i] = scheme.memory * q[i] + scheme.gain * d[i]
        u[i] += d[i]
    dissipated = 0.0
    if nodal.c_val.shape[0] > 0:
        dissipated = _csr_form(nodal.c_ptr, nodal.c_col, nodal.c_val, velocity, velocity)
    for i in range(size):
        total = fields.constant[i]
        for p in range(nodal.m_ptr[i], nodal.m_ptr[i + 1]):
            total += nodal.m_val[p] * q[nodal.m_col[p]]
        for p in range(nodal.k_ptr[i], nodal.k_ptr[i + 1]):
            total -= nodal.k_val[p] * u[nodal.k_col[p]]
        d[i] = total
    _band_solve(nodal.factor, d)
    for r in range(rows.ptr.shape[0] - 1):
        total = 0.0
        for p in range(rows.ptr[r], rows.ptr[r + 1]):
            i = rows.col[p]
            total += rows.val[p] * (u[i] + d[i])
        predicted[r] = total
    return dissipated


@njit(cache=True)
def _band_solve(factor: Array, x: Array) -> None:  # pragma: no cover - compiled
    """Solve LDLᵀ x = x in place."""
    width = factor.shape[0] - 1
    size = x.shape[0]
    if width:
        for i in range(size):
            value = x[i]
            for k in range(1, min(width, size - 1 - i) + 1):
                x[i + k] -= factor[k, i] * value
    for i in range(size):
        x[i] *= factor[0, i]
    if width:
        for i in range(size - 1, -1, -1):
            value = x[i]
            for k in range(1, min(width, size - 1 - i) + 1):
                value -= factor[k, i] * x[i + k]
            x[i] = value


@njit(cache=True)
def complete_nodal(rows: NodalRows, force: Array, fields: Fields) -> None:  # pragma: no cover - compiled
    """fields.buffer = d with the contact forces in it."""
    d, out, answers = fields.d, fields.buffer, rows.answers
    for i in range(d.shape[0]):
        total = d[i]
        for f in range(answers.shape[1]):
            total += answers[i, f] * force[f]
        out[i] = total


@njit(cache=True)
def nodal_constant(nodal: NodalArrays, rows: NodalRows, fields: Fields) -> None:  # pragma: no cover
    """Right side that loads and supports make."""
    constant, coefficients, auxiliary = fields.constant, fields.coefficients, rows.auxiliary
    for i in range(constant.shape[0]):
        total = 0.0
        for j in range(coefficients.shape[0]):
            total += coefficients[j] * auxiliary[j, i]
        constant[i] = nodal.load_gain * total
