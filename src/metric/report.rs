//! `metrics.json` and `index.html`.
