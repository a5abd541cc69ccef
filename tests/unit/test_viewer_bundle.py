"""The viewer that is shipped built: it is what its sources make, whole, and where it has to be."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import subprocess
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from test_view_solids import boxes, made

from stridor.system import System
from stridor.view.animation import VIEWER_FROM, animation_html
from stridor.view.mode_page import animation_shell, viewer_script

ROOT = Path(__file__).parents[2]
SOURCES = ("build.mjs", "package-lock.json", "package.json", "src/viewer.js")  # as build.mjs has them
HEAD = re.compile(r"/\*! .*?\nsources sha256-(\w+)\nwhat follows sha256-(\w+)\n(.*?)\*/\n", re.DOTALL)
REBUILD = "viewer.js is not what viewer/ makes: `make viewer`"


def parts() -> tuple[str, str, str, str]:
    """Digests of the sources and of the code as its first lines tell them, the licence there, the code."""
    text = viewer_script()
    head = HEAD.match(text)
    assert head
    return head[1], head[2], head[3], text[head.end() :]


def test_it_was_built_from_the_sources_beside_it():
    told = (ROOT / "viewer" / "build.mjs").read_text(encoding="utf-8")
    listed = re.search(r"const SOURCES = (\[.*?\]);", told)
    assert listed
    assert tuple(json.loads(listed[1])) == SOURCES
    sources, own, _, code = parts()
    digest = hashlib.sha256(b"".join((ROOT / "viewer" / name).read_bytes() for name in SOURCES))
    assert digest.hexdigest() == sources, REBUILD
    assert hashlib.sha256(code.encode()).hexdigest() == own, "changed by hand: " + REBUILD


def test_it_is_small_asks_nobody_and_has_its_licence():
    _, _, licence, code = parts()
    assert len(code) < 400_000  # bytes of ASCII
    assert code.isascii()
    assert "</script" not in code.lower()
    assert set(re.findall(r"https?://[\w./-]+", code)) == {"http://www.w3.org/1999/xhtml"}  # a name, not an address
    assert not re.search(r"\bfetch\(|XMLHttpRequest|\beval\(|new Function\(|importScripts", code)
    beside = (resources.files("stridor.view") / "templates" / "three-LICENSE.txt").read_text(encoding="utf-8")
    assert "The above copyright notice and this permission notice shall be included" in beside
    assert beside.replace("©", "(c)").strip() in licence
    lock = json.loads((ROOT / "viewer" / "package-lock.json").read_text(encoding="utf-8"))["packages"]
    assert not any("resolved" in package for package in lock.values())  # addresses are those of whoever builds
    assert f"three.js {lock['node_modules/three']['version']}" in viewer_script()
    assert lock["node_modules/three"]["license"] == "MIT"


def test_pages_have_it_from_a_number_of_triangles_on():
    def page(n: int) -> tuple[int, str]:
        system: System = made([boxes((n, n, 1), (1.0, 1.0, 0.1))], 3)
        return 2 * (2 * n * n + 4 * n), animation_html(system, np.ones(system.size), frequency_hz=10.0)

    below, small = page(48)
    above, large = page(50)
    assert below < VIEWER_FROM <= above
    assert "stridorViewer = " not in small
    assert large.count(viewer_script()) == 1
    assert "The MIT License" in large
    assert viewer_script() not in animation_shell()  # which asks for it


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("npm") is None, reason="needs npm")
def test_its_sources_make_it_again(tmp_path: Path):
    folder = tmp_path / "viewer"
    shutil.copytree(ROOT / "viewer", folder, ignore=shutil.ignore_patterns("node_modules"))
    (tmp_path / "src" / "stridor" / "view" / "templates").mkdir(parents=True)
    fetched = subprocess.run(["npm", "ci", "--no-audit", "--no-fund"], cwd=folder, capture_output=True, text=True, check=False)
    if fetched.returncode:
        pytest.skip(f"npm cannot fetch three and esbuild: {fetched.stderr.strip()[-200:]}")
    subprocess.run(["npm", "run", "build"], cwd=folder, check=True, capture_output=True)
    assert (tmp_path / "src/stridor/view/templates/viewer.js").read_text(encoding="utf-8") == viewer_script()
