//! Monitors for the tests of the loop: lengths in units of 0.4 mm, 0.04 rad, 0.02 rad.

pub mod looped;
pub mod stand_in;

use tautscope_core::{
    AdaptiveAxis, AdaptiveSettings, ChangeLimit, ContactTest, DofSettings, Flags, Friction,
    FrictionSettings, LeadLaw, OffsetPrior, PerDof, Play, SafetySettings,
};

pub const UNITS: PerDof<f64> = [0.4e-3, 0.04, 0.02];
pub const PERIOD: f64 = 0.005;

/// Settings of the monitors in [`UNITS`].
pub fn safety() -> SafetySettings {
    safety_in(UNITS)
}

/// Settings of the monitors with lengths in the given units.
pub fn safety_in(units: PerDof<f64>) -> SafetySettings {
    SafetySettings {
        off: Flags::NONE,
        width_limit: units.map(|unit| 30.0 * unit),
        offset_limit: units.map(|unit| 20.0 * unit),
        reference_speed: units.map(|unit| unit / PERIOD),
        reference_time: 0.05,
        command_speed: units.map(|unit| 5.0 * unit / PERIOD),
        command_travel: units.map(|unit| (-100.0 * unit, 200.0 * unit)),
        reference_count: units.map(|unit| 0.125 * unit),
        reference_age: 0.05,
        late_tick: 3.0,
        stall: 0.1,
        frame_age: 0.3,
        frame_gap: 0.18,
        clock_jump: 1.0,
        frozen_travel: 1.0,
        innovation_limit: 5.0,
        innovation_floor: 0.08,
        innovation_growth: 0.3,
        innovation_decay: 0.05,
        jump: units,
        slip: units,
        grip_distance: 10.0,
        blind_growth: 0.1,
        tremor_swing: 0.5,
        tremor_rate: 4.0,
        ahead_limit: 0.1,
        ahead_ratio: 1.5,
        offset_decrease: 2.0,
        cycle_swings: 4,
        cycle_growth: 1.1,
        cycle_time: 2.0,
        change_limit: units.map(|unit| 2.0 * unit),
        change_travel: 1.5,
        hold_time: 4.0,
        hold_travel: 4.0,
        fade_travel: 2.0,
        restore_travel: 2.0,
        good_frames: 5,
        good_ticks: 200,
    }
}

/// Settings of the DOFs, with lengths in [`UNITS`].
pub fn dofs() -> PerDof<DofSettings> {
    let [insertion, rotation, bending] = UNITS.map(|unit| DofSettings {
        update_distance: unit,
        observable_deviation: 1.0,
        start_deviation: 5e-3,
        free_gain: 5.0,
        gain_limit: 5.0,
        recovery: 0.0,
        contact_tolerance: 0.4,
        smoothing_factor: 0.25,
        delta_minus: 0.0,
        delta_plus: 0.0,
    });
    let rotation = DofSettings {
        start_deviation: 0.6,
        ..rotation
    };
    let bending = DofSettings {
        start_deviation: 0.5,
        ..bending
    };
    [insertion, rotation, bending]
}

/// Of a shaft of 3.5 mm.
pub fn friction() -> Friction {
    Friction::new(FrictionSettings {
        arm: 1.75e-3,
        memory: 0.2e-3,
        deviation: 0.25,
    })
    .unwrap()
}

/// A DOF of profile `best` with lengths in units of `unit`.
pub fn axis(unit: f64) -> AdaptiveAxis {
    let settings = AdaptiveSettings {
        law: LeadLaw {
            free_gain: 5.0,
            contact_gain: 2.0,
            taper: unit,
            settling: unit,
        },
        cautious_gain: 1.5,
        cautious_deviation: 3.0 * unit,
        prior: OffsetPrior {
            spacing: 6.0 * unit,
            level: 20.0 * unit,
            tilt: 0.3,
            local: unit,
            correlation: 40.0 * unit,
            level_drift: unit,
            tilt_drift: 0.1,
            local_drift: unit,
            symmetry: 0.8,
        },
        change: ChangeLimit {
            rate: 0.03,
            spare: unit,
            known: 50.0 * unit,
        },
        contact: ContactTest {
            distance: 3.0 * unit,
            moved: 3.0 * unit,
            tolerance: 0.25,
        },
        model_deviation: unit,
        correction: 1.0,
        gain_limit: 5.0,
        tremor_time: 0.15,
        period: 0.005,
    };
    AdaptiveAxis::new(settings, Play::new(0.0, 0.0).unwrap()).unwrap()
}
