//! Solar-like differential rotation `Omega(b) = Omega_eq - dOmega sin^2 b`.

/// The star's rotation law (rad/d).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rotation {
    /// Angular velocity of the equator (rad/d).
    pub omega_eq_rad_d: f64,
    /// Equator minus pole (rad/d); the paper's gamma is `dOmega / Omega_eq`.
    pub domega_rad_d: f64,
}

impl Rotation {
    /// Angular velocity (rad/d) at the latitude whose sine is given.
    pub fn angular_velocity(&self, sin_latitude: f64) -> f64 {
        self.omega_eq_rad_d - self.domega_rad_d * sin_latitude * sin_latitude
    }

    /// Angular velocity over that of the equator.
    pub fn relative(&self, sin_latitude: f64) -> f64 {
        self.angular_velocity(sin_latitude) / self.omega_eq_rad_d
    }
}
