//! Hard-edged circular spots: the filling factor of a point of the surface.

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
    /// Whether the point at (longitude, latitude), both rad, lies inside.
    pub fn contains(&self, longitude: f64, latitude: f64) -> bool {
        let cos_distance = self.latitude.sin() * latitude.sin()
            + self.latitude.cos() * latitude.cos() * (longitude - self.longitude).cos();
        cos_distance >= self.radius.cos()
    }
}

/// Filling factor at a point: the largest of the spots that cover it, 0 elsewhere.
pub fn filling_at(spots: &[Spot], longitude: f64, latitude: f64) -> f64 {
    spots.iter().filter(|s| s.contains(longitude, latitude)).map(|s| s.filling).fold(0.0, f64::max)
}
