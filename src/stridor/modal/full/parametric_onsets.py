"""Onsets of instability along any parameter of a reduced model, each solved again in the full problem.

The reduced problem is searched as any other is (`search`), and what is found is solved again in the full one.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...case.points import choice
from ...digits import hertz, readable
from ...errors import CaseError
from ...notebook import Shown, counted, html_table
from ...tabular import Rows, Tabular, dataset
from ...threads import one_thread
from ...typing import ComplexArray
from ..dense_problem import combined
from ..growing import UNCHECKED
from ..newton import Root, crossing, meeting, standstill
from ..onset import Onset, from_above
from ..options import Options
from ..parametric import ReducedModel
from ..parametric.contacts_steady import FRICTION, STIFFNESS
from ..parametric.problem import NOT_KNOWN
from ..quadratic import RegionModes
from ..tables import ONSET
from .branches import ends_of
from .counted import ends as turns
from .growth import unstable
from .held_in_full import HeldInFull, Listed, held_in_full
from .line import OnTerms, ParameterLine, of_model
from .opening import told
from .passages import quiet
from .search import search
from .words import sentence

COLUMNS = (
    "value", "frequency_hz", "residual", "square_root_coefficient", "reduced_value", "growth_slope", "enters_at",
    "stabilising",
)  # fmt: skip
ELSEWHERE = "other nodes touch at some of these values (see the note), and modes there are other ones"
LOOKS, FEWER = 9, 3  # values of a line at which it is looked who touches, of small models and of larger ones
SMALL = 8000  # freedoms
NEAR = 1e-3  # of the range and of λ: how far from the reduced model's onset the full problem's may be


@dataclass(frozen=True, repr=False)
class ParametricOnset(Shown):
    """A mode becomes unstable (or stable, ``stabilising``, as the parameter grows) at ``value`` of ``parameter``.

    point: values of all parameters there. kind: "flutter", "divergence" or "contact"
    (growth that begins or ends because other nodes touch). growth_slope: dRe λ/dp [1/s per unit], None
    where two undamped modes meet, whose growth opens as κ √|p − p_c| with κ = square_root_coefficient, 0 where growth
    opens at the low end of the range as a square or a higher power. residual:
    backward error in the full problem, None where it was not solved there. reduced_value: what the reduced model alone
    said. enters_at: where growth begins above the model's frequency, the value (to about a step of following) at which
    the growing mode comes below it; None of all others.
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
    enters_at: float | None = None

    @property
    def _line(self) -> str:
        ends = ", where growth ends" if self.stabilising else ""
        return f"{self.parameter} = {self.value:.6g}, {hertz(self.frequency_hz)}, {self.kind}{ends}"

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return {
            "value": self.value,
            "frequency_hz": self.frequency_hz,
            "kind": self.kind,
            "growth_slope": self.growth_slope,
            "square_root_coefficient": self.square_root_coefficient,
            "stabilising": self.stabilising,
            "residual": self.residual,
            "enters_band_at": self.enters_at,
        }


class ParametricOnsets(Tabular, tuple[ParametricOnset, ...]):
    """Onsets in ascending order, of a parameter over a range up to max_frequency_hz. complete: whether as many roots
    grow, wherever that was looked at, as they say; sentence: that in words. notes: what else was taken how; warnings:
    that the parameter has no effect. provenance: of which case, where there is one."""

    parameter: str
    between: tuple[float, float]
    max_frequency_hz: float
    complete: bool
    sentence: str
    notes: tuple[str, ...]
    warnings: tuple[str, ...]
    provenance: dict[str, Any]

    @classmethod
    def of(
        cls, onsets: Sequence[ParametricOnset], model: ReducedModel, parameter: str, *, complete: bool, sentence: str
    ) -> ParametricOnsets:
        """Onsets with what is to be said of them."""
        made = cls(onsets)
        made.parameter, made.complete, made.sentence = parameter, complete, sentence
        (own,) = (p for p in model.problem.parameters if p.name == parameter)
        made.between, made.max_frequency_hz = (own.low, own.high), model.frequency / (2 * np.pi)
        made.notes = tuple(getattr(model.problem, "notes", ()))
        made.warnings = tuple(words for words in model.problem.idle_words if words.startswith(f"{parameter} "))
        made.provenance = {}
        return made

    def to_json(self) -> dict[str, Any]:
        """Plain values, as `stridor onsets --along NAME --json` prints them."""
        return {
            "parameter": self.parameter,
            "range": list(self.between),
            "max_frequency_hz": self.max_frequency_hz,
            "onsets": [onset.to_json() for onset in self],
            "completeness": self.sentence,
            "complete": self.complete,
            "notes": list(self.notes),
            "warnings": list(self.warnings),
        }

    def table(self) -> Rows:
        """Heads and rows, as its CSV file has them: a row for each onset."""
        return ONSET, [
            (
                o.parameter, o.value, o.frequency_hz, o.kind, o.stabilising, None, None, o.growth_slope,
                o.square_root_coefficient, o.enters_at, o.residual,
            )
            for o in self
        ]  # fmt: skip

    def to_xarray(self) -> Any:
        """xarray.Dataset with dimensions onset and number (of those whose values ``point`` holds), as `st.save` writes
        it; what there is once is JSON in the attribute ``onsets``."""

        def column(name: str) -> list[float]:
            return [np.nan if (v := getattr(o, name)) is None else float(v) for o in self]

        units = {"frequency_hz": "Hz", "residual": "1", "square_root_coefficient": "1/s"}
        variables: dict[str, Any] = {
            name: ("onset", np.array(column(name)), {"units": units[name]} if name in units else {}) for name in COLUMNS
        }
        variables["kind"] = ("onset", np.array([o.kind for o in self], dtype=object))
        variables["stabilising"] = ("onset", np.array([o.stabilising for o in self], dtype=np.int8))
        names = list(self[0].point) if self else []
        point = np.array([[float(o.point[n]) for n in names] for o in self]).reshape(len(self), len(names))
        variables["point"] = (("onset", "number"), point)
        coords = {"number": ("number", np.array(names, dtype=object))}
        data = dataset("onsets along", variables, coords, self.provenance)
        once = {name: value for name, value in self.to_json().items() if name != "onsets"}
        return data.assign_attrs(parameter=self.parameter, onsets=json.dumps(once))

    @classmethod
    def from_xarray(cls, data: Any) -> ParametricOnsets:
        """The onsets whose `to_xarray` that is. Raises KeyError, TypeError or ValueError where it is none's."""
        told = json.loads(data.attrs["onsets"])
        low, high = (float(v) for v in told["range"])
        if not (np.isfinite(low) and np.isfinite(high) and low < high and told["max_frequency_hz"] > 0):
            raise ValueError("its range is none")
        texts = [told["parameter"], told["completeness"], *told["notes"], *told["warnings"]]
        if not all(isinstance(text, str) for text in texts) or not isinstance(told["complete"], bool):
            raise ValueError("its texts are none")
        names = [str(name) for name in data["number"].values]

        def maybe(value: float) -> float | None:
            return None if np.isnan(value) else value

        onsets: list[ParametricOnset] = []
        for k in range(data.sizes["onset"]):
            at = {name: float(data[name].values[k]) for name in COLUMNS}
            if data["kind"].values[k] not in ("flutter", "divergence", "contact"):
                raise ValueError("an onset of another kind")
            onsets.append(
                ParametricOnset(
                    told["parameter"], at["value"], dict(zip(names, map(float, data["point"].values[k]), strict=True)),
                    at["frequency_hz"], maybe(at["growth_slope"]), bool(at["stabilising"]), maybe(at["residual"]),
                    at["reduced_value"], str(data["kind"].values[k]), maybe(at["square_root_coefficient"]),
                    maybe(at["enters_at"]),
                )
            )  # fmt: skip
        made = cls(onsets)
        made.parameter, made.between, made.max_frequency_hz = told["parameter"], (low, high), told["max_frequency_hz"]
        made.complete, made.sentence = told["complete"], told["completeness"]
        made.notes, made.warnings = tuple(told["notes"]), tuple(told["warnings"])
        made.provenance = json.loads(data.attrs["provenance"])
        return made

    @property
    def _line(self) -> str:
        low, high = self.between
        first = next((o for o in self if not o.stabilising), None)
        begins = "" if first is None else f"; growth begins at {first.value:.6g}, {hertz(first.frequency_hz)}"
        return f"{len(self) or 'none'} for {self.parameter} from {low:g} to {high:g}{begins}"

    def _repr_html_(self) -> str:
        heads = (self.parameter, "frequency [Hz]", "what", "growth", "slope [1/s]", "residual")
        rows = [
            (
                f"{o.value:.6g}", readable(o.frequency_hz), o.kind, "ends" if o.stabilising else "begins",
                "" if o.growth_slope is None else readable(o.growth_slope, 4),
                "" if o.residual is None else f"{o.residual:.0e}",
            )
            for o in self
        ]  # fmt: skip
        low, high = self.between
        title = f"{counted(len(self), 'onset')} for {self.parameter} from {low:g} to {high:g}"
        return html_table(title, heads, rows, (*self.from_above_words(), self.sentence, *self.warnings, *self.notes))

    def from_above_words(self) -> list[str]:
        """Onsets above the band whose mode comes into it, a line each."""
        return [
            from_above(o.parameter, f"{o.value:.6g}", o.frequency_hz, self.max_frequency_hz, o.enters_at)
            for o in self
            if o.enters_at is not None
        ]


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
    left out and named in the sentence. It also seeks what grows at both ends anew there: where that is not what grows
    on the model, or was not found, the onsets are not complete. Raises CaseError for unknown parameters.
    """
    names = [p.name for p in model.problem.parameters]
    if parameter not in names:
        raise CaseError("parameter", parameter, f"no such parameter{choice(parameter, names, 'there are')}")
    point = model.problem.point(fixed or {})
    line = of_model(model, parameter, point)
    top = model.searched
    source = OnTerms(line, top, model.projected)
    source.find_at_rest()
    ends = ends_of(line, 0.0, 1.0, top)
    answer = search(line, [lambda: source], (0.0, 1.0), ends, top)
    full = ParameterLine(model.problem, parameter, point, Options(solver=solver)) if confirm else None
    tried = [(o, _confirmed(model, source, full, o) if full else _of(line, o, None)) for o in answer.onsets]
    onsets = [found for _, found in tried if found is not None]
    where = "" if model.keeps_all else "in the reduced model"
    left_out = len(onsets) < len(tried)
    held = _held(model, line, ends, top, solver) if confirm else None
    differs = held is not None and not held.holds
    lead = "With these" if left_out else "On the model" if differs else ""
    said = sentence(line, answer, ends, top, parameter, line.value, where, lead)
    complete = answer.vouched and not differs
    if left_out:
        lost = ", ".join(f"{line.value(o.mu):.6g} ({o.frequency_hz:.6g} Hz)" for o, found in tried if found is None)
        complete, said = False, f"Not confirmed in the full problem and left out: {parameter} = {lost}. {said}"
    if held is not None and where:
        said = _with_full(said, held, parameter, line)
    elif where:
        said = f"{UNCHECKED} in the full problem: what grows is what the model has. {said}"
    # Of a mode with other nodes in contact nothing was sought.
    others = unlike_along(model, parameter, point)
    if others:
        complete, said = False, f"Not complete: {others}. {said}"
    elif getattr(model.problem, "elsewhere", ()):
        complete, said = False, f"Not complete: {ELSEWHERE}. {said}"
    listed = sorted(onsets, key=lambda o: o.value)
    return ParametricOnsets.of(listed, model, parameter, complete=complete, sentence=said)


def _held(
    model: ReducedModel, line: ParameterLine, ends: tuple[RegionModes, RegionModes], top: float, solver: str | None
) -> HeldInFull:
    """What the full problem says of what grows on the model at both ends of a line."""
    listed = [
        Listed(line.point(s), end.values, unstable(line, end.values, top))
        for s, end in zip((0.0, 1.0), ends, strict=True)
    ]
    return held_in_full(model, listed, damped=not line.reversible, solver=solver)


def _with_full(said: str, held: HeldInFull, name: str, line: ParameterLine) -> str:
    """A sentence with what the full problem says of both ends."""
    if held.holds:
        return f"{said} In the full problem the same modes grow at both ends, sought anew there."
    if held.why:
        return f"{UNCHECKED}: {held.why}. {said}"
    places = zip(held.amiss, (0.0, 1.0), strict=True)
    told = "; ".join(f"{words} at {name} = {line.value(s):g}" for words, s in places if words)
    return f"Not complete: {told}. {said}"


def _of(line: ParameterLine, onset: Onset, root: Root | None) -> ParametricOnset:
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
        None if onset.enters_at is None else line.value(onset.enters_at),
    )  # fmt: skip


def _confirmed(model: ReducedModel, source: OnTerms, full: ParameterLine, onset: Onset) -> ParametricOnset | None:
    """The same in the full problem, by Newton from there; None where that does not lead to it."""
    lam, s = 2j * np.pi * onset.frequency_hz, onset.mu
    with quiet():
        right, left = source.null_vectors(lam, s)
    x, y = (combined(model.vectors, v[:, None])[:, 0].astype(complex) for v in (right, left))
    between = max(s - NEAR, 0.0), min(s + NEAR, 1.0)
    for root in _roots(full, s, lam, x, y, between, onset):
        near = root is not None and abs(root.lam - lam) <= NEAR * max(abs(lam), 1e-3 * model.searched)
        if near and root is not None and turns(root) == onset.stabilising:
            return _of(full, onset, root)
    return None


def _roots(
    full: ParameterLine, s: float, lam: complex, x: ComplexArray, y: ComplexArray, between: tuple[float, float],
    onset: Onset,
) -> Iterator[Root | None]:
    if onset.kind == "divergence":
        yield standstill(full, s, x, y, between)
        return
    if onset.growth_slope == 0.0 or (s == full.low and not onset.stabilising):
        # Growth that opens at the low end, or has begun before it by less than rounding, is no root in the range.
        opened = told(full, lam, x, y)
        yield None if opened is None else opened.root
        if onset.growth_slope == 0.0:
            return
    if not full.reversible:
        yield crossing(full, s, lam, x, y, between)
    yield meeting(full, s, lam, x, y, between)


def unlike_along(model: ReducedModel, parameter: str, fixed: Mapping[str, float] | None = None) -> str:
    """Words on that the model does not hold somewhere on the line of `onsets_along`, or that it is not
    known; "" where they do not. Of a box of one number, and of what is dear inside of it, `elsewhere` tells."""
    point = model.problem.point(fixed or {})
    problem, cheap = model.problem, parameter in (FRICTION, STIFFNESS)
    (own,) = (p for p in problem.parameters if p.name == parameter)
    inside = problem.inside(point)
    if inside and (len(problem.parameters) == 1 or not (cheap or problem.size <= SMALL)):
        return ""
    count = LOOKS if cheap or problem.size <= SMALL else FEWER
    places = [{**point, parameter: float(value)} for value in np.linspace(own.low, own.high, count)]
    said = [(at, words) for at, words in zip(places, model.unlike(places), strict=True) if words]
    if not said:
        return ""
    others = ", ".join(f"{name} = {value:.6g}" for name, value in point.items() if name != parameter)
    if all(words == NOT_KNOWN for _, words in said):
        return f"{others} lies {NOT_KNOWN}"
    at, words = said[0]
    where = f"{parameter} = {at[parameter]:.4g}" + (f", {others}" if others else "")
    return (
        f"the model does not hold at {len(said)} of {count} values that were looked at, such as {where} ({words}), and "
        "modes there are other ones"
    )
