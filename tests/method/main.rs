//! The method against independent numbers, limit cases and itself: the library alone.

mod common;
mod data_sets;
mod marginal;

mod chain;
mod ensemble;
mod expansion;
mod exposures;
mod field;
mod field_algebra;
mod field_settling;
mod figure;
mod first_look;
mod forward;
mod imaging;
mod indicators;
mod light;
mod lsd;
mod maps;
mod nuisances;
mod objective;
mod oracle;
mod paraboloid;
mod pixels;
mod plan;
mod posterior;
mod response;
mod round_trips;
mod simulate;
mod surface;
mod surrogate;
