"""The samples of a study, as the map of a page shows them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ...errors import AnalysisError, CaseError
from ...studies.result import StudyResult, open_study
from .state import Source

MOST = 20_000  # samples that are drawn


def is_study(path: Path) -> bool:
    """Whether a path is a store of a study, or the folder of one, and no case file."""
    return path.is_dir()


def study_at(path: Path) -> tuple[Source, dict[str, Any]]:
    """The case of a study, and its samples as plain data: values by parameter, whether something grows, and in words
    what. Raises CaseError for what is no store or has no samples, AnalysisError for studies of something else."""
    result = open_study(path)
    unstable = result.unstable
    if not len(unstable):
        raise CaseError("file", str(path), "a study with at least one sample that has a result")
    if len(unstable) > MOST:
        most = f"more than a page draws ({MOST}); `stridor plot` draws them all"
        raise AnalysisError(f"{len(unstable)} samples are {most}")
    name = path.resolve().parent.name if path.name.endswith(".zarr") else path.resolve().name
    case = result.study.base()
    numbers = {p: np.asarray(result.data[p].values, dtype=float)[result.done].tolist() for p in result.parameters}
    rows = {
        "name": name, "numbers": numbers, "grows": unstable.tolist(), "words": _words(result), "left": _left(result)
    }  # fmt: skip
    return Source(name, case.to_toml(), str(Path.cwd())), rows


def _words(result: StudyResult) -> list[str]:
    if result.compute == "modes":
        growth, frequency = (
            result.data[f"largest_growth_{what}"].values[result.done] for what in ("rate", "frequency_hz")
        )
        return [f"{f:.6g} Hz, {g:+.4g} 1/s" for g, f in zip(growth, frequency, strict=True)]
    critical = result.data["critical_mu"].values[result.done]
    return [f"grows from μ = {mu:.5g} on" if np.isfinite(mu) else "no onset" for mu in critical]


def _left(result: StudyResult) -> str:
    """What of the study is not shown."""
    said = [f"{result.pending} samples are not computed yet"] * (result.pending > 0)
    said += [f"{len(result.failed)} have no result"] * (len(result.failed) > 0)
    return "; ".join(said)
