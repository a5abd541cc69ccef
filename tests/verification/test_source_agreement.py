"""Sources of eigenpairs differ in cost, never in meaning: the same modes, onsets and branch names from each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse.linalg as sla

import stridor as st
from benches import Slave, bench, paper_case
from rubbing_block import rubbing_block
from stridor.case import template_text
from stridor.modal.checked_onsets import checked_onsets
from stridor.modal.complex_modes import complex_modes
from stridor.modal.full.basis import DECAY
from stridor.modal.options import Options
from stridor.modal.over_friction import modes_of_band, onsets_of_band
from stridor.modal.source import SOURCES, sources_for
from stridor.system import System, build_system

pytestmark = pytest.mark.verification

SAME_MU, SAME_ROOT = 1e-10, 1e-9  # of an onset; of the eigenvalues, relative
BAND = 20e3
NAMES = [source.name for source in SOURCES]


def two_beams(damped: bool, stiffness: float | str, **changes: int) -> st.Case:
    case = paper_case(contacts__A__stiffness=stiffness, **changes)
    if damped:
        return case
    return case.with_({f"bodies.{name}.damping": {"mass": 0.0, "stiffness": 0.0} for name in case.bodies})


def pad_on_disc() -> st.Case:
    """The brake of the examples, as coarse as its parts allow."""
    changes = {"disc": [4, 48, 1], "lining": [4, 8, 1], "plate": [3, 6, 1]}
    return st.loads(template_text("pad-on-disc")).with_(
        {f"bodies.{name}.mesh.divisions": divisions for name, divisions in changes.items()}
    )


def rounding(system: System) -> float:
    """What ten roundings of K may change in λ²/2 of any mode, ε ω²/2 of the fastest one each (Weyl): of the lowest modes
    of fine meshes that is more than 1e-9."""
    highest = sla.eigsh(system.stiffness.tocsc(), 1, system.mass.tocsc(), which="LM", return_eigenvectors=False)[0]
    return 5.0 * np.finfo(float).eps * float(highest)


def answers(system: System, names: Sequence[str], band: float, end: float) -> dict[str, st.Onsets]:
    return {name: onsets_of_band(system, (0.0, end), band, options=Options(source=name)) for name in names}


def inside(found: st.ComplexModes, row: int, band: float) -> dict[int, complex]:
    """Eigenvalues by the numbers of their branches, |λ| within the band: faster ones, strongly damped or growing out of
    all bounds, came from above it, where each source follows as far as it likes. The full search leaves out what decays
    faster than half of the highest angular frequency."""
    values, top = found.eigenvalues[row], 2 * np.pi * band
    listed = found.in_band[row] & (np.abs(values) <= top) & (values.real > -DECAY * top)
    return dict(zip(found.branch[listed].tolist(), found.eigenvalues[row, listed].tolist(), strict=True))


def assert_same(system: System, names: Sequence[str], *, band: float = BAND, end: float = 1.0) -> int:
    """Onsets, their branches, eigenvalues and branches' names of every source are those of the first; how many onsets
    there are."""
    first, *others = names
    solved = answers(system, names, band, end)
    mus = [0.25 * end, end]
    listed = {name: modes_of_band(system, mus, band, options=Options(source=name)) for name in names}
    for name in others:
        mine, theirs = ([o for o in solved[n].onsets if o.enters_at is None] for n in (first, name))
        assert [(o.kind, o.stabilising, o.branches) for o in mine] == [
            (o.kind, o.stabilising, o.branches) for o in theirs
        ], (name, solved[first].completeness, solved[name].completeness)
        np.testing.assert_allclose([o.mu for o in mine], [o.mu for o in theirs], rtol=0, atol=SAME_MU, err_msg=name)
        np.testing.assert_allclose([o.frequency_hz for o in mine], [o.frequency_hz for o in theirs], rtol=SAME_ROOT)
        for row in range(len(mus)):
            ours, away = (inside(listed[n], row, band) for n in (first, name))
            assert {b for b, v in ours.items() if v.imag} == {b for b, v in away.items() if v.imag}, (name, mus[row])
            # On the real axis the full search also lists the other half of a mode that has fallen apart there.
            on_axis = np.array([v for v in away.values() if not v.imag], dtype=complex)
            for branch, here in ours.items():
                there = away[branch] if here.imag else on_axis[np.argmin(np.abs(on_axis - here))]
                off = abs(here - there) / (SAME_ROOT * abs(here) + rounding(system) / abs(here))
                assert off <= 1.0, (name, mus[row], branch, here, there)
    assert all(solved[name].source == listed[name].source == name for name in names)
    return len(solved[first].onsets)


ALL = [(damped, stiffness) for damped in (True, False) for stiffness in (1e10, 1e8, "rigid")]
FAST = [(False, 1e8)]


@pytest.mark.parametrize(
    ("damped", "stiffness"), [pytest.param(*c, marks=() if c in FAST else pytest.mark.slow) for c in ALL]
)
def test_two_beams_by_every_source(damped, stiffness):
    coarse = dict(bodies__beam1__elements=6, bodies__beam2__elements=18) if (damped, stiffness) in FAST else {}
    assert assert_same(build_system(two_beams(damped, stiffness, **coarse)), NAMES) >= 3


@pytest.mark.parametrize("seed", [3, *(pytest.param(s, marks=pytest.mark.slow) for s in range(20) if s != 3)])
def test_random_benches_by_every_source(seed):
    """One to three beams on a master, on nodes and between them, rigid and elastic contacts mixed."""
    random = np.random.default_rng(seed)
    slaves = [
        Slave(
            place=place, lean_deg=random.uniform(2.0, 12.0), length=random.uniform(0.03, 0.06),
            thickness=random.uniform(1e-3, 2e-3), stiffness=random.choice([1e7, 1e9, np.inf]),
            end=random.choice(["guided", "clamped"]),
        )
        for place in np.sort(random.uniform(0.3, 0.9, size=1 + seed % 3))
    ]  # fmt: skip
    slaves = [replace(s, stiffness="rigid" if np.isinf(s.stiffness) else float(s.stiffness), end=str(s.end)) for s in slaves]
    assert_same(bench(*slaves), NAMES, end=0.8)


def test_a_mode_that_falls_apart_on_the_real_axis_leaves_others_their_names():
    """At μ = 0.4065 one of a flutter pair meets its conjugate; another pair is near. Of its halves branches lead to one, and
    the other is no mode that is lacking, but where onsets do not say how many roots grow."""
    slave = Slave(
        place=0.5395834615, lean_deg=9.1741467929, length=0.0384246998, thickness=0.0010827249, stiffness="rigid", end="clamped"
    )
    system = bench(slave)
    found = {name: onsets_of_band(system, (0.0, 0.8), BAND, options=Options(source=name)) for name in NAMES[:2]}
    for answer in found.values():
        assert [o.branches for o in answer.onsets] == [(9, 10), (1, 2), (5, 6), (5, 6)]
        assert answer.complete
        assert sum(not lam.imag for lam in answer.at_end) == 2
    krylov = found["krylov"]
    lossy = replace(krylov, onsets=krylov.onsets[1:], at_end=tuple(v for v in krylov.at_end if v.imag or v.real > 1e4))
    assert checked_onsets(system, replace(lossy, onsets=krylov.onsets), damped=True, follow=()).complete
    told = checked_onsets(system, lossy, damped=True, follow=()).completeness
    assert "no branch was seen to lead to 0 Hz (+1124 1/s) at μ = 0.8" in told


@pytest.mark.slow
def test_solids_by_every_source_that_takes_them():
    """A block rubbing along a slider, eight nodes of contact over a surface."""
    text = rubbing_block("max_frequency_hz = 15e3\nfriction_range = [0.0, 0.8]")
    system = build_system(st.loads(text))
    assert [source.name for source in sources_for(system, Options())] == ["krylov", "full"]
    assert_same(system, NAMES[1:], band=15e3, end=0.4)


@pytest.mark.slow
def test_pad_on_disc_by_every_source_that_takes_it():
    assert assert_same(build_system(pad_on_disc()), NAMES[1:], band=7e3, end=0.5) >= 1


@pytest.mark.parametrize("source", NAMES[:2])
def test_a_sweep_that_hits_the_meeting_gives_the_same_names(source):
    """Without damping the two modes meet at 0.0766441, with it within 2e-8 of that: a value of the sweep all the same."""
    case = two_beams(True, 1e10)
    meeting = st.onsets(two_beams(False, 1e10), (0.0, 0.1)).onsets[0].mu
    system = build_system(case)
    for mus in ([2 * meeting], [0.5 * meeting, meeting, 2 * meeting]):
        found = complex_modes(system, mus, max_frequency_hz=10e3, source=source)
        assert found.branch[found.unstable[-1]].tolist() == [8]


def test_one_body_without_damping():
    """By a reduced model, too: modes that no damping holds are looked at at the low end with their vectors."""
    case = st.loads(template_text("two-beams")).with_({
        "bodies.beam1.elements": 20, "bodies.beam2.elements": 60, "modal.max_frequency_hz": 20e3,
        "bodies.beam2.damping": {"mass": 0.0, "stiffness": 0.0},
    })  # fmt: skip
    system = st.build_system(case)
    lists = [onsets_of_band(system, (0.0, 1.0), 20e3, options=Options(source=s)) for s in ("receptance", "reduced")]
    assert len(lists[0]) > 2
    assert [o.mu for o in lists[1]] == pytest.approx([o.mu for o in lists[0]], rel=1e-9)
    assert lists[0].complete
    assert lists[1].complete
