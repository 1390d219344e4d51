//! Hard-edged circular spots and faculae: the filling factor and the excess of brightness of a point of the surface.
//!
//! Spots may evolve: the area of one grows linearly to its maximum and decays again, over twice its lifetime. Positions
//! are those of the map, whose longitudes refer to the epoch; differential rotation moves them. An evolving spot is
//! circular at the time of its largest area, so that on the map it is sheared the opposite way.

use std::f64::consts::PI;

/// A circle on the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disc {
    /// Longitude of its centre (rad).
    pub longitude: f64,
    /// Latitude of its centre (rad).
    pub latitude: f64,
    /// Angular radius (rad).
    pub radius: f64,
}

impl Disc {
    /// Whether the point at (longitude, latitude), both rad, lies inside.
    pub fn contains(&self, longitude: f64, latitude: f64) -> bool {
        let cos_distance = self.latitude.sin() * latitude.sin()
            + self.latitude.cos() * latitude.cos() * (longitude - self.longitude).cos();
        cos_distance >= self.radius.cos()
    }

    /// Whether a feature at (longitude, latitude) that extends to `reach` from there (all rad) may overlap it.
    pub fn may_touch(&self, longitude: f64, latitude: f64, reach: f64) -> bool {
        // larger than the rounding error of an arc cosine
        const MARGIN: f64 = 1e-6;
        let radius = (self.radius + reach + MARGIN).min(PI);
        Disc { radius, ..*self }.contains(longitude, latitude)
    }
}

/// A circular spot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// Longitude of its centre (rad).
    pub longitude: f64,
    /// Latitude of its centre (rad).
    pub latitude: f64,
    /// Angular radius (rad), at its largest.
    pub radius: f64,
    /// Spot filling factor inside it, in [0, 1].
    pub filling: f64,
    /// Its evolution in time; `None` if static.
    pub life: Option<Life>,
}

/// The evolution of a spot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Life {
    /// Time of its largest area (d).
    pub peak_d: f64,
    /// Full width at half maximum of its area in time (d).
    pub lifetime_d: f64,
    /// Rotation of the equator relative to the pole from the epoch to that time (rad).
    pub winding: f64,
}

impl Life {
    /// Its area at a time (d) over the largest.
    pub fn area(&self, time_d: f64) -> f64 {
        (1.0 - (time_d - self.peak_d).abs() / self.lifetime_d).max(0.0)
    }
}

impl Spot {
    /// Its circle at the largest area, when it is circular.
    pub fn disc(&self) -> Disc {
        Disc { longitude: self.longitude, latitude: self.latitude, radius: self.radius }
    }

    /// Its radius (rad) at a time (d), 0 while it is absent. The area of a cap of radius r is 4 pi sin^2(r / 2).
    pub fn radius_at(&self, time_d: f64) -> f64 {
        match self.life {
            Some(life) => 2.0 * (life.area(time_d).sqrt() * (0.5 * self.radius).sin()).asin(),
            None => self.radius,
        }
    }

    /// Whether it covers the point at (longitude, latitude), both rad.
    fn covers(&self, longitude: f64, latitude: f64) -> bool {
        self.disc().contains(longitude + self.unwinding(latitude), latitude)
    }

    /// Whether a feature at (longitude, latitude) that extends to `reach` from there (all rad) may overlap it.
    pub fn may_touch(&self, longitude: f64, latitude: f64, reach: f64) -> bool {
        let winding = self.life.map_or(0.0, |life| life.winding.abs());
        // the relative rotation of two latitudes is at most the winding times their distance
        self.disc().may_touch(longitude + self.unwinding(latitude), latitude, reach * (1.0 + winding))
    }

    /// Offset of longitudes at a latitude in the frame where the spot is circular.
    fn unwinding(&self, latitude: f64) -> f64 {
        match self.life {
            Some(Life { winding, .. }) if winding != 0.0 => {
                winding * (self.latitude.sin().powi(2) - latitude.sin().powi(2))
            }
            _ => 0.0,
        }
    }

    /// Its values in a config: longitude, latitude and radius (degrees), filling factor, and if it evolves the time of
    /// its largest area and its lifetime (d).
    pub fn written(&self) -> Vec<f64> {
        // conversion to radians and back changes the last digit
        let degrees = |x: f64| (1e9 * x.to_degrees()).round() / 1e9;
        let Spot { longitude, latitude, radius, filling, life } = *self;
        let mut numbers = vec![degrees(longitude), degrees(latitude), degrees(radius), filling];
        numbers.extend(life.iter().flat_map(|life| [life.peak_d, life.lifetime_d]));
        numbers
    }
}

/// The spots present at a time (d), with their sizes then.
pub fn spots_at(spots: &[Spot], time_d: f64) -> Vec<Spot> {
    let at = spots.iter().map(|spot| Spot { radius: spot.radius_at(time_d), ..*spot });
    at.filter(|spot| spot.radius > 0.0).collect()
}

/// A circular facula.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Facula {
    /// Its circle.
    pub disc: Disc,
    /// Brightness inside it minus that of the photosphere, which is 1; above 0.
    pub excess: f64,
}

/// Filling factor at a point: the largest of the spots that cover it, 0 elsewhere.
pub fn filling_at(spots: &[Spot], longitude: f64, latitude: f64) -> f64 {
    largest(spots.iter().filter(|s| s.covers(longitude, latitude)).map(|s| s.filling))
}

/// Excess of brightness at a point: the largest of the faculae that cover it, on the part of the surface that `spots`
/// leave free; 0 elsewhere.
pub fn excess_at(faculae: &[Facula], spots: &[Spot], longitude: f64, latitude: f64) -> f64 {
    let excess = largest(faculae.iter().filter(|f| f.disc.contains(longitude, latitude)).map(|f| f.excess));
    if excess > 0.0 { excess * (1.0 - filling_at(spots, longitude, latitude)) } else { 0.0 }
}

fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, f64::max)
}
