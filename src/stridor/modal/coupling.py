"""The small contact problem T(λ, μ) δ = 0 that carries the whole friction coupling.

Unknowns per touching contact: the perturbation of the normal force, and where the friction law has
a slope also that of the slip speed. With receptances H of the uncoupled structure (normal n,
tangential t), sense s and compliance 1/K_c,

    gap:       −δN/K_c = H_nn δN + H_nt F_t
    slip:       δw     = H_tn δN + H_tt F_t          (only with a slope)
    friction:   F_t    = s μ δN − d λ δw,   d = N μ'(v)

(paper eqs 2–4, linearised about steady sliding; docs/theory-modal.md). Constant μ leaves
T = 1/K_c + H_nn + H_nt s μ.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from ..errors import AnalysisError
from ..laws.friction import slope_at
from ..sliding import (
    anything_acts,
    force_rates,
    full_motion,
    least_force,
    refuse_redundant,
    require_pressed,
    slip_speeds,
    steady_nodes,
    steady_sliding,
)
from ..system import System
from ..typing import Array, ComplexArray
from .pencil import Pencil


@dataclass(frozen=True)
class PointCoupling:
    """What friction adds to a system whose contacts all touch. m contacts.

    compliance (m,) 1/K_c [m/N]; sense (m,) ±1 times the share of μ, 0 of a frictionless contact;
    slip_speed (m,) [m/s], signed. Whether the laws have a slope at their slip speeds is ``sloped``.
    """

    system: System
    compliance: Array
    sense: Array
    slip_speed: Array
    sloped: bool

    @property
    def contacts(self) -> int:
        """Number of touching contacts m."""
        return len(self.compliance)

    def friction_damping(self, mu: float) -> Array:
        """d = N dμ/d|v| (m,) [N s/m] at steady sliding with coefficient ``mu``."""
        return self.friction_damping_slope(mu)[0] if self.sloped and mu else np.zeros(self.contacts)

    def friction_damping_slope(self, mu: float) -> tuple[Array, Array]:
        """d and its derivative in μ (m,)."""
        if not self.sloped:
            zero = np.zeros(self.contacts)
            return zero, zero
        # Newton's method asks at one μ once for every root.
        return self.system.once(("friction damping", mu), lambda: self._friction_damping(mu))

    def _friction_damping(self, mu: float) -> tuple[Array, Array]:
        (force, rate), step = self._forces(mu), 1e-4 * mu
        if mu == 0.0:  # there is no damping yet, and it sets in with the slope that a unit of friction has
            return _kept(np.zeros(self.contacts)), _kept(self._slopes(1.0) * force)
        slopes = self._slopes(mu)
        # As good as exact: laws are scaled to μ, and slopes with them.
        turning = (self._slopes(mu + step) - self._slopes(mu - step)) / (2.0 * step)
        return _kept(force * slopes), _kept(rate * slopes + force * turning)

    def _slopes(self, mu: float) -> Array:
        """dμ/d|v| (m,) [s/m] of the laws, each with its share of ``mu``."""
        speeds = np.abs(self.slip_speed)
        own = mu * self.system.contact_nodes().share[: self.contacts]
        laws = [c.law for c in self.system.contacts]
        return np.array([slope_at(law, float(at), float(v)) for law, at, v in zip(laws, own, speeds, strict=True)])

    def _forces(self, mu: float) -> tuple[Array, Array]:
        """|N| (m,) and its derivative in μ."""
        steady = steady_sliding(self.system, mu=mu)
        sign = np.where(steady.pulls, -1.0, 1.0)
        return sign * steady.normal_force, sign * force_rates(self.system, steady)

    def matrices(
        self, lam: ComplexArray, mu: float | complex, receptance: ComplexArray, slope: ComplexArray
    ) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """T, ∂T/∂λ, ∂T/∂μ (k, q, q) at λ (k,), q = m or 2m, from H and dH/dλ (k, 2m, 2m)."""
        nn, nt = receptance[:, 0::2, 0::2], receptance[:, 0::2, 1::2]
        dnn, dnt = slope[:, 0::2, 0::2], slope[:, 0::2, 1::2]
        friction = self.sense * mu
        value = np.diag(self.compliance) + nn + nt * friction
        by_lambda = dnn + dnt * friction
        by_mu = nt * self.sense
        if not self.sloped:
            return value, by_lambda, by_mu
        d, d_slope = self.friction_damping_slope(float(np.real(mu)))
        tn, tt = receptance[:, 1::2, 0::2], receptance[:, 1::2, 1::2]
        dtn, dtt = slope[:, 1::2, 0::2], slope[:, 1::2, 1::2]
        at = lam[:, None, None]
        identity = np.eye(self.contacts)
        return (
            _blocks(value, -nt * (d * at), -(tn + tt * friction), identity + tt * (d * at)),
            _blocks(
                by_lambda,
                -dnt * (d * at) - nt * d,
                -(dtn + dtt * friction),
                dtt * (d * at) + tt * d,
            ),
            _blocks(by_mu, -nt * (d_slope * at), -tt * self.sense, tt * (d_slope * at)),
        )

    def pencil(self, mu: float) -> Pencil:
        """P(λ) of displacements and normal forces at ``mu``."""
        system, rows = self.system, self.system.contact_rows()
        normal, tangent = sp.csr_array(rows[0::2]), sp.csr_array(rows[1::2])
        damping = system.damping
        if self.sloped and mu:
            damping = damping + tangent.T @ sp.diags_array(self.friction_damping(mu)) @ tangent
        push = sp.csr_array(normal + sp.diags_array(mu * self.sense) @ tangent)
        return Pencil(system.mass, sp.csr_array(damping), system.stiffness, normal, push, self.compliance)

    def push(self, mu: float, lam: ComplexArray, null: ComplexArray) -> ComplexArray:
        """Contact forces on [normal, tangential] rows (k, 2m) belonging to null vectors (k, q) of T."""
        m = self.contacts
        normal = null[:, :m]
        tangential = self.sense * mu * normal
        if self.sloped:
            tangential = tangential - self.friction_damping(mu) * lam[:, None] * null[:, m:]
        return np.stack([normal, tangential], axis=2).reshape(len(null), 2 * m)


def _kept(values: Array) -> Array:
    """An answer that nobody changes, as others get the same one."""
    values.setflags(write=False)
    return values


def _blocks(a: ComplexArray, b: ComplexArray, c: ComplexArray, d: ComplexArray) -> ComplexArray:
    return np.concatenate([np.concatenate([a, b], axis=2), np.concatenate([c, d], axis=2)], axis=1)


def couple(system: System, *, mu: float | None = None) -> tuple[PointCoupling, tuple[str, ...]]:
    """Coupling of the contacts that touch in steady sliding at `System.touching_at`, else at ``mu``, else at the
    laws' own coefficients, and the names of those that do not. Where nothing acts every contact counts as touching."""
    open_names: tuple[str, ...] = ()
    velocities = full_motion(system)
    system = system.in_place()
    if system.contacts and anything_acts(system):
        steady = steady_nodes(system, mu if system.touching_at is None else system.touching_at)
        require_pressed(system, steady.normal_force)
        # A contact that only rounding presses is not closed, unless it is kept so.
        kept = np.array([c.closed for c in system.contacts], dtype=bool)
        closed = steady.active & (kept | (steady.normal_force > least_force(system)))
        open_names = tuple(c.name for c, a in zip(system.contacts, closed, strict=True) if not a)
        touching = tuple(c for c, a in zip(system.contacts, closed, strict=True) if a)
        system = replace(system, contacts=touching)
        pulls = steady.pulls[closed]
    else:
        refuse_redundant(system)
        pulls = np.zeros(len(system.contacts), dtype=bool)
    speeds = slip_speeds(system, velocities)
    sloped = any(c.law.slope(abs(float(v))) != 0.0 for c, v in zip(system.contacts, speeds, strict=True))
    if sloped and not anything_acts(system):
        raise AnalysisError(
            "a friction law with a slope needs the normal force: give the case a load that presses the bodies"
        )
    share = system.contact_nodes().share[: len(system.contacts)]
    still = [c.name for c, v, own in zip(system.contacts, speeds, share, strict=True) if v == 0.0 and own]
    if still:
        raise AnalysisError(
            f"contact {', '.join(still)} does not slide: no support moves one of its bodies along the "
            "tangent; give a support a velocity"
        )
    compliance = np.array([c.compliance for c in system.contacts])
    # Friction is μ|N|: where a contact kept closed pulls, it goes with −N.
    sense = np.where(pulls, 1.0, -1.0) * np.sign(speeds) * share
    return PointCoupling(system, compliance, sense, speeds, sloped), open_names
