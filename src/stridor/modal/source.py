"""Where eigenpairs come from: sources that differ in cost, never in meaning.

- receptance: few point contacts on a complete basis of the structure without them. The fastest.
- krylov: sparse symmetric matrices that stand without friction, on a basis enriched until it is right.
- reduced: a reduced model over μ, made once, whose modes are solved in the full problem. Asked for by name alone.
- full: any matrices, searched region by region. The slowest, and the one that takes everything.

`sources_for` names those that take a system, the fastest first; where one turns out not to serve, the next is asked. A
source asked for by name is the only one. That all give the same is tested (`test_source_agreement`).
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal, Protocol, TypeVar

from ..direct import SingularMatrix
from ..errors import AnalysisError, CaseError, FollowingError
from ..sliding import far_apart
from ..system import System
from ..system.uncoupled import no_complete_basis
from ..typing import Array
from .full import full_modes, full_onsets
from .full.reduced_source import reduced_modes, reduced_onsets
from .krylov import Carried, NotPositive, krylov_modes, krylov_onsets
from .onset import Onsets
from .options import Options
from .quadratic.find import WHOLE
from .receptance_modes import modes_by_receptance
from .receptance_onsets import onsets_by_receptance
from .results import ComplexModes, Progress
from .unfit import Unfit

_log = logging.getLogger("stridor")

Answer = TypeVar("Answer", ComplexModes, Onsets)


@dataclass(frozen=True)
class ModesAsked:
    """What is asked of a source: the band (None: as many branches as ``count``), whether C is used, what is kept.

    follow: branches are followed that start up to so many times the band. numbered_at: the μ from which on they may be
    followed, where their names are of no matter; sources that follow from 0 whatever is asked go on doing so. carried:
    what one stretch of μ hands on to the next. unfollowed: why they were not, where another
    source tried. residuals: whether backward errors are asked for; sources that have them anyway give them.
    """

    max_frequency_hz: float | None
    damped: bool
    options: Options
    count: int | None = 20
    vectors: bool | Literal["right"] = False
    residuals: bool = True
    progress: Progress | None = None
    follow: float = 1.1
    numbered_at: float = 0.0
    carried: Carried | None = None
    unfollowed: str = ""

    @property
    def band_hz(self) -> float:
        """The end of the band [Hz]. Raises CaseError where branches are counted instead."""
        if self.max_frequency_hz is None:
            raise CaseError("max_frequency_hz", None, "missing – modes are sought in a band")
        return self.max_frequency_hz


class EigenSource(Protocol):
    """Whoever gives the eigenpairs of a band over μ, and the onsets between."""

    @property
    def name(self) -> str:
        """The word a user chooses it by."""
        ...

    def refuses(self, system: System, options: Options) -> str:
        """Why it does not take a system, as far as can be seen without computing; "" if it does."""
        ...

    def modes(self, system: System, values: Array, asked: ModesAsked) -> ComplexModes:
        """Modes at values (k,) of μ. Raises Unfit and FollowingError where another source may serve."""
        ...

    def onsets(self, system: System, friction_range: tuple[float, float], asked: ModesAsked) -> Onsets:
        """Onsets between two μ. Raises Unfit where another source may serve."""
        ...


class ReceptanceSource:
    """Roots of the contacts' receptance."""

    name = "receptance"

    def refuses(self, system: System, options: Options) -> str:
        """See `EigenSource`."""
        if options.prestress and system.stress_stiffness is not None:
            return "stresses of steady sliding stiffen it (prestress)"
        return no_complete_basis(system)

    def modes(self, system: System, values: Array, asked: ModesAsked) -> ComplexModes:
        """See `EigenSource`."""
        return modes_by_receptance(
            system, values, count=asked.count or 20, max_frequency_hz=asked.max_frequency_hz, damped=asked.damped,
            vectors=asked.vectors, residuals=asked.residuals, progress=asked.progress,
        )  # fmt: skip

    def onsets(self, system: System, friction_range: tuple[float, float], asked: ModesAsked) -> Onsets:
        """See `EigenSource`."""
        return onsets_by_receptance(
            system, friction_range, max_frequency_hz=asked.band_hz, damped=asked.damped, follow=asked.follow
        )


class KrylovSource:
    """Frictionless modes and enrichment on one symmetric factorisation."""

    name = "krylov"

    def refuses(self, system: System, options: Options) -> str:
        """See `EigenSource`."""
        return system.not_symmetric_definite

    def modes(self, system: System, values: Array, asked: ModesAsked) -> ComplexModes:
        """See `EigenSource`."""
        try:
            return krylov_modes(
                system, values, count=asked.count or 20, max_frequency_hz=asked.max_frequency_hz, damped=asked.damped,
                vectors=asked.vectors, options=asked.options, progress=asked.progress, numbered_at=asked.numbered_at,
                carried=asked.carried,
            )  # fmt: skip
        except NotPositive as error:
            raise Unfit(str(error), asked.max_frequency_hz) from error

    def onsets(self, system: System, friction_range: tuple[float, float], asked: ModesAsked) -> Onsets:
        """See `EigenSource`."""
        try:
            return krylov_onsets(
                system, friction_range, max_frequency_hz=asked.band_hz, damped=asked.damped, options=asked.options,
                follow=asked.follow, numbered_at=asked.numbered_at, carried=asked.carried,
            )  # fmt: skip
        except NotPositive as error:
            raise Unfit(str(error), asked.max_frequency_hz) from error


class ReducedSource:
    """A reduced model over μ, its modes solved in the full problem. Asked for by name."""

    name = "reduced"

    def refuses(self, system: System, options: Options) -> str:
        """See `EigenSource`."""
        return ""

    def modes(self, system: System, values: Array, asked: ModesAsked) -> ComplexModes:
        """See `EigenSource`."""
        return reduced_modes(
            system, values, max_frequency_hz=asked.band_hz, damped=asked.damped, vectors=asked.vectors,
            options=asked.options, progress=asked.progress,
        )  # fmt: skip

    def onsets(self, system: System, friction_range: tuple[float, float], asked: ModesAsked) -> Onsets:
        """See `EigenSource`."""
        return reduced_onsets(
            system, friction_range, max_frequency_hz=asked.band_hz, damped=asked.damped, options=asked.options,
            beyond=asked.follow,
        )  # fmt: skip


class FullSource:
    """The region search, matrices of any structure."""

    name = "full"

    def refuses(self, system: System, options: Options) -> str:
        """See `EigenSource`."""
        return ""

    def modes(self, system: System, values: Array, asked: ModesAsked) -> ComplexModes:
        """See `EigenSource`."""
        if asked.max_frequency_hz is None and (why := system.not_symmetric_definite):
            raise CaseError("max_frequency_hz", None, f"missing – {why}: modes are sought in a band")
        return full_modes(
            lambda _: system, values, count=None, max_frequency_hz=asked.band_hz, damped=asked.damped,
            vectors=asked.vectors, options=asked.options, progress=asked.progress, unfollowed=asked.unfollowed,
        )  # fmt: skip

    def onsets(self, system: System, friction_range: tuple[float, float], asked: ModesAsked) -> Onsets:
        """See `EigenSource`."""
        return full_onsets(
            lambda _: system, friction_range, max_frequency_hz=asked.band_hz, damped=asked.damped,
            options=asked.options,
        )  # fmt: skip


SOURCES: tuple[EigenSource, ...] = (ReceptanceSource(), KrylovSource(), ReducedSource(), FullSource())
UNASKED = tuple(source for source in SOURCES if source.name != ReducedSource.name)


def sources_for(system: System, options: Options) -> tuple[EigenSource, ...]:
    """The sources that take a system with such options, the fastest first; with a name in them that one alone.

    Raises CaseError for a name that none has, AnalysisError where the named one does not take the system.
    """
    name = options.source
    if name is None:
        # What turned out not to suit receptances is known to suit any matrices alone.
        first = next(source for source in UNASKED if not source.refuses(system, options))
        return (first,) if first is SOURCES[-1] else (first, SOURCES[-1])
    chosen = next((source for source in SOURCES if source.name == name), None)
    if chosen is None:
        names = ", ".join(source.name for source in SOURCES)
        raise CaseError("source", name, f"one of {names}, or none for what suits")
    if why := chosen.refuses(system, options):
        raise AnalysisError(f"source {name}: {why}; {_others(system, options, name)}")
    return (chosen,)


def by_receptance(system: System, options: Options) -> bool:
    """Whether modes at any μ are roots of receptances unless a source is asked for: they cost next to nothing."""
    return sources_for(system, replace(options, source=None))[0].name == ReceptanceSource.name


def require_full(name: str | None) -> None:
    """Raise AnalysisError for a source by name that takes no matrices which depend on μ."""
    if name not in (None, SOURCES[-1].name):
        raise AnalysisError(
            f"source {name}: factors of imported matrices depend on mu; leave it out, or take {SOURCES[-1].name}"
        )


def answered(
    system: System, asked: ModesAsked, ask: Callable[[EigenSource, ModesAsked], Answer], *, without_following: bool
) -> Answer:
    """The answer of the first source that serves.

    without_following: whether a source that follows no branches is asked where they cannot be told apart. Raises
    SingularMatrix in words of the system where its stiffnesses lie too far apart.
    """
    try:
        return _answered(system, asked, ask, without_following=without_following)
    except SingularMatrix as error:
        if apart := far_apart(system):
            raise SingularMatrix(apart, error.motion) from error
        raise


def _answered(
    system: System, asked: ModesAsked, ask: Callable[[EigenSource, ModesAsked], Answer], *, without_following: bool
) -> Answer:
    *first, last = sources_for(system, asked.options)
    for source in first:
        try:
            _log.info("source %s, the fastest that takes %d freedoms", source.name, system.size)
            return replace(ask(source, asked), source=source.name)
        except Unfit as error:
            _log.info("source %s does not serve: %s", source.name, error)
            band = asked.max_frequency_hz
            if band is None and error.band_hz is None:
                raise
            count = asked.count if band is None else None
            asked = replace(asked, count=count, max_frequency_hz=band or error.band_hz)
        except FollowingError as error:
            if not without_following or asked.max_frequency_hz is None or system.size > WHOLE:
                raise
            _log.info("source %s follows branches that cannot be told apart: %s", source.name, error)
            # What is the matter, without the advice, which is for those who get no answer.
            asked = replace(asked, count=None, unfollowed=str(error).partition(";")[0])
    try:
        chosen = "asked for" if not first and asked.options.source else "which takes any matrices"
        _log.info("source %s, %s", last.name, chosen)
        return replace(ask(last, asked), source=last.name)
    except Unfit as error:
        raise Unfit(f"source {last.name}: {error}; {_others(system, asked.options, last.name)}") from error


def _others(system: System, options: Options, failed: str) -> str:
    """What to ask for instead of the source ``failed``, which does not serve."""
    fit = [source.name for source in SOURCES if source.name != failed and not source.refuses(system, options)]
    return f"leave it out for what suits, or take {' or '.join(fit)}"
