//! Tests of the scattering models: against Mitsuba, against their own densities, and against physics.

mod energy;
mod lobes;
mod models;
mod reference;
mod sampling;
