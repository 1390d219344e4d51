"""Kills at random moments, full disks, two processes at once, clocks that jump: is anything lost?
(results/reliability.md)

    python3 examples/faults.py --program target/release/dimcmc --kill 208 --full-disk 208 --at-once 64 --clock 48
    python3 examples/faults.py --python target/python/bin/python --kill-python 96
    python3 examples/faults.py --program target/mpi/release/dimcmc --kill-rank 48
    python3 examples/faults.py --table

Every command that writes is run on a small star with two data sets, once to its end. Then it is started again in a
fresh copy of what it reads, and cut short after a random share of that time:

- `--kill`: by SIGKILL; `--kill-python` kills a Python process in which the function of the package runs, `--kill-rank`
  one of two MPI ranks, of the program `dimcmc-mpi`;
- `--full-disk`: the disk is full after a random share of what the command writes, and has room again afterwards;
- `--at-once`: a second process is started on the same folder, every other time both with `--force`;
- `--clock`: the clock jumps by ten years, or to before 1970, with results kept from run to run (`DIMCMC_CACHE`).

Then it is run once more as a user would: with `--resume` where the command has it and its folder holds a run, with
`--force` where the message asks for it as the folder holds some of the files, otherwise as before. Afterwards the
folder must hold the same bytes as that of the run that was left alone, but for times, and nothing else, no temporary
file either. The last command writes the table. Linux; needs numpy; full disks need root, ranks Open MPI, and clocks the
Debian package `faketime`.
"""

import argparse
import functools
import json
import os
import random
import shutil
import signal
import subprocess
import time
from pathlib import Path

import calibration_table

CONFIG = {
    "star": {
        "rotation_period_d": 3.0,
        "epoch_d": 10.0,
        "inclination_deg": 50.0,
        "vsini_kms": 20.0,
        "contrast": 0.1,
        "line": {"sigma_kms": 2.5, "equivalent_width_kms": 5.8},
        # nothing is fitted that takes long
        "regions": {"area": 0.0},
    },
    "observations": [
        {
            "name": name,
            "simulate": {
                **({"random_spots": {"number": 6, "lifetime_d": 15, "seed": 2}} if seed == 1 else {}),
                "schedule": {"nights": 7, "per_night": [1, 2], "seed": seed},
                "velocity_kms": {"min": -27.0, "max": 27.0, "step": 3.0},
                "snr": 500,
                "seed": seed,
            },
            # the star is that of the first set
            **({"zero_point_kms": "fitted"} if seed == 2 else {}),
        }
        for name, seed in (("a", 1), ("b", 2))
    ],
    "imaging": {"pixels": 200, "spot_amplitude": 0.3, "spot_slope": 1.0, "spot_lifetime_d": 15.0},
    "planet": {"k_kms": 0.1, "porb_over_prot": 1.7, "phi": 0.2},
    "parameters": {
        "k_kms": {"prior": "uniform", "min": 0.0, "max": 2.0},
        "porb_over_prot": {"prior": "log-uniform", "min": 0.5, "max": 4.0},
        "phi": {"prior": "periodic"},
        "vsys_kms": {"prior": "uniform", "min": -2.0, "max": 2.0},
    },
    "sampler": {"ensembles": 2, "walkers": 16, "steps": 100, "seed": 1, "ess": 1e6},
}
GRID = {"axes": {"k_kms": [0.0, 0.3, 5], "phi": [0.0, 1.0, 9]}}
# what is run, and whether it goes on by --resume
COMMANDS = {
    "simulate": ("simulate star.json --out out", False),
    "init": (
        "init data/a/observations.txt data/b/observations.txt --rotation-period 3 --inclination 50 --out out/s.json",
        False,
    ),
    "map": ("map star.json --out out", False),
    "periodogram": ("periodogram star.json --draws 1000 --out out", False),
    "limits": ("limits star.json --draws 1000 --periods 6 --amplitudes 6 --phases 4 --out out", False),
    "plan": ("plan one.json --draws 1000 --maps 2 --out out", False),
    "inject": ("inject star.json --k-kms 0.2 --porb-over-prot 2.6 --phi 0.25 --out out", False),
    "grid": ("grid grid.json --out out", True),
    "optimise": ("optimise star.json --out out", False),
    "sample": ("sample star.json --out out", True),
    "batch": ("batch list.txt --out out", False),
    "merge": ("merge runs/1 runs/2 --out out", False),
    "export": ("export runs/1 --format csv --out out/chain.csv", False),
    "report": ("report runs/1 --out out/page.html", False),
    "plot": ("plot runs/1 --out out", False),
    "survey": ("survey survey/one survey/other --out out", False),
}
# Python has functions of these
FUNCTIONS = tuple("simulate init map periodogram limits plan inject grid optimise sample report survey".split())
# and these use ranks
RANKED = ("limits", "grid", "sample", "batch")
COLUMNS = ("command", "fault", "at", "of_seconds", "second", "same", "problem")
FAKETIME = "/usr/lib/x86_64-linux-gnu/faketime/libfaketimeMT.so.1"
TIMES = ("seconds", "started", "finished", "elapsed", "wall")


def files(folder):
    """Contents of all files, without times."""
    found = {}
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            data = path.read_bytes()
            if path.suffix == ".json" and path.name != "s.json":
                data = json.dumps(without_times(json.loads(data)), sort_keys=True).encode()
            found[str(path.relative_to(folder))] = data
    return found


def without_times(value):
    if isinstance(value, dict):
        return {key: without_times(one) for key, one in value.items() if not any(word in key for word in TIMES)}
    return [without_times(one) for one in value] if isinstance(value, list) else value


def statement(words):
    """The call of the Python package that does what a command does."""
    name, *rest = words
    given, options = [], {}
    while rest:
        word = rest.pop(0)
        if not word.startswith("--"):
            given.append(word)
        elif word in ("--resume", "--force"):
            options[word[2:]] = True
        else:
            value = rest.pop(0)
            options[word[2:].replace("-", "_")] = value if word == "--out" else json.loads(value)
    given = given if len(given) > 1 else given[0]
    call = ", ".join([repr(given), *(f"{key}={value!r}" for key, value in options.items())])
    return f"import dimcmc; dimcmc.{name}({call})"


class Command:
    """A command that writes into `out`, in a folder."""

    def __init__(self, bench, name, start):
        self.name, self.bench, self.start = name, bench, start
        self.words, self.resumes = COMMANDS[name][0].split(), COMMANDS[name][1]
        folder = bench.fresh("reference")
        began = time.monotonic()
        done = self.run(self.words, folder)
        if done.returncode != 0:
            raise SystemExit(f"{self.words}: {done.stderr}")
        self.seconds, self.reference = time.monotonic() - began, files(folder / "out")

    def begin(self, words, folder, **environment):
        environment = self.bench.environment() | environment
        pipe = subprocess.PIPE
        return subprocess.Popen(
            self.start(words), cwd=folder, env=environment, stdout=subprocess.DEVNULL, stderr=pipe, text=True
        )

    def run(self, words, folder, **environment):
        process = self.begin(words, folder, **environment)
        _, stderr = process.communicate()
        return subprocess.CompletedProcess(words, process.returncode, "", stderr)

    def kill(self, rng, share):
        folder = self.bench.fresh("killed")
        process = self.begin(self.words, folder)
        time.sleep(share * self.seconds)
        process.send_signal(signal.SIGKILL)
        process.communicate()
        return self.once_more(folder, None if process.returncode == -signal.SIGKILL else "had ended")

    def kill_rank(self, rng, share):
        folder = self.bench.fresh("ranks")
        process = self.begin(self.words, folder)
        time.sleep(share * self.seconds)
        ranks = []
        while not ranks and process.poll() is None:
            ranks = [pid for pid in os.listdir("/proc") if pid.isdigit() and is_rank(pid, folder)]
        for rank in rng.sample(ranks, min(1, len(ranks))):
            # it may have ended by itself
            subprocess.run(["kill", "-KILL", rank], stderr=subprocess.DEVNULL)
        process.communicate()
        return self.once_more(folder, None if process.returncode != 0 else "had ended")

    def full_disk(self, rng, share):
        folder = self.bench.fresh("full")
        pages = int(share * sum(len(data) // 4096 + 1 for data in self.reference.values()))
        room = lambda size, more="": ["mount", "-t", "tmpfs", "-o", f"{more}size={size}", "tmpfs", folder / "out"]
        subprocess.run(room(max(pages, 1) * 4096), check=True)
        try:
            done = self.run(self.words, folder)
            if done.returncode != 0 and "No space left" not in done.stderr:
                return {"same": 0, "problem": f"exit {done.returncode}: {done.stderr.strip()[-200:]}"}
            subprocess.run(room("64m", "remount,"), check=True)
            return self.once_more(folder, None if done.returncode != 0 else "had ended")
        finally:
            subprocess.run(["umount", folder / "out"], check=True)

    def at_once(self, rng, share):
        """Two processes: one at least ends well, and what the other says is no panic."""
        folder = self.bench.fresh("two")
        # a batch goes on by itself
        forced = rng.random() < 0.5 and self.name != "batch"
        words = [*self.words, "--force"] if forced else self.words
        first = self.begin(words, folder)
        time.sleep(share * self.seconds)
        second = "had ended" if first.poll() is not None else "both by --force" if forced else "both"
        other = self.run(words, folder)
        _, stderr = first.communicate()
        for code, said in ((first.returncode, stderr), (other.returncode, other.stderr)):
            if code not in (0, 1, 2) or "panicked" in said:
                return {"second": second, "same": 0, "problem": f"exit {code}: {said.strip()[-200:]}"}
        if first.returncode != 0 and other.returncode != 0:
            problem = f"neither: {stderr.strip()[-200:]} / {other.stderr.strip()[-200:]}"
            return {"second": second, "same": 0, "problem": problem}
        if second != "had ended" and (first.returncode, other.returncode) != (0, 0):
            second = "refused"
        return self.compared(folder, second)

    def clock(self, rng, share):
        folder = self.bench.fresh("clock")
        stamp = folder / "clock"
        stamp.write_text("+0")
        environment = {
            "LD_PRELOAD": FAKETIME,
            "FAKETIME_TIMESTAMP_FILE": str(stamp),
            "FAKETIME_NO_CACHE": "1",
            "FAKETIME_DONT_FAKE_MONOTONIC": "1",
            "NO_FAKE_STAT": "1",
            "DIMCMC_CACHE": str(folder / "cache"),
        }
        process = self.begin(self.words, folder, **environment)
        time.sleep(share * self.seconds)
        stamp.write_text(rng.choice(("+10y", "-10y", "-60y")))
        _, stderr = process.communicate()
        if process.returncode != 0:
            return {"same": 0, "problem": f"exit {process.returncode}: {stderr.strip()[-200:]}"}
        line = self.compared(folder, "ended")
        if line["same"]:
            # with the clock put right, and what was kept under the wrong one
            shutil.rmtree(folder / "out")
            (folder / "out").mkdir()
            done = self.run(self.words, folder, DIMCMC_CACHE=str(folder / "cache"))
            if done.returncode != 0:
                return {"same": 0, "problem": f"the second time: {done.stderr.strip()[-200:]}"}
            line = self.compared(folder, "ended")
        return line

    def once_more(self, folder, second):
        """How a command that was cut short is run again, if it was, and whether all is as without it."""
        if second is None:
            ways = [("again", self.words), ("again by --force", [*self.words, "--force"])]
            if self.resumes and any((folder / "out").iterdir()):
                ways.insert(0, ("resume", [*self.words, "--resume"]))
            for second, way in ways:
                done = self.run(way, folder)
                # some files were written, and the message says what to do; or nothing had begun that could go on
                if done.returncode == 0 or "force" not in done.stderr and second != "resume":
                    break
            if done.returncode != 0:
                return {"second": second, "same": 0, "problem": done.stderr.strip().splitlines()[-1]}
        return self.compared(folder, second)

    def compared(self, folder, second):
        found = files(folder / "out")
        names = found.keys() | self.reference.keys()
        differ = sorted(name for name in names if found.get(name) != self.reference.get(name))
        return {"second": second, "same": int(not differ), "problem": " ".join(differ)}


def is_rank(pid, folder):
    """Whether a process is a rank of the run in a folder."""
    try:
        environment = Path(f"/proc/{pid}/environ").read_bytes()
        return b"OMPI_COMM_WORLD_RANK=" in environment and Path(f"/proc/{pid}/cwd").resolve() == folder.resolve()
    except OSError:
        return False


class Bench:
    """What the commands read."""

    def __init__(self, args):
        self.program, self.python = args.program, args.python
        self.work = args.work.resolve()
        self.inputs = self.work / "inputs"
        if not (self.inputs / "ready").exists():
            self.prepare()

    def environment(self):
        return os.environ | {"DIMCMC_CACHE": "off", "RAYON_NUM_THREADS": "2"}

    def by_program(self, words):
        return [self.program, *words]

    def by_python(self, words):
        return [self.python, "-c", statement(words)]

    def by_ranks(self, words):
        return [*"mpirun --oversubscribe --allow-run-as-root --bind-to none -n 2".split(), self.program, *words]

    def prepare(self):
        shutil.rmtree(self.inputs, ignore_errors=True)
        self.inputs.mkdir(parents=True)
        write = lambda name, config: (self.inputs / name).write_text(json.dumps(config))
        write("star.json", CONFIG)
        one = CONFIG | {"observations": CONFIG["observations"][0]}
        write("one.json", one)
        write("two.json", one | {"sampler": CONFIG["sampler"] | {"seed": 2}})
        data = CONFIG["observations"][0]
        other = data | {"simulate": data["simulate"] | {"seed": 5}}
        write("other.json", one | {"observations": other})
        (self.inputs / "list.txt").write_text("one.json\ntwo.json\n")
        star = {key: value for key, value in CONFIG["star"].items() if key != "regions"}
        imaging = {"pixels": 200, "objective": "spottedness", "chi2_target": 1.05}
        static = one | {"star": star, "imaging": imaging, "grid": GRID}
        write("grid.json", static)
        steps = [
            "simulate star.json --out data",
            "sample one.json --out runs/1",
            "sample two.json --out runs/2",
        ]
        for name in ("one", "other"):
            steps.append(f"periodogram {name}.json --draws 1000 --out survey/{name}/search")
            limits = "--draws 1000 --periods 6 --amplitudes 6 --phases 4"
            steps.append(f"limits {name}.json {limits} --out survey/{name}/limits")
        for step in steps:
            call = self.by_program(step.split()) if self.program else [self.python, "-m", "dimcmc", *step.split()]
            subprocess.run(call, cwd=self.inputs, env=self.environment(), stdout=subprocess.DEVNULL, check=True)
        (self.inputs / "ready").write_text("")

    def fresh(self, name):
        folder = self.work / name
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(self.inputs, folder)
        (folder / "out").mkdir()
        return folder


# how a command is started, what happens to it, and of which this is done
FAULTS = {
    "kill": (Bench.by_program, Command.kill, tuple(COMMANDS)),
    "full disk": (Bench.by_program, Command.full_disk, tuple(COMMANDS)),
    "kill python": (Bench.by_python, Command.kill, FUNCTIONS),
    "kill rank": (Bench.by_ranks, Command.kill_rank, RANKED),
    "at once": (Bench.by_program, Command.at_once, tuple(COMMANDS)),
    "clock": (Bench.by_program, Command.clock, tuple(COMMANDS)),
}


def table(rows):
    head = "| command | fault | seconds | cut short | resumed | by --force | same bytes afterwards |"
    lines = [head, "|---|---|---|---|---|---|---|"]
    count = lambda of, *seconds: sum(row["second"] in seconds for row in of)
    for fault in FAULTS:
        for name in (*COMMANDS, "all"):
            of = [row for row in rows if row["fault"] == fault and name in ("all", row["command"])]
            if of:
                seconds = sum(float(row["of_seconds"]) for row in of) / len(of)
                cut = len(of) - count(of, "had ended", "both", "both by --force", "ended")
                same = f"{sum(row['same'] == '1' for row in of)} of {len(of)}"
                numbers = (f"{seconds:.1f}", cut, count(of, "resume"), count(of, "again by --force"), same)
                lines.append(f"| `{name}` | {fault} | {' | '.join(map(str, numbers))} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", help="dimcmc")
    parser.add_argument("--python", help="a Python that has the package")
    for fault in FAULTS:
        parser.add_argument(f"--{fault.replace(' ', '-')}", type=int, default=0, metavar="TIMES", dest=fault)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--work", type=Path, default=Path("target/faults"))
    parser.add_argument("--csv", type=Path, default=Path("results/calibration/faults.csv"))
    parser.add_argument("--out", type=Path, default=Path("results/reliability.md"))
    parser.add_argument("--table", action="store_true", help="write the table of the lines so far")
    args = parser.parse_args()
    if args.table:
        lines = table(calibration_table.read(args.csv))
        calibration_table.under_the_head(args.out, "Kills and full disks", lines)
    elif args.program or args.python:
        args.program = args.program and str(Path(args.program).resolve())
        args.python = args.python and os.path.abspath(args.python)
        bench, rng = Bench(args), random.Random(args.seed)
        for fault, (start, disturb, names) in FAULTS.items():
            times = getattr(args, fault)
            for name in names if times else ():
                command = Command(bench, name, functools.partial(start, bench))
                for _ in range(-(-times // len(names))):
                    share = rng.random()
                    line = {"command": name, "fault": fault, "at": f"{share:.3f}"}
                    line["of_seconds"] = f"{command.seconds:.2f}"
                    calibration_table.append(args.csv, COLUMNS, line | disturb(command, rng, share))
    else:
        parser.error("--program, --python, or --table")
