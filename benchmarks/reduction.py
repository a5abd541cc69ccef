"""Reduced models against full solves: the pad on the disc over friction and contact stiffness, and synthetic brakes.

python benchmarks/reduction.py [--short]   (--short: coarse pad, few points, for CI)

Columns as in table 2 of Gräbner, Mehrmann, Quraishi, Schröder and von Wagner (ZAMM 96(12), 2016): time to make the
model, time for one value of the parameters, largest relative error of the eigenvalues in the band. Their brake is not
public; the problem here has terms of the same kinds (gyroscopic, circulatory, low-rank damping with 1/Ω) and size.
Modal truncation takes the lowest real modes, POD the singular vectors of full solutions at a few Ω; both as one would
write them first, the companion matrix by LAPACK.
"""

from __future__ import annotations

import resource
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp
import scipy.sparse.linalg as ssl

import stridor as st
from _common import COARSE, machine, options
from stridor.case import template_text
from stridor.direct import factorise
from stridor.modal.full import onsets_along
from stridor.modal.parametric import (
    Parameter,
    ParametricProblem,
    ReducedModel,
    Term,
    contact_parameters,
    reduce,
    verified,
)
from stridor.modal.parametric.factors import CONSTANT, Formula, Product
from stridor.modal.quadratic import Region, find_modes

PAIRS = 5
MIDDLE = {
    "bodies.disc.mesh.divisions": [6, 60, 2],
    "bodies.lining.mesh.divisions": [6, 14, 2],
    "bodies.plate.mesh.divisions": [5, 12, 1],
}


def timed(call: Callable[[], object]) -> tuple[float, object]:
    started = time.perf_counter()
    answer = call()
    return time.perf_counter() - started, answer


def worked(call: Callable[[], Any]) -> tuple[float, Any]:
    """CPU seconds and the answer: what else runs on the machine does not count."""
    started = time.process_time()
    answer = call()
    return time.process_time() - started, answer


def memory() -> str:
    return f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6:.2f} GB so far"


def pair(problem: ParametricProblem, limit: float) -> ReducedModel:
    """One factorisation of the full problem and one reduced model, timed against each other."""
    matrix = problem.at(problem.reference).at(1j * np.pi * limit)
    factor_s, factor = timed(lambda: factorise(matrix))
    print(f"  factorisation at a shift, complex    {factor_s:8.2f} s, {factor.memory_bytes / 1e9:.2f} GB")
    factor.free()
    offline, model = timed(lambda: reduce(problem, limit))
    print(f"  reduced model, {model.size} unknowns        {offline:8.2f} s = {offline / factor_s:.1f} factorisations, "
          f"{model.solves} solves, {memory()}")  # fmt: skip
    return model


def pad(short: bool) -> None:
    case = st.loads(template_text("pad-on-disc"))
    case = case.with_(COARSE) if short else case
    system = st.build_system(case)
    limit = case.modal.max_frequency_hz
    problem = contact_parameters(system, (0.0, 0.6), (0.5, 2.0))
    print(f"pad on disc, {problem.size} freedoms, μ 0 to 0.6, contact stiffness × 0.5 to 2, {limit:g} Hz ({machine()})")
    middle = problem.at(problem.reference)
    # Times of either scatter by a fifth: several pairs, one after the other.
    for _ in range(0 if short else PAIRS - 1):
        pair(problem, limit)
    model = pair(problem, limit)
    print("    " + ", ".join(f"{part} {seconds:.1f}" for part, seconds in model.seconds.items()))
    full_s, found = timed(lambda: find_modes(middle, Region.band(1.0, limit, above=-500.0)))
    print(f"  full solve of all {len(found.values)} modes         {full_s:8.2f} s, {memory()}")
    rng = np.random.default_rng(11)
    points = [{p.name: rng.uniform(p.low, p.high) for p in problem.parameters} for _ in range(2 if short else 20)]
    times = [timed(lambda point=point: model.modes(point))[0] for point in points for _ in range(3)]
    print(f"  one point                            {1e3 * np.median(times):8.1f} ms (longest {1e3 * max(times):.1f})")
    worst, number, estimate = 0.0, 0, 0.0
    for point in points:
        exact = verified(model, point)
        worst, number = max([worst, *exact.shift]), number + len(exact.values)
        modes = model.modes(point)
        estimate = max([estimate, *modes.error[modes.unstable]])
    print(f"  {number} unstable modes at {len(points)} points: error ≤ {worst:.1e} of λ, estimated ≤ {estimate:.1e}")


def brake(short: bool) -> ParametricProblem:
    """A disc and pad with gyroscopic, centrifugal, circulatory and low-rank damping terms in Ω."""
    case = st.loads(template_text("pad-on-disc")).with_(COARSE if short else MIDDLE)
    contact = contact_parameters(st.build_system(case), (0.0, 0.6), (0.5, 2.0))
    still, middle = contact.at({"mu": 0.0}), contact.at({"mu": 0.35})
    n = contact.size
    diagonal = middle.mass.diagonal()
    # Neighbouring freedoms as the two directions in the plane: skew, as the Coriolis force is.
    pairs = np.arange(0, n - 1, 3)
    size = np.sqrt(diagonal[pairs] * diagonal[pairs + 1])
    turn = sp.coo_array((np.r_[-size, size], (np.r_[pairs, pairs + 1], np.r_[pairs + 1, pairs])), shape=(n, n))
    rng = np.random.default_rng(7)
    few = sp.random_array((n, 8), density=0.01, rng=rng)
    low_rank = sp.csr_array(few @ few.T)
    low_rank = low_rank * (200.0 * diagonal.mean() / abs(low_rank).max())

    def omega(p: Mapping[str, float]) -> float:
        return p["Omega"]

    terms = (
        Term(middle.mass, "mass", lambda _: 1.0, symmetric=True),
        Term(middle.damping, "damping", lambda _: 1.0, symmetric=True),
        Term(sp.csr_array(2 * turn), "damping", omega),
        Term(low_rank, "damping", lambda p: 50.0 / p["Omega"], symmetric=True),
        Term(still.stiffness, "stiffness", lambda _: 1.0, symmetric=True),
        Term(sp.csr_array(middle.stiffness - still.stiffness), "stiffness", lambda _: 1.0),
        Term(sp.csr_array(-sp.diags_array(diagonal)), "stiffness", lambda p: p["Omega"] ** 2, symmetric=True),
    )
    return ParametricProblem(terms, (Parameter("Omega", 5.0, 500.0, 100.0),))


def dampers(short: bool) -> ParametricProblem:
    """The brake's matrices with 24 dampers far beyond critical, as shims, bushings and seals are where a brake is
    imported: half of its modes below the limit are real."""
    divisions = {
        "bodies.disc.mesh.divisions": [6, 70, 2],
        "bodies.lining.mesh.divisions": [4, 12, 2],
        "bodies.plate.mesh.divisions": [4, 12, 1],
    }
    case = st.loads(template_text("pad-on-disc")).with_(COARSE if short else divisions)
    contact = contact_parameters(st.build_system(case), (0.0, 0.6), (0.5, 2.0))
    still, middle = contact.at({"mu": 0.0}), contact.at({"mu": 0.35})
    n = contact.size
    diagonal = middle.mass.diagonal()
    pairs = np.arange(0, n - 1, 3)[::40]
    size = np.sqrt(diagonal[pairs] * diagonal[pairs + 1])
    turn = sp.coo_array((np.r_[-size, size], (np.r_[pairs, pairs + 1], np.r_[pairs + 1, pairs])), shape=(n, n))
    rng = np.random.default_rng(7)
    places = rng.choice(n, 24, replace=False)
    strength = 400 * 2 * np.pi * 3000.0 * diagonal[places]
    points = sp.coo_array((strength, (places, places)), shape=(n, n))
    few = sp.random_array((n, 4), density=0.01, rng=rng)
    low_rank = sp.csr_array(few @ few.T)
    low_rank = low_rank * (200.0 * diagonal.mean() / abs(low_rank).max())
    terms = (
        Term(middle.mass, "mass", CONSTANT, symmetric=True),
        Term(middle.damping, "damping", CONSTANT, symmetric=True),
        Term(sp.csr_array(points), "damping", CONSTANT, symmetric=True),
        Term(sp.csr_array(2 * turn), "damping", Product((("Omega", 1.0),))),
        Term(low_rank, "damping", Formula("50 / Omega", ("Omega",)), symmetric=True),
        Term(still.stiffness, "stiffness", CONSTANT, symmetric=True),
        Term(sp.csr_array(middle.stiffness - still.stiffness), "stiffness", CONSTANT),
    )
    return ParametricProblem(terms, (Parameter("Omega", 5.0, 500.0, 100.0),))


def overdamped(short: bool) -> None:
    """What dampers beyond critical cost: CPU seconds, each the median of several."""
    problem, limit = dampers(short), 3000.0 if short else 7000.0
    print(f"brake with 24 strong dampers, {problem.size} freedoms, Ω 5 to 500 1/s, {limit:g} Hz ({machine()})")
    deepest = 2 * np.pi * limit
    region = Region.band(0.0, limit, above=-1.5 * deepest)
    full, offline, exact = [], [], {}
    for omega in (6.0,) if short else (6.0, 31.0, 420.0):
        seconds, found = worked(lambda omega=omega: find_modes(problem.at({"Omega": omega}), region))
        full.append(seconds)
        exact[omega] = found.values[(found.values.imag >= 0) & (np.abs(found.values) < 0.9999 * deepest)]
        seconds, model = worked(lambda: reduce(problem, limit))
        offline.append(seconds)
    real = sum(int(np.sum(values.imag == 0)) for values in exact.values()) // len(exact)
    one, ratio = np.median(full), np.median(np.array(offline) / full)
    print(f"  full solve                     {one:8.2f} s each, {len(exact[6.0])} modes, of which {real} real")
    each = [worked(lambda w=w: model.modes({"Omega": w}))[0] for w in np.linspace(6.0, 490.0, 4 if short else 40)]
    plain = replace(model, states=None)
    whole = [worked(lambda w=w: plain.modes({"Omega": w}))[0] for w in np.linspace(6.0, 490.0, 2 if short else 8)]
    worst = max(errors(model.modes({"Omega": w}).values, values) for w, values in exact.items())
    states = model.states.count if model.states else 2 * model.size
    made = np.median(offline)
    print(f"  d = {model.size}, {states} states            {made:8.2f} s = {ratio:.1f} of these, {model.solves} solves")
    point, factor = 1e3 * np.median(each), np.median(whole) / np.median(each)
    print(f"  one point                      {point:8.1f} ms (longest {1e3 * max(each):.1f}), error ≤ {worst:.1e}; "
          f"{factor:.1f} times faster than its companion matrix")  # fmt: skip
    seconds, onsets = worked(lambda: onsets_along(model, "Omega"))
    print(f"  onsets along Ω                 {seconds:8.2f} s: {len(onsets)}. {onsets.sentence}")


def projected_modes(problem: ParametricProblem, basis: np.ndarray, point: Mapping[str, float]) -> np.ndarray:
    """λ of the Galerkin projection on real columns, by the companion matrix."""
    full = problem.at(point)
    mass, damping, stiffness = (basis.T @ (m @ basis) for m in (full.mass, full.damping, full.stiffness))
    unit, r = 1e4, basis.shape[1]
    companion = np.zeros((2 * r, 2 * r))
    companion[:r] = -np.linalg.solve(unit**2 * mass, np.hstack([unit * damping, stiffness]))
    companion[r:, :r] = np.eye(r)
    return unit * sl.eigvals(companion)


def errors(found: np.ndarray, exact: np.ndarray) -> float:
    return float((np.abs(exact[:, None] - found).min(axis=1) / np.abs(exact)).max())


def table(short: bool) -> None:
    problem, limit = brake(short), 3000.0 if short else 7000.0
    print(f"synthetic brake, {problem.size} freedoms, Ω 5 to 500 1/s, {limit:g} Hz ({machine()})")
    points = [problem.point({"Omega": w}) for w in ((31.0,) if short else (7.0, 31.0, 180.0, 420.0))]
    region = Region.band(1.0, limit, above=-500.0)
    full_s, exact = [], []
    for point in points:
        seconds, found = timed(lambda point=point: find_modes(problem.at(point), region))
        full_s.append(seconds)
        exact.append(found.values)
    print(f"  full solve                     {np.median(full_s):8.2f} s each, {len(exact[0])} modes, {memory()}")
    middle = problem.at(problem.reference)
    # Real modes without friction, as modal truncation takes them.
    symmetric = next(t.matrix for t in problem.terms if t.role == "stiffness" and t.symmetric)
    count = 100 if short else 300

    def real_modes() -> np.ndarray:
        with factorise(sp.csr_array(symmetric + 1e6 * middle.mass), symmetric=True) as factor:
            inverse = ssl.LinearOperator(symmetric.shape, matvec=factor.solve)
            return ssl.eigsh(symmetric, k=count, M=middle.mass, sigma=-1e6, OPinv=inverse)[1]

    seconds, basis = timed(real_modes)
    show(f"modal truncation, d = {count}", seconds, problem, basis, points, exact)

    def pod() -> np.ndarray:
        shots = []
        for omega in (5.0,) if short else (5.0, 60.0, 250.0, 500.0):
            found = find_modes(problem.at({"Omega": omega}), region)
            shots += [found.right.real, found.right.imag]
        return np.linalg.svd(np.hstack(shots), full_matrices=False)[0][:, :75]

    seconds, basis = timed(pod)
    show("POD, d = 75", seconds, problem, basis, points, exact)
    for bound in (1e-6,) if short else (1e-6, 1e-8):
        seconds, model = timed(lambda bound=bound: reduce(problem, limit, bound=bound))
        each, worst = [], 0.0
        for point, values in zip(points, exact, strict=True):
            each.append(timed(lambda point=point, model=model: model.modes(point))[0])
            worst = max(worst, errors(model.modes(point).values, values[np.abs(values) < 0.9999 * model.frequency]))
        name = f"ours to {bound:g}, d = {model.size}"
        print(f"  {name:30s} {seconds:8.2f} s + {np.median(each):.4f} s each, error ≤ {worst:.1e}, {memory()}")


def show(
    name: str, seconds: float, problem: ParametricProblem, basis: np.ndarray, points: list[dict[str, float]],
    exact: list[np.ndarray],
) -> None:  # fmt: skip
    each, worst = [], 0.0
    for point, values in zip(points, exact, strict=True):
        one, found = timed(lambda point=point: projected_modes(problem, basis, point))
        each.append(one)
        worst = max(worst, errors(found, values))
    print(f"  {name:30s} {seconds:8.2f} s + {np.median(each):.4f} s each, error ≤ {worst:.1e}, {memory()}")


def main() -> None:
    short = options(__doc__ or "").short
    table(short)
    overdamped(short)
    pad(short)


if __name__ == "__main__":
    main()
