"""Along any number of a case each value has the nodes that touch in its own steady sliding, as over friction.

The truth is the case rebuilt at one value, whose modes are solved with the nodes that touch there.
"""

from __future__ import annotations

import numpy as np
import pytest
from typer.testing import CliRunner

import stridor as st
from stridor.app.cli import app
from stridor.app.conclusions import of_onsets_along
from stridor.modal.full import onsets_along, unlike_along
from stridor.study.boundary import stability_boundary

pytestmark = pytest.mark.verification

PAD = """
[materials.soft]
young_modulus = 1e9
density = 2500.0
poisson_ratio = 0.25
[bodies.pad]
type = "solid"
model = "plane strain"
material = "soft"
thickness = 0.01
mesh = { shape = "rectangle", corner = [0.0, 0.0], size = [0.04, 0.03], divisions = [4, 2], cells = "quad" }
damping = { mass = 20.0, stiffness = 1e-7 }
points = { a = [0.0, 0.03], b = [0.04, 0.03] }
[bodies.belt]
type = "obstacle"
shape = "flat"
point = [0.0, 0.0]
normal = [0.0, 1.0]
sliding = { velocity = [1.0, 0.0] }
[springs.s1]
between = ["pad.a", "ground"]
stiffness = 4e6
direction = [1.0, 0.3]
[springs.s2]
between = ["pad.b", "ground"]
stiffness = 2e6
direction = [1.0, -0.4]
[loads.press]
at = "pad.top"
force = [0.0, -1000.0]
[contacts.A]
slave = "pad.bottom"
master = "belt"
stiffness = 1e12
friction = { law = "coulomb", coefficient = 0.3 }
[modal]
max_frequency_hz = 20000.0
friction_range = [0.0, 0.8]
"""
SIDEWAYS, OWN = "loads.press.force.0", "contacts.A.friction.coefficient"


def pad() -> st.Case:
    return st.loads(PAD)


def rebuilt(case: st.Case, name: str, value: float) -> int | None:
    """How many modes grow at a value with the case's own friction; None where nothing slides steadily."""
    try:
        return int(st.modes(case.with_({name: value})).unstable.sum())
    except st.AnalysisError:
        return None


def said(found, start: int, value: float) -> int:
    return start + sum(-1 if o.stabilising else 1 for o in found if o.value <= value)


def test_the_load_decides_who_touches_and_that_what_grows():
    case = pad()
    found = st.onsets(case, (-600.0, 600.0), along=SIDEWAYS)
    assert found.complete
    assert [(o.kind, o.stabilising) for o in found] == [("contact", True)] * 2
    assert found.sentence.startswith(f"3 stretches of {SIDEWAYS}, each with the nodes that touch there. (-600 to -566.97")
    (words,) = found.warnings
    assert words == f"{SIDEWAYS} changes nothing but which nodes touch: no matrix of the problem depends on it"
    assert "5 between" in found.notes[0]
    assert max(o.residual for o in found) < 1e-9
    for value in (-600.0, -567.1, -566.9, 0.0, 600.0):
        assert rebuilt(case, SIDEWAYS, value) == said(found, 2, value), value
    at = found[0].value
    counts = [int(st.steady_sliding(case.with_({SIDEWAYS: at + shift})).active.sum()) for shift in (-1e-3, 1e-3)]
    assert counts == [5, 4]


@pytest.mark.parametrize("seed", [pytest.param(s, marks=[pytest.mark.slow] * (s != 2)) for s in range(1, 25)])
def test_random_pads_along_their_numbers(seed):
    """Of every value that is not at a border, as many modes grow as the onsets say."""
    pick = np.random.default_rng(seed)
    case = pad().with_(
        {
            "springs.s1.stiffness": float(10 ** pick.uniform(6, 7)),
            "springs.s2.stiffness": float(10 ** pick.uniform(6, 7)),
            "springs.s1.direction.1": float(pick.uniform(-1.0, 1.0)),
            "springs.s2.direction.1": float(pick.uniform(-1.0, 1.0)),
            "loads.press.force.0": float(pick.uniform(-300, 300)),
            OWN: float(pick.uniform(0.2, 0.7)),
            "contacts.A.stiffness": float(10 ** pick.uniform(11.5, 12.5)),
            "modal.max_frequency_hz": 1e6,  # none leaves the band
        }
    )
    name = [SIDEWAYS, "contacts.A.stiffness", "springs.s2.stiffness", OWN][seed % 4]
    between = {
        SIDEWAYS: (-700.0, 700.0), "contacts.A.stiffness": (1e11, 4e12), "springs.s2.stiffness": (5e5, 2e7), OWN: (0.0, 0.9)
    }[name]  # fmt: skip
    values = np.linspace(*between, 25)
    truth = [rebuilt(case, name, float(value)) for value in values]
    if all(count is None for count in truth):
        with pytest.raises(st.AnalysisError, match="equilibrium"):
            st.onsets(case, between, along=name)
        return
    found = st.onsets(case, between, along=name)
    assert found.complete
    start, compared = None, 0
    for value, count in zip(values, truth, strict=True):
        if any(abs(value - o.value) < 1e-3 * (between[1] - between[0]) for o in found):
            continue
        if count is None:
            start = None  # nothing slides there, and beyond it the count begins anew
            continue
        start = count - said(found, 0, value) if start is None else start
        assert said(found, start, value) == count, (name, value)
        compared += 1
    assert compared > 10


@pytest.mark.slow  # in each run: `test_frictionless_contacts.py`, onsets along the friction of one contact
def test_own_friction_of_the_one_contact_is_mu():
    case = pad().with_({"springs.s2.direction.1": 0.4})
    one, other = st.onsets(case, (0.0, 0.8)), st.onsets(case, (0.0, 0.8), along=OWN)
    assert len(one.onsets) == len(other) > 1
    for mine, theirs in zip(one.onsets, other, strict=True):
        assert theirs.value == pytest.approx(mine.mu, rel=1e-6)
        assert theirs.frequency_hz == pytest.approx(mine.frequency_hz, rel=1e-6)
        assert (theirs.kind, theirs.stabilising) == (mine.kind, mine.stabilising)


def test_models_that_hold_the_nodes_of_the_case_call_nothing_complete(tmp_path):
    case = pad()
    plane = stability_boundary(case, SIDEWAYS, "springs.s1.stiffness", x_range=(-600.0, 600.0), y_range=(3e6, 5e6), lines=2)
    assert not plane.agree
    assert plane.sentence.startswith("Not complete: other nodes touch at some of these values")
    assert any("(1 open one would touch)" in note for note in plane.notes)
    assert plane.warnings == (f"{SIDEWAYS} changes at most which nodes touch: no matrix depends on it",)
    whole = stability_boundary(case, SIDEWAYS, "springs.s1.stiffness", x_range=(-50.0, 50.0), y_range=(3.9e6, 4.1e6), lines=2)
    assert whole.agree
    path = tmp_path / "pad.toml"
    path.write_text(PAD)
    box = ["--box", f"{SIDEWAYS}=-600:600", "--at", f"{SIDEWAYS}=-600", "--onsets", SIDEWAYS]
    done = CliRunner().invoke(app, ["reduce", str(path), *box, "--out", str(tmp_path / "out")])
    assert done.exit_code == 3
    assert "with the nodes that are held: others touch at" in " ".join(done.stdout.split())


def test_what_lies_outside_the_box_of_a_model_is_looked_at_like_the_box(tmp_path):
    """Pressed sideways by 600 N a node lifts off, by −60 N none does: `steady_sliding` of the case rebuilt there."""
    case, path = pad().with_({"modal.max_frequency_hz": 4e3}), tmp_path / "model.npz"
    model = st.reduced_model(case, {"mu": (0.26, 0.29), SIDEWAYS: (-50.0, 50.0)})
    st.save(model, path, case=case)
    kept = st.open(path)
    assert not model.problem.elsewhere
    near, far = {SIDEWAYS: -60.0}, {SIDEWAYS: 600.0}
    lifts = "1 of 4 touching nodes would lift off"
    unknown = "outside the box, and the model does not know which nodes touch there"
    assert model.unlike([{}, near, far, {**far, "mu": 0.35}]) == ("", "", lifts, lifts)
    assert kept.unlike([{}, near, far]) == ("", unknown, unknown)
    for point, touching in (({}, 4), (near, 4), (far, 3)):
        assert st.steady_sliding(st.build_system(case.with_(point)), mu=0.275).active.sum() == touching
    assert unlike_along(model, "mu", near) == ""
    assert unlike_along(model, "mu", far).startswith("the model does not hold at 9 of 9 values")
    assert unlike_along(kept, "mu", near) == f"{SIDEWAYS} = -60 lies {unknown}"
    found = onsets_along(model, "mu", far, confirm=False)
    assert not found.complete
    assert found.sentence.startswith("Not complete: the model does not hold at 9 of 9 values")
    assert of_onsets_along(found).sentence.endswith(", but see above")
    done = CliRunner().invoke(app, ["reduce", str(path), "--at", f"{SIDEWAYS}=600", "--onsets", "mu", "--out", str(tmp_path / "out")])
    told = " ".join(done.output.split())
    assert done.exit_code == 3
    assert f"note: Modes of the model may not hold at mu = 0.275, {SIDEWAYS} = 600 ({unknown})" in told
    assert "with what the model holds: that is not so, or not known to be, at some values, see the notes" in told


def test_matrices_outside_the_box_of_a_model_are_those_of_the_case_or_it_does_not_hold():
    """Poisson's ratio from 0.24 to 0.26 is a polynomial but for rounding, and at 0.4 no longer: λ is 0.6 % off there."""
    case, ratio, thickness = pad().with_({"modal.max_frequency_hz": 4e3}), "materials.soft.poisson_ratio", "bodies.pad.thickness"
    model = st.reduced_model(case, {ratio: (0.24, 0.26)})
    assert model.unlike([{}, {ratio: 0.4}])[0] == ""
    assert "the model's matrices are off by 3.3e-02 there" in model.unlike([{ratio: 0.4}])
    assert st.reduced_model(case, {thickness: (0.008, 0.012)}).unlike([{thickness: 0.03}]) == ("",)
