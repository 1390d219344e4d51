//! Hard-edged circular spots and faculae: the filling factor and the excess of brightness of a point of the surface.

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
}

/// A circular spot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// Longitude of its centre (rad).
    pub longitude: f64,
    /// Latitude of its centre (rad).
    pub latitude: f64,
    /// Angular radius (rad).
    pub radius: f64,
    /// Spot filling factor inside it, in [0, 1].
    pub filling: f64,
}

impl Spot {
    /// The circle that it fills.
    pub fn disc(&self) -> Disc {
        Disc { longitude: self.longitude, latitude: self.latitude, radius: self.radius }
    }
}

/// A circular facula.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Facula {
    /// Where it is.
    pub disc: Disc,
    /// Brightness inside it minus that of the photosphere, which is 1; above 0.
    pub excess: f64,
}

/// Filling factor at a point: the largest of the spots that cover it, 0 elsewhere.
pub fn filling_at(spots: &[Spot], longitude: f64, latitude: f64) -> f64 {
    largest(spots.iter().filter(|s| s.disc().contains(longitude, latitude)).map(|s| s.filling))
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
