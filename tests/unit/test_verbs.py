"""Every verb takes a case, the path of its file, a workspace, and most a system; what is none of these is refused."""

from __future__ import annotations

import re
import subprocess
import sys
import xml.etree.ElementTree as tree
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stridor as st
from stridor.case import template_text
from stridor.errors import kind_of
from stridor.notebook import MOST_LETTERS
from stridor.periodic import returns
from undrawn import nothing_drawn

COARSE = {
    "bodies.beam1.elements": 3, "bodies.beam2.elements": 6, "modal.max_frequency_hz": 12e3,
    "phases": [{"name": "go", "duration": 3e-4}], "temporal.record_every": 1, "temporal.step": None,
    "comparison": {"mu": [0.3], "critical": False},
}  # fmt: skip
MASS = ("bodies.beam1.damping.mass", "bodies.beam2.damping.mass")
ANY = "a case, the path of its file, a system or a workspace"

VERBS: dict[str, Callable[[Any, Path], object]] = {
    "body_modes": lambda p, _: st.body_modes(p),
    "compare": lambda p, _: st.compare(p, only=["growth"]),
    "cycles": lambda p, _: st.cycles(p, 0.01, push=1e-4),
    "damping_map": lambda p, _: st.damping_map(
        p, *MASS, x_range=(1, 20), y_range=(1, 20), grid=(2, 2), mu_range=(0, 0.2)
    ),
    "describe": lambda p, _: st.describe(p),
    "ensemble": lambda p, _: st.ensemble(p, mu=[0.1, 0.3]),
    "export": lambda p, out: st.export(p, out),
    "friction_curve": lambda p, _: st.friction_curve(p, [5000.0, 6000.0]),
    "modes": lambda p, _: st.modes(p, 0.1),
    "onsets": lambda p, _: st.onsets(p, (0.0, 0.2)),
    "pencil": lambda p, _: st.pencil(p, 0.1),
    "perturbed_copies": lambda p, _: st.perturbed_copies(p, st.simulate(p), count=1),
    "rank_countermeasures": lambda p, _: st.rank_countermeasures(p, mu=0.3, verify=0, added_mass=False, chamfers=0),
    "reduced_model": lambda p, _: st.reduced_model(p, {"mu": (0.0, 0.2)}, bound=1e-4),
    "report": lambda p, out: st.report(p, out, mu=0.1, skip=["modes", "sensitivities", "countermeasures"]),
    "run": lambda p, out: st.run(p, out, only=["onsets"]),
    "sensitivities": lambda p, _: st.sensitivities(p, mu=0.1, modes="all"),
    "simulate": lambda p, _: st.simulate(p),
    "stability_boundary": lambda p, _: st.stability_boundary(
        p, MASS[0], "mu", x_range=(1, 20), y_range=(0, 0.02), lines=2, max_frequency_hz=4e3
    ),
    "steady_sliding": lambda p, _: st.steady_sliding(p),
    "summarise": lambda p, _: st.summarise(p, st.simulate(p)),
    "Workspace": lambda p, _: p if isinstance(p, st.Workspace) else st.Workspace(p),
}  # fmt: skip
OF_A_CASE = {  # of what is in a case file beside the matrices
    "damping_map", "describe", "rank_countermeasures", "reduced_model", "report", "run", "sensitivities",
    "stability_boundary",
}  # fmt: skip
OTHERS = {  # what takes no problem
    "AnalysisError", "Case", "CaseError", "StridorError", "Study", "System", "app", "build_system", "load", "loads", "open",
    "open_study", "plot", "run_study", "save", "sound", "study_figures", "to_dataset",
}  # fmt: skip


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("verbs") / "bench.toml"
    path.write_text(st.loads(template_text("two-beams")).with_(COARSE).text, encoding="utf-8")
    return path


def test_each_verb_is_looked_at() -> None:
    assert set(VERBS) | OTHERS == set(st.__all__)


def test_modules_by_which_the_documentation_calls_are_there_at_once() -> None:
    """`st.case` was there only once something else had imported it."""
    root = Path(__file__).parents[2]
    pages = [root / "README.md", *(root / "docs").glob("*.md"), *(root / "docs").glob("*.py"), *(root / "examples").glob("*.py")]
    called = {name for page in pages for name in re.findall(r"\bst\.(\w+)\.\w+\(", page.read_text(encoding="utf-8"))}
    assert {"case", "plot"} <= called
    for name in sorted(called):
        said = subprocess.run([sys.executable, "-c", f"import stridor as st; st.{name}"],
                              capture_output=True, text=True, check=False)  # fmt: skip
        assert said.returncode == 0, said.stderr


@pytest.mark.parametrize("verb", sorted(VERBS))
def test_kinds_of_problem(verb: str, file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(returns, "QUIET", 0.05 * returns.QUIET)  # how long a motion is followed is no matter here
    call, case = VERBS[verb], st.load(file)
    work, kinds = st.Workspace(case), set[type]()
    with nothing_drawn():
        result = call(file, tmp_path / "first")
    for part in result.values() if isinstance(result, dict) else [] if isinstance(result, np.ndarray) else [result]:
        short(part)
    settings = {"modal": case.modal, "temporal": case.temporal, "phases": case.phases, "comparison": case.comparison}
    tables = {name: [t.model_dump() for t in v] if name == "phases" else v.model_dump() for name, v in settings.items()}
    kinds.add(type(result))
    with nothing_drawn():
        for number, problem in enumerate((str(file), case, work)):
            kinds.add(type(call(problem, tmp_path / str(number))))
    if verb in OF_A_CASE:
        with pytest.raises(st.CaseError, match="takes a Case, the path of its file or a Workspace of one, not a System"):
            call(work.system(), tmp_path / "system")
    else:
        kinds.add(type(call(st.Workspace(work.system(), **tables), tmp_path / "system")))
    assert len(kinds) == 1


def short(thing: Any) -> None:
    """What is printed is one line without arrays, what a notebook shows a small table."""
    line = repr(thing)
    assert "\n" not in line
    assert "array(" not in line
    assert len(line) <= MOST_LETTERS
    assert line.startswith(f"<{type(thing).__name__}: ")
    page = thing._repr_html_()
    assert 20 < len(page) < 4000
    tree.fromstring(page)


def test_parts_of_results_are_short_as_well(file: Path) -> None:
    case = st.load(file)
    sweep = st.modes(case, [0.1, 0.3], vectors=True)
    model = st.reduced_model(case, {"mu": (0.0, 0.2)}, bound=1e-4)
    parts = (
        case, st.build_system(case), sweep, sweep[-1], st.onsets(case)[0], model.modes({"mu": 0.1}),
        st.rank_countermeasures(case, mu=0.3, verify=1, added_mass=False, chamfers=0).measures[0],
        st.compare(case, [0.3], only=["growth"]).comparisons[0],
    )  # fmt: skip
    for part in parts:
        short(part)
    assert str(case) == repr(case)
    short(case.with_({"title": "a\nlong " + 1000 * "t"}))


@pytest.mark.parametrize("wrong", [None, 3, {"bodies": {}}, ["a"]], ids=repr)
@pytest.mark.parametrize("verb", sorted(VERBS))
def test_anything_else_is_refused(verb: str, wrong: object, tmp_path: Path) -> None:
    if verb in ("perturbed_copies", "summarise"):  # what is wrong shows before the run is looked at
        call: Callable[[Any, Path], object] = lambda p, _: getattr(st, verb)(p, run_that_is_none())  # noqa: E731
    else:
        call = VERBS[verb]
    with pytest.raises(st.CaseError) as told:
        call(wrong, tmp_path)
    assert str(told.value) == f"problem: '{kind_of(wrong)}' – {ANY}"
    assert not list(tmp_path.iterdir())


def run_that_is_none() -> Any:
    return st.simulate(st.loads(template_text("two-beams")).with_(COARSE))


def test_a_path_without_a_file_is_told_as_such(tmp_path: Path) -> None:
    for verb in ("modes", "damping_map", "run", "build_system"):
        call = VERBS.get(verb, lambda p, _: st.build_system(p))
        with pytest.raises(st.CaseError, match="no such file"):
            call(tmp_path / "missing.toml", tmp_path)
    with pytest.raises(st.CaseError, match="path: 'a NoneType' – the path of a case file"):
        st.load(None)  # pyright: ignore[reportArgumentType]


def test_files_go_beside_the_case_that_is_named_by_its_path(file: Path) -> None:
    assert st.run(file, only=["onsets"]).files[0].parent == file.with_suffix(".out")
    with pytest.raises(st.CaseError, match="folder"):
        st.run(st.load(file), only=["onsets"])
    with pytest.raises(st.CaseError, match=r"the system of a workspace is work\.system"):
        st.build_system(st.Workspace(file))  # pyright: ignore[reportArgumentType]
    assert st.build_system(str(file)).size == st.build_system(st.load(file)).size
