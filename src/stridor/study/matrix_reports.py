"""What the imported matrices of a case are like, by themselves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import scipy.sparse as sp

from ..case import Case
from ..case.bodies import MatrixBody
from ..case.expression import parse_expression
from ..case.matrix_checks import MU
from ..errors import CaseError
from ..matrices.report import MatrixReport, report
from ..system.imported import load_terms


@dataclass(frozen=True)
class BodyReport:
    """A body's matrices, its terms summed, and what was noticed in reading their files.

    mu: the friction coefficient that they are looked at, None where no factor depends on it; ranks: of K − Kᵀ at that
    and at other μ of the range, where factors do; contacts: those that the case makes at the body.
    """

    matrices: MatrixReport
    notes: tuple[str, ...]
    mu: float | None = None
    ranks: Mapping[float, int] = field(default_factory=dict[float, int])
    contacts: tuple[str, ...] = ()

    def lines(self) -> list[str]:
        """The report for a reader, a statement a line."""
        over = [f"mu = {mu:g}: {rank}" for mu, rank in self.ranks.items()]
        ranks = f"rank of K − Kᵀ at {', '.join(over)}"
        said = [] if self.mu is None else [f"mu is in factors: looked at mu = {self.mu:g}; {ranks}"]
        if self.contacts and not self.matrices.coupling:
            made = ", ".join(f"contacts.{name}" for name in self.contacts)
            said.append(f"K is symmetric: friction is that of {made}, which the case makes")
        return [*(f"read: {note}" for note in self.notes), *said, *self.matrices.lines()]


def matrix_reports(case: Case, mu: float | None = None) -> dict[str, BodyReport]:
    """A report for each body of matrices, at ``mu``; None: where factors depend on μ, at that end of
    modal.friction_range where more friction couples. Raises CaseError where the case has none."""
    if not case.imported:
        raise CaseError("bodies", None, 'none is of type "matrices"; there is nothing to report')
    found: dict[str, BodyReport] = {}
    for name, body in case.imported.items():
        if mu is not None or not _varies(case, body):
            found[name] = _report(case, name, body, mu)
            continue
        low, high = case.modal.friction_range
        reports = {at: made for at in (low, high) if (made := _report_at(case, name, body, at)) is not None}
        if not reports:
            found[name] = _report(case, name, body, None)
            continue
        ranks = {at: made.matrices.coupling for at, made in reports.items()}
        most = max(ranks, key=lambda at: (ranks[at], at))
        found[name] = replace(reports[most], mu=most, ranks=ranks)
    return found


def _varies(case: Case, body: MatrixBody) -> bool:
    """Whether μ is in a factor of the body's."""
    names = (*case.parameters, MU)
    return any(MU in parse_expression(t.factor, names).names for t in body.terms if isinstance(t.factor, str))


def _report_at(case: Case, name: str, body: MatrixBody, mu: float) -> BodyReport | None:
    """The report at ``mu``, None where a factor has no value there."""
    try:
        return _report(case, name, body, mu)
    except CaseError as error:
        if all(problem.where.endswith(".factor") for problem in error.problems):
            return None
        raise


def _held(case: Case, body: str) -> list[str]:
    """Names of supports, springs and ties of the case at a body."""
    ends: dict[str, tuple[str, ...]] = {f"supports.{key}": (support.at,) for key, support in case.supports.items()}
    ends |= {f"springs.{key}": spring.between for key, spring in case.springs.items()}
    ends |= {f"ties.{key}": (tie.slave, tie.master) for key, tie in case.ties.items()}
    return [key for key, places in ends.items() if any(p != "ground" and case.location(p).body == body for p in places)]


def _report(case: Case, name: str, body: MatrixBody, mu: float | None) -> BodyReport:
    terms = load_terms(case, name, body, mu)
    pairs = zip(terms.shares, terms.values, strict=True)
    # A beam and an obstacle are masters as a whole, and no places.
    sides = {key: {case.location(c.slave).body, c.master.partition(".")[0]} for key, c in case.contacts.items()}
    contacts = [key for key, bodies in sides.items() if name in bodies]
    matrices = report(
        terms.mass, terms.damping, terms.stiffness, labels=terms.labels, stored=terms.stored,
        stiffness_terms=[sp.csr_array(value * share.matrix) for share, value in pairs if share.role == "stiffness"],
        contacts=contacts, supports=_held(case, name), doubts=terms.doubts,
    )  # fmt: skip
    notes = dict.fromkeys(f"{s.source}: {note}" for s in terms.stored for note in s.notes)
    return BodyReport(matrices, tuple(notes), contacts=tuple(contacts))
