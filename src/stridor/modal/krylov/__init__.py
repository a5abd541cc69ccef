"""The modal approach on assembled sparse matrices: large systems, many contact nodes.

**The problem.** With u (n) the displacements and p (m) the normal forces of the touching nodes, N and S the rows of
their relative displacement slave − master along the normal and against the slip, and c their compliances (zero for
rigid contact), small motions about steady sliding obey

    (λ²M + λC + K) u − (N + μS)ᵀ p = 0,        N u + c p = 0 .

Keeping p costs m unknowns and makes rigid contact and contact springs one problem. Eliminating it where contact is
rigid is right but unpleasant: with u restricted to N u = 0, pᵀ follows from the equations across the contact, p holds
their inertia and damping, and friction μSᵀp then stands in mass, damping and stiffness alike. Here it does so by
itself. Springs 1/c converge to rigid contact with order c.

**The method.** One factorisation of the symmetric frictionless problem at a shift below all frequencies (`shifted`)
serves throughout. It gives the frictionless modes (u_j, p_j) up to beyond the band by block Lanczos. They and what
their friction forces Sᵀp_j do to the frictionless structure are the first basis (`reduced`): pairs (u, p) that satisfy
N u + c p = 0, so that tested with U itself

    λ²UᵀMU + λUᵀCU + (UᵀKU + PᵀcP) − μ(SU)ᵀP

is symmetric but for friction. At sampled μ the projected eigenpairs are put into the sparse problem, what they leave
unbalanced is solved for with the same factors, and the answers join the basis, until all pairs asked for satisfy the
sparse problem (`refine`). Branches are matched over μ by tangents and shapes (`follow`), onsets enclosed and solved
for, with enrichment at each (`critical`). `direct_modes` is the reference that shares none of this: one unsymmetric
factorisation and Arnoldi's method for each μ.

**What is complete.** Modes of the band at μ = 0 and a tenth beyond are made exact, those up to 1.25 of it are
followed. A mode that starts higher and sinks into the band as μ rises is found by `growing`, which seeks anew what
grows at a few μ. The set of touching nodes is that of steady sliding at one μ. Up to 20 000 freedoms the number of
frictionless modes is checked by Sylvester's law of inertia.
"""

from ..options import Options
from .carried import Carried
from .critical import krylov_onsets
from .direct_modes import DirectModes, direct_modes
from .energy import FrictionEnergy, friction_energy
from .modes import krylov_modes
from .shifted import NotPositive

__all__ = [
    "Carried",
    "DirectModes",
    "FrictionEnergy",
    "NotPositive",
    "Options",
    "direct_modes",
    "friction_energy",
    "krylov_modes",
    "krylov_onsets",
]
