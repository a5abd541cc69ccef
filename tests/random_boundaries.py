"""Random problems over two numbers, and what is true of them: how many roots grow, by dense eigenvalues alone.

Circulatory, gyroscopic, damped by little or much, without damping; two to eight freedoms; products of both numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy.ndimage as ndi
import scipy.sparse as sp

from stridor.modal.boundary import Found, Plane, crossings
from stridor.modal.parametric import Parameter, ParametricProblem, Term
from stridor.modal.parametric.factors import CONSTANT, Product

X, Y, XY = Product((("x", 1.0),)), Product((("y", 1.0),)), Product((("x", 1.0), ("y", 1.0)))
KINDS = ("column", "damped", "gyroscopic", "circulatory", "undamped")
GRID = 31
CLEAR = 1e-3  # of |λ|: growth that is neither rounding nor next to a curve
ON_EDGE = 0.2  # of the band: what grows there is not judged


def plane(terms: Sequence[tuple], ranges: Sequence[tuple[float, float]], top: float) -> Plane:
    """A problem of matrices (n, n), roles and factors over x and y."""
    made = tuple(Term(sp.csr_array(m), role, f, symmetric=bool(np.allclose(m, m.T))) for m, role, f in terms)
    parameters = tuple(Parameter(name, *r, float(np.mean(r))) for name, r in zip("xy", ranges, strict=True))
    problem, (low, high) = ParametricProblem(made, parameters), np.array(ranges, dtype=float).T
    dense = np.array([np.asarray(m, dtype=float) for m, _, _ in terms])
    return Plane(problem, dense, ("x", "y"), problem.reference, top, low, high)


def random_plane(seed: int) -> Plane:
    """One of the kinds, each in turn."""
    rng, kind = np.random.default_rng([seed, 5]), KINDS[seed % len(KINDS)]
    n = int(rng.integers(2, 9))
    scale = 0.5 / np.sqrt(n)

    def part(sign: int) -> np.ndarray:
        a = scale * rng.standard_normal((n, n))
        return a + sign * a.T

    mass = np.diag(rng.uniform(0.5, 2.0, n))
    turn, root = np.linalg.qr(rng.standard_normal((n, n)))[0], np.sqrt(np.diag(mass))
    stiffness = root[:, None] * (turn @ np.diag(rng.uniform(0.3, 3.0, n) ** 2) @ turn.T) * root
    terms: list[tuple] = [(mass, "mass", CONSTANT), (stiffness, "stiffness", CONSTANT)]
    if kind != "undamped":
        size, alone = float(rng.choice([1e-3, 0.02, 0.1])), np.diag(rng.uniform(0.0, 1.0, n))
        terms.append((size * (alone if rng.random() < 0.5 else 0.3 * (mass + stiffness)), "damping", CONSTANT))
    terms.append((2 * scale * rng.standard_normal((n, n)), "stiffness", Y))
    if kind in ("column", "undamped"):
        terms.append((part(1), "stiffness", X))
    if kind == "damped":
        terms.append((np.diag(rng.uniform(0.0, 0.1, n)), "damping", X))
    if kind == "gyroscopic":
        terms.append((part(-1), "damping", X))
    if kind == "circulatory":
        terms += [(part(-1), "stiffness", X), (part(1), "stiffness", XY)]
    low = -1.0 if kind in ("column", "undamped", "circulatory") else 0.0
    return plane(terms, ((low, 1.0), (0.0, 1.5)), float(rng.uniform(2.0, 5.0)))


def random_islands(seed: int) -> tuple[str, list[np.ndarray]]:
    """A damping over x and mu, each in [0, 1], with one to three hollows in it, as a formula; and the islands on which it
    is negative, places (m, 2) of each on a grid of 401 × 401 points."""
    rng = np.random.default_rng([seed, 9])
    formula, (x, mu) = "0.1", np.meshgrid(np.linspace(0.0, 1.0, 401), np.linspace(0.0, 1.0, 401), indexing="ij")
    value = np.full(x.shape, 0.1)
    for _ in range(rng.integers(1, 4)):
        a, b = rng.uniform(0.05, 0.95, 2)
        width = rng.uniform(0.05, 0.2)
        other, depth = width * rng.uniform(0.5, 2.0), rng.uniform(0.08, 0.14)
        formula += f" - {depth}*exp(-((x - {a})/{width})**2 - ((mu - {b})/{other})**2)"
        value -= depth * np.exp(-(((x - a) / width) ** 2) - ((mu - b) / other) ** 2)
    names, count = ndi.label(value < 0)
    return formula, [np.stack([x[names == k], mu[names == k]], axis=1) for k in range(1, count + 1)]


def eigenvalues(problem: Plane, places: np.ndarray) -> np.ndarray:
    """All of them (m, 2n) at places (m, 2) in shares of the ranges, from the terms by NumPy alone."""
    n, places = len(problem.terms[0]), np.atleast_2d(places)
    values = [problem.values(p) for p in places]
    total = {role: np.zeros((len(places), n, n)) for role in ("mass", "damping", "stiffness")}
    for term, matrix in zip(problem.problem.terms, problem.terms, strict=True):
        total[term.role] += np.array([term.factor(v) for v in values])[:, None, None] * matrix
    inverse = np.linalg.inv(total["mass"])
    states = np.zeros((len(places), 2 * n, 2 * n))
    states[:, :n, n:] = np.eye(n)
    states[:, n:, :n], states[:, n:, n:] = -inverse @ total["stiffness"], -inverse @ total["damping"]
    return np.linalg.eigvals(states)


def growing(values: np.ndarray, top: float) -> np.ndarray:
    """How many roots grow in the band at each place (m,)."""
    size = np.abs(values)
    return np.sum((values.real > 1e-9 * size) & (size <= top), axis=1)


def judged(values: np.ndarray, top: float) -> np.ndarray:
    """At which places (m,) that is clear: nothing growing is at the end of the band, or so slow that it may not grow."""
    size = np.abs(values)
    at_end = (values.real > 0) & (np.abs(size / top - 1.0) < ON_EDGE)
    faint = (np.abs(values.real) < CLEAR * size) & (values.real > 1e-7 * size)
    return ~np.any(at_end | faint, axis=1)


def disagreement(problem: Plane, found: Found, mesh: float) -> str:
    """Where on a grid, in regions wider than the mesh of the lines, more or fewer roots grow than the curves say; ""
    for nowhere."""
    edge = np.linspace(0.0, 1.0, GRID) * 0.998 + 0.001
    places = np.array([(x, y) for x in edge for y in edge])
    values = eigenvalues(problem, places)
    counts, clear = growing(values, problem.top), judged(values, problem.top)
    said = np.array([found.said(p)[1] if ok else 0 for p, ok in zip(places, clear, strict=True)])
    wrong = (clear & (said != counts)).reshape(GRID, GRID)
    names, _ = ndi.label(wrong, structure=np.ones((3, 3)))
    for where in ndi.find_objects(names):
        if max(part.stop - part.start for part in where) / GRID >= mesh:
            k = int(np.flatnonzero(wrong.ravel())[0])
            return f"{counts[k]} roots grow at {places[k].round(4)}, the curves say {said[k]}"
    return ""


def off_the_curves(problem: Plane, found: Found, beside: float, every: int = 1) -> list[np.ndarray]:
    """Points of the curves, one in every so many of their pieces, between whose two sides, so far away in shares of the ranges and half as far again, no root of
    the curve's frequency begins to grow, nor as many in all as the curves say. Where another curve is as near they are not
    told apart."""
    wrong: list[np.ndarray] = []
    for curve in found.curves:
        points, ways = curve.drawn.points, np.diff(curve.drawn.points, axis=0)[::every]
        others = replace(found, curves=[other for other in found.curves if other is not curve])
        middle = 0.5 * (points[1:] + points[:-1])[::every]
        normal = np.stack([-ways[:, 1], ways[:, 0]], axis=1) / np.maximum(np.hypot(*ways.T), 1e-300)[:, None]
        sides = [(m - 1.5 * beside * n, m + 1.5 * beside * n) for m, n in zip(middle, normal, strict=True)]
        alone = distance(others, middle) > 2 * beside
        judged = [k for k, (a, b) in enumerate(sides) if min(*a, *b) >= 0 and max(*a, *b) <= 1 and alone[k]]
        if not judged:
            continue
        omega = curve.drawn.omega[:-1][::every][judged, None]
        off = np.ones(len(judged), dtype=bool)
        for share in (beside, 1.5 * beside):
            ends = [middle[judged] + sign * share * normal[judged] for sign in (-1, 1)]
            values = [eigenvalues(problem, end) for end in ends]
            before, after = (growing(v, problem.top) for v in values)
            own = [np.take_along_axis(v, np.abs(v - 1j * omega).argmin(axis=1)[:, None], axis=1)[:, 0] for v in values]
            passes = own[0].real * own[1].real < 0
            for j, (a, b) in enumerate(zip(*ends, strict=True)):
                off[j] &= not passes[j] and after[j] - before[j] != sum(c.roots for c in crossings(found.drawn, a, b))
        wrong += [middle[judged[j]] for j in np.flatnonzero(off)]
    return wrong


def distance(found: Found, places: np.ndarray) -> np.ndarray:
    """From each place (m, 2) to the nearest curve (m,), in shares of the ranges."""
    nearest = np.full(len(places), np.inf)
    for curve in found.drawn:
        (x, y), (along, up) = curve.points[:-1].T, np.diff(curve.points, axis=0).T
        right, above = places[:, :1] - x, places[:, 1:] - y
        share = np.clip((right * along + above * up) / np.maximum(along**2 + up**2, 1e-300), 0.0, 1.0)
        off = np.hypot(share * along - right, share * up - above)
        nearest = np.minimum(nearest, off.min(axis=1, initial=np.inf))
    return nearest
