"""Kills at random moments, and full disks: is anything lost? (results/reliability.md)

    python3 examples/faults.py --program target/release/dimcmc --kills 200 --full 200
    python3 examples/faults.py --table

Every command that writes is run on a small star with two data sets, once to its end. Then it is started again in a
fresh copy of what it reads, killed (SIGKILL) after a random share of that time, and run once more as a user would: with
`--resume` where the command has it and its folder holds a run, with `--force` where the message asks for it as the
folder holds some of the files, otherwise as before. Afterwards the folder must hold the same bytes as that of the run
that was not killed, but for times, and nothing else, no temporary file either. Disks are full after a random share of
what a command writes, and have room again when it is run once more. The second command writes the table. Linux; needs
numpy, and full disks need root.
"""

import argparse
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
FAULTS = ("kill", "full disk")
COLUMNS = ("command", "fault", "at", "of_seconds", "second", "same", "problem")
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
        words, _ = COMMANDS[name]
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
        line = {"command": name, "fault": "kill", "at": f"{share:.3f}", "of_seconds": f"{seconds:.2f}"}
        if process.wait() != -signal.SIGKILL:
            line["second"] = "had ended"
        return line | self.once_more(name, folder, reference, line.get("second"))

    def full(self, name, seconds, reference, share):
        """The disk is full after a share of what is written, and has room again afterwards."""
        words, _ = COMMANDS[name]
        folder = self.fresh("full")
        pages = int(share * sum(len(data) // 4096 + 1 for data in reference.values()))
        room = lambda size, more="": ["mount", "-t", "tmpfs", "-o", f"{more}size={size}", "tmpfs", folder / "out"]
        subprocess.run(room(max(pages, 1) * 4096), check=True)
        try:
            done = self.run(words.split(), folder)
            line = {"command": name, "fault": "full disk", "at": f"{share:.3f}", "of_seconds": f"{seconds:.2f}"}
            if done.returncode == 0:
                line["second"] = "had ended"
            elif "No space left" not in done.stderr:
                return line | {"same": 0, "problem": f"exit {done.returncode}: {done.stderr.strip()[-200:]}"}
            subprocess.run(room("64m", "remount,"), check=True)
            return line | self.once_more(name, folder, reference, line.get("second"))
        finally:
            subprocess.run(["umount", folder / "out"], check=True)

    def once_more(self, name, folder, reference, second):
        """How a command that was cut short is run again, if it was, and whether all is as without it."""
        words, resumes = COMMANDS[name]
        again = words.split()
        if second is None:
            ways = [("again", again), ("again by --force", [*again, "--force"])]
            if resumes and any((folder / "out").iterdir()):
                ways.insert(0, ("resume", [*again, "--resume"]))
            for second, way in ways:
                done = self.run(way, folder)
                # some files were written, and the message says what to do; or nothing had begun that could go on
                if done.returncode == 0 or "--force" not in done.stderr and second != "resume":
                    break
            if done.returncode != 0:
                return {"second": second, "same": 0, "problem": done.stderr.strip().splitlines()[-1]}
        found = files(folder / "out")
        differ = sorted(key for key in found.keys() | reference.keys() if found.get(key) != reference.get(key))
        return {"second": second, "same": int(not differ), "problem": " ".join(differ)}


def table(rows):
    head = "| command | fault | seconds | cut short | resumed | by --force | same bytes afterwards |"
    lines = [head, "|---|---|---|---|---|---|---|"]
    count = lambda of, second: sum(row["second"] == second for row in of)
    for fault in FAULTS:
        for name in (*COMMANDS, "all"):
            of = [row for row in rows if row["fault"] == fault and name in ("all", row["command"])]
            if of:
                seconds = sum(float(row["of_seconds"]) for row in of) / len(of)
                cut = len(of) - count(of, "had ended")
                same = f"{sum(row['same'] == '1' for row in of)} of {len(of)}"
                numbers = (f"{seconds:.1f}", cut, count(of, "resume"), count(of, "again by --force"), same)
                lines.append(f"| `{name}` | {fault} | {' | '.join(map(str, numbers))} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", help="dimcmc")
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--full", type=int, default=0, help="full disks, which need root")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--work", type=Path, default=Path("target/faults"))
    parser.add_argument("--csv", type=Path, default=Path("results/calibration/faults.csv"))
    parser.add_argument("--out", type=Path, default=Path("results/reliability.md"))
    parser.add_argument("--table", action="store_true", help="write the table of the lines so far")
    args = parser.parse_args()
    if args.table:
        lines = table(calibration_table.read(args.csv))
        calibration_table.under_the_head(args.out, "Kills and full disks", lines)
    elif args.program:
        args.program = str(Path(args.program).resolve())
        bench, rng = Bench(args), random.Random(args.seed)
        for name in COMMANDS:
            seconds, reference = bench.reference(name)
            for fault, times in ((bench.killed, args.kills), (bench.full, args.full)):
                for _ in range(-(-times // len(COMMANDS))):
                    calibration_table.append(args.csv, COLUMNS, fault(name, seconds, reference, rng.random()))
    else:
        parser.error("--program, or --table")
