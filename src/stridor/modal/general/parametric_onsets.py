"""Onsets of instability along any parameter of a reduced model, each solved again in the full problem.

The reduced problem is searched as any other is (`onsets`): branches followed, passages enclosed, meetings of undamped
modes solved as the double roots they are, and the modes that grow at both ends held against what the onsets say.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...errors import AnalysisError, CaseError
from ...threads import one_thread
from ...typing import ComplexArray
from ..assembled.steady import Options
from ..onset import Onset
from ..parametric import ReducedModel
from ..parametric.basis import expanded
from ..quadratic import Spectrum
from .counted import GRID, Counted, counted
from .counted import ends as turns
from .line import Line, OnTerms, of_model
from .newton import Root, crossing, meeting, standstill
from .onsets import FINER, ends_of, solved, unstable
from .passages import quiet

NEAR = 1e-3  # of the range and of λ: how far from the reduced model's onset the full problem's may be


@dataclass(frozen=True)
class ParametricOnset:
    """A mode becomes unstable (or stable, ``stabilising``, as the parameter grows) at ``value`` of ``parameter``.

    point: values of all parameters there. kind: "flutter" or "divergence". growth_slope: dRe λ/dp [1/s per unit], None
    where two undamped modes meet, whose growth opens as κ √|p − p_c| with κ = square_root_coefficient. residual:
    backward error in the full problem, None where it was not solved there. reduced_value: what the reduced model alone
    said.
    """

    parameter: str
    value: float
    point: Mapping[str, float]
    frequency_hz: float
    growth_slope: float | None
    stabilising: bool
    residual: float | None
    reduced_value: float
    kind: str = "flutter"
    square_root_coefficient: float | None = None


class ParametricOnsets(tuple[ParametricOnset, ...]):
    """Onsets in ascending order. complete: whether as many modes turn unstable at them as grow at the end of the range
    and not at its start; sentence: that in words."""

    complete: bool
    sentence: str

    @classmethod
    def of(cls, onsets: Sequence[ParametricOnset], *, complete: bool, sentence: str) -> ParametricOnsets:
        """Onsets with what is to be said of them."""
        made = cls(onsets)
        made.complete, made.sentence = complete, sentence
        return made


@one_thread
def onsets_along(
    model: ReducedModel,
    parameter: str,
    fixed: Mapping[str, float] | None = None,
    *,
    confirm: bool = True,
    solver: str | None = None,
) -> ParametricOnsets:
    """Every change of stability along a parameter's range up to the model's frequency, the others held at ``fixed`` (or
    their own values), in ascending order.

    confirm solves each again in the full problem, two or three factorisations for one; what that does not confirm is
    left out and named in the sentence. Raises CaseError for unknown parameters.
    """
    names = [p.name for p in model.problem.parameters]
    if parameter not in names:
        raise CaseError("parameter", parameter, f"no such parameter; there are: {', '.join(names)}")
    point = model.problem.point(fixed or {})
    line = of_model(model, parameter, point)
    top = model.frequency
    source = OnTerms(line, top, model.projected)
    source.settle()
    ends = ends_of(line, 0.0, 1.0, top)
    found, complete, seen = _found(source, ends, top)
    inside = sorted((o for o in found if _counts(o, top)), key=lambda o: (o.mu, o.frequency_hz))
    full = Line(model.problem, parameter, point, Options(solver=solver)) if confirm else None
    tried = [(o, _confirmed(model, source, full, o) if full else _of(line, o, None)) for o in inside]
    onsets = [found for _, found in tried if found is not None]
    said = _sentence(line, ends, inside, top, complete=complete, seen=seen)
    if len(onsets) < len(tried):
        lost = ", ".join(f"{line.value(o.mu):.6g} ({o.frequency_hz:.6g} Hz)" for o, found in tried if found is None)
        complete, said = False, f"Not confirmed in the full problem and left out: {parameter} = {lost}. {said}"
    return ParametricOnsets.of(sorted(onsets, key=lambda o: o.value), complete=complete, sentence=said)


def _found(source: OnTerms, ends: tuple[Spectrum, Spectrum], top: float) -> tuple[list[Onset], bool, Counted | None]:
    """Onsets of the reduced problem, whether the modes that grow agree with them, and what was counted on a grid where
    branches were not followed."""
    found: list[Onset] = []
    try:
        for finer in (1, FINER):
            ours, _, complete = solved(source, (0.0, 1.0), ends, top, finer)
            found = [f.onset for f in ours]
            if complete:
                return found, True, None
    except AnalysisError:
        # Branches cannot be told apart, as where damping is beyond critical. What grows does not depend on that.
        pass
    seen = counted(source, top)
    if found and not seen.agree:
        return found, False, None
    return [_as_onset(source, root) for root in seen.roots], seen.agree, seen


def _as_onset(source: OnTerms, root: Root) -> Onset:
    return Onset(
        mu=root.mu, frequency_hz=abs(root.lam.imag) / (2 * np.pi), kind="flutter" if root.lam else "divergence",
        damped=source.family.dissipates, stabilising=turns(root), branches=(0, 0), residual=root.residual,
        square_root_coefficient=None if root.square is None else float(np.sqrt(abs(root.square))),
        growth_slope=root.slope,
    )  # fmt: skip


def _counts(onset: Onset, top: float) -> bool:
    inside = 2 * np.pi * onset.frequency_hz <= top or onset.enters_at is not None
    return 0.0 <= onset.mu <= 1.0 and bool(inside)


def _of(line: Line, onset: Onset, root: Root | None) -> ParametricOnset:
    """The onset in terms of the parameter, as the full problem has it where that was asked."""
    length = line.parameter.high - line.parameter.low
    s = onset.mu if root is None else root.mu
    slope, opening = onset.growth_slope, onset.square_root_coefficient
    if root is not None:
        slope = root.slope
        opening = None if root.square is None else float(np.sqrt(abs(root.square)))
    if slope is not None:
        opening = None
    return ParametricOnset(
        line.parameter.name, line.value(s), line.point(s),
        onset.frequency_hz if root is None else abs(root.lam.imag) / (2 * np.pi),
        None if slope is None else slope / length, onset.stabilising, None if root is None else root.residual,
        line.value(onset.mu), onset.kind, None if opening is None else opening / np.sqrt(length),
    )  # fmt: skip


def _confirmed(model: ReducedModel, source: OnTerms, full: Line, onset: Onset) -> ParametricOnset | None:
    """The same in the full problem, by Newton from there; None where that does not lead to it."""
    lam, s = 2j * np.pi * onset.frequency_hz, onset.mu
    with quiet():
        right, left = source.null_vectors(lam, s)
    x, y = (expanded(model.vectors, v[:, None].astype(complex))[:, 0] for v in (right, left))
    between = max(s - NEAR, 0.0), min(s + NEAR, 1.0)
    for root in _roots(full, s, lam, x, y, between, onset):
        near = root is not None and abs(root.lam - lam) <= NEAR * max(abs(lam), 1e-3 * model.frequency)
        if near and root is not None and turns(root) == onset.stabilising:
            return _of(full, onset, root)
    return None


def _roots(
    full: Line, s: float, lam: complex, x: ComplexArray, y: ComplexArray, between: tuple[float, float], onset: Onset
) -> Iterator[Root | None]:
    if onset.kind == "divergence":
        yield standstill(full, s, x, y, between)
        return
    if not full.reversible:
        yield crossing(full, s, lam, x, y, between)
    yield meeting(full, s, lam, x, y, between)


def _sentence(
    line: Line, ends: tuple[Spectrum, Spectrum], found: Sequence[Onset], top: float, *, complete: bool,
    seen: Counted | None,
) -> str:  # fmt: skip
    first, last = (int(np.count_nonzero(unstable(line, end.values, top))) for end in ends)
    name = line.parameter.name
    low, high = (f"{line.value(s):g}" for s in (0.0, 1.0))
    counts = f"in the reduced model {first} modes grow at {name} = {low} and {last} at {high}"
    if complete and seen is not None:
        passing = f", {seen.passed} passing the highest frequency while they grow" if seen.passed else ""
        return (
            f"As many modes grow at each of {GRID + 1} values of {name} as the onsets say{passing}: {counts}. Branches "
            "were not followed; growth that begins and ends again between two of these values may be missing."
        )
    if complete:
        return f"Complete as far as both ends tell: {counts}, as the onsets say."
    begins = sum(not o.stabilising for o in found)
    return (
        f"Not complete: {counts}, but growth begins at {begins} onsets between them and ends at {len(found) - begins}. "
        f"Take a smaller range of {name}."
    )
