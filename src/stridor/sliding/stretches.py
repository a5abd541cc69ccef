"""Which nodes touch over the friction coefficient, or another number: stretches of it in which they are the same.

Friction redistributes the pressure, so that nodes of a surface open and close as μ grows. Between two such changes the
equilibrium is that of one linear problem and its forces and gaps are smooth in μ: where the first of them runs out is
foreseen by a straight line through the last two, and enclosed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..errors import AnalysisError, NotSlidingError
from ..system import System
from ..typing import Array, BoolArray
from .equilibrium import FEW
from .motions import placed
from .pressing import anything_acts, least_force
from .solution import ALL_TRIED, STEADY, SteadySliding, other_equilibria, steady_nodes, steady_sliding

HELD = "are held at every μ of the model"  # nodes of one friction coefficient
HELD_AT_ALL = "are held at all values of the model"
LOOKS = 9  # equilibria over a range, of small models
FEWER = 3  # of larger ones
SMALL = 8000  # freedoms
WIDTH = 1e-9  # of the largest μ: how closely a change is enclosed
WIDTH_ALONG = 1e-7  # of the largest size of another number, each of whose values is a system of its own
WIDTH_OF_NONE = 1e-3  # where there is no equilibrium on one side, which costs far more to find out
UNCLEAR = b""  # key of a μ at which who touches may be read in two ways
EDGE = 1e-3  # of a stretch: closer to a border it is looked at elsewhere which nodes it has
MOST = 40  # changes of single nodes; where there are more, each is small, and stretches of equal length do
EQUAL = 12  # of them


@dataclass(frozen=True)
class Stretch:
    """Friction coefficients from low to high at which the same nodes touch, and the same of those kept closed pull.

    at: a μ whose steady sliding has them, None where they are those of the case's own friction. touching: how many of
    ``nodes`` they are; pulling: how many of these pull. reason: why there is no steady sliding, "" where there is.
    others: how many nodes are others at one end or the other, of stretches that were cut where nothing changes; 0 of
    all that are exact. several: the μ that were looked at where other nodes may touch as well.
    """

    low: float
    high: float
    at: float | None
    touching: int = 0
    nodes: int = 0
    reason: str = ""
    others: int = 0
    several: tuple[float, ...] = ()
    pulling: int = 0

    def of(self, system: System) -> System:
        """The system whose modes hold these nodes."""
        return system.touching(self.at)


@dataclass(frozen=True)
class _Look:
    """Steady sliding at one μ: which nodes touch and which of those kept closed pull, as ``key``; None without any."""

    mu: float
    key: bytes | None
    found: SteadySliding | None
    reason: str = ""


def stretches(
    system: System, low: float, high: float, *, at: Sequence[float] | Array = (), solver: str | None = None
) -> tuple[Stretch, ...]:
    """The stretches that make up the friction coefficients from ``low`` to ``high``, in order. at (k,): μ between them
    whose own nodes have to be right; they are looked at whatever the others show, up to LOOKS of them.

    One, without a look, where nothing can change: nothing acts, or contacts may stick, whose state is held
    (`System.load_steps`). A set that comes and goes between two looks that agree is not seen. Where
    more than MOST nodes open or close, the range is cut into EQUAL parts, each with the nodes of its middle.
    """
    nodes = system.contact_nodes()
    if not nodes.count or not anything_acts(system) or system.load_steps:
        return (Stretch(low, high, None),)
    search = _Equilibria(system, solver)
    own = search.own()
    if own is None and (first := search.at(low)).found is None:
        return (Stretch(low, high, None, 0, nodes.count, first.reason),)
    count = LOOKS if system.size <= SMALL else FEWER
    asked = np.asarray(at if len(at) <= LOOKS else (), dtype=float)
    looks = [search.at(float(mu)) for mu in np.unique(np.append(np.linspace(low, high, count), asked))]
    return _between(search, looks, own)


def stretches_along(
    system_at: Callable[[float], System], own: System, low: float, high: float, *, rubs: bool = False,
    solver: str | None = None,
) -> tuple[Stretch, ...]:  # fmt: skip
    """`stretches` of another number than μ, from ``low`` to ``high``: system_at gives the system at its values, own is
    that of the case as it is. ``Stretch.at`` is a value of this number, and every contact has its own friction; rubs:
    the number is the friction of all contacts, and something else too."""
    nodes = own.contact_nodes()
    if not nodes.count or not anything_acts(own) or own.load_steps:
        return (Stretch(low, high, None),)
    search = _Along(own, system_at, max(abs(low), abs(high)), solver, rubs=rubs)
    looks = [search.at(float(value)) for value in np.linspace(low, high, LOOKS if own.size <= SMALL else FEWER)]
    if all(look.found is None for look in looks):
        return (Stretch(low, high, None, 0, nodes.count, looks[0].reason),)
    return _between(search, looks, search.own())


def _between(search: _Equilibria, looks: Sequence[_Look], own: bytes | None) -> tuple[Stretch, ...]:
    """The stretches between the first and the last of some looks."""
    low, high, count = looks[0].mu, looks[-1].mu, search.count
    if sum(_different(a, b) for a, b in pairwise(looks)) > MOST:
        return _equal(search, low, high, count)
    pieces = [looks[0]]
    borders: list[float] = []
    for before, after in pairwise(looks):
        for border, beyond in search.changes(before, after):
            borders.append(border)
            pieces.append(beyond)
            if len(pieces) > MOST:
                return _equal(search, low, high, count)
    ends = [low, *borders, high]
    several = _several(search, looks)
    return tuple(
        Stretch(
            a, b, None if piece.key == own else search.inside(a, b, piece),
            0 if piece.found is None else int(piece.found.active.sum()), count, piece.reason,
            pulling=0 if piece.found is None else int(piece.found.pulls.sum()),
            several=tuple(mu for mu in several if a <= mu <= b and not piece.reason),
        )
        for (a, b), piece in zip(pairwise(ends), pieces, strict=True)
    )  # fmt: skip


def _several(search: _Equilibria, looks: Sequence[_Look]) -> list[float]:
    """At which of some μ more than one set of touching nodes is in equilibrium, as far as all are tried."""
    if (free := search.free) > ALL_TRIED:
        return []
    some = looks if free < ALL_TRIED - 1 else [looks[0], looks[len(looks) // 2], looks[-1]]
    return [look.mu for look in some if look.found is not None and search.others(look.mu, look.found)]


def _equal(search: _Equilibria, low: float, high: float, count: int) -> tuple[Stretch, ...]:
    """Stretches of equal length with the nodes that touch in the middle of each."""
    edges = np.linspace(low, high, EQUAL + 1)
    result: list[Stretch] = []
    for a, b in pairwise(edges.tolist()):
        middle, ends = search.at(0.5 * (a + b)), (search.at(a), search.at(b))
        touching = 0 if middle.found is None else int(middle.found.active.sum())
        others = max(_different(middle, end) for end in ends)
        pulling = 0 if middle.found is None else int(middle.found.pulls.sum())
        result.append(Stretch(a, b, middle.mu, touching, count, middle.reason, others, pulling=pulling))
    return tuple(result)


def stretch_words(found: tuple[Stretch, ...], name: str = "μ") -> tuple[str, ...]:
    """A sentence on what touches where, and one on where there is no steady sliding; () where nothing changes. name: of
    the number whose values they are."""
    asked = " --mu" if name == "μ" else ""
    as_grows, one = ("as friction grows", "μ") if name == "μ" else (f"as {name} grows", "value")
    told: list[str] = []
    solid = [s for s in found if not s.reason]
    if (most := max((s.others for s in solid), default=0)) > 0:
        told.append(
            f"More than {MOST} of the {solid[0].nodes} contact nodes open or close between {name} = {found[0].low:.6g} "
            f"and {found[-1].high:.6g}: in each of {len(found)} equal stretches of {name} those touch that do so "
            f"in its middle, and up to {most} are others at its ends. Modes there are other ones: ask for one {one}, "
            "or a smaller range."
        )
    elif len(solid) > 1:
        alike = any(s.pulling for s in solid) and len({s.touching for s in solid}) == 1
        verb = "pull, of those kept closed," if alike else "touch"
        parts = [f"{_counts(s, alike)} between {name} = {s.low:.6g} and {s.high:.6g}" for s in solid]
        told.append(
            f"Of the {solid[0].nodes} contact nodes other ones {verb} in steady sliding {as_grows}: "
            f"{', '.join(parts)}. Each {one} is solved with those of its stretch; modes keep their numbers from one to "
            f"the next, where a single {one} numbers its own."
        )
    if several := sorted({mu for s in solid for mu in s.several}):
        where = ", ".join(f"{mu:.4g}" for mu in several)
        told.append(
            f"At {name} = {where} there is more than one equilibrium of steady sliding, each with other nodes that "
            f"touch: modes and onsets are those of one of them (`stridor steady{asked}` names the others)."
        )
    none = [(f"{s.low:.4g}", f"{s.high:.4g}", s.reason) for s in found if s.reason]
    # Where one equilibrium jumps to another there may be none at that μ alone.
    told += [f"Between {name} = {low} and {high} nothing was solved: {why}." for low, high, why in none if low != high]
    return tuple(told)


def _touch(stretch: Stretch) -> str:
    return f"{stretch.touching} touch" + (f", {stretch.pulling} of them pull" if stretch.pulling else "")


def _counts(stretch: Stretch, alike: bool) -> str:
    """How many touch, and pull, in a stretch; alike: as many touch in all of them."""
    if alike:
        return f"{stretch.pulling}"
    return f"{stretch.touching} ({stretch.pulling} of them pull)" if stretch.pulling else f"{stretch.touching}"


def instead_of_own(system: System, low: float, high: float, *, solver: str | None = None) -> float | None:
    """The μ from low to high whose touching nodes are held where there is no steady sliding at the case's own friction;
    None where there is, or nowhere in the middle or at the ends either."""
    nodes = system.contact_nodes()
    if not nodes.count or not anything_acts(system) or system.load_steps:
        return None
    search = _Equilibria(system, solver)
    if search.own() is not None:
        return None
    return next((mu for mu in (0.5 * (low + high), low, high) if search.at(mu).found is not None), None)


def elsewhere_words(found: tuple[Stretch, ...], name: str = "μ") -> tuple[str, ...]:
    """A sentence where a model that holds the nodes of the case's own friction has others than steady sliding."""
    others = [s for s in found if s.at is not None or s.reason]
    if not others:
        return ()
    own = next((s for s in found if s not in others), None)
    held = "The nodes" if own is None else f"The {own.touching} of {own.nodes} contact nodes"
    where = ", ".join(
        f"{s.low:.4g} to {s.high:.4g} ({'no steady sliding' if s.reason else _touch(s)})" for s in others
    )
    own_value = "at the case's own friction" if name == "μ" else "in the case as it is"
    at_every = HELD if name == "μ" else HELD_AT_ALL
    return (
        f"{held} that touch {own_value} {at_every}; steady sliding has others at "
        f"{name} = {where}. Modes there are other ones: `stridor modes` and `stridor onsets` have them.",
    )


class _Equilibria:
    """Equilibria by μ, each solved once, the nearest known one as its first guess. Of few nodes there is no guess:
    where there is more than one equilibrium, it would choose one that another question at the same μ does not have."""

    def __init__(self, system: System, solver: str | None) -> None:
        self._system, self._solver = system, solver
        self._known: dict[float, _Look] = {}
        self._guess: BoolArray | None = None
        nodes = system.contact_nodes()
        self.count, self.free = nodes.count, int(np.count_nonzero(~nodes.kept))

    def others(self, mu: float, found: SteadySliding) -> bool:
        """Whether other nodes may touch at ``mu`` as well, as far as all sets are tried."""
        return bool(other_equilibria(self._system, found, mu))

    def size(self, mu: float) -> float:
        """What the width of a change near ``mu`` is measured by."""
        return max(mu, 1e-3)

    @property
    def width(self) -> float:
        """How closely a change is enclosed."""
        return WIDTH

    def own(self) -> bytes | None:
        """The key of the laws' own coefficients; None where there is no steady sliding, and UNCLEAR where a node is
        about to open there, so that no stretch takes its nodes from it."""
        try:
            found = self._solved(None)
        except AnalysisError:
            return None  # what is asked of others needs it not
        self._guess = found.active
        touches = found.active & ~self._system.contact_nodes().kept
        clear = np.all(found.normal_force[touches] > least_force(self._system.in_place()))
        return _key(found) if clear else UNCLEAR

    def at(self, mu: float) -> _Look:
        """Steady sliding at ``mu``, kept with the system, also that there is none, which is dear to find out."""
        if mu not in self._known:
            self._known[mu] = self._system.once(("look", mu, self._solver), lambda: self._look(mu))
        return self._known[mu]

    def inside(self, low: float, high: float, piece: _Look) -> float:
        """A μ well between two borders that shows the nodes of a look: right behind a border, where a force or a gap
        is zero but for rounding, who touches may be read in two ways."""
        if piece.found is None:
            return piece.mu
        middle = 0.5 * (low + high)
        known = (k.mu for k in self._known.values() if k.key == piece.key and low <= k.mu <= high)
        mu = min(known, key=lambda mu: abs(mu - middle), default=piece.mu)
        if min(mu - low, high - mu) < EDGE * (high - low) and self.at(middle).key == piece.key:
            return middle
        return mu

    def _look(self, mu: float) -> _Look:
        try:
            found = self._solved(mu)
        except NotSlidingError:
            raise
        except AnalysisError as error:
            return _Look(mu, None, None, placed(error, mu))
        return _Look(mu, _key(found), found)

    def _solved(self, mu: float | None) -> SteadySliding:
        def solved() -> SteadySliding:
            guess = None if mu is None else self._near(mu)
            return steady_sliding(self._system, mu=mu, guess=guess, solver=self._solver)

        return self._system.once((STEADY, mu, self._solver), solved)

    def _near(self, mu: float) -> BoolArray | None:
        solved = [look for look in self._known.values() if look.found is not None]
        if self._system.contact_nodes().count <= FEW:
            return None
        if not solved:
            return self._guess
        nearest = min(solved, key=lambda look: abs(look.mu - mu)).found
        assert nearest is not None
        return nearest.active

    def changes(self, low: _Look, high: _Look) -> Iterator[tuple[float, _Look]]:
        """Each μ between two looks from which on other nodes touch, and a look beyond it that shows which."""
        width = self.width if None not in (low.key, high.key) else WIDTH_OF_NONE
        foreseen: float | None = None
        while low.key != high.key:
            span = high.mu - low.mu
            if span <= width * self.size(high.mu):
                # Where one side has no equilibrium, the other ends with the last that has.
                solved = [look.mu for look in (low, high) if look.found is not None]
                yield sum(solved) / len(solved), high
                return
            before, foreseen = foreseen, self._foreseen(low, high)
            for mu in _probes(low.mu, high.mu, foreseen, before, self.width * self.size(high.mu)):
                look = self.at(mu)
                if look.key == low.key:
                    low = look
                elif look.key == high.key:
                    high = look
                else:
                    yield from self.changes(low, look)
                    low, foreseen = look, None
                    break

    def _foreseen(self, low: _Look, high: _Look) -> float | None:
        """Where the first force or gap of either set runs out, on lines through its two nearest looks; None unknown."""
        for edge in (low, high):
            others = [k for k in self._known.values() if k.key == edge.key and k.mu != edge.mu]
            if edge.found is None or not others:
                continue
            other = min(others, key=lambda k: abs(k.mu - edge.mu))
            assert other.found is not None
            margin, other_margin = _margin(edge.found), _margin(other.found)
            with np.errstate(divide="ignore", invalid="ignore"):
                at = edge.mu - margin * (edge.mu - other.mu) / (margin - other_margin)
            inside = at[(at > low.mu) & (at < high.mu)]
            if len(inside):
                return float(inside.min() if edge is low else inside.max())
        return None


class _Along(_Equilibria):
    """The same by the values of another number, each with a system of its own. scale: the largest size of one."""

    def __init__(
        self, own: System, system_at: Callable[[float], System], scale: float, solver: str | None, *, rubs: bool
    ) -> None:
        super().__init__(own, solver)
        self._system_at, self._scale, self._rubs = system_at, scale, rubs

    def others(self, mu: float, found: SteadySliding) -> bool:
        return bool(other_equilibria(self._system_at(mu), found, mu if self._rubs else None))

    def size(self, mu: float) -> float:
        return self._scale

    @property
    def width(self) -> float:
        return WIDTH_ALONG

    def at(self, mu: float) -> _Look:
        if mu not in self._known:
            self._known[mu] = self._look(mu)
        return self._known[mu]

    def _look(self, mu: float) -> _Look:
        try:
            system = self._system_at(mu).in_place()
            found = steady_nodes(system, mu if self._rubs else None, self._solver, guess=self._near(mu))
        except NotSlidingError:
            raise
        except AnalysisError as error:
            return _Look(mu, None, None, f"{error}; that is at {mu:.6g}")
        return _Look(mu, _key(found), found)


def _probes(
    low: float, high: float, foreseen: float | None, before: float | None, width: float | None = None
) -> Iterator[float]:
    """Where to look next, low < μ < high: on both sides of what is foreseen, the closer the better that was; width: how
    closely a change is enclosed (None: WIDTH of the highest μ)."""
    span = high - low
    if foreseen is None:
        yield 0.5 * (low + high)
        return
    doubt = 0.05 * span if before is None else 4.0 * abs(foreseen - before)
    doubt = min(max(doubt, 0.25 * (WIDTH * high if width is None else width)), 0.2 * span)
    yield min(max(foreseen - doubt, low + 0.02 * span), high - 0.02 * span) if foreseen - doubt > low else low + doubt
    yield foreseen + doubt if foreseen + doubt < high else high - doubt


def _different(one: _Look, other: _Look) -> int:
    """How many nodes touch, or pull, at one of two μ alone; none where there is no steady sliding at either."""
    if one.found is None or other.found is None:
        return 0
    changed: BoolArray = (one.found.active != other.found.active) | (one.found.pulls != other.found.pulls)
    return int(np.count_nonzero(changed))


def _key(found: SteadySliding) -> bytes:
    """What modes hold of steady sliding: who touches, and which way friction goes where a kept contact pulls."""
    return np.concatenate([found.active, found.pulls]).tobytes()


def _margin(found: SteadySliding) -> Array:
    """What may run out, per node (m,): the normal force where it touches, the gap where it is open."""
    return np.where(found.active, found.normal_force, found.gap)
