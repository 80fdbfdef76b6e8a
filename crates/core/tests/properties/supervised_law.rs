//! The compensator within supervision: a share of its gain, a limited command, a shifted reference.

use crate::article::compensator::{Compensator, CompensatorState};
use crate::article::play::Play;

use super::compensator::start;
use super::{close, path};

/// Of 5 it is 1 + 4 of that share; all else stays as it is.
#[test]
fn gain_share_scales_the_gain_beyond_one() {
    let of_gain = |gain| {
        let law = Compensator::new(gain, 6.0).unwrap();
        law.with_recovery(0.1).unwrap()
    };
    let whole = of_gain(5.0);
    for (share, gain) in [(1.0, 5.0), (0.5, 3.0), (0.25, 2.0), (0.0, 1.0)] {
        assert_eq!(whole.with_share(share), of_gain(gain), "{share}");
    }
    let (mut state, none) = (
        CompensatorState::new(Play::new(-1.0, 1.0).unwrap()),
        whole.with_share(0.0),
    );
    for tick in 0..100 {
        let reference = 3.0 * (0.1 * f64::from(tick)).sin();
        assert!(close(none.step(&mut state, reference), reference));
    }
}

/// What a limit keeps back is not made up for later: in contact the gain is 1 from there on.
#[test]
fn the_law_continues_from_a_limited_command() {
    for play in [Play::new(-2.0, 2.0), Play::new(1.0, 2.0)].map(Result::unwrap) {
        let (compensator, mut state) = start(5.0, play);
        for reference in path(&[0.0, 10.0], 100) {
            compensator.step(&mut state, reference);
        }
        let before = state.command();
        assert!(close(compensator.propose(&mut state, 10.5), before + 0.5));
        assert_eq!(state.command(), before);
        let limited = before + 0.2;
        compensator.commit(&mut state, limited);
        assert_eq!(state.command(), limited);
        assert!(close(state.position(), 2.0));
        let next = compensator.step(&mut state, 10.6);
        assert!(close(next - limited, 0.1), "{}", next - limited);
    }
}

/// The same law for a reference that is counted from elsewhere.
#[test]
fn a_shift_of_the_reference_moves_nothing() {
    let play = Play::new(-2.0, 2.0).unwrap();
    let (compensator, mut plain) = start(5.0, play);
    let mut shifted = CompensatorState::new(play);
    compensator.shift_reference(&mut shifted, 3.0);
    assert!(shifted.command().is_nan(), "nothing to shift yet");
    for reference in path(&[0.0, 10.0, 8.0], 10) {
        compensator.step(&mut plain, reference);
        compensator.step(&mut shifted, reference);
    }
    compensator.shift_reference(&mut shifted, 3.0);
    for reference in path(&[8.0, 4.0, 9.0], 10) {
        let expected = compensator.step(&mut plain, reference);
        let command = compensator.step(&mut shifted, reference + 3.0);
        assert!(close(command, expected), "{command} {expected}");
    }
}
