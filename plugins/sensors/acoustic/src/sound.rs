//! The speed of sound along the path of a signal, a state that sensors share.

use navfuse_core::prelude::*;

/// Speed of sound between vehicle and transponder, as it acts on ranges: a state to which acoustic
/// sensors refer by name.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SoundSpeed {
    /// Speed of sound that the instruments are set to, as a multiple of the true mean speed along the
    /// path; a range is read too long by this factor. Default: 1.
    #[serde(default)]
    pub ratio: ScaleFactor,
}

impl ProcessType for SoundSpeed {
    const TYPE: &'static str = "sound-speed";

    fn build(self, composer: &mut Composer) -> Result<BuiltProcess, ComposeError> {
        self.ratio.block::<Scalar>(composer, "ratio", &[1.0], display::RATIO)?;
        Ok(BuiltProcess::new(OwnDynamics))
    }
}

/// Ratio of the speeds of sound of a range: the state of a `[process.NAME]`, or 1 without one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ratio(Option<Handle<Scalar>>);

impl Ratio {
    /// Finds the state of the process that the key `sound` names.
    pub fn find(composer: &Composer, name: Option<&str>) -> Result<Self, ComposeError> {
        let find = |name| composer.find("sound", &format!("{name}.ratio"));
        name.map(find).transpose().map(Self)
    }

    pub fn get<T: navfuse_core::Real>(&self, x: &View<'_, T>) -> T {
        self.0.map_or_else(T::one, |ratio| x.get(ratio))
    }
}
