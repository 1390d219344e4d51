//! The response: forward, transpose and build, against a plain loop and against a sequential read of as many bytes.

mod common;
#[path = "../tests/common/plain_loop.rs"]
mod plain_loop;

use common::paper::{Free, Passes, Size, scene, truth, uneven_map};
use common::stopwatch::{Candidate, fastest, in_turn};
use common::table::{Table, Target, thousands};
use dimcmc::internals::data::scene::Scene;
use dimcmc::internals::numerics::vector::{self, Instructions, Task};
use plain_loop::PlainLoop;
use std::hint::black_box;

/// Bins of the plain loop's window: 4.5 standard deviations of the line on either side.
const WINDOW: usize = 16;

/// Times fewer nanoseconds than the plain loop.
const OVER_PLAIN: Target = Target::AtLeast(4.0);

/// Multiple of a sequential read.
const OVER_READ: Target = Target::AtMost(3.0);

const ROUNDS: usize = 50;

/// Label of rows without a comparison.
const OTHER_ROUNDS: usize = 25;

/// Runs in a row; an evaluation makes 20 passes and more.
const RUNS: usize = 8;

fn main() {
    if !common::wanted() {
        return;
    }
    let fewer = format!("plain / response ({OVER_PLAIN})");
    let read = format!("response / read ({OVER_READ})");
    let mut table = Table::new(
        "Passes: ns per visible (pixel, profile) pair",
        &["pixels", "", "response", "plain loop", "plain read", "read", &fewer, "response / plain read", &read],
    );
    for pixels in [5000, 20_000] {
        let scene = scene(Free::Three, Size::pixels(pixels));
        passes(&scene, pixels, &mut table);
        others(&scene, pixels, &mut table);
    }
    table.print(&format!(
        "One thread; the fastest of {ROUNDS} rounds in which all take turns, {RUNS} runs in a row; of the rows \
        without ratios \
         {OTHER_ROUNDS} rounds, one run. `read` sums as many bytes as the response stores for its pairs, by the same \
         instructions, \
         `plain read` by those that the plain loop is compiled for ({} bytes a pair in the plain loop, whose windows \
         have {WINDOW} \
         bins). `build` is a response for new stellar parameters, `shift` one for a new orbit; there and back are two \
         passes, and \
         the time is that of one. Ratios are of whole passes: the plain loop looks at the middle of a pixel alone, \
         and has fewer \
         pairs.",
        PlainLoop::<WINDOW>::PAIR_BYTES,
    ));
}

/// A sequential read with the instructions of the response.
struct Read<'a>(&'a [u64]);

impl Task for Read<'_> {
    type Output = u64;

    #[inline(always)]
    fn run<I: Instructions>(self, _: I) -> u64 {
        self.0.iter().fold(0, |sum, x| sum.wrapping_add(*x))
    }
}

/// Forward and transpose: response, plain loop, read.
fn passes(scene: &Scene, pixels: usize, table: &mut Table) {
    let imager = &scene.imager;
    let response = imager.response(&truth(scene));
    let plain = PlainLoop::<WINDOW>::new(&imager.grid, &imager.star, &truth(scene), &imager.sets[0].sampling);
    let stored = vec![1_u64; response.bytes() / size_of::<u64>()];
    let plain_read = || black_box(&stored).iter().fold(0_u64, |sum, x| sum.wrapping_add(*x));
    let read = || vector::run(Read(black_box(&stored)));
    let x = uneven_map(response.pixels());
    let (y, z) = (uneven_map(response.data_len()), uneven_map(response.profiles()));

    let outputs = || (vec![0.0; response.data_len()], vec![0.0; response.profiles()]);
    let ((mut line, mut continuum), (mut plain_line, mut plain_continuum)) = (outputs(), outputs());
    let (mut map, mut plain_map) = (vec![0.0; x.len()], vec![0.0; x.len()]);
    let mut forward = [
        Candidate::new("response", || response.apply(black_box(&x), &mut line, &mut continuum)),
        Candidate::new("plain loop", || plain.apply(black_box(&x), &mut plain_line, &mut plain_continuum)),
        Candidate::new("plain read", plain_read),
        Candidate::new("read", read),
    ];
    let mut transpose = [
        Candidate::new("response", || response.apply_transpose(black_box(&y), black_box(&z), &mut map)),
        Candidate::new("plain loop", || plain.apply_transpose(black_box(&y), black_box(&z), &mut plain_map)),
        Candidate::new("plain read", plain_read),
        Candidate::new("read", read),
    ];
    for (name, candidates) in [("forward", &mut forward), ("transpose", &mut transpose)] {
        let times = in_turn(candidates, ROUNDS, RUNS);
        let per_pair = |times: &[f64], pairs: usize| format!("{:.2}", 1e9 * fastest(times) / pairs as f64);
        table.row([
            thousands(pixels),
            name.to_owned(),
            per_pair(&times[0], response.pairs()),
            per_pair(&times[1], plain.pairs()),
            per_pair(&times[2], response.pairs()),
            per_pair(&times[3], response.pairs()),
            OVER_PLAIN.judge(fastest(&times[1]) / fastest(&times[0]), 1),
            OVER_READ.judge(fastest(&times[0]) / fastest(&times[2]), 1),
            OVER_READ.judge(fastest(&times[0]) / fastest(&times[3]), 1),
        ]);
    }
}

/// Responses for new stellar parameters and for a new orbit, and a pass of those, forward and back, in single
/// precision.
fn others(scene: &Scene, pixels: usize, table: &mut Table) {
    let (imager, state) = (&scene.imager, truth(scene));
    let response = imager.response(&state);
    let build = || imager.response(black_box(&state));
    let shift = || imager.with_velocities(&response, black_box(&state));
    let mut only_passes = Passes::new(&response);
    let single = || only_passes.run_single(&response, 2);
    let mut candidates = [
        Candidate::new("build", build),
        Candidate::new("shift", shift),
        Candidate::new("there and back, single precision", single),
    ];
    let times = in_turn(&mut candidates, OTHER_ROUNDS, 1);
    for ((candidate, times), parts) in candidates.iter().zip(times).zip([1.0, 1.0, 2.0]) {
        let per_pair = format!("{:.2}", 1e9 * fastest(&times) / (parts * response.pairs() as f64));
        let none = || "-".to_owned();
        let row = [thousands(pixels), candidate.name.to_owned(), per_pair];
        table.row(row.into_iter().chain((0..6).map(|_| none())));
    }
}
