//! Files in and out: LSD profiles, the chain's journal, maps, exports. No decisions are taken here.

pub mod atomic;
pub mod csv;
pub mod journal;
pub mod lsd;
pub mod map;
pub mod provenance;
pub mod truth;
