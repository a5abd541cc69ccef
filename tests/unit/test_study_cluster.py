"""A study on a Dask cluster of this computer: a scheduler and two workers in processes of their own."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

import stridor as st
from stridor.case import template_text

pytest.importorskip("distributed", reason="the extra cluster is not installed")
FEW = ["bodies.beam1.elements=3", "bodies.beam2.elements=6", "modal.max_frequency_hz=3e3"]
MASS = "bodies.beam1.damping.mass"


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """Address and workers, one of which the last test kills."""
    tmp_path = tmp_path_factory.mktemp("cluster")
    file = tmp_path / "scheduler.json"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": tmp_path, "start_new_session": True}
    dask = Path(sys.executable).with_name("dask")
    running = [subprocess.Popen([dask, "scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", file], **quiet)]  # type: ignore[call-overload]
    workers = [
        subprocess.Popen([dask, "worker", "--scheduler-file", file, "--nthreads", "1", "--no-dashboard"], **quiet)  # type: ignore[call-overload]
        for _ in range(2)
    ]
    from distributed import Client

    try:
        until = time.monotonic() + 60
        while not file.exists() and time.monotonic() < until:
            time.sleep(0.1)
        with Client(scheduler_file=str(file), set_as_default=False) as client:
            client.wait_for_workers(2, timeout=60)
            address = client.scheduler.address
        yield address, workers
    finally:
        for process in (*workers, *running):
            with suppress(ProcessLookupError):  # killed by a test
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def test_workers_with_another_stridor_are_refused(scheduler, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from stridor.studies import cluster, task

    monkeypatch.setattr(cluster, "program", lambda: "9.9.9 of-the-future")
    case = st.loads(template_text("two-beams"), FEW)
    study = st.Study(case=case, parameters={"mu": {"values": (0.1,)}}, answers={"source": "full"})
    with pytest.raises(st.AnalysisError, match=rf"has another stridor \({task.program()}\) than this study \(9\.9\.9 of-the-future\)"):
        st.run_study(study, tmp_path / "refused", scheduler=scheduler[0])


def test_rows_are_those_of_local_workers_and_a_lost_worker_loses_none(scheduler, tmp_path: Path) -> None:
    address, workers = scheduler
    case = st.loads(template_text("two-beams"), FEW)
    parameters = {"mu": {"range": (0.0, 0.6), "points": 30}, MASS: {"values": (1.0, 5.0, 20.0)}}
    study = st.Study(case=case, parameters=parameters, answers={"source": "full"})
    killer = threading.Timer(3.0, lambda: os.killpg(workers[0].pid, signal.SIGKILL))
    killer.start()
    found = st.run_study(study, tmp_path / "cluster", scheduler=address)
    killer.join()
    here = st.run_study(study, tmp_path / "local", workers=2)
    assert found.done.all()
    for name in ("growth_rate", "frequency_hz", "unstable_modes"):
        assert np.array_equal(found.data[name].values, here.data[name].values, equal_nan=True)


def test_a_scheduler_that_takes_the_connection_and_says_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One that was stopped does so; the library waits for its answer without end."""
    from stridor.studies import cluster

    monkeypatch.setattr(cluster, "PATIENCE", 1.0)
    study = st.Study(case=st.loads(template_text("two-beams"), FEW), parameters={"mu": {"values": (0.1,)}}, answers={"source": "full"})
    with socket.create_server(("127.0.0.1", 0)) as silent:
        address = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        with pytest.raises(st.AnalysisError, match=rf"{address} does not answer within 1 s \(it takes the connection and says nothing\)"):
            st.run_study(study, tmp_path, scheduler=address)


def test_that_all_workers_are_gone_is_said(scheduler, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """And a study that waits for others can be left at once. The last test: it kills all workers."""
    from stridor.studies import cluster

    class Left(Exception): ...

    def say(line: str) -> None:
        if "workers of" in line or "worker of" in line:
            for process in scheduler[1]:
                if process.poll() is None:
                    os.killpg(process.pid, signal.SIGKILL)
        if line.startswith("warning: "):
            assert line.startswith(f"warning: the scheduler {scheduler[0]} has no workers any more; rows wait until some come")
            raise Left

    monkeypatch.setattr(cluster, "PATIENCE", 3.0)
    study = st.Study(case=st.loads(template_text("two-beams"), FEW), parameters={"mu": {"range": (0.0, 0.6), "points": 30}}, answers={"source": "full"})
    with pytest.raises(Left):
        st.run_study(study, tmp_path, scheduler=scheduler[0], say=say)
