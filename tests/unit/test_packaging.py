"""What an installation promises is there: extras, the environment of conda, addresses."""

from __future__ import annotations

import re
import runpy
import tomllib
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from stridor.direct.backends import PACKAGES

ROOT = Path(__file__).parents[2]
PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
MODULES = {"python-mumps": "mumps", "numba-cuda": "numba_cuda"}


def bare(requirement: str) -> str:
    return requirement.partition(";")[0].replace(" ", "")


def test_extras_are_what_the_program_knows_how_to_use():
    named = {re.split(r"[><=\[]", bare(r))[0] for extra in PROJECT["optional-dependencies"].values() for r in extra}
    assert all(PROJECT["optional-dependencies"].values()), "an extra with nothing behind it"
    known = {module for modules, _ in PACKAGES.values() for module in modules}
    known |= {"slepc4py", "distributed", "nicegui", "numba_cuda"}
    named -= {re.split(r"[><=\[]", bare(r))[0] for r in PROJECT["dependencies"]}  # of these an extra may want a version
    assert {MODULES.get(name, name) for name in named} <= known


def test_conda_brings_what_pip_would():
    text = (ROOT / "environment.yml").read_text(encoding="utf-8").replace("matplotlib-base", "matplotlib")
    conda = set(re.findall(r"^  - (\S+)$", text, re.M))
    needed = {bare(r).lower() for r in (*PROJECT["dependencies"], *PROJECT["optional-dependencies"]["mumps"])}
    assert needed <= conda


def test_the_readme_of_a_package_index_leads_nowhere_that_it_has_not():
    hook = runpy.run_path(str(ROOT / "hatch_build.py"))
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    shown = hook["for_an_index"](readme)
    assert "](docs/" in readme
    assert "](docs/" not in shown
    assert "a brake pad on a disc;\neach finds" in shown
    assert "![" not in shown
    kept = "[words](https://example.org) ![picture](https://example.org/a.png)"
    assert hook["for_an_index"](kept) == kept


@pytest.mark.skipif(find_spec("pypardiso") is None, reason="pypardiso (stridor[fast]) is not installed")
def test_pardiso_is_taken_where_it_is_installed():
    from stridor import direct

    assert "pardiso" in direct.available()
