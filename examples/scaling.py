"""A simulated cluster: evaluations per second of a chain on 10 to 10,000 ranks.

Events are those of the program: rank 0 proposes for one half of all walkers, hands the vectors out, some ahead while
there are many, takes the answers as they come, decides and writes; then the other half. Durations are measured by
`cargo bench -p dimcmc-mpi --bench ranks --features mpi` (the last tables and line). Prints the tables of
results/scaling.md. Needs Python alone.
"""

import heapq
import math
import random

# s: a message one way, the nap of whoever waits for it included; what rank 0 works on a question and its answer
LATENCY, SERVICE = 125e-6, 12e-6
# what rank 0 does for each walker and step: propose, decide, write a line
PROPOSAL = 42e-6

# most questions ahead, and how long (s) they are to last
AHEAD, BRIDGED = 8, 30e-3

# name, median of an evaluation (s), spread of its logarithm
CASES = [("3-D, 2,000 pixels", 0.9e-3, 0.24), ("3-D, 20,000 pixels", 5.9e-3, 0.24), ("7-D, 20,000 pixels", 14e-3, 0.44)]
# spread of the logarithm of the ranks' speeds: machines are not all alike
UNEQUAL = 0.1


class Batch:
    """One half of all walkers, handed out and taken back."""

    def __init__(self, questions, workers, median, spread, rng):
        self.left, self.clock, self.work = questions, PROPOSAL * questions, 0.0
        self.median, self.spread, self.rng = median, spread, rng
        self.speed = [math.exp(rng.gauss(0.0, UNEQUAL)) for _ in range(min(workers, questions))]
        self.workers, self.until, self.open = workers, [0.0] * len(self.speed), [0] * len(self.speed)
        self.answers = []

    def send(self, worker):
        """A request to a worker, which begins with it after its earlier ones."""
        self.clock += SERVICE / 2
        took = self.speed[worker] * self.median * math.exp(self.rng.gauss(0.0, self.spread))
        self.until[worker] = max(self.until[worker], self.clock + LATENCY) + took
        heapq.heappush(self.answers, (self.until[worker] + LATENCY, worker))
        self.left, self.open[worker], self.work = self.left - 1, self.open[worker] + 1, self.work + took

    def ahead(self):
        """Requests that a worker may have queued: fewer the longer they take, and the fewer remain."""
        if self.left <= self.workers:
            return 0
        return max(1, min(AHEAD, int(BRIDGED / self.median), self.left // (2 * self.workers)))

    def run(self):
        """Seconds, and seconds of work, until all results are back."""
        for worker in range(len(self.speed)):
            self.send(worker)
        for _ in range(AHEAD):
            for worker in range(len(self.speed)):
                if self.open[worker] <= self.ahead():
                    self.send(worker)
        while self.answers:
            arrival, worker = heapq.heappop(self.answers)
            self.clock = max(self.clock, arrival) + SERVICE / 2
            self.open[worker] -= 1
            while self.left > 0 and self.open[worker] <= self.ahead():
                self.send(worker)
        return self.clock, self.work


def throughput(walkers, ranks, case, steps):
    """Evaluations per second, and the fraction of the workers' time that is work."""
    _, median, spread = case
    rng = random.Random(1)
    halves = [Batch(walkers // 2, ranks - 1, median, spread, rng).run() for _ in range(2 * steps)]
    seconds, work = sum(h[0] for h in halves), sum(h[1] for h in halves)
    return walkers * steps / seconds, work / (seconds * (ranks - 1))


def main():
    ranks = [10, 30, 100, 300, 1000, 3000, 10000]
    for case in CASES:
        what = "evaluations a second (share of the workers' time that is work)"
        print(f"\n{case[0]}, evaluations of {1e3 * case[1]:g} ms: {what}\n")
        print("| walkers in all | " + " | ".join(f"{n:,} ranks" for n in ranks) + " |")
        print("|---" * (len(ranks) + 1) + "|")
        for walkers in [128, 512, 2048, 8192, 32768]:
            cells = [throughput(walkers, n, case, steps=12 if walkers < 5000 else 4) for n in ranks]
            print(f"| {walkers:,} | " + " | ".join(f"{rate:,.0f} ({share:.2f})" for rate, share in cells) + " |")
    limit = 1.0 / (PROPOSAL + SERVICE)
    print(f"\nRank 0 alone: {limit:,.0f} evaluations a second at most.")


if __name__ == "__main__":
    main()
