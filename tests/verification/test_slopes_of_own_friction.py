"""Contacts with coefficients of their own, of which some vary with slip speed: the slope of each law acts in full.

The truth is put together here, on dense matrices: steady sliding by Newton's method, the slope of a law by differences
of its own formula, the friction force −μ(|w|) N w/|w| linearised contact by contact.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import scipy.linalg as sl

import stridor as st
from stridor.modal.krylov import friction_energy
from stridor.study.workspace import in_proportion
from stridor.system import System

Spec = dict[str, Any]
WEAKENING = {"law": "weakening", "coefficient": 0.2, "static_coefficient": 0.4, "decay_speed": 0.5}


def coefficient(law: Spec, v: float) -> float:
    """μ at a slip speed, by the formulas of the case file."""
    low = law["coefficient"]
    if law["law"] == "weakening":
        return low + (law["static_coefficient"] - low) * np.exp(-v / law["decay_speed"])
    if law["law"] == "hyperbolic":
        return low + (law["static_coefficient"] - low) / (1 + law["delta"] * v)
    return low


def slope(law: Spec, v: float) -> float:
    """dμ/dv of it, of sixth order."""
    h, weights = 1e-3 * v, {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}
    return sum(w * (coefficient(law, v + k * h) - coefficient(law, v - k * h)) for k, w in weights.items()) / h


@dataclass(frozen=True)
class Model:
    """Matrices (n, n), contacts by name as `System.from_matrices` takes them, a load (n,)."""

    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    contacts: dict[str, Spec]
    load: np.ndarray

    @property
    def system(self) -> System:
        return System.from_matrices(
            self.mass, self.damping, self.stiffness, contacts=self.contacts, loads={"press": self.load}
        )


@dataclass(frozen=True)
class Truth:
    """Steady sliding (motion, normal forces, coefficients) and the pairs (λ, u) of small motions about it.

    weakening (m,): N dμ/dv; sense (m,): of friction along the tangents.
    """

    normal: np.ndarray
    mu: np.ndarray
    weakening: np.ndarray
    sense: np.ndarray
    values: np.ndarray
    vectors: np.ndarray


def truth(model: Model) -> Truth | None:
    """None where not all contacts are pressed."""
    contacts, n = list(model.contacts.values()), len(model.load)
    normal, tangent = (np.array([c[name] for c in contacts]) for name in ("normal", "tangent"))
    slip = np.array([c["slip"] for c in contacts])
    sense, speed = -np.sign(slip), np.abs(slip)
    mu = np.array([coefficient(c["friction"], v) for c, v in zip(contacts, speed, strict=True)])
    push = normal + (mu * sense)[:, None] * tangent
    rigid = np.array([c["stiffness"] == "rigid" for c in contacts])
    linear = np.array([0.0 if c["stiffness"] == "rigid" else c["stiffness"] for c in contacts])
    cubic = np.array([c.get("cubic", 0.0) for c in contacts])
    # Newton's method for K u − pushᵀ N = f with N = k d + k₃ d³ of the approach d = −n u, or d = 0.
    u, force = np.zeros(n), np.zeros(len(contacts))
    for _ in range(60):
        d = -normal @ u
        tangents = np.where(rigid, 1.0, linear + 3 * cubic * d**2)
        jacobian = np.block(
            [[model.stiffness, -push.T], [tangents[:, None] * normal, np.diag(np.where(rigid, 0.0, 1.0))]]
        )
        law = np.where(rigid, -d, force - linear * d - cubic * d**3)
        left = np.concatenate([model.stiffness @ u - push.T @ force - model.load, law])
        step = np.linalg.solve(jacobian, left)
        u, force = u - step[:n], force - step[n:]
    assert np.abs(step).max() < 1e-10
    if force.min() <= 1e-3:
        return None
    weakening = force * [slope(c["friction"], v) for c, v in zip(contacts, speed, strict=True)]
    soft = ~rigid
    stiffness = model.stiffness + (push[soft].T * (linear + 3 * cubic * (normal @ u) ** 2)[soft]) @ normal[soft]
    damping = model.damping + (tangent.T * weakening) @ tangent
    # Rigid contacts: motions that keep their gaps, tested with what their forces do no work on.
    motion, tests = (sl.null_space(rows[rigid]) if rigid.any() else np.eye(n) for rows in (normal, push))
    m, c, k = (tests.T @ matrix @ motion for matrix in (model.mass, damping, stiffness))
    size = len(m)
    inverse = np.linalg.inv(m)
    whole = np.block([[np.zeros((size, size)), np.eye(size)], [-inverse @ k, -inverse @ c]])
    values, vectors = sl.eig(whole)
    return Truth(force, mu, weakening, sense, values, motion @ vectors[:size])


def chain(*, kind: str) -> Model:
    """Three freedoms, a Coulomb contact and one that weakens with less than half its coefficient."""
    more = {"plain": {"stiffness": 10.0}, "cubic": {"stiffness": 10.0, "cubic": 1e-9}}[kind]
    along = {"tangent": [1.0, 0.0, 0.0], "slip": 0.4, **more}
    return Model(
        np.eye(3), 0.05 * np.eye(3), np.array([[4.0, 1, 0], [1, 9, 1], [0, 1, 6]]),
        {
            "a": {"normal": [0.0, 1.0, 0.0], "friction": {"law": "coulomb", "coefficient": 0.6}, **along},
            "b": {"normal": [0.0, 0.0, 1.0], "friction": WEAKENING, **along},
        },
        np.array([0.0, -1.0, -2.0]),
    )  # fmt: skip


def drawn(seed: int) -> Model:
    """Random matrices of 4 to 7 freedoms and 2 or 3 contacts: rigid, springs or hardening ones, of several laws."""
    random = np.random.default_rng(seed)
    n, count = int(random.integers(4, 8)), int(random.integers(2, 4))
    turn = np.linalg.qr(random.standard_normal((n, n)))[0]
    omega = np.sort(random.uniform(0.7, 3.0, n))
    contacts: dict[str, Spec] = {}
    load = np.zeros(n)
    places = random.permutation(n)
    for k in range(count):
        low = float(random.uniform(0.1, 0.6))
        laws: list[Spec] = [
            {"law": "weakening", "coefficient": low, "static_coefficient": 1.4 * low,
             "decay_speed": float(random.uniform(0.2, 1.0))},
            {"law": "hyperbolic", "coefficient": low, "static_coefficient": 1.4 * low,
             "delta": float(random.uniform(1.0, 5.0))},
            {"law": "static-kinetic", "coefficient": low, "static_coefficient": 1.3 * low},
            {"law": "coulomb", "coefficient": low},
        ]  # fmt: skip
        normal, tangent = 0.2 * random.standard_normal((2, n))
        normal[places[k]] += 1.0
        tangent[places[-1]] += 1.0
        spec: Spec = {
            "normal": normal.tolist(), "tangent": tangent.tolist(), "friction": laws[(seed + k) % 2 if k < 2 else 2],
            "slip": float(random.choice([-1, 1]) * random.uniform(0.1, 0.6)), "stiffness": float(random.uniform(2, 20)),
        }  # fmt: skip
        if k == 1 and seed % 3 == 0:
            spec["friction"] = laws[3]
        match int(random.integers(3)):
            case 0:
                spec["stiffness"] = "rigid"
            case 1:
                spec["cubic"] = float(random.uniform(1, 20))
        contacts[f"c{k}"] = spec
        load -= normal * random.uniform(0.5, 1.5)
    return Model(
        np.eye(n), turn @ np.diag(2 * omega * random.uniform(0.005, 0.04, n)) @ turn.T,
        turn @ np.diag(omega**2) @ turn.T, contacts, load,
    )  # fmt: skip


def assert_all_modes(model: Model, known: Truth) -> None:
    """Without μ, `modes` has every vibration of the truth once and nothing else."""
    upper = known.values[known.values.imag > 1e-6]
    top = 1.01 * np.abs(known.values).max()
    found = st.modes(model.system, max_frequency_hz=top)
    assert found.mu[0] == pytest.approx(known.mu.max(), rel=1e-12)
    values = found.eigenvalues.ravel()
    values = values[values.imag > 1e-6]
    assert len(values) == len(upper)
    for value in upper:
        assert np.abs(values - value).min() < 1e-7 * abs(value)


def share_of_slopes(known: Truth) -> float:
    """How much of the slopes belongs to other contacts than that of the largest coefficient, which never was wrong."""
    others = known.mu < 0.95 * known.mu.max()
    return float(np.abs(known.weakening[others]).max(initial=0.0))


@pytest.mark.parametrize("kind", ["plain", "cubic"])
def test_a_weakening_contact_beside_one_with_more_friction(kind: str) -> None:
    model = chain(kind=kind)
    known = truth(model)
    assert known is not None
    assert share_of_slopes(known) > 0.1
    assert known.values.real.max() == pytest.approx(0.0875031, rel=1e-5)
    assert_all_modes(model, known)


def assert_random(seed: int) -> bool:
    """Whether the system says anything about slopes of contacts with less friction than another."""
    model = drawn(seed)
    known = truth(model)
    if known is None or share_of_slopes(known) < 0.01:
        return False
    assert_all_modes(model, known)
    return True


@pytest.mark.parametrize(
    ("seeds", "least"), [(range(4), 1), pytest.param(range(14), 5, marks=pytest.mark.slow)], ids=["few", "many"]
)
def test_random_contacts_with_friction_of_their_own(seeds: range, least: int) -> None:
    assert sum(assert_random(seed) for seed in seeds) >= least


def assert_power_of_each(model: Model) -> float:
    """The power of friction at each contact from the truth's pairs; the most that the slopes of laws have in it."""
    known = truth(model)
    assert known is not None
    made = in_proportion(model.system)
    assert made is not None
    system, mu = made
    modes = st.modes(model.system, max_frequency_hz=1.01 * np.abs(known.values).max(), vectors=True)
    contacts = list(model.contacts.values())
    normal, tangent = (np.array([c[name] for c in contacts]) for name in ("normal", "tangent"))
    along = known.sense[:, None] * tangent
    most = 0.0
    assert modes.mu[0] == pytest.approx(mu)
    for mode in np.flatnonzero(modes.frequency_hz[0] > 0):
        found = friction_energy(system, modes, 0, int(mode))
        k = int(np.argmin(np.abs(known.values - modes.eigenvalues[0, mode])))
        lam, u = known.values[k], known.vectors[:, k]
        # What the structure asks for is what contacts give: (N + μS)ᵀ p − Sᵀ d λ S u.
        slopes = known.weakening * lam * (along @ u)
        asked = (lam**2 * model.mass + lam * model.damping + model.stiffness) @ u + along.T @ slopes
        force = np.linalg.lstsq((normal + known.mu[:, None] * along).T.astype(complex), asked, rcond=None)[0]
        power = 0.5 * (np.conj(lam * (along @ u)) * (known.mu * force - slopes)).real
        size = abs(lam) ** 2 * np.vdot(u, model.damping @ u).real / 2
        assert (found.power.sum() - found.damping) == pytest.approx(2 * lam.real, abs=1e-7 * abs(lam))
        assert found.power / found.damping == pytest.approx(power / size, rel=1e-5, abs=1e-6 * np.abs(power / size).max())
        own = 0.5 * (np.conj(lam * (along @ u)) * slopes).real
        most = max(most, float(np.abs(own).max() / np.abs(power).max()))
    return most


@pytest.mark.parametrize("kind", ["plain", "cubic"])
def test_power_of_friction_at_each_contact(kind: str) -> None:
    assert assert_power_of_each(chain(kind=kind)) > 0.3


def test_power_of_friction_at_each_rigid_contact() -> None:
    model = drawn(next(seed for seed in range(200) if _rigid_alone(seed)))
    assert assert_power_of_each(model) > 0.1


def _rigid_alone(seed: int) -> bool:
    known = truth(model := drawn(seed))
    rigid = all(c["stiffness"] == "rigid" for c in model.contacts.values())
    return rigid and known is not None and share_of_slopes(known) > 0.01


@pytest.mark.slow
def test_many_random_contacts_with_friction_of_their_own() -> None:
    assert sum(assert_random(seed) for seed in range(14, 200)) >= 60


# -- masses on a belt that moves along two directions, by a case file ---------------------------------------------------
LAWS: dict[str, Spec] = {
    "m": {"law": "coulomb", "coefficient": 0.6},
    "q": WEAKENING,
    "r": {"law": "weakening", "coefficient": 0.05, "static_coefficient": 0.3, "decay_speed": 0.4},
}


def masses(stiffness: float | str = 10.0, *, turns: bool = False, **laws: Spec) -> st.Case:
    """Three masses in space on springs, pressed on a belt; ``laws`` in place of those above."""
    random = np.random.default_rng(3)
    bodies: Spec = {
        "belt": {
            "type": "obstacle", "shape": "flat", "point": [0.0, 0.0, 0.0], "normal": [0.0, 0.0, 1.0],
            "sliding": {"velocity": [-0.4, 0.1, 0.0]},
        }
    }  # fmt: skip
    springs: Spec = {}
    case: Spec = {
        "units": "nondimensional", "bodies": bodies, "springs": springs, "dashpots": {}, "loads": {}, "contacts": {},
        "modal": {"max_frequency_hz": 2.0, "friction_damping": turns},
    }  # fmt: skip
    for k, (name, law) in enumerate({**LAWS, **laws}.items()):
        bodies[name] = {"type": "mass", "mass": 1.0, "position": [float(k), 0.1 * k, 0.0]}
        case["loads"][name] = {"at": name, "force": [0.0, 0.0, -1.0 - 0.5 * k]}
        case["contacts"][name] = {"slave": name, "master": "belt", "stiffness": stiffness, "friction": law}
        for j, way in enumerate(np.eye(3)):
            across = (way + 0.2 * random.standard_normal(3)).tolist()
            held: Spec = {"between": [name, "ground"], "direction": across, "stiffness": float(random.uniform(2, 8))}
            springs[f"{name}{j}"] = held
            case["dashpots"][f"{name}{j}"] = {"between": held["between"], "direction": way.tolist(), "damping": 0.03}
    for one, two in ("mq", "qr"):
        springs[one + two] = {"between": [one, two], "direction": [1.0, 0.3, 0.2], "stiffness": 1.5}
    return st.Case.model_validate(case)


def vibrations(case: st.Case, laws: dict[str, Spec], *, turns: bool = False) -> np.ndarray:
    """λ of all vibrations of the case's masses with these laws, friction linearised by differences node by node."""
    system = st.build_system(case)
    nodes = system.contact_nodes()
    m, c, k = (matrix.toarray() for matrix in (system.mass, system.damping, system.stiffness))
    normal, tangent = nodes.normal.toarray(), nodes.tangent.toarray()
    slip = nodes.slip_velocity(system.motion.full)
    force = sum(system.loads.values()) - system.motion.damping @ system.motion.full

    def rubs(i: int, w: np.ndarray) -> np.ndarray:
        """Friction on node i per normal force at a slip velocity."""
        speed = float(np.linalg.norm(w))
        return -coefficient(laws[nodes.names[nodes.owner[i]]], speed) * w / speed

    rows = [tangent[2 * i : 2 * i + 2] for i in range(nodes.count)]
    push = normal + np.array([rubs(i, slip[i]) @ rows[i] for i in range(nodes.count)])
    rigid = bool(np.all(nodes.compliance == 0.0))
    spring = np.zeros(nodes.count) if rigid else 1.0 / nodes.compliance
    whole = k + push.T @ (spring[:, None] * normal)
    if rigid:
        border = np.block([[k, -push.T], [normal, np.zeros((nodes.count, nodes.count))]])
        pressed = np.linalg.solve(border, np.concatenate([force, -nodes.gap]))[len(m) :]
    else:
        pressed = -spring * (normal @ np.linalg.solve(whole, force - push.T @ (spring * nodes.gap)) + nodes.gap)
    assert pressed.min() > 0.0
    for i in range(nodes.count):
        along = slip[i] / np.linalg.norm(slip[i])
        for way in (along, np.array([-along[1], along[0]]))[: 1 + turns]:
            h = 1e-4
            change = sum(
                w * (rubs(i, slip[i] + j * h * way) - rubs(i, slip[i] - j * h * way)) / h
                for j, w in ((1, 3 / 4), (2, -3 / 20), (3, 1 / 60))
            )
            c = c - pressed[i] * rows[i].T @ np.outer(change, way) @ rows[i]
    if rigid:
        motion, tests = sl.null_space(normal), sl.null_space(push)
        m, c, whole = (tests.T @ matrix @ motion for matrix in (m, c, k))
    inverse = np.linalg.inv(m)
    values = sl.eigvals(np.block([[np.zeros_like(m), np.eye(len(m))], [-inverse @ whole, -inverse @ c]]))
    return values[values.imag > 1e-6]


def assert_same(found: np.ndarray, known: np.ndarray, rel: float = 1e-7) -> None:
    found = found[found.imag > 1e-6]
    assert len(found) == len(known)
    assert max(np.abs(found - value).min() / abs(value) for value in known) < rel


@pytest.mark.parametrize("stiffness", [10.0, "rigid"])
@pytest.mark.parametrize("turns", [False, True])
def test_in_space_with_and_without_friction_that_turns(stiffness: float | str, turns: bool) -> None:
    case = masses(stiffness, turns=turns)
    assert_same(st.modes(case).eigenvalues[0], vibrations(case, LAWS, turns=turns))


def test_a_model_over_numbers_beside_friction_that_each_contact_has_of_its_own() -> None:
    case = masses()
    model = st.reduced_model(case, {"springs.m0.stiffness": (3.0, 6.0)})
    for value in (3.4, 5.7):
        there = case.with_({"springs.m0.stiffness": value})
        assert_same(model.modes({"springs.m0.stiffness": value}).values, vibrations(there, LAWS))


def scaled(law: Spec, mu: float, speed: float) -> Spec:
    factor = mu / coefficient(law, speed)
    return {k: factor * v if k.endswith("coefficient") else v for k, v in law.items()}


def test_one_coefficient_of_all_beside_a_contact_without_friction() -> None:
    """Slopes are those of the laws scaled to it; over μ, at one μ, at onsets, and in derivatives."""
    still: Spec = {"law": "coulomb", "coefficient": 0.0}
    case, speed = masses(m=still), float(np.hypot(0.4, 0.1))

    def known(mu: float, case: st.Case = case) -> np.ndarray:
        return vibrations(case, {"m": still, **{n: scaled(LAWS[n], mu, speed) for n in "qr"}})

    model = st.reduced_model(case, {"mu": (0.02, 0.5)})
    for mu in (0.05, 0.3):
        assert_same(st.modes(case, mu).eigenvalues[0], known(mu))
        assert_same(model.modes({"mu": mu}).values, known(mu))
    found = st.onsets(case, (0.0, 0.5)).onsets
    assert found
    for onset in found:
        before, after = (int(np.sum(known(onset.mu + d).real > 0.0)) for d in (-1e-5, 1e-5))
        assert after - before == (-1 if onset.stabilising else 1)
    rates = st.sensitivities(case, ["mu", "contacts.q.compliance"], mu=0.3, modes="all")
    h, own = 1e-5, known(0.3)
    softer, stiffer = (case.with_({"contacts.q.stiffness": 1 / (0.1 + d)}) for d in (h, -h))
    for k, (high, low) in enumerate([(known(0.3 + h), known(0.3 - h)), (known(0.3, softer), known(0.3, stiffer))]):
        for value, rate in zip(rates.eigenvalues, rates.derivative[k], strict=True):
            near = own[np.argmin(np.abs(own - value))]
            change = high[np.argmin(np.abs(high - near))] - low[np.argmin(np.abs(low - near))]
            assert rate == pytest.approx(change / (2 * h), rel=1e-4, abs=1e-6)


@pytest.mark.slow
def test_onsets_along_the_law_of_the_contact_with_less_friction() -> None:
    case, path = masses(), "contacts.q.friction.static_coefficient"
    found = st.onsets(case, (0.2, 0.9), along=path)

    def growing(value: float) -> int:
        return int(np.sum(vibrations(case, {**LAWS, "q": {**WEAKENING, "static_coefficient": value}}).real > 0.0))

    assert len(found)
    for onset in found:
        step = -1 if onset.stabilising else 1
        assert growing(onset.value + 1e-5) - growing(onset.value - 1e-5) == step
    assert growing(0.9) - growing(0.2) == sum(-1 if onset.stabilising else 1 for onset in found)
