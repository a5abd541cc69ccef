"""The last lines of a verb: its result in a sentence, and which command makes sense next."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..case.repeating import ALIKE, is_of_alike
from ..digits import fixed, measured, readable
from ..notebook import counted
from .closing import Conclusion

if TYPE_CHECKING:
    from ..modal.full import ParametricOnsets
    from ..modal.onsets import Onsets
    from ..modal.results import ComplexModes
    from ..study.measures import Countermeasures
    from ..study.sensitivities import Sensitivities

BEYOND = 1.1  # times an onset: where its growth is well to be seen


def fastest(frequency_hz: float, growth: float) -> str:
    """A growing mode in a few words."""
    return f"{readable(frequency_hz)} Hz, +{readable(growth)} 1/s"


def _is_are(count: int, of: str) -> str:
    """How many of so many modes are unstable; of: their number, and where."""
    if of.startswith("0 modes"):
        return f"no mode{of.removeprefix('0 modes')}"
    return f"{count or 'none'} of {of} {'are' if count > 1 else 'is'} unstable"


def of_modes(result: ComplexModes, mu: str | None, *, drawn: bool = True, rubs: bool = True) -> Conclusion:
    """How many are unstable and which is the fastest; then its shape (the report, where the model has none to be
    drawn), or where growth begins (the report, where nothing depends on friction: rubs). mu: as the user gave it."""
    from ..modal.growing import doubt
    from .show_modes import without

    growing = result.unstable & result.in_band
    rate = np.where(growing, result.growth_rate, -np.inf)
    unsure = any(doubt(said) for said in result.completeness)
    caution = "; not all of it was checked, see above" if unsure else ""
    if any(is_of_alike(said) for said in result.completeness):
        caution = f", of {ALIKE}{caution}"
    if len(result.mu) > 1:
        some = growing.any(axis=1)
        # Where there is no steady sliding nothing is stable or unstable: those μ are not counted.
        known = int(np.count_nonzero(result.solved))
        sentence = f"unstable modes at {int(some.sum()) or 'none'} of {counted(known, 'friction coefficient')}"
        if some.any():
            row, b = (int(k) for k in np.unravel_index(int(rate.argmax()), rate.shape))
            first = float(result.mu[some].min())
            top = fastest(float(result.frequency_hz[row, b]), float(rate[row, b]))
            sentence += f", the lowest {first:g}; the fastest at μ = {result.mu[row]:g}: {top}"
        sentence += without(result)
        return Conclusion(sentence + caution, "onsets" if rubs else "report")
    band = "" if result.max_frequency_hz is None else f" up to {result.max_frequency_hz:g} Hz"
    band = " from {:g} to {:g} Hz".format(*result.band_hz) if result.band_hz is not None else band
    sentence = _is_are(int(growing.sum()), f"{result.total[0]} modes{band}")
    sentence += f" at μ = {result.mu[0]:g}" if rubs else ", and no friction coefficient of the case has a say in it"
    if not growing.any():
        return Conclusion(sentence + caution, "onsets" if rubs else "report")
    b = int(rate[0].argmax())
    sentence += f"; the fastest {fastest(float(result.frequency_hz[0, b]), float(rate[0, b]))}"
    own = ("--mu", mu) if mu is not None else ()
    if not drawn:
        return Conclusion(sentence + caution, "report", own)
    return Conclusion(sentence + caution, "shapes", (*own, "--branch", str(result.branch[b])))


def of_onsets(result: Onsets) -> Conclusion:
    """From which μ on something grows; then the modes there."""
    low, high = result.friction_range
    over = f"for μ in {low:g} … {high:g} {result.frequencies}"
    over += f", of {ALIKE}" if is_of_alike(result.completeness) else ""
    if result.at_start_words:
        return Conclusion(f"unstable from the start of the range, μ = {low:g}", "modes", ("--mu", f"{low:g}"))
    first, seen = result.first, "" if result.complete else ", but see above"
    if first is None:
        ends = len(result)
        what = "no onset" if not ends else f"growth only ends, {counted(ends, 'time')},"
        return Conclusion(f"{what} {over}{seen}", "modes")
    count = f"{len(result.onsets)} onsets" if len(result.onsets) > 1 else "1 onset"
    said = f"{count} {over}; growth begins at μ = {fixed(first.mu, 6)}, {readable(first.frequency_hz)} Hz{seen}"
    return Conclusion(said, "modes", ("--mu", f"{min(BEYOND * first.mu, high):.3g}"))


def of_onsets_along(found: ParametricOnsets) -> Conclusion:
    """From which value of a number on something grows; then the modes there."""
    name, (low, high) = found.parameter, found.between
    over = f"along {name} in {low:g} … {high:g} up to {found.max_frequency_hz:g} Hz"
    begins = [o for o in found if not o.stabilising]
    if not found:
        return Conclusion(f"no onset {over}" + ("" if found.complete else ", but see above"))
    count = f"{len(found)} onsets" if len(found) > 1 else "1 onset"
    first, what = (begins[0], "begins") if begins else (found[0], "ends")
    seen = "" if found.complete else ", but see above"
    return Conclusion(f"{count} {over}; growth {what} at {first.value:.6g}, {readable(first.frequency_hz)} Hz{seen}")


def of_shapes(documents: Sequence[dict[str, Any]], mu: str | None) -> Conclusion:
    """What was drawn; then what changes the fastest mode."""
    own = ("--mu", mu) if mu is not None else ()
    growing = [d for d in documents if d["unstable"]]
    drawn = f"{len(documents)} mode{'' if len(documents) == 1 else 's'} drawn"
    if not growing:
        return Conclusion(f"{drawn}, none of them unstable", "onsets")
    top = max(growing, key=lambda d: d["growth_rate"])
    said = f"{drawn}; the fastest: mode {top['branch']}, {fastest(top['frequency_hz'], top['growth_rate'])}"
    return Conclusion(said, "countermeasures", (*own, "--branch", str(top["branch"])))


def of_sensitivities(result: Sensitivities, mu: str | None) -> Conclusion:
    """Which number the growth of which mode answers to most; then changes that help."""
    own = ("--mu", mu) if mu is not None else ()
    known = np.isfinite(result.growth_per_percent)
    if not known.any():
        return Conclusion("", "modes", own)  # the warnings say why
    if not result.beyond_rounding.any():
        name = result.parameters[0] if len(result.parameters) == 1 else f"each of {len(result.parameters)} numbers"
        said = f"a per cent more of {name} changes the growth of no mode by more than rounding"
        return Conclusion(said, "modes", own)
    change = np.where(known & result.beyond_rounding, np.abs(result.growth_per_percent), 0.0)
    k, b = (int(i) for i in np.unravel_index(int(np.argmax(change)), change.shape))
    rate = float(result.growth_per_percent[k, b])
    name, mode = result.parameters[k], result.branch[b]
    said = f"a per cent more of {name} changes the growth of mode {mode} most: {rate:+.4g} 1/s"
    return Conclusion(said, "countermeasures", own)


def of_countermeasures(result: Countermeasures, value_of: Callable[[str], float], mu: str | None) -> Conclusion:
    """The change that takes most growth away, as it was solved again or is predicted; then the modes with the best
    change of a number made. value_of: what a number of the case is."""
    from ..study.measures import more_of

    own = ("--mu", mu) if mu is not None else ()
    if not result.measures:
        return Conclusion("", "modes", own)  # the warnings say why
    if not result.helpful:
        return Conclusion("no change takes growth away", "modes", own)
    best = result.helpful[0]
    if best.verified is None:
        said = f"best: {best.words}, predicted to take {readable(best.removed, 4)} 1/s away"
        if again := result.solved_again:
            said = f"{counted(again, 'change')} solved again, and none takes growth away; {said}"
    else:
        left = len(best.verified.unstable_hz)
        rest = f"{left} unstable mode{'' if left == 1 else 's'} left" if left else "nothing grows then"
        said = f"best: {best.words}, takes {readable(best.verified.removed, 4)} 1/s away, solved again; {rest}"
    # Of numbers those first that were solved again: a prediction may not hold.
    numbers = [m for m in result.helpful if m.kind == "number"]
    number = min(numbers, key=lambda m: m.verified is None, default=None)
    if number is None:
        return Conclusion(said)
    value = value_of(number.name) if number.value is None else number.value
    name, new = number.name, more_of(value, number.direction * number.percent)
    if name == "mu":
        return Conclusion(said, "modes", ("--mu", f"{new:.6g}"))
    if name == "parameters.mu.value" or (mu is not None and name.endswith(".friction.coefficient")):
        return Conclusion(said)  # --mu is asked for of all contacts, whatever the case has
    if name.endswith(".compliance"):  # a case has its inverse
        name, new = name.removesuffix("compliance") + "stiffness", 1 / new
    return Conclusion(said, "modes", (*own, "--set", f"{name}={new:.6g}"))


def of_run(summary: dict[str, Any], *, slides: bool = True) -> Conclusion:
    """What vibrates at the end of a run in time; then both approaches side by side, where bodies slide steadily."""
    from ..study.run_summary import slower_is_stronger
    from ..temporal.growth import state_of

    if summary["dominant_frequency_hz"] is None:
        said = (
            "last phase: too few records or periods (some six are needed) for a dominant frequency, or nothing vibrates"
        )
        return Conclusion(said, "modes" if slides else "")
    rate, fit = summary["growth_rate"], summary["growth_fit"]
    state, growth = "saturated" if summary["saturated"] else "not saturated", "nowhere exponential growth"
    if rate is not None:
        state = state_of(rate, fit["end"] - fit["start"], saturated=bool(summary["saturated"]))
        growth = f"growth {measured(rate, 1)} 1/s where exponential"
    growth = "" if state == "of constant amplitude" else f"{growth}, "
    loudest, below = measured(summary["dominant_frequency_hz"], 1), summary["stronger_below_hz"]
    said = f"last phase: {loudest} Hz {'dominates' if below is None else 'is the strongest line'}, {growth}{state}"
    if below is not None:
        said += f"; {slower_is_stronger(below)}"
    return Conclusion(said, "compare" if slides else "")


def of_reduced(
    document: Sequence[dict[str, Any]], found: ParametricOnsets | None, ranges: Mapping[str, str], *,
    elsewhere: bool = False, doubtful: bool = False,
) -> Conclusion:  # fmt: skip
    """What grows at the points that were asked for, and where growth begins; then the other of the two. ranges: of each
    parameter, as --at takes them. elsewhere: whether other nodes touch at some values than those that are held;
    doubtful: whether the model does not hold at some of those asked for, or may not."""
    first = next(iter(ranges))
    onsets = None if found is None else of_onsets_along(found).sentence
    held = ", with what the model holds: that is not so, or not known to be, at some values, see the notes"
    if elsewhere:
        held = ", with the nodes that are held: others touch at some values, see the note"
    if not document:
        return Conclusion(onsets or "", "reduce", ("--at", f"{first}={ranges[first]}"))
    some = sum(any(point["unstable"]) for point in document)
    modes = [(g, f) for p in document for g, f in zip(p["growth_rate"], p["frequency_hz"], strict=True)]
    said = f"unstable modes at {some or 'none'} of {len(document)} point{'' if len(document) == 1 else 's'}"
    if some:
        rate, frequency = max(modes)
        said += f"; the fastest {fastest(frequency, rate)}"
    said += held if elsewhere or doubtful else ""
    if onsets is None:
        return Conclusion(said, "reduce", ("--onsets", first))
    return Conclusion(f"{said}\n{onsets}")
