"""Many runs of one system: side by side where the modal stepper takes them, on cores or a GPU, else separate runs.

What comes out is a `Trajectory` for each member, the same in both cases but that side by side neither energies nor the
state for a restart are kept. Members that fail do not stop others.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass, replace
from threading import Event

from ..errors import AnalysisError, CaseError, StridorError
from ..interrupts import at_once, held
from ..stages import passing, stage
from ..system import System
from ..threads import available_cores, one_thread
from .devices import Gpu, first_line, place
from .inputs import check_inputs
from .legs import Legs, in_two, leg_phases, legs_of
from .march import Progress
from .schedule import PhaseSpec
from .settings import ASKED, Settings
from .side_by_side import Block, Seen, Track
from .simulate import plan, simulate, step_of
from .steppers.modal import ModalStepper, choose_path, modal_stepper
from .steppers.modal.vectors import LANES
from .trajectory import Trajectory

TOLD_SECONDS = 0.1


@dataclass(frozen=True)
class EnsembleOutcome:
    """How an ensemble was run: side by side or, for a reason in words, one after the other; whether it was cut short;
    step Δt [s]; on "cpu" or the GPU of that name, and what is to say about that."""

    side_by_side: bool
    reason: str
    interrupted: bool
    step: float
    device: str = "cpu"
    said: str = ""


@passing()
@one_thread
def march_all(
    system: System,
    phases: Sequence[PhaseSpec],
    settings: Settings,
    tracks: Sequence[Track],
    seen: Seen,
    *,
    window: float,
    cores: int | None = None,
    progress: Progress | None = None,
    separately: bool = False,
    device: str = "cpu",
) -> EnsembleOutcome:
    """March every track: its first member from the initial state, each further one from where the one before ended.

    Tracks are of one length. seen is called, from any thread, with each member's run or why there is none; the last
    phase of a run is the window, the last share of the case's last phase. cores: threads (None: all). separately: one
    run after the other in any case. device: see `devices.place`. Ctrl-C, or KeyboardInterrupt from progress, ends it;
    what was seen until then stays. Raises CaseError and AnalysisError for what holds of all members.
    """
    taken = settings.system(system)
    check_inputs(
        taken, phases, step=settings.step, beta2=settings.beta2, record_every=settings.record_every,
        watch=settings.watch,
    )  # fmt: skip
    parts = in_two(phases, window)
    gpu, said = place(device, len(tracks))
    stepper, reason = (None, ASKED) if separately else _shared(taken, settings, parts)
    if stepper is None and device == "gpu":
        raise CaseError("device", device, f"cpu: what is run separately ({reason}) runs on no GPU")
    step = stepper.scheme.step if stepper is not None else step_of(system, settings, parts)
    legs = legs_of(phases, taken, step, len(tracks[0]), window, steady=settings.initial == "steady-sliding")
    if stepper is None:
        cut = _one_by_one(system, replace(settings, step=step), tracks, seen, legs, progress)
        return EnsembleOutcome(False, reason, cut, step)
    common = Block(stepper, settings, legs, tracks, range(len(tracks)), seen)
    if gpu is not None:
        blocks, failed = _on(gpu, common)
        if not failed:
            return EnsembleOutcome(True, "", _at_the_same_time(blocks, legs, progress, 1), step, gpu.name)
        said = f"{gpu.name} cannot run the time loop: {failed}"
        if device == "gpu":
            raise AnalysisError(f"{said}; device cpu runs it")
        said = f"on the CPU: {said}"
    stage("time loop of an ensemble; the first one of a version is compiled for up to a minute")
    blocks = common.cut(_cuts(len(tracks), cores or available_cores()))
    with at_once():  # compiles the loop or loads it, before anybody waits for its end
        blocks[0].warm()
    found = _at_the_same_time(blocks, legs, progress, cores or available_cores())
    return EnsembleOutcome(True, "", found, step, said=said)


def _on(gpu: Gpu, common: Block) -> tuple[list[Block], str]:
    """Blocks for a GPU, of as many members as its memory and that for records hold, and why it cannot run them."""
    from .steppers.modal.device import DeviceBatch, most_members

    stage(f"time loop of an ensemble, compiled for {gpu.name}")
    stepper, settings, legs = common.stepper, common.settings, common.legs
    records = max(s.steps - legs.first(k) for k, s in enumerate(legs.schedules)) / settings.record_every
    size = most_members(stepper.system, len(settings.watch), records, gpu.free)
    blocks = replace(common, batch=DeviceBatch).cut([*range(0, len(common.tracks), size), len(common.tracks)])
    try:
        with at_once():
            blocks[0].warm()
    except StridorError:
        raise
    except Exception as error:  # of many kinds: compiler, linker, driver, memory
        return [], first_line(error)
    return blocks, ""


def _shared(system: System, settings: Settings, phases: Sequence[PhaseSpec]) -> tuple[ModalStepper | None, str]:
    """The stepper whose operators all members share, else None and why not."""
    path, why, _ = plan(system, settings, phases)
    if path != "modal":
        if settings.stepper in ("exact", "implicit"):
            why = f'temporal.stepper is "{settings.stepper}"'
        elif why == ASKED:
            why = f'temporal.path is "{settings.path}"'
        return None, why
    finite = [c.name for c in system.contacts if c.sliding != "small"]
    if finite:
        return None, f'sliding = "finite" at {", ".join(finite)}'
    modes, why = choose_path(system, settings)
    assert modes is not None
    return modal_stepper(system, settings, None, modes, why), ""


def _cuts(count: int, cores: int) -> list[int]:
    """Where to cut tracks into blocks: no more than the lanes in each, all about as long, as many as keep all cores."""
    blocks = -(-count // LANES)
    blocks = min(count, -(-blocks // cores) * cores)
    return [round(k * count / blocks) for k in range(blocks + 1)]


def _at_the_same_time(blocks: Sequence[Block], legs: Legs, progress: Progress | None, cores: int) -> bool:
    """All blocks on some threads; whether that was cut short."""
    planned = legs.steps * sum(len(block.tracks) for block in blocks)
    done = [0] * len(blocks)
    end = Event()

    def work(number: int) -> None:
        def count(steps: int) -> None:
            done[number] += steps

        blocks[number].run(end.is_set, count)

    with held() as block, ThreadPoolExecutor(min(cores, len(blocks))) as pool:
        running = [pool.submit(work, number) for number in range(len(blocks))]
        try:
            while running:
                finished, left = wait(running, TOLD_SECONDS)
                running = list(left)
                for future in finished:
                    future.result()
                if progress is not None:
                    progress(sum(done), planned)
                if block.asked:
                    end.set()
        except KeyboardInterrupt:
            end.set()
        except BaseException:
            end.set()
            raise
        block.met = True
    return end.is_set()


def _one_by_one(
    system: System, settings: Settings, tracks: Sequence[Track], seen: Seen, legs: Legs, progress: Progress | None
) -> bool:
    """Every member by a run of its own; whether that was cut short."""
    planned = legs.steps * len(tracks)
    for number, track in enumerate(tracks):
        before: Trajectory | None = None
        failed = ""
        for leg, member in enumerate(track):
            if failed:
                seen(number, leg, f"not reached: {failed}")
                continue
            base = number * legs.steps

            def told(done: int, _: int, base: int = base) -> None:
                if progress is not None:
                    progress(base + done, planned)

            phases = [p for k in range(leg + 1) for p in leg_phases(legs, k, track[k], system)]
            try:
                run = simulate(
                    system, phases, member.settings(settings), mu=member.mu, progress=told, restart=before, join=False,
                    changed=before is not None,
                )  # fmt: skip
            except StridorError as error:
                failed = str(error)
                seen(number, leg, failed)
                continue
            if run.interrupted:
                return True
            seen(number, leg, run)
            gone = () if before is None else before.phases
            before = replace(run, phases=(*gone, *run.phases))  # a restart wants all that was before
    return False
