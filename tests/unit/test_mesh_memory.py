"""Meshes of bodies that are asked for again and again: of a case's checks, its matrices and its warnings."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import pytest

import stridor as st
from stridor.case import template_text
from stridor.system import meshes


def test_a_mesh_is_made_once_until_its_body_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[str] = []
    loaded = meshes._loaded
    monkeypatch.setattr(meshes, "_loaded", lambda name, body: made.append(name) or loaded(name, body))
    meshes._KNOWN.clear()
    case = st.loads(template_text("pad-on-disc"), ["bodies.disc.mesh.divisions=[1,12,1]"])
    again = case.with_(title="another")
    first = meshes.load_mesh("disc", case.bodies["disc"])
    assert meshes.load_mesh("disc", again.bodies["disc"]) is first
    assert made == ["disc"]
    other = case.with_({"bodies.disc.mesh.divisions": [1, 16, 1]})
    assert len(meshes.load_mesh("disc", other.bodies["disc"]).mesh.points) > len(first.mesh.points)
    for k in range(8):
        meshes.load_mesh(f"disc{k}", case.bodies["disc"])
    assert len(meshes._KNOWN) <= meshes._KEPT


def test_a_file_that_changes_is_read_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def written(height: float) -> None:
        points = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, height], [0.0, height]])
        meshio.Mesh(points, [("quad", np.array([[0, 1, 2, 3]]))]).write(tmp_path / "block.vtk")

    case = st.loads(template_text("pad-on-disc"))
    body = case.bodies["lining"].model_copy(
        update={"mesh": None, "file": "block.vtk", "model": "plane strain", "thickness": 0.1}
    )
    monkeypatch.chdir(tmp_path)
    written(1.0)
    assert np.ptp(meshes.load_mesh("lining", body).mesh.points[:, 1]) == 1.0
    written(20.5)
    assert np.ptp(meshes.load_mesh("lining", body).mesh.points[:, 1]) == 20.5
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    with pytest.raises(st.CaseError, match=r"no such file"):
        meshes.load_mesh("lining", body)
