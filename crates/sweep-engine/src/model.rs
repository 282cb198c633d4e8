//! The trait of models: named parameters with values.

use std::borrow::Cow;
use std::fmt;

use sweep_parameter::{Channel, Parameter, UnknownParameter};

use crate::build::Build;
use crate::method::Integrator;

/// A model that can be swept. A value holds the model's parameters as a grid file sets them; the
/// points of a plan differ from it in the values of the axes only.
///
/// [`crate::config::Read`] reads the model's part of a grid file, [`crate::store::Rows`] declares
/// the columns of its rows, and [`crate::swept::Swept`] creates the engine that computes them.
pub trait Model: Clone + PartialEq + fmt::Debug + Send + Sync + Sized + 'static {
    /// The type of parameters, which can be set and swept.
    type Parameter: Parameter;
    /// The type of channels, the compared motions.
    type Channel: Channel;
    /// The type of integration methods.
    type Integrator: Integrator;

    /// The build that results name.
    const BUILD: Build;

    /// Returns every channel.
    fn channels() -> &'static [Self::Channel];

    /// Returns the channels that are compared if the grid file names none.
    fn default_channels() -> Vec<Self::Channel> {
        Self::channels().to_vec()
    }

    /// Returns every parameter.
    fn parameters(&self) -> Vec<Self::Parameter>;

    /// Returns the parameter of a name.
    ///
    /// # Errors
    /// An unknown name, with the reason.
    fn find(&self, name: &str) -> Result<Self::Parameter, UnknownParameter>;

    /// Returns the names of the single numbers that a parameter writes; by default its own name.
    fn parts(&self, parameter: &Self::Parameter) -> Vec<Cow<'static, str>> {
        vec![parameter.name().to_owned().into()]
    }

    /// Returns the model's own value of a parameter, if it has one number for it.
    fn value(&self, _: &Self::Parameter) -> Option<f64> {
        None
    }

    /// Writes a parameter's value, which is in its range.
    fn write(&mut self, parameter: &Self::Parameter, value: f64);
}
