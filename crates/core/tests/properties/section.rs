//! The axis of the bending section: its tangent, and its ends.

use crate::math::linear::{add, dot};
use crate::model::instrument::Instrument;

#[test]
fn tangent_is_the_derivative_of_the_axis_and_the_end_is_where_the_tip_begins() {
    let at_end = Instrument::new(30e-3, 0.0, 0.0, 1.75e-3, 4e-3).unwrap();
    for state in [[20e-3, 0.4, 1.6], [35e-3, -1.9, 0.0], [10e-3, 2.0, -0.2]] {
        let [end, _] = at_end.markers(state);
        assert_eq!(at_end.section(state, 0.0), Some((end.position, end.axis)));
        for distance in [2e-3, 9e-3, 25e-3] {
            let step = 1e-6;
            let [near, here, far] =
                [-step, 0.0, step].map(|by| at_end.section(state, distance + by).unwrap());
            let slope = add(near.0, -1.0, far.0).map(|value| value / (2.0 * step));
            let error = add(slope, -1.0, here.1);
            assert!(dot(error, error).sqrt() < 1e-6, "{state:?} {distance}");
        }
        assert_eq!(at_end.section(state, 31e-3), None);
    }
}
