"""Random problems for the search for onsets, and what is true of them: dense eigenvalues on a fine grid.

Beams with one to three contacts, on nodes and between them, elastic and rigid; masses under a belt; matrices of other
programs, symmetric, gyroscopic, circulatory, without damping, lightly damped and overdamped; columns under end loads
that follow in part. The truth is the number of growing roots at every value, by `scipy.linalg.eig` alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import scipy.linalg as sl
from scipy.optimize import linear_sum_assignment

import stridor as st
from benches import Slave, bench, by_hand, full_eigenvalues
from matrix_cases import matrix_case
from stridor.modal.over_friction import onsets_of_band
from stridor.system import System

KINDS = ("beams", "belt", "column", "symmetric", "gyroscopic", "circulatory", "both", "overdamped")
GRID = 60
FAINT = 1e-6  # of |λ|: growth that either side may take for rounding
STILL = 1e-4  # of the band: growth so slow may be taken for a motion as a whole
NOTHING = 1e-9  # of |λ|, or of the band: rounding
ON_EDGE = 1e-6  # of the band
FINEST = 1e-6  # of the range: how closely a mode that passes the end of the band is looked at


@dataclass(frozen=True)
class Problem:
    """A problem over one number in [low, high] and the band up to top [1/s]."""

    name: str
    low: float
    high: float
    top: float
    solve: Callable[[Path], st.Onsets]
    eigenvalues: Callable[[float], np.ndarray]


def random_problem(seed: int, *, small: bool = False) -> Problem:
    """One of the kinds, each in turn; small: imported matrices of 6 to 11 freedoms instead of up to 60."""
    kind = KINDS[seed % len(KINDS)]
    rng = np.random.default_rng([seed, 7])
    if kind in ("beams", "belt", "column"):
        return {"beams": _beams, "belt": _belt, "column": _column}[kind](f"{kind} {seed}", rng)
    return _imported(f"{kind} {seed}", rng, small=small)


def _of_system(name: str, system: System, high: float, top: float, *, damped: bool) -> Problem:
    truth, high = system if damped else system.undamped(), min(high, 0.999 * determined_up_to(system))
    return Problem(
        name, 0.0, high, top,
        lambda _: onsets_of_band(system, (0.0, high), top / (2 * np.pi), damped=damped),
        lambda mu: full_eigenvalues(truth, mu),
    )  # fmt: skip


def determined_up_to(system: System) -> float:
    """The μ at which rigid contacts no longer determine the motion (Painlevé's paradox), dense: beyond it modes have no
    meaning and are refused."""
    rigid = [c for c in system.contacts if not np.isfinite(c.stiffness)]
    if not rigid:
        return np.inf
    normals = np.array([c.normal_row for c in rigid])
    rubs = np.array([-np.sign(c.tangent_lift.sum()) * c.tangent_row for c in rigid])
    answer = np.linalg.solve(system.mass.toarray(), normals.T)
    values = sl.eigvals(-rubs @ answer, normals @ answer)
    real = values[(np.abs(values.imag) < 1e-7 * np.abs(values)) & (values.real > 0)].real
    return float(1.0 / real.max()) if len(real) else np.inf


def _beams(name: str, rng: np.random.Generator) -> Problem:
    """Slaves on a clamped master, small enough for many."""
    count = int(rng.integers(1, 4))
    places = (np.arange(count) + rng.uniform(0.3, 0.9, count)) / count
    damping = (float(rng.choice([0.0, 50.0, 300.0])), float(rng.choice([0.0, 1e-8, 1e-6])))
    elements = int(rng.integers(6, 10))
    slaves = [
        Slave(
            # Some on a node of the master, some between.
            place=float(np.round(p * elements) / elements) if rng.random() < 0.3 and p * elements > 0.6 else float(p),
            lean_deg=float(rng.uniform(-25, 25)), length=float(rng.uniform(0.03, 0.07)), elements=3,
            damping=(damping[0] * float(rng.uniform(0.2, 3.0)), damping[1]), end="clamped",
            stiffness="rigid" if rng.random() < 0.3 else float(10 ** rng.uniform(6, 10)),
        )
        for p in places
    ]  # fmt: skip
    # Without loads all contacts count as touching.
    system = replace(bench(*slaves, elements=elements, damping=damping, length=0.05 + 0.05 * count), loads={})
    damped = bool(rng.random() < 0.8)
    return _of_system(name, system, float(rng.uniform(0.3, 0.9)), 2 * np.pi * float(rng.uniform(10e3, 60e3)), damped=damped)


def falling_problem(seed: int) -> Problem:
    """Slaves pressed on a clamped master whose friction falls with the slip speed: gently, or so steeply that motions
    diverge; with damping of the structure or without. All of them touch all over the range."""
    rng = np.random.default_rng([seed, 11])
    while True:
        count, elements = int(rng.integers(1, 3)), int(rng.integers(6, 10))
        high, velocity = float(rng.uniform(0.2, 0.9)), float(10 ** rng.uniform(-3, -1))
        kinetic = float(rng.uniform(0.05, 0.3))
        static = kinetic * float(1 + 10 ** rng.uniform(-2, 0.3))
        laws = (
            {"law": "weakening", "decay_speed": velocity * float(10 ** rng.uniform(-0.5, 1))},
            {"law": "hyperbolic", "delta": float(10 ** rng.uniform(-0.5, 1)) / velocity},
        )
        law = laws[int(rng.integers(2))] | {"coefficient": kinetic, "static_coefficient": static}
        damping = (float(rng.choice([0.0, 50.0, 300.0])), float(rng.choice([0.0, 1e-8, 1e-6])))
        slaves = [
            Slave(
                place=(k + float(rng.uniform(0.3, 0.9))) / count, lean_deg=float(rng.uniform(-15, 15)),
                length=float(rng.uniform(0.03, 0.07)), elements=3, damping=damping, end="clamped", friction=law,
                stiffness="rigid" if rng.random() < 0.3 else float(10 ** rng.uniform(6, 10)),
                force=float(10 ** rng.uniform(0, 2)),
            )
            for k in range(count)
        ]  # fmt: skip
        system = bench(*slaves, elements=elements, damping=damping, length=0.05 + 0.05 * count, velocity=velocity)
        forces = partial(_pressed, system)
        if all(np.all(forces(mu) > 0.0) for mu in np.linspace(0.0, high, GRID + 1)):
            break
    damped = bool(rng.random() < 0.7)
    truth, top = system if damped else system.undamped(), 2 * np.pi * float(rng.uniform(10e3, 60e3))
    # By hand: μ = μ_k + (μ_s − μ_k) e^(−v/d), or μ_k + (μ_s − μ_k)/(1 + δv); the master moves along itself.
    fall = np.exp(-velocity / law["decay_speed"]) if "decay_speed" in law else 1.0 / (1.0 + law["delta"] * velocity)
    slope = -fall / law["decay_speed"] if "decay_speed" in law else -law["delta"] * fall**2
    falls = (static - kinetic) * slope / (kinetic + (static - kinetic) * fall)
    return Problem(
        f"falling {seed}", 0.0, high, top,
        lambda _: onsets_of_band(system, (0.0, high), top / (2 * np.pi), damped=damped),
        lambda mu: full_eigenvalues(truth, mu, slopes=forces(mu) * mu * falls),
    )  # fmt: skip


def _pressed(system: System, mu: float) -> np.ndarray:
    """Normal forces (m,) of steady sliding, all contacts closed: K u = f + Σ p (n + μ s t), p = −K_c nᵀu or nᵀu = 0."""
    stiffness, load = system.stiffness.toarray(), sum(system.loads.values())
    normals = np.array([c.normal_row for c in system.contacts])
    tangents = np.array([c.tangent_row for c in system.contacts])
    sense = np.array([-np.sign(c.tangent_lift.sum()) for c in system.contacts])
    compliance = np.diag([0.0 if not np.isfinite(c.stiffness) else 1.0 / c.stiffness for c in system.contacts])
    pushes = normals + mu * sense[:, None] * tangents
    whole = np.block([[stiffness, -pushes.T], [normals, compliance]])
    return np.linalg.solve(whole, np.concatenate([np.asarray(load, dtype=float), np.zeros(len(normals))]))[len(stiffness) :]


def _belt(name: str, rng: np.random.Generator) -> Problem:
    """Masses under a belt; damping light, heavy or none."""
    system, top = belt(rng, kind=None)
    return _of_system(name, system, float(rng.uniform(0.3, 1.2)), top, damped=True)


def belt(rng: np.random.Generator, *, kind: int | None) -> tuple[System, float]:
    """Masses under a belt, a contact each to three of them, and the angular frequency of a band; kind of the damping: 0
    none, 1 light, 2 of many sizes, 3 heavy."""
    n, m = int(rng.integers(3, 10)), int(rng.integers(1, 4))
    shapes = rng.standard_normal((n, n))
    stiffness = shapes.T @ np.diag(np.exp(rng.uniform(-1.0, 2.5, n))) @ shapes
    mass = np.diag(rng.uniform(0.5, 2.0, n))
    rows = rng.standard_normal((n, n))
    kind = int(rng.integers(4)) if kind is None else kind
    damping = (
        np.zeros((n, n)),
        0.02 * mass + 1e-3 * stiffness,
        float(rng.uniform(0.01, 0.5)) * rows.T @ rows,
        float(rng.uniform(1.0, 10.0)) * rows.T @ rows,
    )[kind]
    normal, tangent = rng.standard_normal((2, m, n))
    contact = np.exp(rng.uniform(0, 4, m))
    contact[rng.random(m) < 0.2] = np.inf
    system = by_hand(mass, damping, stiffness, normal, tangent, contact)
    return system, float(rng.uniform(0.4, 3.0) * np.sqrt(np.linalg.norm(stiffness, 2) / 0.5))


def _of_matrices(name: str, terms: list, high: float, top: float) -> Problem:
    def eigenvalues(p: float) -> np.ndarray:
        n = len(terms[0][0])
        total = {role: np.zeros((n, n)) for role in ("mass", "damping", "stiffness")}
        for matrix, role, factor in terms:
            total[role] += (p if factor else 1.0) * matrix
        inverse = np.linalg.inv(total["mass"])
        state = np.block(
            [[np.zeros((n, n)), np.eye(n)], [-inverse @ total["stiffness"] / top**2, -inverse @ total["damping"] / top]]
        )
        return sl.eigvals(state) * top

    def solve(folder: Path) -> st.Onsets:
        return st.onsets(matrix_case(folder, terms, top / (2 * np.pi), (0.0, high)))

    return Problem(name, 0.0, high, top, solve, eigenvalues)


def _column(name: str, rng: np.random.Generator) -> Problem:
    """A cantilever of EI = ρA = L = 1 whose end load follows in part, on n elements; damping of mass and stiffness."""
    n = int(rng.integers(3, 8))
    mass, stiffness, load = column(n, float(rng.uniform(0.0, 1.1)))
    terms = [(mass, "mass", ""), (stiffness, "stiffness", ""), (load, "stiffness", "mu")]
    outer, inner = float(rng.choice([0.0, 0.1, 1.0, 8.0])), float(rng.choice([0.0, 0.0, 1e-4, 1e-2]))
    if outer or inner:
        terms.append((outer * mass + inner * stiffness, "damping", ""))
    return _of_matrices(name, terms, float(rng.choice([10.0, 25.0, 70.0, 150.0])), float(rng.uniform(50.0, 400.0)))


def column(n: int, share: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """M, K and what a unit of end load adds to the stiffness (2n, 2n); share: how much of it follows (1: Beck)."""
    h = 1.0 / n
    bending = np.array(
        [[12, 6 * h, -12, 6 * h], [6 * h, 4 * h * h, -6 * h, 2 * h * h], [-12, -6 * h, 12, -6 * h],
         [6 * h, 2 * h * h, -6 * h, 4 * h * h]]
    ) / h**3  # fmt: skip
    inertia = h / 420 * np.array(
        [[156, 22 * h, 54, -13 * h], [22 * h, 4 * h * h, 13 * h, -3 * h * h], [54, 13 * h, 156, -22 * h],
         [-13 * h, -3 * h * h, -22 * h, 4 * h * h]]
    )  # fmt: skip
    geometric = 1 / (30 * h) * np.array(
        [[36, 3 * h, -36, 3 * h], [3 * h, 4 * h * h, -3 * h, -h * h], [-36, -3 * h, 36, -3 * h],
         [3 * h, -h * h, -3 * h, 4 * h * h]]
    )  # fmt: skip
    size = 2 * (n + 1)
    mass, stiffness, load = np.zeros((3, size, size))
    for e in range(n):
        part = slice(2 * e, 2 * e + 4)
        mass[part, part] += inertia
        stiffness[part, part] += bending
        load[part, part] -= geometric
    load[-2, -1] += share  # the end turns the load along
    return mass[2:, 2:], stiffness[2:, 2:], load[2:, 2:]


def _imported(name: str, rng: np.random.Generator, *, small: bool) -> Problem:
    kind = name.split()[0]
    n = int(rng.integers(6, 12 if small else 61)) if small or rng.random() < 0.25 else int(rng.integers(6, 20))
    scale = (3.0 if kind == "overdamped" else 0.3) / np.sqrt(n)  # strong enough for growth against such damping

    def skew() -> np.ndarray:
        a = scale * rng.standard_normal((n, n))
        return a - a.T

    mass = np.diag(rng.uniform(0.5, 2.0, n))
    turn, root = np.linalg.qr(rng.standard_normal((n, n)))[0], np.sqrt(np.diag(mass))
    stiffness = root[:, None] * (turn @ np.diag(rng.uniform(0.3, 3.0, n) ** 2) @ turn.T) * root
    terms = [(mass, "mass", ""), (stiffness, "stiffness", "")]
    damping = 3.0 if kind == "overdamped" else float(rng.choice([0.0, 1e-3, 0.02, 0.3]))
    if damping:
        alone = np.diag(rng.uniform(0.0, 1.0, n))
        terms.append((damping * (alone if rng.random() < 0.5 else 0.3 * (mass + stiffness)), "damping", ""))
    if kind == "symmetric":
        half = scale * rng.standard_normal((n, n))
        load = half @ half.T
        terms.append((-load * rng.uniform(0.5, 3.0) / np.linalg.eigvalsh(load)[-1], "stiffness", "mu"))
    if kind in ("circulatory", "both", "overdamped"):
        terms.append((skew() if rng.random() < 0.5 else scale * rng.standard_normal((n, n)), "stiffness", "mu"))
    if kind in ("gyroscopic", "both"):
        terms.append((skew(), "damping", "mu" if rng.random() < 0.5 or kind == "gyroscopic" else ""))
    return _of_matrices(name, terms, float(rng.uniform(0.5, 2.0)), float(rng.uniform(2.2, 12.0)))


def disagreement(problem: Problem, folder: Path) -> tuple[str, str]:
    """What the onsets say otherwise than the eigenvalues at some value, and why there is no whole answer; "" for
    neither. Not judged are values where a mode is on the end of the band or growth may be rounding."""
    try:
        found = problem.solve(folder)
    except st.AnalysisError as error:
        return "", f"{problem.name}: {error}"
    if not found.complete:
        return "", f"{problem.name}: {found.completeness}"
    inside = [o for o in found.onsets if 2 * np.pi * o.frequency_hz <= problem.top]
    # How many more grow than the onsets say: as many as at the start, and those that have come into the band.
    base: int | None = None
    before: tuple[float, np.ndarray] | None = None
    for p in judged_at(problem):
        values = problem.eigenvalues(p)
        if unsure(values, problem.top):
            continue
        if before is not None and base is not None:
            came = passing(problem, before, (p, values))
            base = None if came is None else base + came
        before = p, values
        count = int(np.sum((values.real > FAINT * np.abs(values)) & (np.abs(values) <= problem.top)))
        said = sum(o.roots for o in inside if o.mu < p)
        if base is None:
            base = count - said
        if count - said != base:
            onsets = [(round(o.mu, 6), o.kind, "-" if o.stabilising else "+", round(o.frequency_hz, 4)) for o in found.onsets]
            return f"{problem.name}: {count} roots grow at {p:.6g}, onsets say {said + base}: {onsets} {found.completeness}", ""
    return "", ""


def judged_at(problem: Problem) -> list[float]:
    """Both ends and between them values of a grid on which nothing of the problem is likely to fall."""
    width = problem.high - problem.low
    grid = np.linspace(problem.low, problem.high, GRID + 1)[1:-1] + 1.234e-5 * width
    return [problem.low, *grid.tolist(), problem.high]


def unsure(values: np.ndarray, top: float) -> bool:
    """Whether the number of growing roots in the band hangs on rounding: a mode on its end, or on the axis but for little
    or for rounding. Where the spectrum is its own image in the axis modes stay on it, but for rounding, until two meet."""
    size = np.abs(values)
    if np.any((size <= STILL * top) & (values.real > NOTHING * top)):
        return True
    if np.any((values.real > 0) & (np.abs(size / top - 1.0) < ON_EDGE)):
        return True
    real = np.sort(values.real)
    image = np.all(np.abs(real + real[::-1]) <= NOTHING * size.max())
    least = NOTHING * size * (1.0 if image else -1.0)
    return bool(np.any((np.abs(values.real) <= 30 * FAINT * size) & (values.real > least) & (size <= top)))


def passing(problem: Problem, one: tuple[float, np.ndarray], other: tuple[float, np.ndarray]) -> int | None:
    """By how many more growing roots are in the band at the other value because they have come in over its end; None
    where it cannot be told whether one that does grows."""
    (low, first), (high, last) = one, other
    top = problem.top
    # On the sphere, where what leaves through infinity is near what comes from there; along a line all sums are the same.
    sizes = np.sqrt(top**2 + np.abs(first[:, None]) ** 2) * np.sqrt(top**2 + np.abs(last) ** 2)
    rows, columns = linear_sum_assignment(np.abs(first[:, None] - last) / sizes)
    first, last = first[rows], last[columns]
    step, was, now = np.abs(first - last), np.abs(first), np.abs(last)
    near = (np.minimum(was, now) - step <= top) & (np.maximum(was, now) + step >= top)
    near &= np.maximum(first.real, last.real) + step > 0
    if not near.any():
        return 0
    if high - low > FINEST * (problem.high - problem.low):
        middle = 0.5 * (low + high)
        here = middle, problem.eigenvalues(middle)
        parts = passing(problem, one, here), passing(problem, here, other)
        return None if None in parts else sum(parts)
    across = (was <= top) != (now <= top)
    growth = np.array([first.real, last.real])[:, across] / top
    grows = growth > 30 * FAINT
    if np.any(~grows & (growth > NOTHING)) or np.any(grows[0] != grows[1]):
        return None
    return int(np.sum(np.where(now <= top, 1, -1)[across][grows[0]]))
