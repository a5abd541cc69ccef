"""What a row of a study costs, alone and beside others: two-beam bench, scatter of friction, damping and density.

python benchmarks/studies.py [--short] [--cluster] [--pad]
(--short: few rows; --cluster: also over TCP, needs distributed; --pad: also the pad on the disc, a minute)

Overhead: what a study takes beyond the rows themselves, of the workers' time; rows are timed where they are computed.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import stridor as st
from _common import machine
from stridor.case import template_text
from stridor.studies.rows import variables
from stridor.studies.schema import Study
from stridor.studies.store import Head, OpenStore
from stridor.studies.task import SampleBatch

SCATTER = {
    "mu": {"range": (0.0, 0.5)},
    "bodies.beam1.damping.mass": {"distribution": "normal", "mean": 5.0, "deviation": 1.0, "low": 0.1},
    "materials.steel.density": {"range": (7700.0, 7900.0)},
}


def scatter(samples: int, source: str) -> Study:
    case = st.loads(template_text("two-beams"))
    answers = {"source": source, "confirm": 0.0}
    return Study(case=case, parameters=SCATTER, sampling={"method": "sobol", "samples": samples}, answers=answers)


def timed(study: Study, workers: int | None, scheduler: str | None = None) -> tuple[float, np.ndarray, int]:
    """Seconds in all from the first answer on, those of each row, bytes on the disk."""
    marks: list[float] = []
    with tempfile.TemporaryDirectory() as folder:
        found = st.run_study(
            study, folder, workers=workers, scheduler=scheduler, progress=lambda *_: marks.append(time.perf_counter())
        )
        size = sum(path.stat().st_size for path in found.path.rglob("*") if path.is_file())
        return time.perf_counter() - marks[0], np.asarray(found.data["seconds"].values), size


def line(name: str, workers: int, took: tuple[float, np.ndarray, int]) -> float:
    seconds, rows, size = took
    busy = float(rows.sum())
    print(
        f"  {name:<34} {len(rows):>6} rows  {len(rows) / seconds:8.1f} rows/s  {1e3 * np.median(rows):8.2f} ms a row  "
        f"efficiency {busy / (workers * seconds):5.2f}  {size / len(rows):6.0f} bytes a row"
    )
    return len(rows) / seconds


def scheduling(address: str) -> None:
    """What a task without work costs, one row and a hundred in it."""
    from distributed import Client

    with Client(address, set_as_default=False) as client:
        for rows in (1, 100):
            batch = SampleBatch(tuple(range(rows)), ((0.0,),) * rows, (False,) * rows)
            started = time.perf_counter()
            client.gather([client.submit(len, batch.places, pure=False) for _ in range(1000)])
            each = (time.perf_counter() - started) / 1000
            print(f"  a task of {rows:>3} rows without work: {1e3 * each:.2f} ms, {1e6 * each / rows:.0f} µs a row")


def writing(rows: int) -> None:
    """What the one process that writes the store takes for rows of modes."""
    study = scatter(rows, "reduced")
    columns = variables("modes")
    row = {v.name: np.zeros(40) if v.inner else "" if v.dtype == "str" else 1 for v in columns}
    with tempfile.TemporaryDirectory() as folder:
        head = Head(study.document(), "", {})
        values = np.random.default_rng(1).random((rows, 3))
        store = OpenStore.made(Path(folder) / "x.zarr", head, values, dict.fromkeys(SCATTER, ""), columns, {"mode": 40})
        started = time.perf_counter()
        for first in range(0, rows, 1000):
            store.write({k: row for k in range(first, min(first + 1000, rows))})
        each = (time.perf_counter() - started) / rows
    print(f"  writing a row of 40 modes: {1e6 * each:.0f} µs, {1 / each:.0f} rows/s at most")


def cluster(study: Study) -> None:
    dask = Path(sys.executable).with_name("dask")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scheduler.json"
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        begin = [dask, "scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", file]
        work = [dask, "worker", "--scheduler-file", file, "--nthreads", "1", "--no-dashboard", "--no-nanny"]
        running = [subprocess.Popen(begin, **quiet), *(subprocess.Popen(work, **quiet) for _ in range(2))]
        try:
            from distributed import Client

            while not file.exists():
                time.sleep(0.1)
            with Client(scheduler_file=str(file), set_as_default=False) as client:
                client.wait_for_workers(2, timeout=60)
                address = client.scheduler.address
            scheduling(address)
            line("reduced, 2 workers over TCP", 2, timed(study, None, address))
        finally:
            for process in running:
                process.kill()
                process.wait()


def pad() -> None:
    """Rows of the pad on the disc on its coarsest mesh, over friction, damping and Young's modulus of the lining."""
    meshes = {"disc": [4, 44, 1], "lining": [4, 9, 2], "plate": [4, 9, 1]}
    case = st.loads(template_text("pad-on-disc"))
    case = case.with_({f"bodies.{name}.mesh.divisions": value for name, value in meshes.items()})
    parameters = {
        "mu": {"range": (0.0, 0.3)},
        "bodies.disc.damping.stiffness": {"range": (1e-8, 2e-7)},
        "materials.lining.young_modulus": {"distribution": "normal", "mean": 1e9, "deviation": 5e7},
    }
    study = Study(case=case, parameters=parameters, sampling={"method": "sobol", "samples": 128})
    line("pad, reduced, 1 worker", 1, timed(study, 1))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--short", action="store_true")
    parser.add_argument("--cluster", action="store_true")
    parser.add_argument("--pad", action="store_true")
    args = parser.parse_args()
    few, many = (16, 200) if args.short else (300, 10_000)
    print(f"studies of the two-beam bench ({machine()})")
    full = scatter(few, "full")
    one = line("full, 1 worker", 1, timed(full, 1))
    print(f"  ratio of 2 workers to 1: {line('full, 2 workers', 2, timed(full, 2)) / one:.2f}")
    writing(many)
    reduced = scatter(many, "reduced")
    first = line("reduced, 1 worker", 1, timed(reduced, 1))
    print(f"  ratio of reduced to full, 1 worker: {first / one:.0f}")
    print(f"  ratio of 2 workers to 1: {line('reduced, 2 workers', 2, timed(reduced, 2)) / first:.2f}")
    if args.pad:
        pad()
    if args.cluster:
        cluster(reduced)


if __name__ == "__main__":
    main()
