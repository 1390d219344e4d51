//! Tests of the line kernels.

use super::*;
use crate::numerics::vector::{self, Instructions, Task};
use crate::star::block::{Block, Pixels};

const PIXELS: usize = 190;
const GRID: usize = 20;

fn number(i: usize) -> f64 {
    0.5 + 0.5 * (12.9898 * i as f64).sin()
}

/// Groups of cells with their blocks: neither all of a group nor all rows of a cell are there.
fn groups() -> Vec<([u32; LANES], Vec<Block>, Vec<Pixels>)> {
    let numbers = |first: usize, filled: usize, middle: f64| {
        std::array::from_fn(|l| if l < filled { (number(first + l) - middle) as f32 } else { 0.0 })
    };
    let block = |b: usize, filled: usize| Block {
        weight: numbers(8 * b, filled, 0.0),
        position: numbers(100 + 8 * b, filled, 0.5),
        spread: numbers(300 + 8 * b, filled, 0.0),
    };
    // empty lanes point to a pixel of the group that is not empty
    let pixels = |b: usize, filled: usize| std::array::from_fn(|l| if l < filled { 8 * b + l } else { 8 * b } as u32);
    let filled = [vec![8, 8, 8, 8, 7, 6, 3, 1], vec![5, 5, 4], vec![8, 8, 8, 3], vec![]];
    let mut first = 0;
    let mut group = |filled: &Vec<usize>, cells: [u32; LANES]| {
        let rows = (first..).zip(filled.iter().copied());
        first += filled.len();
        (cells, rows.clone().map(|(b, n)| block(b, n)).collect(), rows.map(|(b, n)| pixels(b, n)).collect())
    };
    let cells = [[3, 0, 1, 9, 14, 2, 7, 5], [4, 6, 8, 10, 11, 4, 4, 4], [12; LANES], [13; LANES]];
    filled.iter().zip(cells).map(|(filled, cells)| group(filled, cells)).collect()
}

/// Every pair, its weight on each node of its cell: the reference, one pixel after another.
fn pairs() -> Vec<(usize, usize, f64)> {
    let mut pairs = Vec::new();
    for (cells, blocks, pixels) in groups() {
        let rows = blocks.iter().zip(&pixels);
        for ((block, pixels), lane) in rows.flat_map(|row| (0..LANES).map(move |lane| (row, lane))) {
            let [weight, t, spread] = [block.weight, block.position, block.spread].map(|row| f64::from(row[lane]));
            // P(t) + spread P''(t), the polynomial of node n by its coefficients
            let power = |t: f64, k: usize| t.powi(k as i32);
            let second = |t: f64, k: usize| if k < 2 { 0.0 } else { (k * (k - 1)) as f64 * power(t, k - 2) };
            let on_node = |weights: &[f64; DEPOSIT_NODES], t: f64| -> f64 {
                weights.iter().enumerate().map(|(k, w)| w * (power(t, k) + spread * second(t, k))).sum()
            };
            for (n, weights) in DEPOSIT_WEIGHTS.iter().enumerate() {
                for (n, t) in [(n, t), (DEPOSIT_NODES - 1 - n, -t)] {
                    let node = cells[lane] as usize + n;
                    pairs.push((pixels[lane] as usize, node, weight * on_node(weights, t)));
                }
            }
        }
    }
    pairs
}

struct Both<N> {
    x: Vec<N>,
    nodes: Vec<N>,
    left: Vec<N>,
    out: Vec<N>,
}

impl<N: Number> Task for Both<N> {
    type Output = [Vec<f64>; 2];

    #[inline(always)]
    #[allow(unsafe_code)]
    fn run<I: Instructions>(mut self, i: I) -> Self::Output {
        let r = N::registers(i);
        for (cells, blocks, pixels) in groups() {
            let group = Group { cells: &cells, blocks: &blocks, pixels: &pixels };
            // safe: pixels and cells of the test
            unsafe {
                gather(r, group, &self.x, &mut self.left);
                scatter(r, group, &self.nodes, &mut self.out);
            }
        }
        let node = |node: usize| self.left.chunks(GRID).map(|row| row[node].into()).sum();
        [(0..GRID).map(node).collect(), self.out.iter().map(|x| (*x).into()).collect()]
    }
}

/// Compares the results of all sets of instructions with a plain loop over pairs.
fn check<N: Number>(tolerance: f64) {
    let numbers = |count: usize| (0..count).map(|i| N::of(number(i))).collect::<Vec<N>>();
    let (x, nodes) = (numbers(PIXELS), numbers(GRID));
    let (mut plain_nodes, mut plain_out) = (vec![0.0; GRID], vec![1.0; PIXELS]);
    for (pixel, node, weight) in pairs() {
        plain_nodes[node] += weight * x[pixel].into();
        plain_out[pixel] += weight * nodes[node].into();
    }
    let (left, out) = (vec![N::default(); DEPOSIT_NODES * GRID], vec![N::of(1.0); PIXELS]);
    let task = || Both { x: x.clone(), nodes: nodes.clone(), left: left.clone(), out: out.clone() };
    let outputs = vector::by_each(task);
    for (got, wanted) in outputs.iter().flat_map(|both| both.iter().zip([&plain_nodes, &plain_out])) {
        for (got, wanted) in got.iter().zip(wanted) {
            assert!((got - wanted).abs() < tolerance, "{got} {wanted}");
        }
    }
    assert!(outputs[1..].windows(2).all(|two| two[0] == two[1]), "wider registers change the sums");
}

#[test]
fn all_instructions_give_what_a_plain_loop_over_pairs_gives() {
    check::<f64>(1e-13);
    // sums of up to 8 x 6 terms of one or less, 6e-8 each
    check::<f32>(5e-6);
}
