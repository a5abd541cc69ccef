"""What the imported matrices of a case are like, by themselves."""

from __future__ import annotations

from dataclasses import dataclass

import scipy.sparse as sp

from ..case import Case
from ..errors import CaseError
from ..matrices.report import MatrixReport, report
from ..system.imported import load_terms


@dataclass(frozen=True)
class BodyReport:
    """A body's matrices, its terms summed, and what was noticed in reading their files."""

    matrices: MatrixReport
    notes: tuple[str, ...]

    def lines(self) -> list[str]:
        """The report for a reader, a statement a line."""
        return [*(f"read: {note}" for note in self.notes), *self.matrices.lines()]


def matrix_reports(case: Case, mu: float | None = None) -> dict[str, BodyReport]:
    """A report for each body of matrices. Raises CaseError where the case has none."""
    if not case.imported:
        raise CaseError("bodies", None, 'none is of type "matrices"; there is nothing to report')
    found: dict[str, BodyReport] = {}
    for name, body in case.imported.items():
        terms = load_terms(case, name, body, mu)
        pairs = zip(terms.shares, terms.values, strict=True)
        matrices = report(
            terms.mass, terms.damping, terms.stiffness, labels=terms.labels, stored=terms.stored,
            stiffness_terms=[sp.csr_array(value * share.matrix) for share, value in pairs if share.role == "stiffness"],
        )  # fmt: skip
        notes = dict.fromkeys(f"{s.source}: {note}" for s in terms.stored for note in s.notes)
        found[name] = BodyReport(matrices, tuple(notes))
    return found
