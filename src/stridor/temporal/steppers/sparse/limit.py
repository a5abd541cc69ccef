"""The largest stable step on assembled matrices, with damping that acts on an older velocity.

For one freedom with stiffness ω², diagonal damping c and lagged damping r (per mass), the scheme reads

    (1 + β2 Δt c) d = Δt²s/2 (−ω² u − r q) + (Δt − Δt²c/2) q,      q' = ((2β2 − 1) q + 2 d/Δt)/s,      s = 1 + 2 β2.

It leaves the unit circle through z = −1: d = −2u, Δt q = u/β2, hence, with 4β2² − 1 = s (2β2 − 1),

    ω²Δt² + rΔt/β2 = (2/β2) (1 + (β2 − 1/2) Δt c).

For β2 = 1/2 that is ω²Δt² + 2rΔt = 4; with r = βω² = 2ζω the known Δt = (2/ω)(√(1 + ζ²) − ζ). The other way out,
|det| > 1 with det = 1 − (β2 − 1/2)ω²Δt² − rΔt for c = 0, comes later for β2 in [1/2, 1]. Diagonal damping can only
raise the limit and is left out. For matrices every mode of the scheme obeys the scalar equation with its Rayleigh
quotients, so

    largest eigenvalue of (K + C_r/(β2Δt), M)  ≤  2/(β2Δt²)

is enough. Skew parts of imported matrices do not lower it: gyroscopic forces take no energy, so that the energy of
the scheme, positive below the limit, is kept, and circulatory ones make what grows grow faster by up to 1/√(1 −
(Δt/limit)²), which leaves a step stable but near the limit wrong; the step taken without being given is therefore a
smaller part of the limit. What gyroscopic forces need is that the passes of `unsymmetric` halve what is missing,
β2 Δt |M^(−1/2) G M^(−1/2)| ≤ 1/2.

The eigenvector of a larger step gives, through its quotients, an upper bound of the limit: a few rounds
converge from above. Where C_r is K times a number, one does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl

from ....errors import AnalysisError
from ....fe.assembly import connected_components, plus
from ....system import System
from ....typing import Array, Sparse
from ...beta2 import SAFE_FRACTION, StepLimit
from .damping import split_damping
from .unsymmetric import halves

DENSE = 60
MARGIN = 1.01  # on an iterated frequency, which approaches from below
ROUNDS = 8
CIRCULATORY_SHARE = 0.4  # of the limit: growth of the highest modes then is at most 9 % too fast


@dataclass(frozen=True)
class _Mode:
    """Largest eigenvalue [1/s²], its vector on the scaled freedoms, and the margin on the frequency."""

    value: float
    vector: Array
    margin: float


def step_limit_assembled(system: System, beta2: float) -> StepLimit:
    """Courant limit [s] of the scheme with lagged damping, body by body; contacts by multipliers do not lower it.

    Of the same matrices it is sought once. Raises AnalysisError where a freedom has no mass.
    """
    limit = system.of_matrices.once(("lagged step limit", beta2), lambda: _sought(system, beta2))
    return limit.of(system)


def _sought(system: System, beta2: float) -> StepLimit:
    mass = system.mass.diagonal()
    if not np.all(mass > 0.0):
        raise AnalysisError("the mass matrix is not positive definite: a freedom has stiffness but no mass")
    parts, damping = halves(system), split_damping(system)
    rest = damping.rest
    root = sp.diags_array(1.0 / np.sqrt(mass))
    stiffness, lagged = (sp.csr_array(root @ m @ root) for m in (parts.stiffness, rest))
    best, omega, body = np.inf, 0.0, "the system"
    for part in connected_components(stiffness, lagged):
        whole = len(part) == system.size
        own_stiffness, own_lagged = (m if whole else m[part][:, part] for m in (stiffness, lagged))
        step, own, vector = _part_limit(own_stiffness, own_lagged, beta2, alike=damping.factor is not None)
        if step < best:
            best, omega = step, own
            body = _owner(system, int(part[int(np.argmax(np.abs(vector)))]))
    if parts.gyroscopic.nnz:
        skew = sp.csr_array(root @ parts.gyroscopic @ root)
        mode = _largest(sp.csr_array(skew.T @ skew), None)
        step = 0.5 / (beta2 * mode.margin * math.sqrt(max(mode.value, 0.0)))
        if step < best:
            best, body = step, _owner(system, int(np.argmax(np.abs(mode.vector))))
    return StepLimit(best, omega, body, CIRCULATORY_SHARE if parts.circulatory.nnz else SAFE_FRACTION)


def _part_limit(stiffness: Sparse, lagged: Sparse, beta2: float, *, alike: bool) -> tuple[float, float, Array]:
    """Limit [s], undamped circular frequency of the mode that sets it [rad/s], and the mode; alike: whether the lagged
    damping is the stiffness times a number, so that both have the same modes."""
    mode = _largest(stiffness, None)
    if mode.value <= 0.0 and lagged.nnz == 0:
        return np.inf, 0.0, mode.vector
    if lagged.nnz and mode.value <= 0.0:
        mode = _largest(lagged, None)
    step, square = np.inf, 0.0
    for _ in range(ROUNDS):
        x = mode.vector
        square = float(x @ (stiffness @ x)) * mode.margin**2
        drag = float(x @ (lagged @ x)) * mode.margin**2 if lagged.nnz else 0.0
        found = 4.0 / beta2 / (drag / beta2 + math.sqrt((drag / beta2) ** 2 + 8.0 * square / beta2))
        converged = found >= step * (1.0 - 1e-6)
        step = min(step, found)
        if converged or alike or lagged.nnz == 0:
            break
        mode = _largest(plus(stiffness, lagged / (beta2 * step)), mode.vector)
    return step, math.sqrt(max(square, 0.0)), mode.vector


def _largest(matrix: Sparse, guess: Array | None) -> _Mode:
    """Largest eigenvalue of a symmetric matrix: dense where it is small, else by Lanczos."""
    size = matrix.shape[0]
    if size <= DENSE:
        values, vectors = np.linalg.eigh(matrix.toarray())
        return _Mode(float(values[-1]), vectors[:, -1], 1.0)
    # A fixed start makes the limit, and with it the default step, the same in every run.
    start = np.random.default_rng(0).standard_normal(size) if guess is None else guess
    start = start + 1e-3 * np.linalg.norm(start) / math.sqrt(size)
    values, vectors = spl.eigsh(matrix, k=1, which="LA", v0=start, tol=1e-3, maxiter=100 * size)
    return _Mode(float(values[0]), vectors[:, 0], MARGIN)


def _owner(system: System, freedom: int) -> str:
    for body in (*system.lines, *system.solids):
        if np.isin(freedom, body.freedoms):
            return body.name
    return "the system"
