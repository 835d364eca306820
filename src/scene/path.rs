//! Camera paths: `PATH.json`.
