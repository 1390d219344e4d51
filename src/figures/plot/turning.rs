//! The rotating star: a map, or maps of several times, as drawn by a page's script.

use super::content::Content;
use super::maps::Nights;
use super::surface::{PixelMap, Scale};
use super::{OriginError, PlotError};
use crate::data::io::map::{MAP, MapAt, MapColumns, MapFile};
use crate::figures::drawing::{Colour, ColourMap};
use crate::runs::origin;
use crate::star::Brightness;
use serde_json::{Value, json};
use std::f64::consts::TAU;
use std::path::Path;

/// Largest number of pixels of a map: finer ones are invisible.
const PIXELS: usize = 3000;

/// Steps of the colour scale.
const STEPS: u32 = 100;

/// The character of the first step: those that follow need no escape.
const FIRST: u32 = 0xa1;

/// Rotations that are shown one after the other; beyond, one for each map.
const ROTATIONS: f64 = 12.0;

/// One of the maps: its time (d), the origin of its longitudes (d), and the values of its pixels.
struct At {
    time_d: f64,
    epoch_d: f64,
    pixels: PixelMap,
}

/// The maps in `folder` for a script; `None` where there are none.
///
/// # Errors
/// [`PlotError`]: files that are wrong.
pub fn turning(folder: &Path) -> Result<Option<Value>, PlotError> {
    if !folder.join(MAP).is_file() {
        return Ok(None);
    }
    let file: MapFile = origin::read(folder, MAP)?;
    let (maps, scale) = match file.field {
        Some(_) => {
            let nights = Nights::read(folder, &file)?;
            let at = |(time_d, pixels): (f64, &PixelMap)| At { time_d, epoch_d: file.epoch_d, pixels: pixels.clone() };
            (nights.maps().map(at).collect::<Vec<_>>(), nights.scale())
        }
        None => of_static(&file),
    };
    let wrong = || OriginError::Content { path: folder.join(MAP), problem: "holds no whole map".into() };
    if maps.is_empty() || maps.iter().any(|map| !map.pixels.is_whole()) {
        return Err(wrong().into());
    }
    let state = file.parameters.state();
    let mut coarse: Vec<(&At, PixelMap)> = maps.iter().map(|map| (map, map.pixels.coarser(PIXELS))).collect();
    coarse.sort_by(|a, b| a.0.time_d.total_cmp(&b.0.time_d));
    let of_one = |(at, pixels): &(&At, PixelMap)| {
        let pixels = written(&pixels.values, scale);
        json!({ "time": at.time_d, "epoch": at.epoch_d, "pixels": pixels })
    };
    Ok(Some(json!({
        "inclination": state.inclination,
        "omega": TAU / file.rotation_period_d,
        "shear": state.rotation.domega_rad_d,
        "equator": state.rotation.omega_eq_rad_d,
        "rotation_epoch": file.epoch_d,
        "rings": coarse[0].1.ring_pixels,
        "colours": (0..=STEPS).map(|k| hex(scale.shade.map, k)).collect::<Vec<_>>(),
        "first": FIRST,
        "maps": coarse.iter().map(of_one).collect::<Vec<_>>(),
        "spans": spans(&coarse.iter().map(|(at, _)| at.time_d).collect::<Vec<_>>(), file.rotation_period_d),
    })))
}

/// For a static star, or one that is static within a season.
fn of_static(file: &MapFile) -> (Vec<At>, Scale) {
    let of = |columns: &MapColumns| {
        let values = match columns {
            MapColumns::BrightAndDark { brightness, .. } => brightness.clone(),
            MapColumns::Spots { spot_filling, .. } => spot_filling.clone(),
        };
        PixelMap { ring_pixels: file.ring_pixels.clone(), values }
    };
    let content = match file.maps.first().map(|map| &map.pixels) {
        Some(MapColumns::BrightAndDark { .. }) => Content::Brightness(Brightness::of_spots(file.contrast)),
        _ => Content::Spots,
    };
    let at = |map: &MapAt| {
        let (time_d, epoch_d) = match map.season {
            Some(season) => (0.5 * (season.first_d + season.last_d), season.epoch_d),
            None => (file.epoch_d, file.epoch_d),
        };
        At { time_d, epoch_d, pixels: of(&map.pixels) }
    };
    let maps: Vec<At> = file.maps.iter().map(at).collect();
    let scale = content.scale(maps.iter().flat_map(|map| map.pixels.values.iter().copied()));
    (maps, scale)
}

/// The time ranges (d) in which the star is shown: the total time, or a rotation for each map.
fn spans(times_d: &[f64], period_d: f64) -> Vec<[f64; 2]> {
    let (first, last) = (times_d[0], times_d[times_d.len() - 1]);
    match last - first {
        all if all >= period_d && all <= ROTATIONS * period_d => vec![[first, last]],
        all if all < period_d => vec![[0.5 * (first + last - period_d), 0.5 * (first + last + period_d)]],
        _ => times_d.iter().map(|time| [time - 0.5 * period_d, time + 0.5 * period_d]).collect(),
    }
}

/// Steps of the scale as characters.
fn written(values: &[f64], scale: Scale) -> String {
    let step = |value: &f64| {
        let value = if value.is_finite() { *value } else { scale.photosphere };
        let share = (value - scale.shade.low) / (scale.shade.high - scale.shade.low);
        (share.clamp(0.0, 1.0) * f64::from(STEPS)).round() as u32
    };
    values.iter().filter_map(|value| char::from_u32(FIRST + step(value))).collect()
}

fn hex(map: ColourMap, step: u32) -> String {
    let Colour([r, g, b, _]) = map.at(f64::from(step) / f64::from(STEPS));
    format!("{r:02x}{g:02x}{b:02x}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_map_has_its_rotation_where_time_is_long() {
        assert_eq!(spans(&[10.0, 14.0, 20.0], 2.0), [[10.0, 20.0]]);
        assert_eq!(spans(&[10.0], 2.0), [[9.0, 11.0]]);
        assert_eq!(spans(&[10.0, 100.0], 2.0), [[9.0, 11.0], [99.0, 101.0]]);
    }
}
