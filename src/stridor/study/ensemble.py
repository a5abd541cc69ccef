"""Temporal ensembles: one case over friction, loads, speeds and starts, and which unstable mode responds where."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, Literal

import numpy as np

from ..asking import FUNCTION, NUMBER, NUMBERS, SWITCH, TEXT, takes
from ..case.fields import MOST
from ..errors import CaseError
from ..modal.painleve import steps_undetermined
from ..notebook import counted
from ..sliding import full_motion
from ..system import System
from ..temporal.ensembles import EnsembleOutcome, march_all
from ..temporal.legs import Member, in_two, require_window
from ..temporal.settings import Settings
from ..temporal.simulate import Progress, step_of
from ..temporal.trajectory import Trajectory
from ..typing import Array, IntArray
from .analyses import check_extent
from .asked import require_choice, require_count, require_friction
from .ensemble_modes import UnstableMap, unstable_modes
from .ensemble_numbers import LEAST_RECORDS, MemberNumbers, Observable, last_phase, numbers_of, observable_of
from .ensemble_result import AXES, Ensemble
from .pressed import require_pressed_in_time
from .provenance import provenance
from .run_summary import slower_is_stronger
from .settings import phases_of, settings_of
from .workspace import Problem, Workspace

ONE_EACH = ("rms", "peak", "frequency_hz", "stronger_below_hz", "growth_rate")  # numbers of a member, as of the result
UNSEEN = "what vibrates is rounding, and whether they would grow it does not say; give a perturbation to see it"

Values = float | Sequence[float] | Array | None
Sweep = Literal["up", "down", "both"]


@takes(
    mu=NUMBERS.or_none(), load=NUMBERS.or_none(), speed=NUMBERS.or_none(), perturbation=NUMBERS.or_none(),
    grid=SWITCH, observable=TEXT.or_none(), window=NUMBER, modes=SWITCH, records=SWITCH, progress=FUNCTION,
)  # fmt: skip
def ensemble(
    problem: Problem,
    *,
    mu: Values = None,
    load: Values = None,
    speed: Values = None,
    perturbation: Values = None,
    initial: Literal["rest", "steady-sliding"] | None = None,
    grid: bool = True,
    sweep: Sweep | None = None,
    swept: Literal["mu", "load", "speed"] | None = None,
    observable: str | None = None,
    window: float = 0.5,
    modes: bool = True,
    records: bool = False,
    cores: int | None = None,
    separately: bool = False,
    device: Literal["auto", "cpu", "gpu"] = "auto",
    progress: Progress | None = None,
) -> Ensemble:
    """Runs in time of one case, side by side: every combination of the values given, or with ``grid`` False the first
    of each, the second of each and so on.

    mu scales every contact's friction law at the case's own speed; load and speed are factors on all loads and on all
    prescribed velocities (None: 1); perturbation [m/s] of the slip speed at the start, where runs begin in steady
    sliding (initial; None: as [temporal] says). sweep: members that differ in the number ``swept`` (None: mu) follow
    one another, each from where the one before ended, for the duration of the last phase, with rising values ("up"),
    falling ones ("down") or both; loads and speeds change by a ramp over its first tenth, friction at once. observable:
    what amplitudes are of ("beam1.tip.velocity", "A.normal_force"; default the velocity of the first watched point);
    window: the share of the last phase that is looked at. modes False leaves out the modal map. records keeps the
    members' runs from the start of the last phase on. cores: threads (None: all). separately: one run after the other
    in any case. device: "gpu" (`stridor[gpu]`), "cpu", or "auto", a GPU where there is one and members are many.

    Members go side by side on the modal path with contacts that slide little; others take separate runs, and a note
    says so. A member that fails is a row with its error. progress is called with steps done and planned of all. Ctrl-C
    returns what is finished. Raises CaseError for values that are none, AnalysisError where a GPU is asked for and
    cannot be had, and what `simulate` raises for all members.
    """
    started = time.perf_counter()
    require_choice(initial, "initial", ("rest", "steady-sliding", None))
    if cores is not None:
        require_count(cores, "cores", more=", or None for all")
    work = Workspace.of(problem)
    values = _values(work, mu, load, speed, perturbation, initial)
    plan = _Plan.of(values, grid=grid, sweep=sweep, swept=swept)
    system = work.structured("simulate")
    require_pressed_in_time(work, system, "ensemble")
    check_extent(work, system)
    settings = settings_of(work)
    if initial is not None:
        settings = replace(settings, initial=initial)
    if speed is not None and not np.any(system.motion.full):
        raise CaseError("speed", None, "no support of the case moves with a prescribed velocity, so none can be scaled")
    looked_at = observable_of(observable, system, settings)
    _check_window(work, system, settings, window)
    watch = settings.watch if records else (looked_at.owner,) if looked_at.of_point else ()
    seen = _Seen(looked_at, work.modal.max_frequency_hz, plan, records, settings.initial == "steady-sliding")
    outcome = march_all(
        system, phases_of(work), replace(settings, watch=watch), plan.tracks, seen.see, window=window, cores=cores,
        progress=progress, separately=separately, device=device,
    )  # fmt: skip
    found = _modes(work, plan) if modes else UnstableMap(1.0, {}, ())
    made = provenance(work, "ensemble", time.perf_counter() - started, **_asked(values, grid, sweep, swept, window))
    result = _result(work, system, plan, seen, outcome, found, window, made)
    highest = None if np.isnan(plan.rows[:, 0]).all() else float(np.nanmax(plan.rows[:, 0]))
    beyond = steps_undetermined(settings.system(system), highest, work.options)
    return replace(result, notes=(*result.notes, beyond)) if beyond else result


def _check_window(work: Workspace, system: System, settings: Settings, window: float) -> None:
    """Refuse a window that is none, or of too few records for a spectrum."""
    require_window(window)
    step = step_of(system, settings, in_two(phases_of(work), window))
    count = int(window * work.phases[-1].duration / step / settings.record_every)
    if count < LEAST_RECORDS:
        raise CaseError(
            "window", window,
            f"a share of the last phase with {LEAST_RECORDS} records at least, here it has {count}: let that phase "
            "last longer, or record more often (temporal.record_every)",
        )  # fmt: skip


def _values(
    work: Workspace, mu: Values, load: Values, speed: Values, perturbation: Values, initial: str | None
) -> dict[str, Array]:
    """What members differ in, by name, checked; NaN for friction that is the laws' own."""
    starts = initial or work.temporal.initial
    if perturbation is not None and starts != "steady-sliding":
        raise CaseError(
            "perturbation", None, 'goes with initial = "steady-sliding"; from rest runs are disturbed anyway'
        )
    own = work.own_friction
    default = {
        "mu": np.nan if own is None else own, "load": 1.0, "speed": 1.0, "perturbation": work.temporal.perturbation
    }  # fmt: skip
    given = {"mu": mu, "load": load, "speed": speed, "perturbation": perturbation}
    made: dict[str, Array] = {}
    for name, values in given.items():
        array = np.atleast_1d(np.asarray(default[name] if values is None else values, dtype=float))
        factor = name in ("load", "speed")
        low = array <= 0.0 if factor else array < 0.0
        if values is not None and (array.ndim != 1 or not len(array) or not np.isfinite(array).all() or low.any()):
            raise CaseError(name, values, f"finite numbers {'above 0' if factor else '≥ 0'}, at least one")
        if array.max() > MOST:  # as of every number of a case
            raise CaseError(name, float(array.max()), f"numbers up to {MOST:g}")
        made[name] = array
    if mu is not None:
        require_friction(float(made["mu"].max()))
    return made


def _asked(values: dict[str, Array], grid: bool, sweep: str | None, swept: str | None, window: float) -> dict[str, Any]:
    asked = {name: [None if np.isnan(v) else float(v) for v in array] for name, array in values.items()}
    return asked | {"grid": grid, "sweep": sweep, "swept": swept or "mu" if sweep else None, "window": window}


@dataclass(frozen=True)
class _Plan:
    """Members (k, 4) in the order of the result, their branch, tracks of members and where each of these belongs."""

    axes: tuple[tuple[str, Array], ...]
    rows: Array
    sweep: tuple[str, ...]
    tracks: tuple[tuple[Member, ...], ...]
    place: dict[tuple[int, int], int]

    @classmethod
    def of(cls, values: dict[str, Array], *, grid: bool, sweep: str | None, swept: str | None) -> _Plan:
        """Raises CaseError for lists of several lengths, and a sweep of what has one value."""
        if swept is not None and sweep is None and swept in AXES[:3]:
            raise CaseError("swept", swept, "goes with sweep: up, down or both")
        swept = swept or "mu"
        if sweep not in (None, "up", "down", "both") or swept not in AXES[:3]:
            name, given = ("swept", swept) if swept not in AXES[:3] else ("sweep", sweep)
            raise CaseError(name, given, "mu, load or speed" if name == "swept" else "up, down or both")
        if not grid:
            return cls._listed(values, sweep)
        values = {name: np.unique(array) if sweep and name == swept else array for name, array in values.items()}
        if sweep and len(values[swept]) < 2:
            raise CaseError("sweep", sweep, f"goes over {swept}, of which two or more values are needed")
        branches = {None: ("",), "up": ("up",), "down": ("down",), "both": ("up", "down")}[sweep]
        combined = np.array(list(product(*(values[name] for name in AXES))))
        rows, marks = np.tile(combined, (len(branches), 1)), tuple(b for b in branches for _ in combined)
        numbers = np.arange(len(rows)).reshape(len(branches), *(len(values[name]) for name in AXES))
        if sweep:
            moved = np.moveaxis(numbers, 1 + AXES.index(swept), 1)
            moved = moved.reshape(len(branches), len(values[swept]), -1)
            chains = [moved[k][::-1] if branch == "down" else moved[k] for k, branch in enumerate(branches)]
            order = np.concatenate(chains).T
        else:
            order = numbers.reshape(-1, 1)
        return cls(tuple(values.items()), rows, marks, *_tracks(rows, order))

    @classmethod
    def _listed(cls, values: dict[str, Array], sweep: str | None) -> _Plan:
        if sweep:
            raise CaseError("sweep", sweep, "goes over all combinations of values: grid=True")
        count = max(len(array) for array in values.values())
        for name, array in values.items():
            if len(array) not in (1, count):
                raise CaseError(name, f"{len(array)} values", f"one value or {count}, as many as others have")
        rows = np.stack([np.broadcast_to(values[name], count) for name in AXES], axis=1)
        return cls((), rows, ("",) * count, *_tracks(rows, np.arange(count)[:, None]))


def _tracks(rows: Array, order: IntArray) -> tuple[tuple[tuple[Member, ...], ...], dict[tuple[int, int], int]]:
    """Members of each track, and the row of each by track and number in it."""
    tracks = tuple(tuple(_member(rows[int(k)]) for k in line) for line in order)
    return tracks, {(t, leg): int(k) for t, line in enumerate(order) for leg, k in enumerate(line)}


def _member(row: Array) -> Member:
    mu, load, speed, perturbation = (float(v) for v in row)
    return Member(None if np.isnan(mu) else mu, load, speed, perturbation)


class _Seen:
    """Takes runs as they are finished, from any thread, and keeps their numbers."""

    def __init__(
        self, observable: Observable, max_frequency_hz: float, plan: _Plan, records: bool, begun_in_sliding: bool
    ) -> None:
        self.begun_in_sliding = begun_in_sliding
        self.observable, self.max_frequency_hz, self.plan, self.records = observable, max_frequency_hz, plan, records
        self.numbers: dict[int, MemberNumbers] = {}
        self.errors: dict[int, str] = {}
        self.runs: dict[int, Trajectory] = {}

    def see(self, track: int, leg: int, run: Trajectory | str) -> None:
        """One member."""
        row = self.plan.place[track, leg]
        if isinstance(run, str):
            self.errors[row] = run
            return
        disturbed = not self.begun_in_sliding or leg > 0 or bool(self.plan.rows[row, 3] != 0.0)
        self.numbers[row] = numbers_of(run, self.observable, self.max_frequency_hz, disturbed=disturbed)
        if self.records:
            self.runs[row] = last_phase(run)


def _modes(work: Workspace, plan: _Plan) -> UnstableMap:
    if np.isnan(plan.rows[:, 0]).any():
        return UnstableMap(1.0, {}, ("no modal map: contacts have different friction coefficients; name mu",))
    mus, loads, speeds = ([float(v) for v in plan.rows[:, k]] for k in range(3))
    return unstable_modes(work, mus, speeds, loads)


def _result(
    work: Workspace, system: System, plan: _Plan, seen: _Seen, outcome: EnsembleOutcome, found: UnstableMap,
    window: float, made: dict[str, Any],
) -> Ensemble:  # fmt: skip
    """All rows."""
    count = len(plan.rows)
    names = next((tuple(n.contacts) for n in seen.numbers.values()), ())
    one = {name: np.full(count, np.nan) for name in ONE_EACH}
    shares = {name: np.full((count, len(names)), np.nan) for name in ("stick", "slip", "separation")}
    mode, mode_hz, deviation = np.zeros(count, dtype=np.int64), np.full(count, np.nan), np.full(count, np.nan)
    regime = ["failed" if k in seen.errors else "interrupted" for k in range(count)]
    for k, numbers in seen.numbers.items():
        regime[k] = numbers.regime
        for name, values in one.items():
            values[k] = getattr(numbers, name)
        for name, values in shares.items():
            values[k] = [getattr(c, f"{name}_fraction") for c in numbers.contacts.values()]
        growing = found.at(float(plan.rows[k, 0]), float(plan.rows[k, 2]), float(plan.rows[k, 1]))
        responds = numbers.regime in ("steady", "transient", "grows") and np.isnan(numbers.stronger_below_hz)
        if growing is not None and responds:  # else its line is not what is strongest, and no mode answers to it
            mode[k], mode_hz[k], deviation[k] = growing.nearest(numbers.frequency_hz)
    separate = () if outcome.side_by_side else (f"separate runs, not side by side: {outcome.reason}",)
    separate += (outcome.said,) if outcome.said else ()
    nodes = system.contact_nodes()
    sliding = np.linalg.norm(nodes.slip_velocity(full_motion(system)), axis=1).max(initial=0.0)
    end = sum(p.duration for p in work.phases)
    given = () if np.isnan(plan.rows[:, 0]).all() else work.one_for_all
    rest = [k for k, name in enumerate(regime) if name == "still" and seen.begun_in_sliding and not plan.rows[k, 3]]
    if rest:
        given = (*given, f"{counted(len(rest), 'member')} without a perturbation stayed in steady sliding: {UNSEEN}")
    slower = one["stronger_below_hz"][np.isfinite(one["stronger_below_hz"])]
    if len(slower):
        said = slower_is_stronger(float(slower.max()), "the window")
        which = f"the line of {counted(len(slower), 'member')} does not dominate, and no mode is named for it"
        given = (*given, f"{which}: {said}")
    return Ensemble(
        mu=plan.rows[:, 0], load=plan.rows[:, 1], speed=plan.rows[:, 2], perturbation=plan.rows[:, 3],
        sweep=plan.sweep, slip_speed=plan.rows[:, 2] * float(sliding), observable=seen.observable.name,
        unit=seen.observable.unit, **one, **shares, contact_names=names, regime=tuple(regime), mode=mode,
        mode_hz=mode_hz, mode_deviation=deviation, error=tuple(seen.errors.get(k, "") for k in range(count)),
        window=(end - window * work.phases[-1].duration, end), step=outcome.step,
        method="side by side" if outcome.side_by_side else "separate runs", axes=plan.axes, modal=found.map,
        runs=tuple(seen.runs.get(k) for k in range(count)) if seen.records else (),
        notes=(*separate, *found.notes, *given),
        interrupted=outcome.interrupted, device=outcome.device, provenance=made,
    )  # fmt: skip
