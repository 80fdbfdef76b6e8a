//! Settings for the tests of the loop: lengths in units of 0.4 mm, 0.04 rad, 0.02 rad.

pub mod loops;
pub mod plays;

use tautscope_core::{
    CameraSettings, ControlSettings, DofSettings, EstimateSettings, Flag, Flags,
    InstrumentSettings, LawSettings, PoseSettings, SafetySettings, Settings,
};

pub const UNITS: [f64; 3] = [0.4e-3, 0.04, 0.02];
pub const PERIOD: f64 = 0.005;

/// Settings of the monitors in [`UNITS`].
pub fn safety() -> SafetySettings {
    safety_in(UNITS)
}

/// [`safety`] of a loop that is never told where the tip is.
pub fn open_loop() -> SafetySettings {
    SafetySettings {
        off: Flags::of(Flag::Dropped),
        ..safety()
    }
}

/// Settings of the monitors with lengths in the given units.
pub fn safety_in<const N: usize>(units: [f64; N]) -> SafetySettings<N> {
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
        tremor_swing: 0.5,
        tremor_rate: 4.0,
        ahead_limit: 0.1,
        ahead_ratio: 1.5,
        offset_decrease: 2.0,
        cycle_swings: 4,
        cycle_growth: 1.1,
        cycle_time: 2.0,
        hold_time: 4.0,
        hold_travel: 4.0,
        fade_travel: 2.0,
        restore_travel: 2.0,
        good_frames: 5,
        good_ticks: 200,
    }
}

/// Settings of the DOFs, with lengths in [`UNITS`].
pub fn dofs() -> [DofSettings; 3] {
    let [insertion, mut rotation, mut bending] = dofs_in(UNITS);
    (rotation.expected_width, rotation.start_deviation) = (1.75, 0.6);
    (bending.expected_width, bending.start_deviation) = (1.0, 0.5);
    [insertion, rotation, bending]
}

/// Settings of DOFs with lengths in the given units.
pub fn dofs_in<const N: usize>(units: [f64; N]) -> [DofSettings; N] {
    units.map(|unit| DofSettings {
        update_distance: unit,
        observable_deviation: 1.0,
        expected_width: 8e-3,
        start_deviation: 5e-3,
        free_gain: 5.0,
        gain_limit: 5.0,
        recovery: 0.0,
        contact_tolerance: 0.4,
        smoothing_factor: 0.25,
        delta_minus: 0.0,
        delta_plus: 0.0,
    })
}

/// Settings of a loop with these settings of the monitors.
pub fn settings(safety: &SafetySettings) -> Settings {
    let [insertion, rotation, bending] = dofs();
    Settings {
        insertion,
        rotation,
        bending,
        instrument: InstrumentSettings {
            bending_length: 18.5e-3,
            marker_a: 5e-3,
            marker_b: 15e-3,
            diameter: 3.5e-3,
            band_length: 4e-3,
        },
        camera: CameraSettings {
            fx: 424.0,
            fy: 454.0,
            cx: 349.6,
            cy: 285.0,
            distortion: [-0.18, 0.05, 0.001, -0.001, -0.005, 0.0, 0.0, 0.0],
            camera_from_guide: PoseSettings {
                translation: [9e-3, 7e-3, 8e-3],
                rotation: [0.29, -0.37, 0.0],
            },
        },
        control: ControlSettings {
            period: PERIOD,
            history: 2.0,
        },
        safety: *safety,
        law: LawSettings {
            free_gain: 20.0,
            tip_gain: 1.85,
            direction_travel: 0.02,
            change_rate: 0.01,
        },
        estimation: EstimateSettings {
            marker_deviation: 0.3,
            shape_deviation: 0.3,
            image_deviation: 6.0,
            outlier_distance: 4.0,
            misfit_deviation: 2.0,
            misfit_travel: 2.0,
            weight_deviation: 0.2,
            offset_deviation: 0.2,
            tip_deviation: 0.12,
            weight_travel: 800.0,
            offset_travel: 22.0,
        },
    }
}
