//! Files in and out: LSD profiles, the chain's journal, maps, exports. No decisions are taken here.

pub mod journal;
pub mod lsd;
