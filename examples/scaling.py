"""A simulated cluster: how many evaluations a second a chain gets out of 10 to 10,000 ranks.

Events are those of the program: rank 0 proposes for one half of all walkers, hands the vectors out one by one to whoever is free,
takes the answers as they come, decides and writes; then the other half. What things take is measured by `cargo bench --bench ranks
--features mpi` (the last tables and line). Prints the tables of results/scaling.md. Needs Python alone.
"""

import heapq
import math
import random

# a message over a network, s: latency of either direction, and what rank 0 works on a question with its answer
LATENCY, SERVICE = 20e-6, 12e-6
# what rank 0 does for each walker and step: propose, decide, write a line
PROPOSAL = 60e-6

# name, median of an evaluation (s), spread of its logarithm
CASES = [("3-D, 2,000 pixels", 3.3e-3, 0.15), ("3-D, 20,000 pixels", 40e-3, 0.15), ("7-D, 20,000 pixels", 150e-3, 0.25)]
# a quarter slower: other machines' cores are not alike
UNEQUAL = 0.1


def step_s(batch, ranks, median, spread, rng):
    """Seconds of a half-step of `batch` questions with so many ranks, the first of which only hands out; and of work in it."""
    workers = ranks - 1
    speed = [math.exp(rng.gauss(0.0, UNEQUAL)) for _ in range(min(workers, batch))]
    clock = PROPOSAL * batch
    work, given, answers = 0.0, 0, []
    for worker, factor in enumerate(speed):
        clock += SERVICE / 2
        work, given = work + send(answers, clock, worker, factor, median, spread, rng), given + 1
    while answers:
        arrival, worker = heapq.heappop(answers)
        clock = max(clock, arrival) + SERVICE / 2
        if given < batch:
            clock += SERVICE / 2
            work, given = work + send(answers, clock, worker, speed[worker], median, spread, rng), given + 1
    return clock, work


def send(answers, clock, worker, factor, median, spread, rng):
    took = factor * median * math.exp(rng.gauss(0.0, spread))
    heapq.heappush(answers, (clock + 2 * LATENCY + took, worker))
    return took


def throughput(walkers, ranks, case, steps=12):
    """Evaluations a second, and the share of the workers' time that is work."""
    _, median, spread = case
    rng = random.Random(1)
    halves = [step_s(walkers // 2, ranks, median, spread, rng) for _ in range(2 * steps)]
    seconds, work = sum(h[0] for h in halves), sum(h[1] for h in halves)
    return walkers * steps / seconds, work / (seconds * (ranks - 1))


def main():
    ranks = [10, 30, 100, 300, 1000, 3000, 10000]
    for case in CASES:
        print(f"\n{case[0]}, evaluations of {1e3 * case[1]:.1f} ms: evaluations a second (share of the workers' time that is work)\n")
        print("| walkers in all | " + " | ".join(f"{n:,} ranks" for n in ranks) + " |")
        print("|---" * (len(ranks) + 1) + "|")
        for walkers in [128, 512, 2048, 8192, 32768]:
            cells = [throughput(walkers, n, case, steps=12 if walkers < 5000 else 4) for n in ranks]
            print(f"| {walkers:,} | " + " | ".join(f"{rate:,.0f} ({share:.2f})" for rate, share in cells) + " |")
    limit = 1.0 / (PROPOSAL + SERVICE)
    print(f"\nRank 0 alone: {limit:,.0f} evaluations a second at most.")


if __name__ == "__main__":
    main()
