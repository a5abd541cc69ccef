"""A case and what has been computed for it, each thing once.

What follows from a system alone (its steady sliding, its modes without contacts, what grows at a μ, its onsets) is kept
with the system by whoever computes it (`System.once`); a workspace keeps the systems of its case, and what takes the
case as well.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from functools import cached_property, lru_cache, partial
from os import PathLike
from typing import Any

import numpy as np
from pydantic import ValidationError

from ..case import Case, load
from ..case.fields import Table
from ..case.matrix_checks import MU
from ..case.messages import problems_of
from ..case.schema import DEFAULT_PHASES, Comparison, Modal, Phase, Phases, Temporal
from ..errors import AnalysisError, CaseError, kind_of
from ..laws.friction import Shared, own_law
from ..modal.krylov import Carried
from ..modal.options import Options
from ..notebook import Shown, counted
from ..sliding.result import SteadySliding
from ..sliding.solution import steady_nodes
from ..system import System, build_system
from ..system.model import AnswerCache
from ..temporal.ended import ended
from ..temporal.inputs import unfit_in_time
from ..typing import Array
from .case_key import case_key
from .options import options_of
from .settings import phases_of

SYSTEMS = 16  # kept at the same time, of a case whose matrices depend on μ
SAME_FRICTION = 1e-6  # of a coefficient: two contacts with a law of speed that differ by less have one
KEPT_BY = "`modes`, `steady` and `simulate` without μ answer with each contact's own"
ACCEPTED = "a case, the path of its file, a system or a workspace"


class _Settings(Table):
    """The tables of a case that say how to compute, not what."""

    phases: Phases = DEFAULT_PHASES
    modal: Modal = Modal()
    temporal: Temporal = Temporal()
    comparison: Comparison = Comparison()


class Workspace(Shown):
    """A case, or a system alone, and what has been computed for it.

    problem: a Case, the path of its file, or a System. Every analysis takes a workspace in place of these; what it
    needs and is there already is not computed again. A case is frozen: one that is varied is another workspace. With a
    system alone the tables [modal], [temporal], [comparison] and [[phases]] of a case may be given by name, as
    mappings; they have the defaults of a case. answers: what was computed, by what was asked. Raises CaseError for
    tables that are wrong, or given beside a case, and for what is no problem.
    """

    def __init__(self, problem: Case | System | str | PathLike[str], /, **tables: Any) -> None:
        if isinstance(problem, str | PathLike):
            problem = load(problem)
        if not isinstance(problem, Case | System):  # pyright: ignore[reportUnnecessaryIsInstance]
            raise CaseError("problem", kind_of(problem), ACCEPTED)
        self._case = problem if isinstance(problem, Case) else None
        if isinstance(problem, Case):
            for name in tables:
                raise CaseError(name, None, "a table of the case; vary that: case.with_({…})")
            settings: Case | _Settings = problem
            self._build: Callable[[float | None], System] = lru_cache(SYSTEMS)(partial(build_system, problem))
        else:
            try:
                settings = _Settings(**tables)
            except ValidationError as error:
                raise CaseError.many(problems_of(error, tables, _Settings)) from None
            self._build = lambda mu: problem
        self.phases: tuple[Phase, ...] = settings.phases
        self.modal: Modal = settings.modal
        self.temporal: Temporal = settings.temporal
        self.comparison: Comparison = settings.comparison
        self.answers = AnswerCache()
        self.handed: Carried | None = None  # of modes at one μ, for those of systems with a small change

    @staticmethod
    def of(problem: Problem) -> Workspace:
        """The workspace itself, or a new one of a case, its file or a system. Raises CaseError for anything else."""
        return problem if isinstance(problem, Workspace) else Workspace(problem)

    @property
    def _line(self) -> str:
        of = self.system() if self._case is None else self._case
        return f"of {of!r}, {counted(self.answers.count, 'answer')} kept"

    def _repr_html_(self) -> str:
        of = self.system() if self._case is None else self._case
        table = of._repr_html_()  # pyright: ignore[reportPrivateUsage]
        return f"<div>{table}<div>{counted(self.answers.count, 'answer')} kept</div></div>"

    @property
    def given(self) -> Case | None:
        """The case, None of a system alone."""
        return self._case

    def case(self, what: str) -> Case:
        """The case. Raises CaseError of a system alone, with what it is that cannot do without one."""
        if self._case is None:
            takes = "takes a Case, the path of its file or a Workspace of one, not a System alone"
            raise CaseError("case", None, f"missing – {what} {takes}")
        return self._case

    @cached_property
    def varies(self) -> bool:
        """Whether factors of imported matrices depend on the friction coefficient."""
        return self._case is not None and MU in self._case.factor_names

    def system(self, mu: float | None = None) -> System:
        """The system, built once; where its matrices depend on friction, that at ``mu`` (None: the case's own).

        Raises what `build_system` raises."""
        return self._build(None if mu is None or not self.varies else float(mu))

    def ending(self, load: float = 1.0, speed: float = 1.0) -> Workspace:
        """The same in the steady sliding that a run through its phases ends with (`temporal.ended`), with ``load``
        times all loads and ``speed`` times all velocities of these, and answers of its own where that is another. A
        friction coefficient asked for is that at full velocities."""
        if load == speed == 1.0 and not ended(self.system(), phases_of(self)).words:
            return self

        def built(mu: float | None) -> System:
            system = self._build(mu)
            return ended(system, phases_of(self)).of(system, load, speed)

        other = copy(self)
        other.__dict__.pop("slides", None)  # the one property kept that loads decide
        other._build, other.answers = lru_cache(SYSTEMS)(built), AnswerCache()
        return other

    @cached_property
    def key(self) -> str:
        """The name of the case by its contents (`case_key`), "" of a system alone."""
        return "" if self._case is None else case_key(self._case)

    @cached_property
    def text(self) -> str:
        """The case as TOML, "" of a system alone."""
        return "" if self._case is None else self._case.text

    @property
    def options(self) -> Options:
        """What [modal] asks of the modal approach."""
        return options_of(self)

    @property
    def has_contacts(self) -> bool:
        """Whether anything is in contact."""
        return bool(self.system().contact_nodes().count if self._case is None else self._case.contacts)

    @property
    def rubs(self) -> bool:
        """Whether anything depends on the friction coefficient: contacts, or factors of matrices."""
        return self.has_contacts or self.varies

    @property
    def has_places(self) -> bool:
        """Whether nodes have places, so that shapes and pressures can be drawn."""
        system = self.system()
        return bool(system.solids or system.lines)

    @property
    def has_shapes(self) -> bool:
        """Whether there are beams or meshes whose shapes can be drawn: point masses have none."""
        system = self.system()
        return bool(system.lines) or any(solid.cells.keys() - {"vertex"} for solid in system.solids)

    @cached_property
    def slides(self) -> bool:
        """Whether contacts have a state of steady sliding, about which modes, onsets and a comparison are computed."""
        if not self.has_contacts:
            return False
        try:
            self.steady()
        except AnalysisError:
            return False
        return True

    @cached_property
    def own_friction(self) -> float | None:
        """The coefficient of all contacts at their mean slip speeds in steady sliding; None where they differ.

        Where the case has a parameter mu, and so no contacts, it is that.
        """
        if self._case is not None and MU in self._case.parameters:
            return self._case.parameters[MU].value
        if not self.has_contacts:
            return 0.0
        return friction_in_sliding(self.system())

    def one_friction(self) -> float:
        """The same; raises CaseError where contacts differ."""
        found = self.own_friction
        if found is None:
            raise CaseError(
                "mu", None, f"one friction coefficient for all contacts, since {different_friction(self.system())}"
            )
        return found

    @cached_property
    def one_for_all(self) -> tuple[str, ...]:
        """What is said with results over μ where contacts have different coefficients, which μ takes the place of."""
        if not self.has_contacts or (self._case is not None and len(self._case.contacts) < 2):
            return ()
        own = frictions_by_contact(self.system())
        if len(own) < 2 or _one(np.array(list(own.values()))):
            return ()
        given = ", ".join(f"{name} {value:g}" for name, value in own.items())
        nodes = self.system().contact_nodes()
        rigid = {nodes.names[k] for k in nodes.owner[nodes.compliance == 0.0]}
        soft = [name for name in own if name not in rigid]
        along = "" if self._case is None or not soft or self.system().load_steps else (
            f", and `onsets --along contacts.{soft[0]}.friction.coefficient` goes along that of one contact"
        )  # fmt: skip
        return (
            f"μ stands for one friction coefficient of all contacts, to which the case gives different ones ({given}), "
            f"so that their ratios do not count here; {KEPT_BY}{along}",
        )

    def steady(self, mu: float | None = None) -> SteadySliding:
        """Steady sliding, node by node, at ``mu`` (None: with the laws' own coefficients)."""
        return steady_nodes(self.system(mu), mu)

    def structured(self, what: str, mu: float | None = None) -> System:
        """The system, if its matrices are as ``what`` needs them: constant, with a mass that the time loop takes.
        Raises AnalysisError for others."""
        case = self._case
        if case is not None and self.varies:
            # Nothing gives μ: at 0 the matrices may be symmetric where they are not at any other.
            unsaid = mu is None and MU not in case.parameters and not case.contacts
            beyond = self.system(case.modal.friction_range[1]).not_symmetric_definite if unsaid else ""
            if what in ("compare", "run") or beyond:
                always = beyond and self.system(0.0).not_symmetric_definite
                why = f", and {'' if always else 'beyond mu = 0 '}{beyond}" if beyond else ""
                raise AnalysisError(
                    f"{what}: factors of imported matrices depend on mu{why}; the time loop takes constant matrices "
                    f"only; {self._works()}"
                )
        system = self.system(mu)
        if why := unfit_in_time(system):
            raise AnalysisError(f"{what}: {why}; {self._works()}")
        if not system.symmetric_definite and what == "run" and not self.has_contacts:
            raise AnalysisError(
                "run: there are no contacts and no factor of a matrix has mu in it, so there is no onset to solve for; "
                + self._works("simulate")
            )
        return system

    def _works(self, *more: str) -> str:
        """What to do in place of what the time loop does not take: verbs that take the problem."""
        verbs = ["report", "modes", *more, "onsets" if self.rubs else "onsets --along NAME"]
        verbs += ["steady"] if self.has_places else []
        *first, last = (f"`stridor {verb}`" for verb in verbs)
        return f"what works for these is {', '.join(first)} and {last}"


Problem = Case | System | Workspace | str | PathLike[str]
"""What every analysis takes; a text is the path of a case file."""


class Unsaved(Workspace):
    """Of what is drawn, or of which numbers alone are kept: no text of the case goes with its results, which takes as
    long as some of them."""

    @property
    def text(self) -> str:  # pyright: ignore[reportIncompatibleVariableOverride]  # ty: ignore[incompatible-property-override]
        """Nothing."""
        return ""


def friction_in_sliding(system: System) -> float | None:
    """The coefficient of all contacts of a system at their mean slip speeds in steady sliding; None where they differ,
    and where none says what a law makes of its nodes."""
    if untold_by_mean(system):
        return None
    found = np.array(list(frictions_by_contact(system).values()))
    if not len(found):
        return 0.0
    return float(found[0]) if _one(found) else None


def _one(coefficients: Array) -> bool:
    """Whether they are one but for the slip speeds that the facets of curved contacts give them."""
    return bool(np.ptp(coefficients) <= SAME_FRICTION * np.max(np.abs(coefficients)))


def different_friction(system: System) -> str:
    """Which contacts have different coefficients in steady sliding, and what to do."""
    if untold := untold_by_mean(system):
        return (
            f"the law of {', '.join(untold)} gives no friction at the mean slip speed of its nodes, and some at that "
            "of others, which no factor tells: name it (--mu 0.3), every contact with friction then has it; `steady` "
            "and `simulate` without μ answer with those of the law"
        )
    return f"the case gives them different ones: name it (--mu 0.3), every contact with friction then has it; {KEPT_BY}"


def frictions_by_contact(system: System) -> dict[str, float]:
    """The coefficient of each contact with friction, by its law at the mean slip speed of its nodes in steady sliding:
    that to which a μ asked for scales it, so that with this one it has its own law."""
    nodes = system.contact_nodes()
    every = zip(nodes.names, nodes.laws, nodes.mean_speed, strict=True)
    rubbing = set(nodes.owner[nodes.rubs].tolist())
    return {name: law.sliding(v) for k, (name, law, v) in enumerate(every) if k in rubbing}


def untold_by_mean(system: System) -> list[str]:
    """Contacts whose law is zero at the mean slip speed of their nodes, and is not at that of some of them."""
    nodes = system.contact_nodes()
    own, found = nodes.friction_coefficients(nodes.speed), list[str]()
    for k, (name, law, v) in enumerate(zip(nodes.names, nodes.laws, nodes.mean_speed, strict=True)):
        if not law.constant and law.sliding(v) == 0.0 and np.any(own[nodes.rubs & (nodes.owner == k)] > 0.0):
            found.append(name)
    return found


def in_proportion(system: System) -> tuple[System, float] | None:
    """The system whose contacts keep their coefficients to one another at any μ, and the μ, that of the largest, at
    which they have their own; None where none has friction, and where none says what a law makes of its nodes."""
    if untold_by_mean(system):
        return None
    own, nodes = frictions_by_contact(system), system.contact_nodes()
    largest = max(own.values(), default=0.0)
    if not largest:
        return None
    laws = [
        Shared(own_law(law), own.get(name, 0.0) / largest) for name, law in zip(nodes.names, nodes.laws, strict=True)
    ]
    return system.with_laws(laws), largest
