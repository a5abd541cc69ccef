"""Load steps at several speeds with a law that depends on speed: one history, whoever asks and with whichever μ."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.linalg as sl
from typer.testing import CliRunner

import stridor as st
from stridor.app.cli import app
from stridor.case import Case
from stridor.contact.multipliers import SLIP, STICK
from stridor.errors import AnalysisError
from stridor.sliding.result import SteadySliding

# Masses A on a belt, slow at first, and B on a floor at rest.
TWO = """
units = "nondimensional"

[bodies.m0]
type = "mass"
mass = 1.0
position = [0.0, 0.0]

[bodies.m1]
type = "mass"
mass = 1.0
position = [1.0, 0.0]

[springs.y0]
between = ["m0", "ground"]
stiffness = 50.0
direction = [0.3, 1.0]
damping = 0.1

[springs.y1]
between = ["m1", "ground"]
stiffness = 60.0
direction = [0.0, 1.0]
damping = 0.1

[springs.x1]
between = ["m1", "ground"]
stiffness = 40.0
direction = [1.0, 0.3]
damping = 0.1

[springs.s]
between = ["m0", "m1"]
stiffness = 80.0
direction = [1.0, 0.2]

[bodies.belt]
type = "obstacle"
shape = "flat"
point = [0.0, 0.0]
normal = [0.0, 1.0]
sliding = { velocity = [1.0, 0.0] }

[bodies.floor]
type = "obstacle"
shape = "flat"
point = [1.0, 0.0]
normal = [0.0, 1.0]

[contacts.A]
slave = "m0"
master = "belt"
stiffness = 100.0
friction = { law = "weakening", coefficient = 0.2, static_coefficient = 0.8, decay_speed = 0.02 }

[contacts.B]
slave = "m1"
master = "floor"
stiffness = 100.0
friction = { law = "coulomb", coefficient = 0.2 }

[loads.p0]
at = "m0"
force = [0.0, -30.0]

[loads.p1]
at = "m1"
force = [0.0, -10.0]

[loads.pull]
at = "m1"
force = [3.0, 0.0]

[steady]
friction = "stick-slip"

[[steady.steps]]
loads = { pull = 0.0 }
velocities = { belt = 0.01 }

[[steady.steps]]
loads = { pull = 1.0 }
velocities = { belt = 1.0 }

[modal]
max_frequency_hz = 1000.0

[temporal]
initial = "steady-sliding"

[[phases]]
name = "run"
duration = 1.0
"""


@pytest.fixture(scope="module")
def two() -> Case:
    return st.loads(TWO)


def linearised(case: Case, steady: SteadySliding) -> np.ndarray:
    """Eigenvalues about a state of contact points: B as it is left by the load steps, A with the slope of no law."""
    system = st.build_system(case)
    nodes, n = system.contact_nodes(), system.size
    normal, tangent = nodes.normal.toarray(), nodes.tangent.toarray()
    stiffness = system.stiffness.toarray()
    for i in np.flatnonzero(steady.status == SLIP):
        row = normal[i] + steady.friction_coefficient[i] * steady.sense[i, 0] * tangent[i]
        stiffness += np.outer(row, normal[i]) / nodes.compliance[i]
    for i in np.flatnonzero(steady.status == STICK):
        stiffness += np.outer(normal[i], normal[i]) / nodes.compliance[i]
    free = sl.null_space(tangent[steady.status == STICK]) if np.any(steady.status == STICK) else np.eye(n)
    mass, damping, whole = (free.T @ m @ free for m in (system.mass.toarray(), system.damping.toarray(), stiffness))
    k = len(mass)
    lower = -np.linalg.solve(mass, np.hstack([whole, damping]))
    lam = sl.eigvals(np.vstack([np.hstack([np.zeros((k, k)), np.eye(k)]), lower]))
    lam = lam[lam.imag > 0.0]
    return lam[np.argsort(lam.imag)]


SLOW: dict[str, Any] = {}
AT_REST = {
    "steady.steps.0.velocities.belt": 0.0, "springs.s.stiffness": 8.0, "loads.p0.force": [-12.0, -30.0],
    "loads.pull.force": [2.0, 0.0],
}  # fmt: skip


@pytest.mark.parametrize("changes", [SLOW, AT_REST])
def test_a_coefficient_that_all_contacts_have_changes_nothing(two: Case, changes: dict[str, Any]) -> None:
    """Every contact has 0.2 at the end, in double precision: the law at 1, and the floor. In the first step A slides
    with more, or sticks up to what its law has at rest."""
    case = two.with_(changes)
    own, asked = st.steady_sliding(case), st.steady_sliding(case, 0.2)
    assert list(own.status) == [SLIP, STICK]
    assert np.array_equal(own.status, asked.status)
    assert asked.friction_force == pytest.approx(own.friction_force, rel=1e-12)
    assert asked.normal_force == pytest.approx(own.normal_force, rel=1e-12)
    expected = linearised(case, own)
    for mu in (None, 0.2):
        assert st.modes(case, mu).eigenvalues[0] == pytest.approx(expected, rel=1e-10)


def test_the_history_is_that_of_a_run(two: Case) -> None:
    for mu in (0.15, 0.25):
        steady, run = st.steady_sliding(two, mu), st.simulate(two, mu)
        assert run.normal_force[0] == pytest.approx(steady.normal_force, rel=1e-9)
        assert np.abs(run.tangential_force[0]).ravel() == pytest.approx(np.abs(steady.friction_force[:, 0]), rel=1e-9)
        # As with a law written down at that scale.
        whole = {"coefficient": mu, "static_coefficient": 4.0 * mu}
        written = two.with_({
            **{f"contacts.A.friction.{name}": value for name, value in whole.items()},
            "contacts.B.friction.coefficient": mu,
        })  # fmt: skip
        assert steady.friction_force == pytest.approx(st.steady_sliding(written).friction_force, rel=1e-12)


def test_modes_of_contacts_of_their_own_friction_have_its_history(two: Case) -> None:
    case = two.with_({"contacts.A.friction.decay_speed": 0.01, "contacts.B.friction.coefficient": 0.3})
    steady = st.steady_sliding(case)
    found = st.modes(case)
    assert found.mu[0] == pytest.approx(0.3)
    assert found.eigenvalues[0] == pytest.approx(linearised(case, steady), rel=1e-10)


def test_steps_that_end_at_another_speed_are_scaled_there(two: Case) -> None:
    """Modes and runs in time alike."""
    slow = two.with_({
        "steady.steps.1.velocities.belt": 0.02, "phases.run.velocities": {"belt": 0.02}, "phases.run.duration": 0.01,
        "contacts.A.friction.decay_speed": 0.5, "temporal.step": 1e-4,
    })  # fmt: skip
    steady, run = st.steady_sliding(slow, 0.3), st.simulate(slow, 0.3)
    assert steady.friction_coefficient == pytest.approx(0.3, rel=1e-12)
    assert run.normal_force[0] == pytest.approx(steady.normal_force, rel=1e-9)
    assert abs(float(run.tangential_force[0, 0])) == pytest.approx(0.3 * run.normal_force[0, 0], rel=1e-6)


def test_a_law_has_no_slope_where_nothing_slides(two: Case) -> None:
    """A node at its limit that no motion slides: there is no slip about which its law could be linearised."""
    falling = {"law": "hyperbolic", "coefficient": 0.1, "static_coefficient": 0.2, "delta": 3.0}
    case = two.with_({"contacts.B.friction": falling, "loads.pull.force": [12.0, 0.0]})
    steady = st.steady_sliding(case)
    assert list(steady.slips_still) == [False, True]
    expected = linearised(case, steady)
    for source in ("krylov", "full", None):
        chosen = case if source is None else case.with_({"modal.source": source})
        assert st.modes(chosen).eigenvalues[0] == pytest.approx(expected, rel=1e-9)


@pytest.mark.bad_input
def test_onsets_along_a_number_say_that_load_steps_are_not_followed(two: Case) -> None:
    path = "contacts.A.friction.coefficient"
    told = rf"^onsets along {path} \(--along\): load steps .* at one value after another \(--set {path}="
    with pytest.raises(AnalysisError, match=told):
        st.onsets(two, (0.1, 0.7), along=path)


def test_what_is_refused_is_not_advised(two: Case, tmp_path) -> None:
    case = tmp_path / "two.toml"
    case.write_text(TWO.replace('law = "coulomb", coefficient = 0.2', 'law = "coulomb", coefficient = 0.3'))
    result = CliRunner().invoke(app, ["steady", str(case), "--mu", "0.25", "--out", str(tmp_path / "out")])
    assert result.exit_code == 0, result.output
    assert "each contact's own" in " ".join(result.output.split())
    assert "--along" not in result.output
