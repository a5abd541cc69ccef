"""Cases of matrices, as files of another program: written by hand, or exported from cases that stridor has meshed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import scipy.sparse as sp

import stridor as st
from rubbing_block import rubbing_block
from stridor.mesh.model import Mesh
from stridor.modal.krylov import Options
from stridor.modal.krylov.problem import problem_of
from stridor.system.bodies import build_bodies

Term = tuple[object, str, str]
TURN = np.array([[0.0, -1.0], [1.0, 0.0]])


def matrix_case(
    folder: Path, terms: Sequence[Term], hz: float, between: tuple[float, float] = (0.0, 1.0), more: str = ""
) -> st.Case:
    """A case of matrices, each with its role and factor ("" for none)."""
    text = f"{more}\n[modal]\nmax_frequency_hz = {float(hz)}\nfriction_range = [{float(between[0])}, {float(between[1])}]\n"
    for k, (matrix, role, factor) in enumerate(terms):
        sp.save_npz(folder / f"A{k}.npz", sp.csr_array(np.asarray(matrix) if not sp.issparse(matrix) else matrix))
        text += f'[[matrices]]\nfile = "A{k}.npz"\nrole = "{role}"\n' + (f'factor = "{factor}"\n' if factor else "")
    (folder / "case.toml").write_text(text, encoding="utf-8")
    return st.load(folder / "case.toml")


def exported(case: st.Case) -> list[Term]:
    """M, D, K without friction, and what friction adds for μ = 1, of a case with contact springs."""
    problem = problem_of(st.build_system(case), None, Options())
    still, rubbing = problem.pencil(0.0).condensed(), problem.pencil(1.0).condensed()
    friction = sp.csr_array(rubbing.stiffness - still.stiffness)
    friction.eliminate_zeros()
    return [
        (still.mass, "mass", ""),
        (still.damping, "damping", ""),
        (still.stiffness, "stiffness", ""),
        (friction, "stiffness", "mu"),
    ]


def export(folder: Path, case: st.Case, hz: float | None = None) -> st.Case:
    """The case as matrices that depend on mu."""
    settings = case.modal
    return matrix_case(folder, exported(case), hz or settings.max_frequency_hz, settings.friction_range)


MESHED = rubbing_block("max_frequency_hz = 30e3")
IMPORTED = """
type = "matrices"
dimension = 2
mesh = "block.inp"
labels = "dof.txt"
terms = [
  { file = "M.npz", role = "mass" },
  { file = "C.npz", role = "damping" },
  { file = "K.npz", role = "stiffness" },
  { file = "S.npz", role = "stiffness", factor = "mu" },
]
"""


def rubbing(folder: Path, skew: float) -> st.Case:
    """The block of MESHED as matrices with its mesh, and beside them ``skew`` · mu in two entries of the stiffness."""
    body = build_bodies(st.loads(MESHED))["block"]
    assert body.mesh is not None
    rows = ["*NODE", *(f"{k + 1}, {float(x)!r}, {float(y)!r}" for k, (x, y) in enumerate(body.mesh.points))]
    rows += ["*ELEMENT, TYPE=CPE4", *(f"{k + 1}, " + ", ".join(str(n + 1) for n in c) for k, c in _quads(body.mesh))]
    for name in body.mesh.boundaries:
        inside = set(body.mesh.boundary_nodes(name).tolist())
        rows.append(f"*SURFACE, NAME={name}")
        for k, cell in _quads(body.mesh):
            rows += [f"{k + 1}, S{f + 1}" for f in range(4) if {cell[f], cell[(f + 1) % 4]} <= inside]
    (folder / "block.inp").write_text("\n".join(rows) + "\n", encoding="utf-8")
    n = body.mass.shape[0]
    (folder / "dof.txt").write_text("".join(f"{f // 2 + 1} {f % 2 + 1}\n" for f in range(n)), encoding="utf-8")
    small = sp.coo_array((np.array([skew, -skew]), ([0, 1], [1, 0])), shape=(n, n))
    parts = {"M": body.mass, "C": body.damping, "K": body.stiffness, "S": small}
    for name, matrix in parts.items():
        sp.save_npz(folder / f"{name}.npz", sp.csr_array(matrix))
    return st.loads(rubbing_block("max_frequency_hz = 30e3", IMPORTED), folder=folder)


def _quads(mesh: Mesh) -> list[tuple[int, list[int]]]:
    return list(enumerate(mesh.cells["quad"].tolist()))
