//! Maps of an evolving star: one for each night, and the mean standard deviation, in flattened polar projection and in
//! Mollweide's.

use super::projection::{Projection, SOUTHERNMOST_DEG};
use super::star_map::{degrees, parallels, rotation_arrow};
use super::surface::{PixelMap, Scale, graticule, photosphere};
use super::{ANY, PlotError, velocities};
use crate::data::io::csv::Columns;
use crate::data::io::map::{MAP, MapAt, MapColumns, MapFile};
use crate::figures::drawing::colour::{BLACK, ColourMap, GREY};
use crate::figures::drawing::panel::Shade;
use crate::figures::drawing::{Align, Figure, Font, PAGE_MM, Paint, Point, Rect, Stroke, open};
use crate::surface::SpotField;
use std::path::Path;

/// Profiles no further from a map's time than this (d) belong to the same night.
const SAME_NIGHT_D: f64 = 0.5;

/// Pixels of the whole star in a picture of 1 pt of radius: finer ones are invisible.
const PIXELS_PER_PT2: f64 = 1.5;

/// Numbers around small maps.
const TINY: Font = Font { size: 5.5, colour: BLACK };

/// One of the maps.
struct Night {
    time_d: f64,
    filling: PixelMap,
}

/// All maps with their common properties.
pub(super) struct Nights {
    maps: Vec<Night>,
    /// Mean standard deviation of the filling factors.
    sd: PixelMap,
    filling_scale: Scale,
    sd_scale: Scale,
    inclination_deg: f64,
    /// Times (d) and rotation cycles of the profiles.
    observed: Vec<[f64; 2]>,
    field: SpotField,
}

impl Nights {
    /// The maps in `folder`, from `file`.
    pub fn read(folder: &Path, file: &MapFile) -> Result<Self, PlotError> {
        let pixels: usize = file.ring_pixels.iter().sum();
        let wrong = |problem: &str| PlotError::Content { path: folder.join(MAP), problem: problem.into() };
        let of_time = |map: &MapAt| {
            let (MapColumns::Spots { spot_filling, .. }, Some(sd)) = (&map.pixels, &map.sigma_spot_filling) else {
                return None;
            };
            let is_whole = spot_filling.len() == pixels && sd.len() == pixels && pixels > 0;
            let filling = PixelMap { ring_pixels: file.ring_pixels.clone(), values: spot_filling.clone() };
            is_whole.then(|| (Night { time_d: map.time_d.unwrap_or(0.0), filling }, sd.clone()))
        };
        let Some(read) = file.maps.iter().map(of_time).collect::<Option<Vec<_>>>() else {
            return Err(wrong("ring_pixels, spot_filling and sigma_spot_filling do not belong together"));
        };
        let (maps, errors): (Vec<Night>, Vec<Vec<f64>>) = read.into_iter().unzip();
        let (Some(field), false) = (&file.field, maps.is_empty()) else { return Err(wrong("holds no map")) };
        let mean = |k: usize| errors.iter().map(|sd| sd[k]).sum::<f64>() / errors.len() as f64;
        let sd = PixelMap { ring_pixels: file.ring_pixels.clone(), values: (0..pixels).map(mean).collect() };
        let observed = match folder.join(velocities::FILE) {
            table if table.is_file() => {
                let table = Columns::read(&table)?;
                let (times, cycles) = (table.column_within("time_d", ANY)?, table.column_within("cycle", ANY)?);
                times.iter().zip(cycles).map(|(time, cycle)| [*time, *cycle]).collect()
            }
            _ => Vec::new(),
        };
        let reach = reach(maps.iter().flat_map(|map| &map.filling.values));
        let lowest = sd.values.iter().copied().fold(f64::MAX, f64::min);
        let amplitude = field.spot_amplitude;
        Ok(Nights {
            // spots dark, pixels brighter than the photosphere blue
            filling_scale: Scale {
                shade: Shade { map: ColourMap::Brightness, low: reach, high: -reach },
                photosphere: 0.0,
            },
            sd_scale: Scale {
                // from the next tenth of the amplitude below the smallest value
                shade: Shade {
                    map: ColourMap::Cividis,
                    low: amplitude * (10.0 * lowest / amplitude).floor().clamp(0.0, 9.0) / 10.0,
                    high: amplitude,
                },
                photosphere: amplitude,
            },
            maps,
            sd,
            inclination_deg: file.parameters.state().inclination.to_degrees(),
            observed,
            field: field.clone(),
        })
    }

    /// Colours of the filling factors.
    pub fn scale(&self) -> Scale {
        self.filling_scale
    }

    /// Times (d) with their maps.
    pub fn maps(&self) -> impl Iterator<Item = (f64, &PixelMap)> {
        self.maps.iter().map(|map| (map.time_d, &map.filling))
    }

    /// The figures.
    pub fn figures(&self) -> Vec<Figure> {
        vec![self.draw(Kind::Polar), self.draw(Kind::Mollweide)]
    }

    fn draw(&self, kind: Kind) -> Figure {
        // the last panel is the standard deviation
        let panels = self.maps.len() + 1;
        let columns = kind.columns(panels);
        let mut figure = Figure::new(kind.name(), PAGE_MM, 100.0);
        let cell = ((figure.width - MARGIN[0] - MARGIN[1]) / columns as f64).min(WIDEST);
        let (radius, block) = kind.measures(cell);
        let rows = panels.div_ceil(columns);
        figure.height = block * rows as f64 + 44.0;
        figure.caption = self.caption(kind);
        let left = MARGIN[0] + 0.5 * (figure.width - MARGIN[0] - MARGIN[1] - cell * columns as f64);
        for k in 0..panels {
            let (row, column) = (k / columns, k % columns);
            let place = [left + cell * (column as f64 + 0.5), block * row as f64];
            let (title, pixels, scale) = match self.maps.get(k) {
                Some(map) => (format!("{:.2} d", map.time_d), &map.filling, self.filling_scale),
                None => ("mean standard deviation".to_owned(), &self.sd, self.sd_scale),
            };
            figure.text(&title, [place[0], place[1] + 9.0], Font::SMALL, Align::Centre, 0.0);
            let times = self.maps.get(k).map(|map| map.time_d);
            let is_labelled = k == 0 || k + 1 == panels;
            match kind {
                Kind::Polar => {
                    let centre = [place[0], place[1] + 23.0 + radius];
                    let projection = Projection::Polar { centre, radius };
                    self.paint(&mut figure, pixels, projection, scale);
                    let sides = [column == 0, column + 1 == columns || k + 1 == panels];
                    self.around(&mut figure, times, (centre, radius), (is_labelled, sides));
                }
                Kind::Mollweide => {
                    let centre = [place[0], place[1] + 14.0 + radius];
                    self.paint(&mut figure, pixels, Projection::Mollweide { centre, radius }, scale);
                    let sides = [column == 0, k + columns >= panels];
                    self.beside(&mut figure, times, (centre, radius), sides);
                }
            }
        }
        self.bars(&mut figure);
        figure
    }

    fn caption(&self, kind: Kind) -> String {
        let count = match self.maps.len() {
            1 => "The map".to_owned(),
            all => format!("{all} maps"),
        };
        let life = match self.field.lifetime_d() {
            Some(days) => format!("with a spot lifetime of {days} d"),
            None => "with static spots".to_owned(),
        };
        let how = match kind {
            Kind::Polar => {
                "Flattened polar projection down to latitude −30°: parallels at +60°, +30° and 0° (bold). Numbers \
                outside are the rotation phases at which a meridian faces the observer, ticks the phases observed \
                within half a day; arrows show the sense of rotation."
            }
            Kind::Mollweide => {
                "Mollweide projection; longitude = 360° (1 − phase). Ticks below are the longitudes that faced the \
                observer within half a day."
            }
        };
        format!(
            "{count} of a star {life}: most probable spot filling factor; negative where brighter than the \
            photosphere. Last: standard deviation, the mean over all maps; {:.2} where the profiles do not constrain \
            the map. {how} Latitudes that are never visible are grey.",
            self.field.spot_amplitude
        )
    }

    fn paint(&self, figure: &mut Figure, pixels: &PixelMap, projection: Projection, scale: Scale) {
        photosphere(figure, projection, scale);
        let (finest, southernmost) = match projection {
            Projection::Polar { radius, .. } => (PIXELS_PER_PT2 * radius * radius, SOUTHERNMOST_DEG),
            Projection::Mollweide { radius, .. } => (2.0 * PIXELS_PER_PT2 * radius * radius, -90.0),
        };
        pixels.coarser(finest as usize).paint(figure, projection, scale);
        let unseen = [southernmost, -self.inclination_deg];
        if unseen[1] > unseen[0] {
            figure.polygon("unseen", &projection.patch([0.0, 360.0], unseen), Paint::fill(GREY));
        }
        graticule(figure, projection);
    }

    /// Rotation cycles observed in the night of a time (d).
    fn cycles_of(&self, time_d: Option<f64>) -> impl Iterator<Item = f64> {
        let near = move |time: f64| time_d.is_some_and(|of| (time - of).abs() <= SAME_NIGHT_D);
        self.observed.iter().filter(move |[time, _]| near(*time)).map(|[_, cycle]| *cycle)
    }

    /// The labels around a polar map: phases, on sides without another map; those observed; latitudes; and the sense of
    /// rotation.
    fn around(
        &self,
        figure: &mut Figure,
        time_d: Option<f64>,
        (centre, radius): (Point, f64),
        (is_labelled, [left, right]): (bool, [bool; 2]),
    ) {
        let toward = |phase: f64, distance: f64| {
            let (sin, cos) = (-360.0 * phase).to_radians().sin_cos();
            [centre[0] + distance * sin, centre[1] + distance * cos]
        };
        for cycle in self.cycles_of(time_d) {
            let tick = [toward(cycle, radius + 0.8), toward(cycle, radius + 4.5)];
            figure.path("observed-phase", open(&tick), Paint::stroke(Stroke::new(BLACK, 0.7)));
        }
        for (phase, text, align, down, is_shown) in [
            (0.0, "phase 0", Align::Centre, 4.5, true),
            (0.25, "0.25", Align::Right, 2.0, left),
            (0.5, "0.5", Align::Centre, -0.5, true),
            (0.75, "0.75", Align::Left, 2.0, right),
        ] {
            if !is_shown {
                continue;
            }
            let at = toward(phase, radius + 5.5);
            let text = if is_labelled { text } else { text.trim_start_matches("phase ") };
            figure.text(text, [at[0], at[1] + down], TINY, align, 0.0);
        }
        if is_labelled {
            parallels(figure, Projection::Polar { centre, radius }, &[60.0, 30.0, 0.0], TINY);
        }
        let corner = [centre[0] + 0.86 * radius, centre[1] + 0.86 * radius];
        rotation_arrow(figure, corner, 4.0, if is_labelled { "rotation" } else { "" });
    }

    /// The labels beside a map in Mollweide's projection: latitudes to the left, longitudes below.
    fn beside(
        &self,
        figure: &mut Figure,
        time_d: Option<f64>,
        (centre, radius): (Point, f64),
        [left, below]: [bool; 2],
    ) {
        let projection = Projection::Mollweide { centre, radius };
        let bottom = centre[1] + radius;
        for cycle in self.cycles_of(time_d) {
            let x = projection.place((-360.0 * cycle).rem_euclid(360.0), 0.0)[0];
            let tick = open(&[[x, bottom + 1.5], [x, bottom + 5.0]]);
            figure.path("observed-phase", tick, Paint::stroke(Stroke::new(BLACK, 0.7)));
        }
        if left {
            for latitude in [-60.0, -30.0, 0.0, 30.0, 60.0_f64] {
                let [x, y] = projection.place(0.0, latitude);
                let at = [x - 2.0 - latitude.abs() / 16.0, y + 2.0];
                figure.text(&degrees(latitude), at, TINY, Align::Right, 0.0);
            }
        }
        if below {
            for longitude in [0.0, 90.0, 180.0, 270.0, 360.0] {
                let at = [projection.place(longitude, 0.0)[0], bottom + 11.5];
                // those of neighbours do not touch
                let align = match longitude {
                    0.0 => Align::Left,
                    360.0 => Align::Right,
                    _ => Align::Centre,
                };
                figure.text(&format!("{longitude}°"), at, TINY, align, 0.0);
            }
        }
    }

    fn bars(&self, figure: &mut Figure) {
        let (half, top) = (0.5 * figure.width, figure.height - 30.0);
        for (middle, scale, label) in [
            (0.5 * half, self.filling_scale, "spot filling factor"),
            (1.5 * half, self.sd_scale, "standard deviation of the filling factor"),
        ] {
            let bar = Rect { left: middle - 70.0, top, width: 140.0, height: 6.0 };
            scale.shade.lying_bar(figure, bar, label);
        }
    }
}

/// Room to the left and to the right (pt).
const MARGIN: [f64; 2] = [15.0, 15.0];

/// Width of the widest map with its labels (pt).
const WIDEST: f64 = 165.0;

/// Fraction of the pixels within the colour scale: single ones beyond have the colour of its end.
const SHOWN: f64 = 0.999;

/// Range of the colour scale to either side of 0: in steps of 0.05.
fn reach<'a>(values: impl Iterator<Item = &'a f64>) -> f64 {
    let mut sizes: Vec<f64> = values.map(|x| x.abs()).filter(|x| x.is_finite()).collect();
    sizes.sort_by(f64::total_cmp);
    let highest = sizes.get(((sizes.len() as f64 - 1.0) * SHOWN).ceil().max(0.0) as usize).copied().unwrap_or(0.0);
    ((20.0 * highest - 1e-9).ceil() / 20.0).clamp(0.05, 1.0)
}

/// The projection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Polar,
    Mollweide,
}

impl Kind {
    fn name(self) -> &'static str {
        match self {
            Kind::Polar => "maps",
            Kind::Mollweide => "maps_mollweide",
        }
    }

    /// Panels side by side, so that a page contains all nights of most campaigns.
    fn columns(self, panels: usize) -> usize {
        let most = match (self, panels) {
            (Kind::Polar, ..=20) => 5,
            (Kind::Polar, 21..=36) => 6,
            (Kind::Polar, _) => 8,
            (Kind::Mollweide, ..=18) => 3,
            (Kind::Mollweide, 19..=32) => 4,
            (Kind::Mollweide, _) => 5,
        };
        panels.min(most)
    }

    /// Radius of a map in a cell of that width, and height of the cell (pt).
    fn measures(self, cell: f64) -> (f64, f64) {
        match self {
            Kind::Polar => {
                let radius = 0.5 * cell - 9.0;
                (radius, 2.0 * radius + 40.0)
            }
            Kind::Mollweide => {
                let radius = 0.25 * (cell - 12.0);
                (radius, 2.0 * radius + 30.0)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scale_goes_by_what_is_on_the_star() {
        let mut values = vec![0.0; 5000];
        values[..40].fill(-0.31);
        assert_eq!(reach(values.iter()), 0.35);
        // one pixel alone does not widen it
        values[0] = 0.9;
        assert_eq!(reach(values.iter()), 0.35);
        assert_eq!(reach([0.0, 0.001].iter()), 0.05);
        assert_eq!(reach([7.0].iter()), 1.0);
        assert_eq!(reach([].iter()), 0.05);
    }
}
