"""Kills at random moments, full disks and read-only folders: is anything lost? (results/reliability.md)

    python3 examples/kill_check.py --program target/release/dimcmc --kills 200
    python3 examples/kill_check.py --table

Every command that writes is run on a small star with two data sets, once to its end. Then it is started again in a
fresh copy of what it reads, killed (SIGKILL) after a random share of that time, and run once more as a user would: with
`--resume` where the command has it and its folder holds a run, otherwise as before. Afterwards the folder must hold the
same bytes as that of the run that was not killed, but for times, and nothing else, no temporary file either. The second
command writes the tables. Linux; needs nothing but Python.
"""

import argparse
import csv
import json
import os
import random
import shutil
import signal
import subprocess
import time
from pathlib import Path

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
    "survey": ("survey survey/one survey/two --out out", False),
}
COLUMNS = ("command", "killed_at", "of_seconds", "second", "same", "problem")
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


class Bench:
    def __init__(self, args):
        self.program, self.work = args.program, args.work
        self.inputs = args.work / "inputs"
        if not (self.inputs / "ready").exists():
            self.prepare()

    def environment(self):
        return os.environ | {"DIMCMC_CACHE": "off", "RAYON_NUM_THREADS": "2"}

    def run(self, words, folder, **options):
        return subprocess.run(
            [self.program, *words], cwd=folder, env=self.environment(), capture_output=True, text=True, **options
        )

    def prepare(self):
        shutil.rmtree(self.inputs, ignore_errors=True)
        self.inputs.mkdir(parents=True)
        write = lambda name, config: (self.inputs / name).write_text(json.dumps(config))
        write("star.json", CONFIG)
        one = CONFIG | {"observations": CONFIG["observations"][0]}
        write("one.json", one)
        write("two.json", one | {"sampler": CONFIG["sampler"] | {"seed": 2}})
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
        for name in ("one", "two"):
            steps.append(f"periodogram {name}.json --draws 1000 --out survey/{name}/search")
            limits = "--draws 1000 --periods 6 --amplitudes 6 --phases 4"
            steps.append(f"limits {name}.json {limits} --out survey/{name}/limits")
        for step in steps:
            done = self.run(step.split(), self.inputs)
            if done.returncode != 0:
                raise SystemExit(f"{step}: {done.stderr}")
        (self.inputs / "ready").write_text("")

    def fresh(self, name):
        folder = self.work / name
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(self.inputs, folder)
        (folder / "out").mkdir()
        return folder

    def reference(self, name):
        """Seconds, and the files, of a run that is not disturbed."""
        words, _ = COMMANDS[name]
        folder = self.fresh("reference")
        began = time.monotonic()
        done = self.run(words.split(), folder)
        if done.returncode != 0:
            raise SystemExit(f"{words}: {done.stderr}")
        return time.monotonic() - began, files(folder / "out")

    def killed(self, name, seconds, reference, share):
        words, resumes = COMMANDS[name]
        folder = self.fresh("killed")
        process = subprocess.Popen(
            [self.program, *words.split()],
            cwd=folder,
            env=self.environment(),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        time.sleep(share * seconds)
        process.send_signal(signal.SIGKILL)
        ended = process.wait()
        line = {"command": name, "killed_at": f"{share:.3f}", "of_seconds": f"{seconds:.2f}"}
        left = any((folder / "out").iterdir())
        again = words.split()
        if ended != -signal.SIGKILL:
            line["second"] = "had ended"
        elif resumes and left:
            again.append("--resume")
            line["second"] = "resume"
            if self.run(again, folder).returncode != 0:
                # nothing had begun that could go on
                line["second"] = "resume refused, again"
                again.pop()
                done = self.run(again, folder)
                if done.returncode != 0:
                    return line | {"same": 0, "problem": done.stderr.strip().splitlines()[-1]}
        else:
            line["second"] = "again"
            done = self.run(again, folder)
            if done.returncode != 0:
                return line | {"same": 0, "problem": done.stderr.strip().splitlines()[-1]}
        found = files(folder / "out")
        differ = sorted(key for key in found.keys() | reference.keys() if found.get(key) != reference.get(key))
        return line | {"same": int(not differ), "problem": " ".join(differ)}


def read(path):
    if not path.exists():
        return []
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def table(rows):
    lines = ["| command | seconds | kills | resumed | same bytes afterwards |", "|---|---|---|---|---|"]
    for name in COMMANDS:
        of = [row for row in rows if row["command"] == name]
        if of:
            seconds = sum(float(row["of_seconds"]) for row in of) / len(of)
            kills = sum(row["second"] != "had ended" for row in of)
            resumed = sum(row["second"] == "resume" for row in of)
            same = sum(row["same"] == "1" for row in of)
            lines.append(f"| `{name}` | {seconds:.1f} | {kills} | {resumed or ''} | {same} of {len(of)} |")
    same = sum(row["same"] == "1" for row in rows)
    lines.append(f"| all | | {sum(row['second'] != 'had ended' for row in rows)} | | {same} of {len(rows)} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", help="dimcmc")
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--work", type=Path, default=Path("target/kill-check"))
    parser.add_argument("--csv", type=Path, default=Path("results/calibration/kills.csv"))
    parser.add_argument("--table", action="store_true", help="print the table of the lines so far")
    args = parser.parse_args()
    if args.table:
        print(table(read(args.csv)))
    elif args.program:
        args.program = str(Path(args.program).resolve())
        bench, rng = Bench(args), random.Random(args.seed)
        each = -(-args.kills // len(COMMANDS))
        for name in COMMANDS:
            seconds, reference = bench.reference(name)
            for _ in range(each):
                line = bench.killed(name, seconds, reference, rng.random())
                anew = not args.csv.exists()
                with open(args.csv, "a", newline="") as file:
                    writer = csv.DictWriter(file, COLUMNS, restval="", lineterminator="\n")
                    if anew:
                        writer.writeheader()
                    writer.writerow(line)
    else:
        parser.error("--program, or --table")
