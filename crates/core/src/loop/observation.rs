//! Output of a sensor at one time, for a profile.

use crate::estimation::history::Entry;
use crate::r#loop::measurement::Measurement;
use crate::r#loop::profile::Profile;

/// Output of a sensor at one time, from which a profile makes its measurement.
pub(crate) trait Observation<P: Profile<N>, const N: usize> {
    /// What a report says of it.
    type View: Copy;

    /// Whether each measurement is to be complete; else several sensors may share the DOFs.
    const IS_WHOLE: bool = true;

    /// Whether it has any feature or value.
    fn is_usable(&self) -> bool;

    /// The measurement; None where the model of the sensor predicts no features.
    fn measure(
        &self,
        profile: &P,
        past: &Entry<N>,
    ) -> Option<(Measurement<N, P::Evidence>, Self::View)>;

    /// Whether its two markers look exchanged.
    fn is_exchanged(&self, _: &Self::View) -> bool {
        false
    }

    /// Whether it `fits` with its two markers exchanged, by its distance.
    fn fits_exchanged(&self, _: &P, _: &Entry<N>, _: impl Fn(f64) -> bool) -> bool {
        false
    }
}
