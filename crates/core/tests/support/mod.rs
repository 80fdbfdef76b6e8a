//! Monitors for the tests of the loop: lengths in units of 0.4 mm, 0.04 rad, 0.02 rad.

pub mod looped;
pub mod stand_in;

use tautscope_core::{
    AdaptiveAxis, AdaptiveSettings, ChangeLimit, ChangeSettings, CommandLimits, ContactTest, Flags,
    FrameGateSettings, Friction, FrictionSettings, GripSettings, LeadLaw, MonitorsSettings,
    MotionMonitorSettings, OffsetPrior, PerDof, Play, ReferenceGateSettings, SupervisorSettings,
};

pub const UNITS: PerDof<f64> = [0.4e-3, 0.04, 0.02];
pub const PERIOD: f64 = 0.005;

pub fn monitor(unit: f64) -> CommandLimits {
    CommandLimits {
        gain_limit: 5.0,
        step_limit: 5.0 * unit,
        travel: (-100.0 * unit, 200.0 * unit),
        lead_limit: 30.0 * unit,
    }
}

pub fn clutch() -> ReferenceGateSettings {
    ReferenceGateSettings {
        period: PERIOD,
        reference_speed: UNITS.map(|unit| unit / PERIOD),
        reference_time: 0.05,
        reference_count: UNITS.map(|unit| 0.125 * unit),
        reference_age: 0.05,
        late_tick: 3.0,
        stall: 0.1,
    }
}

pub fn supervisor() -> SupervisorSettings {
    SupervisorSettings {
        hold_time: 4.0,
        hold_travel: 4.0,
        fade_travel: 2.0,
        restore_travel: 2.0,
        good_frames: 5,
        good_ticks: 200,
    }
}

pub fn monitors() -> MonitorsSettings {
    MonitorsSettings {
        clutch: clutch(),
        limits: UNITS.map(monitor),
        frames: FrameGateSettings {
            frame_age: 0.3,
            frame_gap: 0.18,
            frozen_travel: UNITS,
            innovation_limit: 5.0,
            start_deviation: [5e-3, 0.6, 0.5],
            least_deviation: UNITS,
            jump: UNITS,
            grips: UNITS.map(|unit| GripSettings {
                distance: 10.0 * unit,
                slip: unit,
            }),
            blind_growth: 0.1,
        },
        motion: MotionMonitorSettings {
            period: PERIOD,
            tremor_swing: UNITS.map(|unit| 0.5 * unit),
            slack: UNITS.map(|unit| 30.0 * unit),
            tremor_rate: 4.0,
            turn: UNITS,
            ahead: UNITS.map(|unit| 3.0 * unit),
            cycle_swings: 4,
            cycle_time: 2.0,
        },
        changes: ChangeSettings {
            limit: UNITS.map(|unit| 2.0 * unit),
            travel: UNITS.map(|unit| 45.0 * unit),
        },
        supervisor: supervisor(),
        width_limit: UNITS.map(|unit| 30.0 * unit),
        offset_limit: UNITS.map(|unit| 20.0 * unit),
        off: Flags::NONE,
    }
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
