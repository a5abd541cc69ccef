"""What a row of a study costs, alone and beside others: two-beam bench, scatter of friction, damping and density.

python benchmarks/studies.py [--short] [--cluster] [--pad] [--start] [--large two|three [--coarse]]
--short: few rows; --cluster: also over TCP, needs distributed; --pad: also the pad on the disc, a minute; --start: what
a worker takes to start; --large: in place of all that the full mesh of the pad over two or three numbers, half an hour,
with --coarse the coarsest mesh, a minute.

Efficiency: the share of the workers' time that is spent in rows; these are timed where they are computed.
"""

from __future__ import annotations

import argparse
import resource
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


Timed = tuple[float, np.ndarray, int]  # seconds in all, those of each row, bytes on the disk


def scatter(samples: int, source: str) -> Study:
    case = st.loads(template_text("two-beams"))
    answers = {"source": source, "confirm": 0.0}
    return Study(case=case, parameters=SCATTER, sampling={"method": "sobol", "samples": samples}, answers=answers)


def timed(study: Study, workers: int | None, scheduler: str | None = None) -> Timed:
    """Seconds in all from the first answer on, those of each row, bytes on the disk."""
    marks: list[float] = []
    with tempfile.TemporaryDirectory() as folder:
        found = st.run_study(
            study, folder, workers=workers, scheduler=scheduler, progress=lambda *_: marks.append(time.perf_counter())
        )
        size = sum(path.stat().st_size for path in found.path.rglob("*") if path.is_file())
        return time.perf_counter() - marks[0], np.asarray(found.data["seconds"].values), size


def line(name: str, workers: int, took: Timed) -> float:
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


def writing(rows: int) -> float:
    """What the one process that writes the store takes for rows of modes, seconds a row."""
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
    return each


def cluster(study: Study, full: Study) -> None:
    """A scheduler and one and two workers, each a process of its own, that talk over TCP."""
    for workers in (1, 2):
        over_tcp(study, full, workers)


def over_tcp(study: Study, full: Study, workers: int) -> None:
    dask = Path(sys.executable).with_name("dask")
    many = f"{workers} worker{'s' * (workers > 1)} over TCP"
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scheduler.json"
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        begin = [dask, "scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", file]
        work = [dask, "worker", "--scheduler-file", file, "--nthreads", "1", "--no-dashboard", "--no-nanny"]
        running = [subprocess.Popen(begin, **quiet), *(subprocess.Popen(work, **quiet) for _ in range(workers))]
        try:
            from distributed import Client

            while not file.exists():
                time.sleep(0.1)
            with Client(scheduler_file=str(file), set_as_default=False) as client:
                client.wait_for_workers(workers, timeout=60)
                address = client.scheduler.address
            if workers > 1:
                scheduling(address)
            line(f"full, {many}", workers, timed(full, None, address))
            line(f"reduced, {many}", workers, timed(study, None, address))
        finally:
            for process in running:
                process.kill()
                process.wait()


def starting() -> None:
    """What a process takes until it could begin a row."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    started = time.perf_counter()
    subprocess.run([sys.executable, "-c", "import stridor.studies.loaded"], check=True)
    seconds, after = time.perf_counter() - started, resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    print(f"  a worker that imports everything: {seconds:.1f} s, {spent:.1f} s of the processor")


def coarse() -> st.Case:
    """The pad on the disc on its coarsest mesh."""
    meshes = {"disc": [4, 44, 1], "lining": [4, 9, 2], "plate": [4, 9, 1]}
    case = st.loads(template_text("pad-on-disc"))
    return case.with_({f"bodies.{name}.mesh.divisions": value for name, value in meshes.items()})


SOBOL = {"method": "sobol", "samples": 128}
PAD = {
    "mu": {"range": (0.0, 0.3)},
    "bodies.disc.damping.stiffness": {"range": (1e-8, 2e-7)},
    "materials.lining.young_modulus": {"distribution": "normal", "mean": 1e9, "deviation": 5e7},
}


def pad() -> None:
    """Rows of the pad on the disc on its coarsest mesh, over friction, damping and Young's modulus of the lining."""
    line("pad, reduced, 1 worker", 1, timed(Study(case=coarse(), parameters=PAD, sampling=SOBOL), 1))


def large(numbers: int, case: st.Case) -> None:
    """Models of a pad on the disc over so many of its numbers: what they take, who answers, how far off they are."""
    parameters = dict(list(PAD.items())[:numbers])
    study = Study(case=case, parameters=parameters, sampling=SOBOL | {"samples": 64}, answers={"confirm": 0.01})
    marks: list[float] = []
    started = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        found = st.run_study(study, folder, workers=1, progress=lambda *_: marks.append(time.perf_counter()), say=print)
        models = len(list(Path(folder).glob("reduced-modes/*.npz")))
    rows = found.data["seconds"].values[found.data["confirmed"].values == 0]
    off = found.data["difference"].values
    print(
        f"  {models} models, made and proved in {marks[0] - started:.0f} s; a row {1e3 * np.median(rows):.1f} ms; "
        f"{np.count_nonzero(np.isfinite(off))} solved in full as well, off by {np.nanmax(off, initial=0.0):.1e} at most"
    )


def million(full: Timed, reduced: Timed, store: float) -> None:
    """What a million rows would take on a thousand cores like these, and of the disk."""
    for name, (_, rows, size) in (("full problem", full), ("reduced model", reduced)):
        hours, each = float(np.median(rows)) / 3.6e-3, size / len(rows)
        print(f"  a million rows of the {name}: {hours:.2g} h of a core, {3.6 * hours:.2g} s on 1000, {each:.0f} MB")
    print(f"  … which one process writes in {1e6 * store:.0f} s")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ("short", "cluster", "pad", "start", "coarse"):
        parser.add_argument(f"--{name}", action="store_true")
    parser.add_argument("--large", choices=("two", "three"))
    args = parser.parse_args()
    print(f"studies of the two-beam bench ({machine()})")
    if args.large:
        large(2 if args.large == "two" else 3, coarse() if args.coarse else st.loads(template_text("pad-on-disc")))
        return
    few, many = (4, 40) if args.short else (300, 10_000)
    full = scatter(few, "full")
    alone = timed(full, 1)
    one = line("full, 1 worker", 1, alone)
    print(f"  ratio of 2 workers to 1: {line('full, 2 workers', 2, timed(full, 2)) / one:.2f}")
    store = writing(many)
    reduced = scatter(many, "reduced")
    one_reduced = timed(reduced, 1)
    first = line("reduced, 1 worker", 1, one_reduced)
    print(f"  ratio of reduced to full, 1 worker: {first / one:.0f}")
    print(f"  ratio of 2 workers to 1: {line('reduced, 2 workers', 2, timed(reduced, 2)) / first:.2f}")
    million(alone, one_reduced, store)
    if args.start:
        starting()
    if args.pad:
        pad()
    if args.cluster:
        cluster(reduced, full)


if __name__ == "__main__":
    main()
