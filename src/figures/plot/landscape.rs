//! A likelihood grid: slices through its highest node and the lowest chi2 over the axis that is not shown, with the
//! paraboloid and, where a run is given, the contours of its chain.

use super::density::Density;
use super::paraboloid::{self, Paraboloid, turned};
use super::symbols::{label, symbol};
use super::trace::Sampled;
use super::{PlotError, corner::SHARES};
use crate::data::io::landscape;
use crate::data::io::paraboloid::ParaboloidFile;
use crate::figures::drawing::colour::{BLACK, BLUE, Colour, ColourMap, VERMILION};
use crate::figures::drawing::contour::contour;
use crate::figures::drawing::panel::{Shade, Sides, Tile};
use crate::figures::drawing::{
    Align, Axis, COLUMN_MM, Figure, Font, Key, Legend, Marker, PAGE_MM, Panel, Rect, Scale, Stroke,
};
use crate::runs::grid_scan::{Header, NODES, PARABOLOID};
use crate::runs::origin;
use crate::sampling::landscape::{Axis as GridAxis, Grid, Landscape};
use std::path::Path;

/// Root of the difference of chi2 at the end of the colour scale.
const DARKEST: f64 = 10.0;

/// Differences of chi2 of contours: 68 and 95 % of two Gaussian parameters.
const LEVELS: [f64; 2] = [2.30, 5.99];

/// The content of the figures.
struct Scene {
    grid: Grid,
    /// Values of the nodes along each axis, rising.
    nodes: Vec<Vec<f64>>,
    /// Number of computed nodes.
    computed: usize,
    /// chi2 minus the lowest, of each node; NaN without a value.
    delta: Vec<f64>,
    /// Index of the lowest on each axis.
    lowest: Vec<usize>,
    paraboloid: Option<Paraboloid>,
    truth: Vec<Option<f64>>,
    chain: Option<Sampled>,
}

/// The figures of the likelihood grid in `folder`, with the chain of the run in folder `run`.
pub(super) fn figures(folder: &Path, run: Option<&Path>) -> Result<Vec<Figure>, PlotError> {
    let scene = Scene::read(folder, run)?;
    let mut figure = match scene.grid.axes.len() {
        1 => scene.curve(),
        _ => scene.planes(),
    };
    if scene.computed < scene.grid.len() {
        let note =
            format!("{NODES}: {} of {} nodes are there, the rest is left white", scene.computed, scene.grid.len());
        figure.caption += &format!(" The likelihood grid is not complete: {note}.");
        figure.notes.push(note);
    }
    Ok(vec![figure])
}

impl Scene {
    fn read(folder: &Path, run: Option<&Path>) -> Result<Self, PlotError> {
        let header = Header::read(folder)?;
        let landscape: Landscape = landscape::read(&folder.join(NODES), header.grid.clone(), &header.numbers)?;
        let wrong = |file: &str, problem: &str| PlotError::Content { path: folder.join(file), problem: problem.into() };
        let top = landscape.best().ok_or_else(|| wrong(NODES, "no node has a value"))?;
        let mut delta = vec![f64::NAN; header.grid.len()];
        for node in landscape.valued() {
            delta[node.index] = 2.0 * (top.evaluation.log_prob - node.evaluation.log_prob);
        }
        let lowest = header.grid.position(top.index);
        let nodes: Vec<Vec<f64>> = header.grid.axes.iter().map(nodes).collect();
        let paraboloid: Option<ParaboloidFile> = match folder.join(PARABOLOID).is_file() {
            true => Some(origin::read(folder, PARABOLOID)?),
            false => None,
        };
        let injected = header.origin.truth.as_ref();
        let truth = header.grid.axes.iter().zip(&nodes);
        let truth =
            truth.map(|(axis, nodes)| injected.and_then(|t| t.get(&axis.name)).map(|t| turned(axis, nodes, *t)));
        let chain = run.map(Sampled::read).transpose()?;
        if let (Some(chain), Some(run)) = (&chain, run) {
            let missing = header.grid.names().find(|name| !chain.summary.names.iter().any(|sampled| sampled == name));
            if let Some(name) = missing {
                let problem = format!("{name} is an axis of the likelihood grid and not sampled in the run");
                return Err(PlotError::Content { path: run.into(), problem });
            }
            if chain.manifest.origin.data_sha256 != header.origin.data_sha256 {
                let problem =
                    format!("the run is of other observations than the likelihood grid in {}", folder.display());
                return Err(PlotError::Content { path: run.into(), problem });
            }
        }
        Ok(Scene {
            truth: truth.collect(),
            paraboloid: paraboloid.and_then(|file| Paraboloid::of(file.paraboloid.as_ref()?, &header.grid, &nodes)),
            grid: header.grid,
            nodes,
            computed: landscape.nodes().len(),
            delta,
            lowest,
            chain,
        })
    }

    /// Difference of chi2 at a node.
    fn at(&self, position: &[usize]) -> f64 {
        let index = self.grid.axes.iter().zip(position).fold(0, |index, (axis, k)| index * axis.nodes + k);
        self.delta[index]
    }

    /// Axis `k` of a panel: half a node beyond the nodes.
    fn axis(&self, k: usize) -> Axis {
        let edges = edges(&self.nodes[k]);
        Axis::linear(&label(&self.grid.axes[k].name), [edges[0], edges[edges.len() - 1]])
    }

    /// The likelihood grid of a single parameter.
    fn curve(&self) -> Figure {
        let mut figure = Figure::new("landscape", COLUMN_MM, 70.0);
        figure.caption =
            "Likelihood grid: chi2 at the nodes (points) minus the lowest, with the paraboloid (line).".into();
        let frame = Rect { left: 38.0, top: 8.0, width: figure.width - 46.0, height: figure.height - 36.0 };
        let points: Vec<[f64; 2]> = self.nodes[0].iter().enumerate().map(|(k, x)| [*x, self.at(&[k])]).collect();
        let highest = points.iter().map(|p| p[1]).filter(|y| y.is_finite()).fold(1.0, f64::max).min(DARKEST * DARKEST);
        let panel = Panel { frame, x: self.axis(0), y: Axis::linear("Δ*χ*^{2}", [-0.05 * highest, highest]) };
        if let Some(paraboloid) = &self.paraboloid {
            let [low, high] = panel.x.range;
            let at = |x: f64| ((x - paraboloid.vertex[0]) / paraboloid.error[0]).powi(2);
            let curve: Vec<[f64; 2]> =
                (0..=200).map(|k| low + (high - low) * f64::from(k) / 200.0).map(|x| [x, at(x)]).collect();
            panel.line(&mut figure, "paraboloid", &curve, paraboloid::PEN);
        }
        if let Some(truth) = self.truth[0] {
            panel.vertical(&mut figure, "truth", truth, super::trace::TRUTH);
        }
        panel.points(&mut figure, "node", &points, (Marker::Disc, 3.6, BLACK));
        panel.frame(&mut figure, Sides::BOTH);
        let mut legend = Legend::default();
        legend.add(Key::Point(Marker::Disc, BLACK), "nodes");
        legend.add(Key::Line(paraboloid::PEN), if self.paraboloid.is_some() { "paraboloid" } else { "" });
        legend.add(Key::Line(super::trace::TRUTH), if self.truth[0].is_some() { "injected" } else { "" });
        legend.draw(&mut figure, frame, [0.5, 0.0]);
        figure
    }

    /// Pairs of axes: slices above; below them, with a third axis, the minima over it.
    fn planes(&self) -> Figure {
        let three = self.grid.axes.len() == 3;
        let pairs: &[[usize; 2]] = if three { &[[0, 1], [0, 2], [1, 2]] } else { &[[0, 1]] };
        let rows = if three { 2 } else { 1 };
        let mut figure =
            Figure::new("landscape", if three { PAGE_MM } else { 110.0 }, if three { 128.0 } else { 96.0 });
        figure.caption = self.caption(three);
        let (left, right, top, between, below) = (38.0, 46.0, 34.0, 42.0, 30.0);
        let cell = (figure.width - right + 12.0) / pairs.len() as f64;
        let width = cell - left - 12.0;
        let height = (figure.height - top - below - 48.0 * (rows - 1) as f64) / rows as f64;
        let shade = Shade { map: ColourMap::Cividis, low: DARKEST, high: 0.0 };
        for row in 0..rows {
            for (column, &[i, j]) in pairs.iter().enumerate() {
                let frame = Rect {
                    left: left + column as f64 * cell,
                    top: top + row as f64 * (height + between),
                    width,
                    height,
                };
                let panel = Panel { frame, x: self.axis(i), y: self.axis(j) };
                self.plane(&mut figure, &panel, [i, j], row == 1, shade);
                let text = self.title([i, j], row == 1);
                figure.text(&text, [frame.centre()[0], frame.top - 4.0], Font::SMALL, Align::Centre, 0.0);
                if column + 1 == pairs.len() {
                    shade.upright_bar(&mut figure, frame, "√Δ*χ*^{2}");
                }
            }
        }
        let middle = 0.5 * (figure.width - 8.0);
        self.legend().row(&mut figure, [middle, 10.0]);
        figure
    }

    fn title(&self, shown: [usize; 2], lowest: bool) -> String {
        let Some(other) = (0..self.grid.axes.len()).find(|k| !shown.contains(k)) else { return String::new() };
        let (symbol, _) = symbol(&self.grid.axes[other].name);
        let value = self.nodes[other][self.lowest[other]];
        if lowest {
            format!("lowest over {symbol}")
        } else {
            {
                let digits = super::symbols::decimals(self.grid.axes[other].spacing());
                format!("slice at {symbol} = {value:.digits$}")
            }
        }
    }

    fn plane(&self, figure: &mut Figure, panel: &Panel, shown: [usize; 2], lowest: bool, shade: Shade) {
        let [i, j] = shown;
        let value = |a: usize, b: usize| self.value(shown, [a, b], lowest);
        let (x, y) = (&self.nodes[i], &self.nodes[j]);
        let (x_edges, y_edges) = (edges(x), edges(y));
        let tile = |(a, b): (usize, usize)| Tile {
            x: [x_edges[a], x_edges[a + 1]],
            y: [y_edges[b], y_edges[b + 1]],
            value: value(a, b).sqrt(),
        };
        panel.tiles(figure, (0..x.len()).flat_map(|a| (0..y.len()).map(move |b| (a, b))).map(tile), shade);
        for level in LEVELS {
            for line in contour(x, y, value, level) {
                panel.line(figure, "contour", &line, CONTOUR_PEN);
            }
        }
        if let Some(paraboloid) = &self.paraboloid {
            paraboloid.draw(figure, panel, shown, &LEVELS, lowest || self.grid.axes.len() == 2);
        }
        if let Some(chain) = self.chain.as_ref().filter(|_| lowest || self.grid.axes.len() == 2) {
            self.chain_contours(figure, panel, chain, shown);
        }
        if let Some(truth) = self.truth[i].zip(self.truth[j]) {
            panel.points(figure, "truth-point", &[[truth.0, truth.1]], (Marker::Cross, 5.5, VERMILION));
        }
        panel.frame(figure, Sides::BOTH);
    }

    /// Difference of chi2 at a pair of nodes: in the slice through the lowest, or the lowest over the other axis.
    fn value(&self, shown: [usize; 2], at: [usize; 2], lowest: bool) -> f64 {
        let mut position = self.lowest.clone();
        (position[shown[0]], position[shown[1]]) = (at[0], at[1]);
        let other = (0..position.len()).find(|k| !shown.contains(k)).filter(|_| lowest);
        let Some(other) = other else { return self.at(&position) };
        let along = (0..self.nodes[other].len()).map(|k| {
            position[other] = k;
            self.at(&position)
        });
        along.fold(f64::NAN, f64::min)
    }

    fn chain_contours(&self, figure: &mut Figure, panel: &Panel, chain: &Sampled, shown: [usize; 2]) {
        let draws = shown.map(|k| {
            let axis = &self.grid.axes[k];
            let number = chain.summary.names.iter().position(|name| *name == axis.name).unwrap_or(0);
            let draws = chain.draws(number).into_iter().map(|x| turned(axis, &self.nodes[k], x));
            draws.collect::<Vec<f64>>()
        });
        let both: Vec<[f64; 2]> = draws[0].iter().zip(&draws[1]).map(|(x, y)| [*x, *y]).collect();
        // the range of the draws: the axes may extend much further
        let everywhere = [f64::NEG_INFINITY, f64::INFINITY];
        let range = draws.map(|draws| super::trace::shown_range(&draws, everywhere, None, Scale::Linear));
        let Some(density) = Density::of(&both, chain.effective(), range) else { return };
        for share in SHARES {
            for line in density.contours(share) {
                panel.line(figure, "chain", &line, CHAIN_PEN);
            }
        }
    }

    fn legend(&self) -> Legend {
        let mut legend = Legend::default();
        legend.add(Key::Line(CONTOUR_PEN), "Δ*χ*^{2} = 2.30, 5.99");
        if self.paraboloid.is_some() {
            legend.add(Key::Line(paraboloid::PEN), "paraboloid");
        }
        if self.chain.is_some() {
            legend.add(Key::Line(CHAIN_PEN), "chain, 68 and 95 %");
        }
        if self.truth.iter().any(Option::is_some) {
            legend.add(Key::Point(Marker::Cross, VERMILION), "injected");
        }
        legend
    }

    fn caption(&self, three: bool) -> String {
        let rows = match three {
            true => {
                " Above: slices through the lowest node, with the section of the paraboloid through its vertex. \
                Below: the lowest \
                 chi2 over the third axis, with the projection of the paraboloid."
            }
            false => "",
        };
        let paraboloid = match self.paraboloid {
            Some(_) => " Cross: vertex of the paraboloid with its error bars, Delta chi2 = 1.",
            None => "",
        };
        let chain = if self.chain.is_some() { " Dashed: 68 and 95 % of the chain." } else { "" };
        format!(
            "Likelihood grid: root of chi2 = -2 ln L minus its lowest value, {DARKEST} and more in the darkest colour, \
             nodes without a reconstruction white.{rows} Contours of grid and paraboloid: Delta chi2 = 2.30 and 5.99, \
             68 and 95 % of two Gaussian parameters.{paraboloid}{chain}"
        )
    }
}

/// The contours of the likelihood grid are below all others, and wide enough to be visible on both sides of a line
/// along them.
const CONTOUR_PEN: Stroke = Stroke::new(Colour([40, 40, 40, 150]), 2.4);

const CHAIN_PEN: Stroke = Stroke::new(BLUE, 1.1).dashed();

/// Values of the nodes of an axis, rising: a periodic one leaves [0, 1) instead of wrapping.
fn nodes(axis: &GridAxis) -> Vec<f64> {
    (0..axis.nodes).map(|k| axis.min + k as f64 * axis.spacing()).collect()
}

/// Borders half way between nodes.
fn edges(nodes: &[f64]) -> Vec<f64> {
    let half = 0.5 * (nodes[1] - nodes[0]);
    std::iter::once(nodes[0] - half).chain(nodes.iter().map(|x| x + half)).collect()
}
