//! Structures and enumerations of the header.

/// Version of this interface. It changes whenever a program has to be compiled again; `tautscope_abi_version` is that of the
/// library in use.
pub const TAUTSCOPE_ABI_VERSION: u32 = 1;

/// Result of an image update.
#[repr(u32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TautscopeStatus {
    /// Every DOF was measured.
    Ok = 0,
    /// A DOF was not observable and was held at its prediction.
    Held = 1,
    /// Only one marker was found; the DOFs it does not determine were held.
    Partial = 2,
    /// Neither marker was found.
    NoMarkers = 3,
    /// The frame was captured before the start of the command history.
    Stale = 4,
    /// The frame was captured no later than one already used.
    Duplicate = 5,
    /// A monitor rejected the frame: it updated nothing.
    Refused = 6,
}

/// What the loop does while a flag is active; a later one has priority.
#[repr(u32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TautscopeReaction {
    /// Continue.
    None = 0,
    /// Continue, with a warning until it is acknowledged.
    Warn = 1,
    /// Compensate with the slack estimated so far; images update nothing.
    HoldEstimate = 2,
    /// As `HOLD_ESTIMATE`, and reduce the compensation to nothing with motion.
    Fade = 3,
    /// Do not compensate: move the command as the reference does. Profile `best` gives back the difference with motion.
    PassThrough = 4,
    /// Hold the command; motion of the reference is discarded.
    HoldMotion = 5,
    /// As `HOLD_MOTION`; the caller must bring the drives to quick stop.
    QuickStop = 6,
    /// As `HOLD_MOTION`; the caller must disable the drives.
    Disable = 7,
}

/// Why a contact offset was updated.
#[repr(u32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TautscopeTrigger {
    /// It was not.
    None = 0,
    /// Contact, Eq. (4).
    Contact = 1,
    /// Violation, Eq. (5).
    Violation = 2,
}

/// Memory layout of an image's 8-bit pixels.
#[repr(u32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TautscopePixelFormat {
    /// B, G, R per pixel.
    Bgr = 0,
    /// R, G, B per pixel.
    Rgb = 1,
    /// B, G, R and an unused byte per pixel.
    Bgra = 2,
    /// Y, U, Y, V per two pixels.
    Yuyv = 3,
    /// U, Y, V, Y per two pixels.
    Uyvy = 4,
    /// The rows of Y, then a line of U, V, U, V, ... for every two rows.
    Nv12 = 5,
    /// The rows of Y, then those of U, then of V, at half the resolution, two of them per line.
    I420 = 6,
}

/// Why a band was not found.
#[repr(u32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TautscopeRejection {
    /// It was found.
    None = 0,
    /// The image has no region of the markers' colour, or no outline fits one.
    NoRegion = 1,
    /// The instrument model predicts no visible bands.
    NotPredicted = 2,
    /// Too much of the band is outside the image.
    Outside = 3,
    /// Too little of the band has the markers' colour.
    Hidden = 4,
    /// The markers' colour continues around the band.
    Spill = 5,
    /// Too little of the band's outline was found.
    MissingEdges = 6,
    /// There is no instrument between the bands.
    NoInstrument = 7,
    /// A band found alone may be either of the two.
    Ambiguous = 8,
    /// The bands are too far from their predicted positions.
    Elsewhere = 9,
    /// A band was found alone, and where the instrument is, is not known.
    Alone = 10,
}

/// A camera image in the caller's memory. Lines are `stride` bytes apart; width, height and format are those of `[camera]`.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct TautscopeImage {
    /// The first line.
    pub data: *const u8,
    /// Readable bytes from `data` on.
    pub length: usize,
    /// Distance of two lines in bytes, at least a line.
    pub stride: usize,
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// A `TautscopePixelFormat`.
    pub format: u32,
}

/// The state at a capture time, before the image is seen: where the detection searches.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TautscopeStatePrediction {
    /// Insertion, rotation, bending [m, rad, rad].
    pub state: [f64; 3],
    /// Their standard deviations [m, rad, rad].
    pub std: [f64; 3],
    /// What images have found of the geometry: unevenness of the section, shift u, v of the image (px).
    pub geometry: [f64; 3],
    /// 1, or 0 beyond the history: then the detection searches the whole workspace.
    pub is_known: u32,
}

/// The bands in an image.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TautscopeDetection {
    /// Centroids u, v of band A, then of band B (px); NaN for a band that was not found.
    pub features: [f64; 4],
    /// Their covariance (4, 4) (px^2); NaN likewise.
    pub covariance: [[f64; 4]; 4],
    /// Why each band was not found, a `TautscopeRejection`.
    pub rejections: [u32; 2],
    /// Discriminant that was used: 0 is the trained one, others count `vision.alternatives` from 1.
    pub discriminant: u32,
    /// CRC-32 of every eighth line of the image.
    pub checksum: u32,
}

/// Result of an image update; values that are not known are NaN.
///
/// Set `size` to `sizeof(TautscopeReport)` first. A smaller one than the library's is refused.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TautscopeReport {
    /// Bytes of the structure as the caller knows it.
    pub size: u32,
    /// Result of the update.
    pub status: TautscopeStatus,
    /// The reaction in force after this image.
    pub reaction: TautscopeReaction,
    /// The active flags, a bit `1 << TautscopeFlag` each.
    pub flags: u32,
    /// When the image was captured (s).
    pub captured_at: f64,
    /// State estimate (3,) [m, rad, rad], Eq. (16).
    pub state_estimate: [f64; 3],
    /// Predicted state q (3,) at the capture time [m, rad, rad].
    pub predicted_state: [f64; 3],
    /// Predicted features (4,) (px), Eq. (9).
    pub predicted_features: [f64; 4],
    /// Measured minus predicted features (4,) (px).
    pub innovation: [f64; 4],
    /// Standard deviation per px of marker noise (3,) [m/px, rad/px].
    pub deviation: [f64; 3],
    /// Standard deviation of the state estimate (3,) [m, rad, rad].
    pub state_deviation: [f64; 3],
    /// Negative contact offsets after this image (3,) [m, rad, rad], input minus output.
    pub delta_minus: [f64; 3],
    /// Positive contact offsets after this image (3,) [m, rad, rad], input minus output.
    pub delta_plus: [f64; 3],
    /// Per DOF, why `delta_minus` was updated.
    pub triggers_minus: [TautscopeTrigger; 3],
    /// Per DOF, why `delta_plus` was updated.
    pub triggers_plus: [TautscopeTrigger; 3],
    /// Per DOF, 1 if the image determined it.
    pub is_observable: [u32; 3],
    /// 0.
    pub reserved: u32,
}

/// A measurement of the tip. Set what you do not know to 0.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct TautscopeMeasurement {
    /// Values (m,); NaN for one that was not measured.
    pub values: *const f64,
    /// m, 1 to 16.
    pub count: usize,
    /// Covariance (m, m) row by row, or null, where the function allows it.
    pub covariance: *const f64,
    /// When it was measured, on the clock of `tautscope_loop_step` (s).
    pub captured_at: f64,
    /// Which of 4 sensors with rates and delays of their own, 0 to 3.
    pub sensor: u32,
    /// Values in a row that are right or wrong together: 2 for u, v of points of an image; 0 is 1.
    pub point: u32,
}

/// Result of an update by a measurement; values that are not known are NaN.
///
/// Of n degrees of freedom and m values the first n and m entries are used. Set `size` to `sizeof(TautscopeTipReport)` first.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TautscopeTipReport {
    /// Bytes of the structure as the caller knows it.
    pub size: u32,
    /// Result of the update.
    pub status: TautscopeStatus,
    /// The reaction in force after this measurement.
    pub reaction: TautscopeReaction,
    /// The active flags, a bit `1 << TautscopeFlag` each.
    pub flags: u32,
    /// When it was measured (s).
    pub captured_at: f64,
    /// The most probable state [m or rad].
    pub state_estimate: [f64; 8],
    /// Its standard deviations [m or rad].
    pub state_deviation: [f64; 8],
    /// Predicted state q at the time of the measurement [m or rad].
    pub predicted_state: [f64; 8],
    /// Values expected in the predicted state.
    pub predicted_values: [f64; 16],
    /// Measured minus expected values.
    pub innovation: [f64; 16],
    /// Negative contact offsets after this measurement [m or rad], input minus output.
    pub delta_minus: [f64; 8],
    /// Positive contact offsets after this measurement [m or rad], input minus output.
    pub delta_plus: [f64; 8],
    /// Per DOF, why `delta_minus` was updated.
    pub triggers_minus: [TautscopeTrigger; 8],
    /// Per DOF, why `delta_plus` was updated.
    pub triggers_plus: [TautscopeTrigger; 8],
    /// Per DOF, 1 if the measurement determined it.
    pub is_observable: [u32; 8],
}

/// Estimated hysteresis of n degrees of freedom, in the first n entries [m or rad].
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TautscopeHysteresis {
    /// Half widths of the slack of each DOF that moves alone.
    pub half_width: [f64; 8],
    /// Standard deviations of the half widths; NaN in profile `paper`.
    pub width_std: [f64; 8],
    /// Centres of the contact offsets, input minus output.
    pub centre: [f64; 8],
    /// Travel of the tip over that of the command in contact; 1 in profile `paper`.
    pub gain: [f64; 8],
    /// Standard deviations of the gains; NaN in profile `paper`.
    pub gain_std: [f64; 8],
}

// SAFETY: the first member is `size`, and the members leave no gap; a test compares the sizes.
#[allow(unsafe_code)]
unsafe impl crate::pointers::Sized32 for TautscopeReport {}
// SAFETY: likewise.
#[allow(unsafe_code)]
unsafe impl crate::pointers::Sized32 for TautscopeTipReport {}

/// State of the supervision.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TautscopeSupervision {
    /// The reaction in force.
    pub reaction: TautscopeReaction,
    /// The active flags, a bit `1 << TautscopeFlag` each.
    pub flags: u32,
    /// The flags raised since the last acknowledgement.
    pub latched: u32,
    /// 0.
    pub reserved: u32,
    /// Share that the supervisor allows of the compensation chosen by `tautscope_loop_set_compensation`, 0 to 1.
    pub share: f64,
}

/// A condition that a monitor detected, or that the rig reported.
#[repr(u32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TautscopeFlag {
    /// An image or measurement repeats an earlier one although the command has moved.
    Frozen = 0,
    /// An image or measurement was older than `frame_age` when it arrived.
    Late = 1,
    /// An image or measurement was made no later than the one before it.
    Duplicate = 2,
    /// No image or measurement has arrived for longer than `frame_gap`.
    Dropped = 3,
    /// A time is later than the control tick, goes back, or is not a number.
    Clock = 4,
    /// The measured state is too far from the predicted state.
    Innovation = 5,
    /// The image agrees with the prediction if its two markers are exchanged.
    Swapped = 6,
    /// Part of a measurement is missing or impossible: one of two markers, or values of a sensor.
    Merged = 7,
    /// Nothing was measured that agrees with the prediction: no marker, or no value of a sensor.
    Lost = 8,
    /// A degree of freedom has moved without a measurement that determines it.
    Unobservable = 9,
    /// The rig reports that a drive does not follow its command.
    FollowingError = 10,
    /// The reference jumped: it changed by more than its speed before and `reference_speed` or `dof.speed` allow.
    ReferenceJump = 11,
    /// The reference was faster than `reference_speed` or `dof.speed` over `reference_time`, and is followed at this speed.
    ReferenceFast = 12,
    /// The reference was older than `reference_age`, or jumped after its device had been silent for as long.
    ReferenceLate = 13,
    /// The reference is not a finite number.
    ReferenceInvalid = 14,
    /// A control tick came too late.
    LateTick = 15,
    /// The rig reports a fault of a drive or of its bus.
    DriveFault = 16,
    /// The tip moves against its command.
    StartCheck = 17,
    /// The estimated slack or the lead of the command reached `width_limit` or `offset_limit`.
    WidthLimit = 18,
    /// A limit of travel, speed or actuators changed a command, or the software is wrong.
    Monitor = 19,
    /// A command would have moved faster than `command_speed`.
    CommandJump = 20,
    /// The reference without its slow part reverses more than `tremor_rate` times a second within the slack.
    Tremor = 21,
    /// The tip has moved farther than the reference since the reference turned.
    Overcompensation = 22,
    /// Reference and tip oscillate with growing amplitude.
    LimitCycle = 23,
    /// The tip is measured elsewhere than predicted: the slack has changed, the instrument was pushed, or measurements or commands are wrong.
    SlackChanged = 24,
    /// The images contradict the configured camera: they are shifted by more than three `image_deviation`. Or a sensor contradicts its
    /// model, by three times as much as its covariance says.
    GeometryOff = 25,
    /// Images or measurements come at another rate than before, or from one sensor less: a clock or a sensor is not as before.
    FrameRate = 26,
}
