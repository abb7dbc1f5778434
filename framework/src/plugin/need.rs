//! The needs of plugins.

/// A plugin that another needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Need {
    /// Name of the plugin needed; `navfuse-core` is the framework.
    pub plugin: &'static str,
    /// Versions that meet the need, as in Cargo.toml: `"0.1"`, `">=0.1.3, <0.3"`.
    pub version: &'static str,
}
