"""A path or a key that leads nowhere is told with the one that was probably meant, or where it belongs."""

from __future__ import annotations

from typing import Any

import pytest

import stridor as st
from stridor.case import template_text
from stridor.case.overrides import number_at
from stridor.errors import kind_of

pytestmark = pytest.mark.bad_input

BENCH = st.loads(template_text("two-beams"))
SOLID = {"material": "m", "model": "3d", "type": "solid"}
BLOCK = {"shape": "block", "corner": [0, 0, 0], "size": [1, 1, 1]}
STEEL = {"m": {"young_modulus": 2e11, "density": 7800.0, "poisson_ratio": 0.3}}


def solid(**given: Any) -> st.Case:
    return st.Case(materials=STEEL, bodies={"a": {**SOLID, **given}})


def told(call: Any) -> str:
    with pytest.raises(st.CaseError) as error:
        call()
    return str(error.value)


SAID = {
    "contacts.A.stifness": "contacts.A.stifness: no such number; did you mean 'stiffness'? contacts.A has: slave, master, ",
    "contact.A.stiffness": "contact: no such number; did you mean 'contacts'? the case has: title, ",
    "bodies.beam1.damping.mas": "bodies.beam1.damping.mas: no such number; did you mean 'mass'? bodies.beam1.damping has: mass, stiffness",
    "phases.slid.duration": "phases.slid: no such item; did you mean 'slide'? the list has: 0 (press), 1 (slide)",
    "materials.steel.density.x": "materials.steel.density.x: no such number; materials.steel.density has: none",
    "bodies.beam1.elements": "bodies.beam1.elements: 30 – the path of a number of the case that may have decimals, such as ",
    "bodies.beam1.damping": "bodies.beam1.damping: the path of a number of the case that may have decimals, such as ",
}


@pytest.mark.parametrize("path", SAID)
def test_paths_that_lead_to_no_number(path: str):
    assert told(lambda: number_at(BENCH.model_dump(mode="json", exclude_none=True), path)).startswith(SAID[path])
    assert told(lambda: st.sensitivities(BENCH, [path])).startswith(SAID[path])


def test_words_that_are_no_number():
    assert told(lambda: st.sensitivities(BENCH, ["mue"])) == (
        "mue: no such number; did you mean 'mu'? a number is: mu, the path of one such as materials.steel.density"
    )
    assert told(lambda: st.reduced_model(BENCH, {"muu": (0.0, 1.0)})) == (
        "box.muu: no such number; did you mean 'mu'? a range is that of: mu, contact_stiffness, the path of a number "
        "such as materials.steel.density"
    )


def test_overrides_of_items_of_a_list():
    assert told(lambda: BENCH.with_({"phases.slid.duration": 1.0})) == SAID["phases.slid.duration"]


def test_keys_written_a_table_too_deep():
    belongs = "belongs one table further out: bodies.a.file, instead of mesh"
    assert told(lambda: solid(mesh={"file": "a.msh"})).endswith(f"a.msh' – {belongs}")
    assert told(lambda: solid(mesh={**BLOCK, "file": "a.msh"})).startswith("bodies.a.mesh.file: ")
    assert told(lambda: solid(mesh={**BLOCK, "file": "a.msh"})).endswith(belongs)
    assert told(lambda: solid(mesh={**BLOCK, "scale": 2})) == (
        "bodies.a.mesh.scale: 2 – belongs one table further out: bodies.a.scale"
    )
    assert told(lambda: solid(mesh={})).startswith("bodies.a.mesh.shape: missing – give ")
    assert "unknown key" in told(lambda: solid(mesh={**BLOCK, "fil": "a.msh"}))


@pytest.mark.parametrize("given", [1, {"bodies": {}}, "two-beams.toml"])
def test_a_case_of_what_has_no_name(given: Any):
    assert told(lambda: st.Case(given)) == (
        f"case: '{kind_of(given)}' – tables are given by name, Case(bodies={{…}}, contacts={{…}}); stridor.load "
        "takes the path of a file"
    )
