"""A march stopped anywhere, taken up again, against the same march in one piece: to the last bit, phases included."""

from __future__ import annotations

import signal
import sys
from dataclasses import replace
from pathlib import Path
from types import FrameType

import numpy as np
import pytest

from benches import Slave, bench
from marching import in_chunks, simulate_assembled
from stridor import interrupts
from stridor.errors import CaseError
from stridor.laws import Coulomb
from stridor.temporal.schedule import PhaseSpec
from stridor.temporal.settings import Settings
from stridor.temporal.simulate import simulate

pytestmark = pytest.mark.verification

MARCHES = {"simulate.py", "march.py", "phase_results.py"}
CHUNK = 40
STEP = 4e-7
# Short enough to be stopped hundreds of times; the phases end within chunks, at their ends, and after one step.
PHASES = (
    PhaseSpec("press", 2 * CHUNK * STEP, {"press0": 1.0}, {"clamp": 0.0}, 0.8 * CHUNK * STEP),
    PhaseSpec("$slide$", 75 * STEP, {"press0": 1.5}, {"clamp": 1.0}, 50 * STEP),
    PhaseSpec("press", 1 * STEP, {}, {"clamp": -0.5}),
    PhaseSpec("stop", 70 * STEP, {}, {"clamp": 0.25}),
)


class Arranged:
    """One of the ways to march, in chunks of a size of its own: a system, settings and the call."""

    def __init__(self, kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
        slaves = Slave(lean_deg=20.0), Slave(place=0.3, side=-1)
        lumped = {} if kind in ("modal", "nodal", "finite") else {"mass": "lumped"}
        self.system = bench(*slaves, velocity=2.0, **lumped)
        if kind == "finite":
            contacts = tuple(replace(c, sliding="finite", stiffness=np.inf) for c in self.system.contacts)
            self.system = replace(self.system, contacts=contacts)
        path = kind if kind in ("modal", "nodal") else "auto"
        self.settings = Settings(step=STEP, record_every=3, path=path, watch=("base.end",))
        in_chunks(monkeypatch, CHUNK)
        self.call = simulate_assembled if kind == "assembled" else simulate

    def run(self, **more):
        return self.call(self.system, PHASES, self.settings, **more)


def same(one, two) -> None:
    """Everything that is computed, bit for bit."""
    for name in ("time", "normal_force", "tangential_force", "slip_speed", "gap", "status", "velocity", "elastic"):
        assert np.array_equal(getattr(one, name), getattr(two, name)), name
    for name, work in one.works.items():
        assert np.array_equal(work, two.works[name]), name
    assert one.phases == two.phases
    assert one.steps == two.steps
    for name, values in one.state.items():
        if name != "state_predicted":  # work space of the step to come
            assert np.array_equal(values, two.state[name]), name


class Lines:
    """Counts the lines of the marches that are run, from the loop over chunks on, and does something at one."""

    def __init__(self, at: int, act) -> None:
        self.at, self.act, self.count = at, act, 0

    def __call__(self, frame: FrameType, event: str, arg):
        return self.line if Path(frame.f_code.co_filename).name in MARCHES and self.count >= 0 else None

    def line(self, frame: FrameType, event: str, arg):
        if event == "line" and (self.count or frame.f_code.co_name == "_loop"):
            self.count += 1
            if self.count == self.at:
                self.act()
        return self.line


def traced(at: int, act, call):
    """What the call returns, or None where it was left by KeyboardInterrupt; and how many lines were run."""
    lines, before = Lines(at, act), sys.gettrace()
    sys.settrace(lines)
    try:
        return call(), lines.count
    except KeyboardInterrupt:
        return None, lines.count
    finally:
        sys.settrace(before)


def press_ctrl_c() -> None:
    signal.raise_signal(signal.SIGINT)  # into this very thread: a signal to the process may come late, by another one


def press_twice() -> None:
    raise KeyboardInterrupt


@pytest.fixture
def listening(monkeypatch):
    """Tests started in the background have Ctrl-C switched off, and those before may have run the program in this
    process, which insists on an interrupt until it is heard."""
    monkeypatch.setattr(interrupts, "_program", interrupts._Program([]))
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def stop_everywhere(way: Arranged, act, every: int) -> tuple[int, int]:
    """Stop at every ``every``-th line of the march, go on from there, compare; how many runs, how many left nothing."""
    whole = way.run()
    _, lines = traced(-1, act, way.run)
    empty = runs = 0
    for at in range(1, lines + 1, every):
        part, _ = traced(at, act, way.run)
        runs += 1
        if part is None:
            empty += 1
            continue
        assert [p.name for p in part.phases] == [p.name for p in whole.phases[: len(part.phases)]]
        assert part.phases[:-1] == whole.phases[: len(part.phases) - 1], at
        same(way.run(restart=part), whole)
    return runs, empty


KINDS = ("modal", "nodal", "finite", "assembled")


@pytest.mark.parametrize("kind", KINDS)
def test_ctrl_c_at_any_line_loses_no_step_and_no_phase(kind, monkeypatch, listening):
    """The chunk that is under way is finished, whatever line the signal meets."""
    _, empty = stop_everywhere(Arranged(kind, monkeypatch), press_ctrl_c, 89)
    assert empty == 0


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("act", [press_ctrl_c, press_twice])
def test_every_line_of_the_march(kind, act, monkeypatch, listening):
    """A second Ctrl-C, or one that nothing holds off, is an exception: nothing is kept only from within a step."""
    runs, empty = stop_everywhere(Arranged(kind, monkeypatch), act, 1)
    assert empty == 0 if act is press_ctrl_c else empty < 0.6 * runs


@pytest.mark.parametrize("kind", KINDS)
def test_an_exception_at_any_line_is_a_state_to_go_on_from(kind, monkeypatch):
    stop_everywhere(Arranged(kind, monkeypatch), press_twice, 113)


@pytest.mark.parametrize("kind", KINDS)
def test_stopped_at_every_chunk_and_taken_up_each_time(kind, monkeypatch):
    """A run made of pieces of one chunk each, joined as they come."""
    way = Arranged(kind, monkeypatch)
    whole = way.run()
    part = None
    for _ in range(100):
        seen = []

        def stop(done, planned, seen=seen):
            seen.append(done)
            raise KeyboardInterrupt

        part = way.run(restart=part, progress=stop)
        assert part.steps == seen[0]
        if part.steps == whole.steps:
            break
    assert part.interrupted
    same(part, whole)
    assert not way.run(restart=part).interrupted


@pytest.mark.parametrize("kind", KINDS)
def test_a_finished_run_goes_on_when_its_last_phase_is_longer(kind, monkeypatch):
    way = Arranged(kind, monkeypatch)
    short = way.run()
    longer = (*PHASES[:-1], replace(PHASES[-1], duration=100 * STEP))
    whole = way.call(way.system, longer, way.settings)
    same(way.call(way.system, longer, way.settings, restart=short), whole)
    assert whole.phases[-1] != short.phases[-1]


@pytest.mark.parametrize("kind", ["modal", "nodal", "assembled"])
def test_another_model_is_refused_and_named(kind, monkeypatch):
    """Each part of a system shows in its sketch; with ``changed`` the run goes on with what can be changed."""
    way = Arranged(kind, monkeypatch)
    part = way.run()
    system = way.system
    contacts = system.contacts
    first = contacts[0]
    others = {
        "contact C0: friction": replace(system, contacts=(replace(first, law=Coulomb(0.3000001)), *contacts[1:])),
        "contact C0: gap": replace(system, contacts=(replace(first, gap=first.gap + 1e-9), *contacts[1:])),
        "load press0": replace(system, loads={**system.loads, "press0": 1.000001 * system.loads["press0"]}),
        "stiffness": replace(system, stiffness=1.000001 * system.stiffness),
    }
    for name, other in others.items():
        with pytest.raises(CaseError) as refused:
            way.call(other, PHASES, way.settings, restart=part)
        assert name in str(refused.value), name
    if kind == "modal":
        with pytest.raises(CaseError, match="saved in the modes of its bodies"):
            way.call(others["stiffness"], PHASES, way.settings, restart=part, changed=True)


@pytest.mark.parametrize("kind", ["modal", "nodal", "assembled"])
def test_a_changed_load_acts_from_the_restart_on(kind, monkeypatch):
    """Half the load at twice the factor is the same load: changed at the restart, nothing happens; a load that is
    changed alone makes another motion."""
    way = Arranged(kind, monkeypatch)

    def stop(done, planned):
        raise KeyboardInterrupt

    part = way.run(progress=stop)
    whole = way.run()
    half = replace(way.system, loads={k: 0.5 * v for k, v in way.system.loads.items()})
    twice = tuple(replace(p, loads={name: 2.0 * f for name, f in p.loads.items()}) for p in PHASES)
    twice = (replace(twice[0], loads={**dict.fromkeys(way.system.loads, 2.0), **twice[0].loads}), *twice[1:])
    on = way.call(half, twice, way.settings, restart=part, changed=True)
    assert np.allclose(on.normal_force, whole.normal_force, rtol=1e-6, atol=1e-9 * whole.normal_force.max())
    other = way.call(half, PHASES, way.settings, restart=part, changed=True)
    assert not np.allclose(other.normal_force, whole.normal_force, rtol=1e-2, atol=0)


def test_a_block_ends_before_it_is_interrupted(listening):
    """What asks for an end within is raised at the end of the outermost block that has not met it."""
    done = []

    def nested():
        with interrupts.held():
            with interrupts.held():
                press_ctrl_c()
                done.append("inner")
            done.append("outer")

    def twice():
        with interrupts.held():
            press_ctrl_c()
            done.append("once")
            press_ctrl_c()
            done.append("never")

    with pytest.raises(KeyboardInterrupt):
        nested()
    assert done == ["inner", "outer"]
    with interrupts.held() as block:
        press_ctrl_c()
        block.met = True
    with pytest.raises(KeyboardInterrupt):
        twice()
    assert done[-1] == "once"
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
