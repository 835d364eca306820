//! The plugin tree that XML and JSON both parse into.
