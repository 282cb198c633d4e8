//! What is swept: named parameters with values.

use std::borrow::Cow;
use std::fmt;

use sweep_parameter::{Channel, Parameter, UnknownParameter};

use crate::build::Build;
use crate::method::Integrator;

/// What can be swept. A value of this type is what a grid file sets of the model, the same at every
/// point but for the axes.
///
/// Further traits ask for the rest: [`crate::config::Read`] for its part of a grid file,
/// [`crate::store::Rows`] for the columns of its rows, [`crate::swept::Swept`] for the engine that
/// computes them.
pub trait Model: Clone + PartialEq + fmt::Debug + Send + Sync + Sized + 'static {
    /// A number that can be set and swept.
    type Parameter: Parameter;
    /// A motion that is compared.
    type Channel: Channel;
    /// The methods of integration.
    type Integrator: Integrator;

    /// Which build writes a result.
    const BUILD: Build;

    /// Every channel.
    fn channels() -> &'static [Self::Channel];

    /// Channels that are compared if the grid file names none.
    fn default_channels() -> Vec<Self::Channel> {
        Self::channels().to_vec()
    }

    /// Every parameter there is.
    fn parameters(&self) -> Vec<Self::Parameter>;

    /// The parameter of this name.
    ///
    /// # Errors
    /// Why there is none.
    fn find(&self, name: &str) -> Result<Self::Parameter, UnknownParameter>;

    /// Names of the single numbers that a parameter writes; one, its own, unless it writes several.
    fn parts(&self, parameter: &Self::Parameter) -> Vec<Cow<'static, str>> {
        vec![parameter.name().to_owned().into()]
    }

    /// Writes a parameter's value, which is in its range.
    fn write(&mut self, parameter: &Self::Parameter, value: f64);
}
