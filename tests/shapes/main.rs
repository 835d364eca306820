//! Scenes as exporters and papers write them: shapes by the thousand, sensors, films, integrators and emitters, against the
//! images that Mitsuba 3.9.1 makes of the same files.

mod crowds;
mod emitters;
mod integrators;
mod measure;
mod sensors;
