"""Each μ has the nodes that touch in its own steady sliding, whatever else is asked for; onsets too.

The block is pressed on a slider and held above: friction at its foot turns it, so that its nodes open one after the
other as μ grows. The truth is the answer for one μ alone, and a count on a fine grid of them.
"""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import stridor as st
from rubbing_block import rubbing_block
from stridor.app.show_modes import by_stretch
from stridor.direct import Factor
from stridor.modal import checked_onsets as checking
from stridor.modal import krylov as krylov_module
from stridor.modal import over_friction
from stridor.modal import source as source_module
from stridor.modal.from_above import with_origins
from stridor.modal.full import search as searching
from stridor.modal.full.counted import Counted, Passing
from stridor.modal.full.search import Answer
from stridor.modal.full.words import _lacking
from stridor.modal.growing import growing_modes
from stridor.modal.joined import ALIKE, TouchingChange, joined_onsets, jumps, matched
from stridor.modal.krylov import Carried, kept_factors, refine
from stridor.modal.krylov import carried as carried_module
from stridor.modal.krylov.kept_factors import KeptFactors
from stridor.modal.krylov.problem import problem_of
from stridor.modal.krylov.refine import GUARD, Band, converge_at, projected
from stridor.modal.onset import Onset, Onsets
from stridor.modal.options import Options
from stridor.sliding import stretches as finding
from stridor.sliding.solution import steady_sliding
from stridor.sliding.stretches import Stretch, stretches
from stridor.system import System, build_system
from stridor.typing import Sparse

pytestmark = pytest.mark.verification

BAND = "max_frequency_hz = {band}\nfriction_range = [0.0, {end}]"


def block(end: float, coefficient: float = 0.4, band: float = 20e3) -> st.Case:
    made = st.loads(rubbing_block(BAND.format(end=end, band=band)))
    return made.with_({"contacts.face.friction.coefficient": coefficient})


def coarse(end: float, coefficient: float = 0.0) -> st.Case:
    """The same with six nodes that open as they do, and fewer behind them."""
    return block(end, coefficient).with_({"bodies.block.mesh.divisions": [5, 2], "bodies.slider.mesh.divisions": [10, 1]})


def touching(case: st.Case, mu: float) -> int:
    return int(st.steady_sliding(case, mu).active.sum())


def listed(found: st.ComplexModes, row: int) -> np.ndarray:
    values = found.eigenvalues[row]
    return np.sort_complex(values[found.in_band[row]])


def same_on_a_grid(case: st.Case, low: float, high: float, count: int) -> list[float]:
    """μ at which the nodes that touch are others than just below it, found by trying many; to half a step."""
    system, grid = build_system(case), np.linspace(low, high, count)
    active = [steady_sliding(system, mu=float(mu)).active for mu in grid]
    return [0.5 * (a + b) for a, b, x, y in zip(grid, grid[1:], active, active[1:], strict=False) if np.any(x != y)]


@pytest.mark.parametrize("coefficient", [0.0, pytest.param(0.4, marks=pytest.mark.slow)])
def test_changes_are_where_many_equilibria_see_them(coefficient: float) -> None:
    case = block(0.45, coefficient)
    found = stretches(build_system(case), 0.0, 0.45)
    seen = same_on_a_grid(case, 0.0, 0.45, 151)
    assert len(seen) >= 2
    np.testing.assert_allclose([s.low for s in found[1:]], seen, atol=1.51e-3)
    system = build_system(case)
    for before, after in pairwise(found):
        # Enclosed to 1e-9: on both sides close by touch as many as said.
        for s, mu in ((before, before.high - 2e-9), (after, after.low + 2e-9)):
            assert int(steady_sliding(system, mu=mu).active.sum()) == s.touching


def test_modes_at_a_friction_do_not_depend_on_the_others() -> None:
    case = coarse(0.4)
    rng = np.random.default_rng(5)
    mus = np.append(rng.uniform(0.0, 0.45, 5), [0.0, 0.45])
    assert len({touching(case, float(mu)) for mu in mus}) >= 3
    swept = st.modes(case, mus)
    for row, mu in enumerate(mus):
        alone = st.modes(case, float(mu))
        np.testing.assert_allclose(listed(swept, row), listed(alone, 0), rtol=1e-8)
        assert swept.mu[row] == mu
    assert np.all(swept.residual[np.isfinite(swept.residual)] < 1e-9)
    (note,) = swept.notes
    assert note.startswith("Of the 6 contact nodes other ones touch in steady sliding as friction grows: 6 between μ = ")
    # Branches keep their numbers over a change: nothing jumps further than a node's stiffness moves it.
    order = np.argsort(mus)
    size = np.abs(swept.eigenvalues[order])
    steps = np.abs(np.diff(swept.eigenvalues[order], axis=0)) / size[1:]
    assert np.nanmax(steps[:, np.isfinite(size).all(axis=0)]) < 0.25


def test_many_changes_are_taken_in_equal_stretches_and_told(monkeypatch: pytest.MonkeyPatch) -> None:
    case = coarse(0.45)
    exact = st.modes(case, 0.0)
    monkeypatch.setattr(finding, "MOST", 1)
    found = stretches(build_system(case), 0.0, 0.45)
    assert len(found) == finding.EQUAL
    assert max(s.others for s in found) >= 1
    for s in found:
        assert s.touching == touching(case, 0.5 * (s.low + s.high))
    swept = st.modes(case, [0.0, 0.2, 0.45])
    assert any("12 equal stretches" in note for note in swept.notes)
    np.testing.assert_allclose(listed(swept, 0), listed(exact, 0), rtol=1e-8)


def test_vectors_and_interruptions_come_through() -> None:
    case = coarse(0.4)
    swept = st.modes(case, [0.0, 0.3, 0.4], vectors=True)
    alone = st.modes(case, 0.3, vectors=True)
    assert swept.right is not None
    assert alone.right is not None
    assert swept.left is not None
    k = int(np.nanargmin(np.abs(swept.eigenvalues[1] - alone.eigenvalues[0, 0])))
    one, two = swept.right[1, k], alone.right[0, 0]
    assert abs(np.vdot(one, two)) / np.linalg.norm(one) / np.linalg.norm(two) == pytest.approx(1.0, abs=1e-8)
    calls: list[int] = []

    def stop(at: int, of: int) -> None:
        calls.append(at)
        if at == 2:
            raise KeyboardInterrupt

    part = st.modes(case, [0.0, 0.3, 0.4], progress=stop)
    assert part.interrupted
    assert part.planned == 3
    np.testing.assert_allclose(listed(part, 0), listed(swept, 0), rtol=1e-8)
    assert set(part.mu) < {0.0, 0.3, 0.4}


def test_an_interruption_before_a_stretch_has_anything_keeps_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    case, calls = coarse(0.4), list[float]()
    plain = over_friction.complex_modes

    def interrupted(system: System, mu: object, **options: object) -> st.ComplexModes:
        calls.append(0.0)
        if len(calls) == 2:
            raise KeyboardInterrupt
        return plain(system, mu, **options)

    monkeypatch.setattr(over_friction, "complex_modes", interrupted)
    part = st.modes(case, [0.0, 0.1, 0.4])
    assert len(calls) == 2
    assert part.planned == 3
    assert 0.0 in part.mu
    assert 0.4 not in part.mu


def test_nothing_is_told_where_the_same_nodes_touch() -> None:
    case = coarse(1e-4)
    values = [0.0, 1e-4]
    assert touching(case, values[0]) == touching(case, values[1])
    found = st.modes(case, values)
    assert found.notes == ()
    np.testing.assert_allclose(found.eigenvalues[1], st.modes(case, values[1]).eigenvalues[0], rtol=1e-8)


def test_a_friction_without_steady_sliding_has_no_modes() -> None:
    # Friction at its foot turns the block, 2 cm wide and held 2 cm above: beyond μ = 1/2 nothing keeps it down.
    case = block(0.4, coefficient=0.2)
    with pytest.raises(st.AnalysisError):
        st.steady_sliding(case, 0.6)
    found = st.modes(case, [0.6, 0.0])
    assert not np.any(np.isfinite(found.eigenvalues[0]))
    assert np.any(np.isfinite(found.eigenvalues[1]))
    assert found.completeness[0].startswith("Not checked: steady sliding")
    assert found.to_json()["unstable_modes"][0] is None
    assert found.solved.tolist() == [False, True]
    (said,) = [note for note in found.notes if "nothing was solved" in note]
    assert float(said.split("μ = ")[1].split(" ")[0]) == pytest.approx(0.5, abs=0.01)
    with pytest.raises(st.AnalysisError):
        st.modes(case, [0.6, 0.7])


def test_onsets_end_where_steady_sliding_does() -> None:
    """A falling law asks for the equilibrium at each μ; the block tips over from about 0.5 on."""
    case = block(1.0).with_(
        {
            "bodies.block.mesh.divisions": [3, 2],
            "bodies.slider.mesh.divisions": [10, 1],
            "contacts.face.friction": {
                "law": "hyperbolic", "coefficient": 0.2, "static_coefficient": 0.6, "delta": 2.0,
            },
        }
    )  # fmt: skip
    found = st.onsets(case)
    assert found.friction_range[1] == pytest.approx(0.5, abs=0.01)
    assert any("nothing was solved" in note for note in found.notes)


def growing(case: st.Case, mu: float) -> tuple[int, int]:
    """How many modes grow at one μ with its own nodes, in the full problem, and how many are on the axis to rounding:
    of these an onset may have begun the growth, or a following one will; those a little above the band, which may have
    left it growing, are among the latter."""
    top = case.modal.max_frequency_hz
    found = growing_modes(build_system(case), mu, 1.02 * top, touching_at=mu)
    every = np.concatenate([found.values, found.beside])
    inside = found.values.imag <= 2 * np.pi * top
    doubtful = int(np.count_nonzero(np.abs(every.real) <= 1e-7 * np.abs(every)))
    return int(np.count_nonzero(inside)), doubtful + int(np.count_nonzero(~inside))


def random_block(seed: int) -> st.Case:
    """A block of other sizes, materials and loads on the slider: most open some nodes, many squeal."""
    rng = np.random.default_rng(seed)
    divisions = [int(rng.integers(2, 7)), int(rng.integers(2, 5))]
    width, height = rng.uniform(0.012, 0.03), rng.uniform(0.008, 0.03)
    end = min(0.45 * width / height, 1.2)
    made = block(end, 0.0, band=float(rng.choice([8e3, 15e3, 25e3])))
    return made.with_(
        {
            "bodies.block.mesh.size": [width, height],
            "bodies.block.mesh.corner": [-width / 2, 0.0],
            "bodies.block.mesh.divisions": divisions,
            "bodies.block.points.crown": [0.0, height],
            "bodies.block.damping.mass": float(rng.choice([0.0, 20.0, 200.0])),
            "bodies.block.damping.stiffness": float(rng.choice([0.0, 1e-9, 1e-7])),
            "materials.pad.young_modulus": float(10 ** rng.uniform(8.5, 10)),
            "contacts.face.stiffness": float(10 ** rng.uniform(10.5, 13)),
            "loads.press.pressure": float(10 ** rng.uniform(4, 6)),
            "bodies.slider.sliding.velocity": [float(rng.choice([-1.0, 1.0])), 0.0],
        }
    )


def wrong(seed: int, count: int = 12) -> str:
    """What the onsets of a random block say otherwise than modes at single μ; "" where nothing."""
    case = random_block(seed)
    try:
        found = st.onsets(case)
    except st.AnalysisError as error:
        return f"{seed}: {error}"
    low, high = found.friction_range
    if "NOT COMPLETE" in found.completeness:
        return ""  # said
    for mu in np.linspace(low, high, count)[1:-1]:
        # Where a mode comes into the band is known to about a step.
        step = (high - low) / 30
        entries = [o.enters_at for o in found.onsets if o.enters_at] + [at for _, at in found.entering]
        if any(abs(o.mu - mu) < 1e-6 for o in found.onsets) or any(abs(at - mu) < step for at in entries):
            continue
        said = len(found.at_start) + sum(at < mu for _, at in found.entering) + sum(
            -1 if o.stabilising else 1 for o in found.onsets if (o.enters_at or o.mu) < mu
        )
        seen, unsure = growing(case, float(mu))
        if abs(said - seen) > unsure:
            return f"{seed}: {seen} grow at μ = {mu:.6g}, and by the onsets {said} ({[o.mu for o in found.onsets]})"
    return ""


@pytest.mark.parametrize("seed", [pytest.param(98, marks=pytest.mark.slow), 113])
def test_onsets_say_what_modes_at_single_frictions_do(seed: int) -> None:
    assert not wrong(seed)


@pytest.mark.slow
def test_onsets_of_many_random_blocks() -> None:
    assert [said for seed in range(300) if (said := wrong(seed, 41))] == []


def test_growth_from_above_the_band_is_told_whichever_stretch_or_range_it_began_in() -> None:
    """At 9.6 kHz a mode begins to grow as a node opens, at μ = 0.676; it comes below 8 kHz at 0.89."""
    case = random_block(98)
    whole = st.onsets(case)
    begins = [o for o in whole.onsets if o.enters_at is not None]
    assert [(o.kind, o.stabilising) for o in begins] == [("contact", False)]
    assert begins[0].mu == pytest.approx(0.6757, abs=1e-4)
    assert begins[0].frequency_hz == pytest.approx(9575, rel=1e-3)
    assert begins[0].residual < 1e-9
    part = st.onsets(case, friction_range=(0.7, 1.1))
    assert not part.onsets
    assert not part.at_start
    ((lam, enters),) = part.entering
    assert lam.real > 0
    assert lam.imag > 2 * np.pi * case.modal.max_frequency_hz
    assert enters == pytest.approx(begins[0].enters_at, abs=0.03)
    assert growing(case, enters - 0.04)[0] == 0
    assert growing(case, enters + 0.04)[0] == 1
    assert "above the band" in " ".join(part.at_start_words)
    assert part.to_json()["growing_above_band_at_start"][0]["enters_band_at"] == enters
    assert part.to_xarray().attrs["growing_above_band_at_start"] == json.dumps([[lam.real, lam.imag, enters]])


def test_where_an_onset_above_the_band_is_not_found_the_list_is_not_complete() -> None:
    def blind(stretch: Stretch, hz: float) -> Onsets:
        raise st.AnalysisError("nothing settles")

    empty = Onsets((), (0.0, 0.5), 8e3, True, completeness="Checked at both ends: all well.")
    coming = replace(empty, entering=((5 + 6e4j, 0.7),))
    parts = [(Stretch(0.0, 0.5, 0.1), empty), (Stretch(0.5, 1.0, 0.6), coming)]
    told = with_origins(parts, blind, lambda *_: 0.0)
    assert told[0][1].complete
    assert not told[1][1].complete
    assert "0.7" in told[1][1].completeness


def sought(case: st.Case, monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """At which μ the onsets have what grows sought anew."""
    asked: list[float] = []
    honest = checking.growing_modes

    def counted(system: System, mu: float, *given: object, **named: object) -> object:
        asked.append(mu)
        return honest(system, mu, *given, **named)

    monkeypatch.setattr(checking, "growing_modes", counted)
    st.onsets(case)
    return asked


def test_the_low_end_of_a_stretch_is_sought_where_its_branches_say_otherwise_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    case = coarse(0.45)
    borders = [s.low for s in stretches(build_system(case), 0.0, 0.45)[1:]]
    assert len(borders) >= 2
    assert sorted(sought(case, monkeypatch)) == pytest.approx([0.0, *borders, 0.45])
    # Branches that leave out what grows at a border are not believed.
    honest = krylov_module.krylov_onsets

    def forgetful(*given: object, **named: object) -> Onsets:
        return replace(honest(*given, **named), at_start=(1 + 5e4j,))

    monkeypatch.setattr(source_module, "krylov_onsets", forgetful)
    found = sorted(sought(coarse(0.45), monkeypatch))
    assert all(found.count(b) >= 2 for b in found if 0.0 < b < 0.45)


def test_onsets_on_a_basis_that_was_handed_on_are_those_on_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    begun: list[bool] = []
    fit = Carried.fit

    def fits(self: Carried, *given: object) -> bool:
        begun.append(fit(self, *given))
        return begun[-1]

    monkeypatch.setattr(Carried, "fit", fits)
    found = st.onsets(coarse(0.45, 0.3))
    assert any(begun)
    monkeypatch.setattr(Carried, "fit", lambda *_: False)
    other = st.onsets(coarse(0.45, 0.3))
    assert [o.mu for o in found.onsets] == pytest.approx([o.mu for o in other.onsets], rel=1e-9)
    assert [o.branches for o in found.onsets] == [o.branches for o in other.onsets]
    assert sorted(found.at_end, key=abs) == pytest.approx(sorted(other.at_end, key=abs), rel=1e-8)


@pytest.mark.parametrize("lost", [0, 3])
def test_a_basis_that_lost_a_mode_on_the_way_is_made_anew(lost: int) -> None:
    problem = problem_of(build_system(coarse(0.45)), 0.2, Options(), frictions=np.linspace(0.0, 0.45, 5))
    band = Band(1, 2 * np.pi * 20e3)
    reduced = projected(problem, band, 0.45)
    converge_at(reduced, [0.45, 0.2])
    carried = Carried()
    carried.take(reduced, GUARD)
    again = projected(problem, band, 0.45, carried)
    assert again.count < carried.shapes.count + 5, "begun with what was carried"
    keep = np.delete(np.arange(carried.modes), lost)
    carried.shapes, carried.modes = carried.shapes.combined(np.eye(carried.shapes.count)[:, keep]), len(keep)
    without = projected(problem, band, 0.45, carried)
    alone, kept, found = (np.sort(r.eigenpairs(0.0).values.imag) for r in (reduced, again, without))
    inside = alone[alone <= band.frequency]
    assert len(inside) > lost
    for other in (kept, found):
        assert other[: len(inside)] == pytest.approx(inside, rel=1e-7)


def test_gaps_stay_closed_on_a_basis_that_is_handed_on_again_and_again() -> None:
    """Shape and force of what is left of a vector apart from others lose digits each by itself."""
    system, carried, widest = build_system(coarse(0.45)), Carried(), 0.0
    for touching_at in (0.1, 0.35, 0.1, 0.35):
        problem = problem_of(system, touching_at, Options(), frictions=np.linspace(0.0, 0.45, 5))
        reduced = projected(problem, Band(1, 2 * np.pi * 20e3), 0.45, carried)
        converge_at(reduced, [0.45, 0.2])
        carried.take(reduced, GUARD)
        opening, force = problem.normal @ reduced.pairs.u, problem.compliance[:, None] * reduced.pairs.p
        size = (abs(problem.normal) @ np.abs(reduced.pairs.u)).max(axis=0)
        widest = max(widest, float((np.abs(opening + force).max(axis=0) / size).max()))
    assert widest < 1e-13


@pytest.mark.parametrize("solver", ["superlu", None])
def test_nodes_that_open_are_left_out_of_factors_that_are_kept(solver: str | None, monkeypatch) -> None:
    """The same shapes and the same number of modes as by factors of the problem itself, and none of these are made."""
    system, frictions = build_system(coarse(0.45)), np.linspace(0.0, 0.45, 5)
    problems = [problem_of(system, mu, Options(solver=solver), frictions=frictions) for mu in (0.1, 0.35, 0.45)]
    assert np.all(np.diff([p.nodes for p in problems]) < 0)
    shift, square, kept = -((2 * np.pi * 2e3) ** 2), (2 * np.pi * 9e3) ** 2, KeptFactors()
    kept.solving(problems[0], shift)
    first = kept.negative(problems[0], square)
    made: list[Sparse] = []
    for name in ("factorise", "counting_factor"):
        monkeypatch.setattr(kept_factors, name, lambda matrix, **_: made.append(matrix))
    answers = [kept.solving(p, shift) for p in problems]
    counts = [kept.negative(p, square) for p in problems]
    assert not made
    monkeypatch.undo()
    assert counts[0] == first
    for problem, (solving, scale), count in zip(problems, answers, counts, strict=True):
        assert count == KeptFactors().negative(problem, square)
        matrix, own = kept_factors.matrix_at(problem, shift)
        assert own == scale
        right = np.random.default_rng(5).standard_normal((matrix.shape[0], 2))
        answer = solving.solve(right)
        assert np.max(np.abs(matrix @ answer - right) / (abs(matrix) @ np.abs(answer) + np.abs(right))) < 1e-12
    # Nodes that come to touch, and another stiffness, need factors of their own.
    kept.solving(problems[1], shift)
    last = KeptFactors()
    last.solving(problems[1], shift)
    for other in (problems[0], replace(problems[2], stiffness=1.5 * problems[2].stiffness)):
        solving, _ = last.solving(other, shift)
        assert isinstance(solving, Factor)
        last.solving(problems[1], shift)


def test_shapes_that_the_full_problem_has_at_the_high_end_save_solving_for_them(monkeypatch: pytest.MonkeyPatch) -> None:
    def counted(known: bool) -> tuple[st.Onsets, list[int]]:
        """The onsets, and the right sides that each stretch took."""
        solves: list[int] = []
        take = Carried.take

        def taken(self: Carried, reduced, beyond: float) -> None:
            solves.append(reduced.solves)
            take(self, reduced, beyond)

        with monkeypatch.context() as patch:
            patch.setattr(Carried, "take", taken)
            if not known:
                patch.setattr(over_friction, "_shapes_at", lambda *_: None)
            return st.onsets(coarse(0.45)), solves

    (found, fewer), (plain, solves) = counted(True), counted(False)
    assert len(fewer) == len(solves) > 1
    assert sum(fewer) < 0.8 * sum(solves), (fewer, solves)
    assert [o.mu for o in found] == pytest.approx([o.mu for o in plain], rel=1e-9)


def test_what_an_opened_node_does_is_taken_in_before_modes_are_swept(monkeypatch: pytest.MonkeyPatch) -> None:
    def counted() -> tuple[st.Onsets, int]:
        """The onsets, and how often modes were looked at."""
        looks: list[float] = []
        unbalanced = refine.unbalanced
        with monkeypatch.context() as patch:
            patch.setattr(refine, "unbalanced", lambda r, mu, *a, **k: looks.append(mu) or unbalanced(r, mu, *a, **k))
            return st.onsets(coarse(0.45)), len(looks)

    # The closer modes are asked for between the ends, the more sweeps there are to be spared.
    monkeypatch.setitem(refine.converge_over.__kwdefaults__, "between", 1e-9)
    found, fewer = counted()
    monkeypatch.setattr(carried_module, "LEVELS", 0)
    plain, looks = counted()
    assert fewer < 0.9 * looks, (fewer, looks)
    assert [o.mu for o in found] == pytest.approx([o.mu for o in plain], rel=1e-9)


def test_shapes_of_the_full_problem_close_the_gaps_and_tell_no_forces_of_rigid_contact() -> None:
    system = build_system(coarse(0.45))
    problem = problem_of(system, 0.1, Options())
    shapes = growing_modes(system, 0.3, 20e3, touching_at=0.1).shapes
    assert shapes is not None
    carried = Carried(at_end=lambda: shapes)
    known = carried.exact_at_end(problem)
    assert known is not None
    assert known.count >= shapes.shape[1]
    assert np.abs(problem.normal @ known.u + problem.compliance[:, None] * known.p).max() < 1e-16
    assert carried.exact_at_end(replace(problem, compliance=np.zeros_like(problem.compliance))) is None
    assert Carried(at_end=lambda: None).exact_at_end(problem) is None


@pytest.mark.slow  # in each run: the test before on growth from above the band
def test_growth_that_ends_above_the_band_is_not_taken_for_what_comes_into_it_later() -> None:
    """At 27 kHz a mode grows from μ = 0.226, where a node opens, to 0.464; at 0.5176 it begins again, just above the
    band, and comes into it. Forces of stiff contact that are handed on keep their digits, so that all settles."""
    found = st.onsets(random_block(173))
    ((onset),) = found.onsets
    assert onset.mu == pytest.approx(0.51759, abs=1e-5)
    assert onset.enters_at is not None
    assert onset.frequency_hz > found.max_frequency_hz
    assert "do not settle" not in found.completeness


def test_counted_growth_from_above_the_band_without_its_onset_is_not_complete(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    into, out = Passing(0.5, 1 + 6e4j, 2), Passing(0.3, 1 + 6e4j, -2)
    begins = Onset(0.2, 9575.0, "flutter", True, False, (0, 0), 0.0, None, None, enters_at=0.5)

    def unplaced(onsets: tuple[Onset, ...], passing: tuple[Passing, ...]) -> int:
        return len(Answer(onsets, True, None, Counted((), (), passing)).unplaced)

    assert unplaced((), (into,)) == 1
    assert unplaced((begins,), (into,)) == 0
    assert unplaced((), (out, into)) == 0
    assert unplaced((begins,), (into, into)) == 1
    # Counted at both ends it agrees; what is said and what is exported must not.
    monkeypatch.setattr(searching, "_ends_agree", lambda *_: True)
    seen = Counted(((0.0, 0), (1.0, 2)), (), (into,))
    for onsets, whole in (((), False), ((begins,), True)):
        answer = searching._counted_answer(None, Answer(onsets, False), seen, None, 5e4, "")
        assert answer.complete is whole
        assert ("0.5 was not found" in _lacking(answer, "μ", float)) is not whole


def test_what_is_true_of_all_stretches_is_said_once() -> None:
    ends = "Checked at both ends: {} at its end. All in 1 disc. What grows and ends again is not seen."
    parts = [
        (Stretch(0.0, 0.2, 0.1), Onsets((), (0.0, 0.2), 8e3, True, completeness=ends.format("none"))),
        (Stretch(0.2, 0.5, 0.3), Onsets((), (0.2, 0.5), 8e3, True, completeness="NOT COMPLETE: " + ends.format("1"))),
    ]
    border = TouchingChange(0.2, (np.zeros(0), np.zeros(0)), (np.zeros(0), np.zeros(0)))
    told = joined_onsets(parts, (0.0, 0.5), lambda _: border, lambda *_: 0.0)
    assert told.completeness.count("All in 1 disc.") == 1
    assert "(0 to 0.2) Checked at both ends: none" in told.completeness
    assert "(0.2 to 0.5) NOT COMPLETE" in told.completeness
    assert not told.complete


def test_what_was_checked_is_printed_a_paragraph_for_each_stretch() -> None:
    found = st.onsets(coarse(0.45, 0.3))
    count = int(found.completeness.split()[0])
    told = by_stretch(found.completeness)
    assert len(told) > count
    assert all(line.startswith("(") for line in told[1 : count + 1])
    assert " ".join(told) == found.completeness
    assert by_stretch("Checked (0.1 to 0.2) as all.") == ["Checked", "(0.1 to 0.2) as all."]
    assert by_stretch("Checked at both ends.") == ["Checked at both ends."]


def test_modes_are_matched_by_their_nearness_alone() -> None:
    before = np.array([-1 + 100j, 2 + 200j, np.nan + 1j * np.nan])
    after = np.array([3 + 201j, -1 + 100.5j, 5 + 400j])
    assert sorted(matched(before, after)) == [(0, 1), (1, 0)]
    assert jumps([2 + 200j], [3 + 201j]) == ([], [])
    assert jumps([2 + 200j], [3 + 300j]) == ([3 + 300j], [2 + 200j])
    far = 100j * (1 + 2 * ALIKE)
    assert jumps([], [far]) == ([far], [])


@pytest.mark.parametrize(
    ("before", "after", "begins", "ends"),
    [
        ([], [700.0], 1, 0),  # one real root
        ([40 + 900j], [700.0, 60.0], 2, 1),  # a pair falls apart, far from where it was
        ([700 + 10j], [720.0, 690.0], 0, 0),  # and near it: as many grow as before
        ([720.0, 690.0], [700 + 10j], 0, 0),
        ([700 + 10j], [720.0], 1, 1),  # of a pair one root is left
        ([40 + 900j, 700.0], [41 + 905j, 705.0], 0, 0),
    ],
)  # fmt: skip
def test_as_many_eigenvalues_grow_behind_a_border_as_its_onsets_say(
    before: list[complex], after: list[complex], begins: int, ends: int
) -> None:
    def roots(values: list[complex], *, ends: bool) -> int:
        about = {"mu": 0.3, "damped": True, "branches": (1, 1), "residual": 0.0, "square_root_coefficient": None, "growth_slope": None}
        return sum(Onset(frequency_hz=abs(complex(v).imag) / (2 * np.pi), kind="contact", stabilising=ends, **about).roots for v in values)

    begun, ended = jumps(before, after)
    assert (len(begun), len(ended)) == (begins, ends)
    count = {side: sum(1 if complex(v).imag == 0 else 2 for v in values) for side, values in (("before", before), ("after", after))}
    assert roots(begun, ends=False) + roots(ended, ends=True) == count["after"] - count["before"]


STANDING = """
units = "nondimensional"
materials.r = {{ young_modulus = 1.0, density = 1.0, poisson_ratio = 0.3 }}
bodies.b = {{ type = "solid", model = "{model}", material = "r", {mesh}, damping = {{ mass = 0.01, stiffness = 0.005 }} }}
supports.top = {{ at = "b.top", fixed = ["x"] }}
contacts.A = {{ slave = "b.bottom", master = "belt", stiffness = 0.5, friction = {{ law = "coulomb", coefficient = 0.9 }} }}
[bodies.belt]
type = "obstacle"
shape = "flat"
point = {point}
normal = {normal}
sliding.velocity = {velocity}
[modal]
max_frequency_hz = 1.0
friction_range = [0.0, 3.0]
"""


def test_nodes_of_a_stretch_are_not_those_of_a_friction_at_which_one_is_about_to_open() -> None:
    """At μ = 0.9 the block stands on its edge, and the node beside it, which touches from 0.444 on, carries nothing.
    The truth is dense: one pair begins to grow between 0.84 and 0.845, no root is zero."""
    mesh = 'thickness = 1.0, mesh = {shape = "rectangle", corner = [0, 0], size = [1.0, 0.6], divisions = [2, 1], cells = "quad"}'
    plane = {"point": "[0, 0]", "normal": "[0, 1]", "velocity": "[-0.02, 0]"}
    made = st.loads(STANDING.format(model="plane strain", mesh=mesh, **plane)).with_(
        {
            "bodies.b.points": {"p": (1.0, 0.0)},
            "springs.s": {"between": ("b.p", "ground"), "direction": (0, 1), "stiffness": 0.01},
            "loads.press": {"at": "b.top", "pressure": 0.02},
        }
    )
    told = []
    for own in (0.9, 0.3):
        found = st.onsets(made.with_({"contacts.A.friction.coefficient": own}))
        assert found.complete
        told.append([(o.kind, o.branches, o.mu) for o in found.onsets])
    assert told[0] == told[1]
    assert [kind for kind, *_ in told[0]] == ["flutter", "contact", "flutter"]
    assert 0.84 < told[0][-1][-1] < 0.845
    for mu, grow in ((0.6, 0), (0.83, 0), (0.85, 1), (0.89, 1)):
        assert int(st.modes(made, mu).unstable.sum()) == grow


@pytest.mark.parametrize("damping", [0.01, 0.0])
def test_what_has_no_stiffness_neither_grows_nor_diverges(damping: float) -> None:
    """A block in space that nothing presses, nor holds sideways: rounding of its zero root was a divergence that began
    and ended a dozen times, and a mode that grows at every other μ."""
    mesh = 'mesh = {shape = "block", corner = [0, 0, 0], size = [1.0, 0.8, 0.6], divisions = [1, 1, 1]}'
    space = {"point": "[0, 0, 0]", "normal": "[0, 0, 1]", "velocity": "[-0.02, 0, 0]"}
    made = st.loads(STANDING.format(model="3d", mesh=mesh, **space)).with_({"bodies.b.damping.mass": damping})
    swept = st.modes(made, np.linspace(0.0, 1.0, 21), check=False)
    assert np.all(swept.frequency_hz.min(axis=1) < 1e-6)
    assert not np.any(swept.unstable & (swept.frequency_hz < 0.1))
    found = st.onsets(made, (0.0, 1.0))
    assert {o.kind for o in found.onsets} == {"flutter"}
    grow = int(swept.unstable[-1].sum())
    assert sum(o.roots for o in found.onsets) == 2 * grow > 0
    assert found.complete
