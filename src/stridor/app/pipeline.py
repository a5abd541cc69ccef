"""`stridor run` and `stridor report`: the analyses of a case, their files, their page."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from datetime import datetime
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ..agreement import PartStore, dominant_response, last_rate, modal_assurance, settled_velocity
from ..asking import FUNCTION, PATH, STORE, SWITCH, takes
from ..case.repeating import in_alike, repeating
from ..digits import measured
from ..errors import CaseError, StridorError
from ..io.atomic import write_text
from ..io.csv_files import write_csv
from ..io.datasets import load_trajectory, save
from ..io.datasets import open as open_result
from ..io.finished import FOLDER, FinishedParts
from ..io.kept_parts import NAME, KeptParts
from ..modal.complex_modes import ComplexModes
from ..modal.onsets import Onsets
from ..notebook import Shown, html_table
from ..periodic import Cycles
from ..study.asked import require_friction
from ..study.comparison import other_in_time
from ..study.everything import Everything, compute_everything
from ..study.fingerprint import same_model
from ..study.parts import OF_REPORT, RunParts, chosen_parts
from ..study.provenance import versions
from ..study.workspace import Problem, Workspace
from ..temporal.signals import low_passed, spectrogram, spectrum
from ..temporal.simulate import Progress
from ..temporal.trajectory import Trajectory
from ..view.inputs import FrictionCurve, NamedFrequencies, NamedShape, ReportInputs
from ..view.report import write_report
from ..view.windows import shown_motion
from ..view.words import verdict


@dataclass(frozen=True, repr=False)
class Outcome(Shown):
    """What a run left: where the report (None: skipped) and the files are, everything computed, one verdict."""

    report: Path | None
    files: tuple[Path, ...]
    everything: Everything

    @property
    def _line(self) -> str:
        return self.verdict if self.report is None else f"{self.verdict}; {self.report}"

    def _repr_html_(self) -> str:
        where = [] if self.report is None else [("report", str(self.report))]
        rows = [*where, *(("file", str(path)) for path in self.files)]
        return html_table(self.verdict, ("", "path"), rows, self.everything.notes)

    @property
    def interrupted(self) -> bool:
        """Whether the simulation or the comparison was cut short."""
        run, agreement = self.everything.run, self.everything.agreement
        return (run is not None and run.interrupted) or (agreement is not None and agreement.interrupted)

    @property
    def verdict(self) -> str:
        """One sentence."""
        agreement, onsets = self.everything.agreement, self.everything.onsets_damped
        if agreement is not None:
            return agreement.verdict
        if onsets is None:
            return verdict(report_inputs(self.everything)).headline
        if onsets.at_start:
            return "; ".join(onsets.at_start_words)
        if onsets.first is None:
            return in_alike("no onset in range", repeating(self.everything.case.ties))
        first = onsets.first
        return (
            f"modal onset at μ = {measured(first.mu, 5)}, {measured(first.frequency_hz, 1)} Hz; no comparison was made"
        )

    def to_json(self) -> dict[str, Any]:
        """The documents of all verbs under their names, None where there is none, and where the report is."""
        e = self.everything
        listed = e.sweep_damped if e.own is None else e.own.lowest(e.case.modal.modes)
        documents = {
            "modes": listed,
            "onsets": e.onsets_damped,
            "sensitivities": e.sensitivities,
            "countermeasures": e.measures,
            "simulate": e.summary,
            "compare": e.agreement,
        }
        return {
            "verdict": self.verdict,
            "report": None if self.report is None else str(self.report),
            "files": [str(f) for f in self.files],
            "check": e.description.to_json(),
            **{name: None if result is None else result.to_json() for name, result in documents.items()},
            "unsaturated": None if e.unsaturated is None else e.unsaturated.to_json(),
            "seconds": dict(e.seconds),
            "taken": list(e.taken),
            "taken_parts": {name: list(what) for name, what in e.taken_parts.items()},
            "notes": list(e.notes),
        }


@takes(folder=PATH.or_none(), progress=FUNCTION, log=FUNCTION, fresh=SWITCH, kept=STORE)
def run(
    problem: Problem,
    folder: str | Path | None = None,
    *,
    progress: Progress | None = None,
    log: Callable[[str], None] | None = None,
    only: Collection[str] | None = None,
    skip: Collection[str] | None = None,
    fresh: bool = False,
    kept: PartStore | None = None,
) -> Outcome:
    """Compute everything, keep each result as soon as it is there, write the report into ``folder``.

    problem: a case, the path of its file, beside which everything then goes (CASE.out) unless a folder is named, or a
    workspace of either. only, skip: parts (`study.parts`) that alone are computed, or are not: modes, onsets, simulate,
    compare, report, and sensitivities and countermeasures, which are computed where they are named. What an earlier
    call on the same case, by the same program, has left in the folder is taken, a run that was cut is gone on from;
    with ``fresh`` nothing is. kept: where finished parts of the comparison are put and sought instead of in the folder.
    Raises CaseError for parts that there are none of.
    """
    parts, work = chosen_parts(only, skip), Workspace.of(problem)
    return _run(work, _folder(problem, folder), parts, progress=progress, log=log, fresh=fresh, kept=kept)


@takes(folder=PATH.or_none(), log=FUNCTION, fresh=SWITCH, kept=STORE)
def report(
    problem: Problem,
    folder: str | Path | None = None,
    *,
    mu: float | None = None,
    log: Callable[[str], None] | None = None,
    skip: Collection[str] | None = None,
    fresh: bool = False,
    kept: PartStore | None = None,
) -> Outcome:
    """The page of a case without any run in time: modes, onsets, sensitivities, counter-measures, shapes.

    problem: a case, or the path of its file, beside which the page then goes (CASE.out) unless a folder is named. mu:
    the friction coefficient of modes and changes, where it is not to be the case's own. Results in time that are in the
    folder already and belong to this case are shown, none are computed. skip, fresh and kept as `run` takes them. What
    a model has nothing to show for (shapes without coordinates of nodes) is left out, and the notes say so.
    """
    work = Workspace.of(problem)
    require_friction(mu, several=False)
    parts = chosen_parts(None, skip, OF_REPORT)
    return _run(work, _folder(problem, folder), parts, mu=mu, log=log, fresh=fresh, kept=kept)


def _folder(problem: Problem, folder: str | Path | None) -> Path:
    """Where files go: the folder that was named, else that beside the case file."""
    if folder is not None:
        return Path(folder)
    if isinstance(problem, str | PathLike):
        return Path(problem).with_suffix(".out")
    raise CaseError("folder", None, "where the page goes, unless the case is given by the path of its file")


def _run(
    work: Workspace,
    target: Path,
    parts: RunParts,
    *,
    mu: float | None = None,
    progress: Progress | None = None,
    log: Callable[[str], None] | None = None,
    fresh: bool,
    kept: PartStore | None,
) -> Outcome:
    case = work.case("run")
    files: list[Path] = []

    def keep(name: str, result: Any) -> None:
        written = [save(result, target / f"{name}.nc")]
        if isinstance(result, ComplexModes | Onsets):
            written.append(write_csv(result, target / f"{name}.csv"))
        # A run is kept again and again while it goes on.
        files.extend(path for path in written if path not in files)

    write_text(target / "case.toml", case.text)
    everything = compute_everything(
        work,
        parts=parts,
        mu=mu,
        progress=progress,
        log=log,
        keep=keep,
        before=None if fresh else _before(work, target / "simulate.nc"),
        kept=KeptParts(target / NAME, work.key, fresh=fresh) if kept is None else kept,
        shelf=FinishedParts(target / FOLDER, work.key, fresh=fresh),
    )
    if "report" not in parts:
        return Outcome(None, tuple(files), everything)
    if log is not None:
        log("report")
    inputs = _with_cycles(report_inputs(everything), work, None if fresh else target / "cycles.nc")
    return Outcome(write_report(inputs, target), tuple(files), everything)


def _with_cycles(inputs: ReportInputs, work: Workspace, path: Path | None) -> ReportInputs:
    """The same with the limit cycles in a file, if they are of this very model; a note where they are not."""

    def noted(what: str) -> ReportInputs:
        return replace(inputs, notes=(*inputs.notes, f"{what}: its limit cycles are not shown."))

    if path is None or not path.is_file():
        return inputs
    try:
        found = open_result(path)
    except StridorError as error:
        return replace(inputs, notes=(*inputs.notes, f"{path.name} cannot be read: {error}"))
    if not isinstance(found, Cycles):
        return noted(f"{path.name} holds no cycles")
    if "fingerprint" not in found.provenance:
        return noted(f"{path.name} does not tell its case")
    if not same_model(work.case("report"), found.provenance["fingerprint"]):
        return noted(f"{path.name} is of another case")
    return replace(inputs, cycles=found, beside_cycles=_beside(inputs, work))


def _beside(inputs: ReportInputs, work: Workspace) -> str:
    """Why the run in time is not drawn beside cycles; "" where it is, or where there is none."""
    run = inputs.trajectory
    if run is None or not run.phases or not len(run.time):
        return ""
    if run.interrupted:
        return "it was cut"
    if inputs.unsaturated is not None:
        return "it still grows"
    if other := other_in_time(work):
        return other
    rate = 0.0 if inputs.modes is None else last_rate(inputs.modes)
    found, why = settled_velocity(run, *dominant_response(run, work.modal.max_frequency_hz), rate)
    return "" if found is not None else why


def _before(work: Workspace, path: Path) -> Trajectory | None:
    """The run in a file, if it is one of this very case; None otherwise."""
    if not path.is_file():
        return None
    try:
        run = load_trajectory(path)
    except StridorError:
        return None
    told = run.provenance
    changed = any(restart.get("changed") for restart in told.get("restarts", []))
    own = told.get("settings", {}).get("mu") is None and not changed
    own = own and "fingerprint" in told
    return run if own and told.get("key") == work.key else None


def report_inputs(e: Everything) -> ReportInputs:
    """Everything, sorted into what the report takes."""
    agreement = e.agreement
    shapes = _shapes(e)
    signals, held = _signals(e)
    return ReportInputs(
        case=e.case,
        system=e.system,
        mu=e.mu,
        steady=e.steady,
        modes=e.own,
        undamped_sweep=e.sweep_undamped,
        damped_sweep=e.sweep_damped,
        undamped_pair=e.zoom_undamped,
        damped_pair=e.zoom_damped,
        body_modes={name: NamedFrequencies(b.frequency_hz, b.labels) for name, b in e.bodies.items()},
        coupled_hz=None if e.coupled is None else np.sort(e.coupled.frequency_hz[0]),
        undamped_onsets=e.onsets_undamped,
        damped_onsets=e.onsets_damped,
        curve=None if e.curve is None else FrictionCurve(mu=e.curve[1], frequency_hz=e.curve[0]),
        trajectory=e.run,
        energy=None if e.summary is None else e.summary.energy,
        **signals,
        **shapes,
        agreement=agreement,
        values=_values(e),
        value_notes={"dominant_frequency_hz": "second half of the last phase"},
        source_places={} if e.case.reference is None else dict(e.case.reference.places),
        timings=e.seconds,
        versions=versions(),
        case_text=e.case.text,
        created=datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %Z"),
        warnings=e.description.warnings,
        notes=(*e.notes, *held),
        shape_vector=e.vector,
        friction_energy=e.energy,
        sensitivities=e.sensitivities,
        measures=e.measures,
        unsaturated=e.unsaturated,
    )


def _signals(e: Everything) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Spectra of the accelerations and the spectrogram of a velocity, from the last phase, along the axis along which
    the first watched point moves; and which points do not move along it, in words: of those there is no spectrum."""
    run = e.run
    if run is None:
        return {}, ()
    motion = shown_motion(run)
    if motion is None:
        names = ", ".join(run.watch_names)
        return {}, (() if not names else (f"{names}: held, without any motion in the run; no spectrum is drawn.",))
    number, along = motion
    axis = "xyz".index(along)
    part = run.phase_slice()
    start, stop = part.start, part.stop
    if stop - start < 64:
        return {}, ()
    half = slice((start + stop) // 2, stop)
    moving = {name: run.acceleration[half, k, axis] for k, name in enumerate(run.watch_names)}
    spectra = {name: spectrum(signal, run.sampling) for name, signal in moving.items() if signal.any()}
    if not spectra:
        return {}, (f"{', '.join(run.watch_names)}: at rest in the second half of the run; no spectrum is drawn.",)
    held = _held(run, axis, spectra)
    limit = e.case.modal.max_frequency_hz
    # Six samples per period of the highest frequency shown are plenty for a picture.
    every = max(1, int(1.0 / (6 * limit * run.sampling)))
    signal = low_passed(run.velocity[part, number, axis], run.sampling, limit)
    cut = (stop - start - len(signal)) // 2
    found: dict[str, Any] = {
        "spectra": spectra,
        "spectra_of": f"acceleration along {along} over the second half of the last phase",
        "spectrogram_of": f"velocity along {along} of {run.watch_names[number]} in the last phase",
        "spectrogram_start": float(run.time[start + cut]),
    }
    picture = spectrogram(signal[::every], run.sampling * every, resolution_hz=limit / 100)
    return found | ({"spectrogram": picture} if picture.amplitude.any() else {}), held


def _held(run: Trajectory, axis: int, shown: Collection[str]) -> tuple[str, ...]:
    """What is said of watched points that do not move along the axis of the spectra, or along those before it."""
    along = "xyz"[axis]
    before = " and ".join("xyz"[:axis])
    said = () if not axis else (f"{next(iter(shown))} is held along {before}: its motion is shown along {along}.",)
    others = ", ".join(name for name in run.watch_names if name not in shown)
    return said if not others else (*said, f"{others}: no motion along {along}, and no spectrum of it.")


def _shapes(e: Everything) -> dict[str, Any]:
    if e.shape is None or e.shape_mode is None:
        return {}
    if e.operating is None:
        return {"unstable_shape": NamedShape(e.shape_mode.imag / (2 * np.pi), e.shape, e.shape_mode.real)}
    by_body = {name: modal_assurance(e.operating[name], e.shape[name]) for name in e.operating}
    dominant = 0.0 if e.summary is None else e.summary.dominant_frequency_hz or 0.0
    return {
        "operating_shape": NamedShape(dominant, e.operating),
        "unstable_shape": NamedShape(e.shape_mode.imag / (2 * np.pi), e.shape, e.shape_mode.real),
        "mac_by_body": by_body,
    }


def _values(e: Everything) -> dict[str, float]:
    """Computed values by the names that a case's reference values may carry."""
    values: dict[str, float] = {}
    if e.summary is not None and e.summary.dominant_frequency_hz is not None:
        values["dominant_frequency_hz"] = e.summary.dominant_frequency_hz
    return values
