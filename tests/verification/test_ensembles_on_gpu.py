"""Members on a GPU are what they are on the CPU.

Without a GPU the kernel runs in numba's simulator, where a thread of Python stands for each of a block: what it
computes is tested, not its speed, nor what a compiler makes of it. On a GPU (`stridor[gpu]`) the rest is tested as well.
"""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np
import pytest

import stridor as st
from benches import paper_case
from device_cases import ALONE, NAMES, made, numbers, run_on, simulated
from stridor.errors import AnalysisError, CaseError
from stridor.temporal import devices, ensembles
from stridor.temporal.devices import ENOUGH, Gpu, gpu, place
from stridor.temporal.legs import Member
from stridor.temporal.schedule import PhaseSpec
from stridor.temporal.settings import Settings

pytestmark = pytest.mark.verification

THERE = gpu()
needs_gpu = pytest.mark.skipif(isinstance(THERE, str), reason=f"needs {THERE}")
COARSE = {"bodies.beam1.elements": 5, "bodies.beam2.elements": 12, "temporal.step": None, "temporal.record_every": 10}
SHORT = {"phases.press.duration": 2e-4, "phases.slide.duration": 2e-3}


@pytest.fixture(scope="module")
def in_simulator(tmp_path_factory):
    if find_spec("numba.cuda") is None and find_spec("numba_cuda") is None:
        pytest.skip("this numba comes without a simulator of CUDA, and numba-cuda is not installed")
    return simulated(tmp_path_factory.mktemp("simulated"))


def assert_same(ours: dict[str, np.ndarray], theirs: dict[str, np.ndarray], close: float) -> None:
    """All numbers of a run: those of contacts and displacements in terms of the largest, all else equal."""
    assert ours.keys() == theirs.keys()
    for name, other in theirs.items():
        mine = ours[name]
        if name == "device":
            continue
        if name.endswith(("time", "status", "sweeps", "shares", "error")):
            assert mine.tolist() == other.tolist(), name
        else:
            # An open gap is compared in terms of itself, a closed one in terms of displacements.
            moved = theirs.get(name.replace("gap", "displacement"), other)
            size = max(np.abs(other).max(initial=0.0), np.abs(moved).max(initial=1e-6) if name.endswith("gap") else 0.0)
            assert np.abs(mine - other).max(initial=0.0) <= close * size, name


@pytest.mark.parametrize("name", NAMES)
def test_in_the_simulator_each_member_is_that_of_the_cpu(name, in_simulator):
    theirs = numbers(*run_on("cpu", made(name)))
    ours = in_simulator[name]
    assert (str(ours["device"]), str(theirs["device"])) == ("CUDA simulator", "cpu")
    assert_same(ours, theirs, 1e-9)
    met = {s for key, values in theirs.items() if key.endswith("status") for s in values.ravel().tolist()}
    assert met == {0, 1, 2}  # all that contacts do was met
    assert ("1.0.error" in theirs) == (name == "legs")  # a member that is lost leaves the others alone


def test_in_the_simulator_it_does_not_matter_to_the_last_bit_who_is_beside_a_member(in_simulator):
    alone, beside = in_simulator[ALONE], in_simulator["legs"]
    assert len(alone) > 20
    for name, values in alone.items():
        assert values.tobytes() == beside[name.replace("0.", "2.", 1)].tobytes(), name


@needs_gpu
@pytest.mark.parametrize("name", NAMES)
def test_on_a_gpu_each_member_is_that_of_the_cpu(name):
    assert_same(numbers(*run_on("gpu", made(name))), numbers(*run_on("cpu", made(name))), 1e-9)


def grown(device: str) -> tuple[np.ndarray, np.ndarray]:
    """Displacement and slip speed of two members over 1000 periods of 8.64 kHz from steady sliding, just above and below
    the friction at which vibrations begin to grow."""
    system = st.build_system(paper_case().with_(COARSE))
    settings = Settings(initial="steady-sliding", perturbation=2e-5, record_every=50, watch=("beam1.tip",))
    found: dict[int, st.Trajectory] = {}
    ensembles.march_all(
        system, (PhaseSpec("slide", 1000 / 8641.0, {}, {}),), settings, [[Member(0.0762)], [Member(0.05)]],
        lambda track, _, run: found.__setitem__(track, run), window=0.5, device=device,
    )  # fmt: skip
    return tuple(np.array([getattr(found[k], name) for k in (0, 1)]) for name in ("displacement", "slip_speed"))


@needs_gpu
def test_on_a_gpu_growth_over_a_thousand_periods_is_that_of_the_cpu():
    ours, theirs = grown("gpu"), grown("cpu")
    moved = theirs[1][0] - theirs[1][0].mean()
    sixth = len(moved) // 6
    assert np.abs(moved[-sixth:]).max() > 3 * np.abs(moved[sixth : 2 * sixth]).max()  # it grows
    assert np.abs(ours[0] - theirs[0]).max() <= 1e-9 * np.abs(theirs[0]).max()
    # Speeds are differences of displacements over Δt: rounding is larger in them by 1/(ωΔt).
    assert np.abs(ours[1] - theirs[1]).max() <= 1e-7 * np.abs(theirs[1]).max()


@needs_gpu
def test_a_gpu_takes_many_members_without_being_asked():
    case = paper_case().with_(COARSE).with_(SHORT)
    found = st.ensemble(case, mu=np.linspace(0.0, 0.4, ENOUGH), modes=False)
    assert found.device == THERE.name
    assert "failed" not in found.regimes


class Looks:
    """Stands for the search for a GPU; counts how often it is made."""

    def __init__(self, answer: Gpu | str) -> None:
        self.answer, self.count = answer, 0

    def __call__(self) -> Gpu | str:
        self.count += 1
        return self.answer


@pytest.mark.parametrize(
    ("device", "members", "installed", "answer", "taken", "said", "looks"),
    [
        ("cpu", 1000, True, Gpu("H", 1e9), False, "", 0),
        ("auto", ENOUGH - 1, True, Gpu("H", 1e9), False, "", 0),
        ("auto", ENOUGH, False, Gpu("H", 1e9), False, "", 0),
        ("auto", ENOUGH, True, Gpu("H", 1e9), True, "", 1),
        ("auto", ENOUGH, True, "a driver", False, "on the CPU, as a GPU needs a driver", 1),
        ("gpu", 1, True, Gpu("H", 1e9), True, "", 1),
    ],
)
def test_where_an_ensemble_runs(monkeypatch, device, members, installed, answer, taken, said, looks):
    look = Looks(answer)
    monkeypatch.setattr(devices, "gpu", look)
    monkeypatch.setattr(devices, "find_spec", lambda _: object() if installed else None)
    assert place(device, members) == (answer if taken else None, said)
    assert look.count == looks


def test_what_is_missing_is_said(monkeypatch):
    monkeypatch.setattr(devices, "find_spec", lambda _: None)
    with pytest.raises(AnalysisError) as told:
        st.ensemble(paper_case().with_(SHORT), device="gpu")
    assert str(told.value) == (
        "a run on a GPU needs numba-cuda, which is not installed: pip install 'stridor[gpu]' (Linux, NVIDIA); without "
        "one: device auto or cpu"
    )
    with pytest.raises(CaseError, match=r"^device: 'tpu' – auto, cpu or gpu$"):
        st.ensemble(paper_case().with_(SHORT), device="tpu")


class NoCuda:
    """numba's CUDA target where it is not available."""

    def __init__(self, error: str | None) -> None:
        self.error = error

    def cuda_error(self) -> str | None:
        return self.error


@pytest.mark.parametrize(
    ("error", "said"),
    [
        ("Error at driver init:\n\nCUDA driver library cannot be found.\nEnsure …",
         "an NVIDIA GPU and its driver: CUDA driver library cannot be found (nvidia-smi lists what the driver sees)"),
        (None, "the compiler of CUDA beside its driver: pip install 'stridor[gpu]'"),
    ],
)  # fmt: skip
def test_of_what_cuda_says_a_line_is_passed_on(error, said):
    assert devices._missing(NoCuda(error)) == said


def test_separate_runs_are_refused_on_a_gpu(monkeypatch):
    monkeypatch.setattr(ensembles, "place", lambda *_: (Gpu("H", 1e9), ""))
    with pytest.raises(CaseError, match=r"^device: 'gpu' – cpu: what is run separately \(asked for\) runs on no GPU$"):
        st.ensemble(paper_case().with_(COARSE).with_(SHORT), device="gpu", separately=True, modes=False)


def test_a_gpu_that_fails_leaves_the_run_to_the_cpu(monkeypatch):
    case = paper_case().with_(COARSE).with_(SHORT)
    monkeypatch.setattr(ensembles, "place", lambda *_: (Gpu("H", 1e9), ""))
    monkeypatch.setattr(ensembles, "_on", lambda *_: ([], "out of memory"))
    found = st.ensemble(case, mu=[0.1], modes=False)
    assert found.device == "cpu"
    where, line = found.notes  # the run is short, and what is slower than its line is stronger
    assert where == "on the CPU: H cannot run the time loop: out of memory"
    assert line.startswith("the line of 1 member does not dominate, and no mode is named for it")
    assert found.to_json()["device"] == "cpu"
    with pytest.raises(AnalysisError, match=r"^H cannot run the time loop: out of memory; device cpu runs it$"):
        st.ensemble(case, mu=[0.1], modes=False, device="gpu")
