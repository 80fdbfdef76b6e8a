//! Settings of the detector. `VisionConfig` of the Python package has the default of each and its origin.

use serde::Deserialize;

/// Settings of a [`Detector`](crate::Detector), `[vision]` in a configuration file.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// Weights of blue, green, red in Fisher's discriminant, Eq. (12).
    pub weights: [f64; 3],
    /// Threshold of the weighted sum (grey levels).
    pub threshold: f64,
    /// Weights and thresholds that are tried in turn where the first give no clear result.
    pub alternatives: Vec<([f64; 3], f64)>,
    /// Passes of the 3x3 binomial low-pass, 0 to 8.
    pub smoothing: usize,
    /// Least area of a region (px), at least 1.
    pub minimum_area: u64,
    /// Standard deviation of a band's position predicted by the instrument model (px); for the caller's
    /// [`BandPredictor`](crate::BandPredictor).
    pub model_deviation: f64,
    /// Margin around the predicted outlines that is searched, for motion and blur (px).
    pub search_margin: f64,
    /// Least share of a band's area inside the image.
    pub least_inside: f64,
    /// Least share of that area that has the markers' colour.
    pub least_coverage: f64,
    /// Least share of that colour that the other band's outline does not enclose too.
    pub least_exclusive: f64,
    /// Largest share of a ring around the band that has the markers' colour, relative to its coverage.
    pub largest_spill: f64,
    /// Least share of the outline at which an edge is found.
    pub least_edges: f64,
    /// Least share of the rims, the two arcs of the outline, at which an edge is found.
    pub least_rims: f64,
    /// Least mean of the edge shares of both bands.
    pub least_edges_on_average: f64,
    /// Least edge share of a band that is found alone; its coverage must reach 3/4 of this.
    pub least_edges_alone: f64,
    /// Largest squared Mahalanobis distance of both bands from their predicted positions.
    pub largest_surprise: f64,
    /// Outline fit.
    pub fit: FitSettings,
    /// Scores at which the search stops.
    pub clear: ClearSettings,
    /// Where the posture is not known.
    pub unlocated: UnlocatedSettings,
    /// Intensity fit of blurred bands.
    pub blur: BlurSettings,
    /// Whether these are the thresholds for images of which the posture is not known.
    #[serde(skip)]
    pub is_unlocated: bool,
}

/// Settings of the outline fit, `[vision.fit]`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FitSettings {
    /// Standard deviation of an edge point (px), neighbours taken as independent.
    pub edge_deviation: f64,
    /// Distance from the outline beyond which an edge is an outlier (px).
    pub edge_tolerance: f64,
    /// Distance from the outline up to which an edge is searched (px).
    pub edge_reach: f64,
    /// Standard deviation of the outlines' growth by blur and threshold (px).
    pub growth_deviation: f64,
    /// And by an unknown scale, per radius of a band.
    pub growth_share: f64,
    /// Standard deviation of the difference in growth between the bands (px).
    pub growth_difference: f64,
    /// And per radius of a band.
    pub growth_difference_share: f64,
    /// Increase of the variance where all edges are missing, relative to where none is.
    pub missing_edge_variance: f64,
}

/// Scores at which a result is clear and nothing else is tried, `[vision.clear]`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClearSettings {
    /// Least edge share of each band; below it, the largest Mahalanobis distance shrinks too.
    pub least_edges: f64,
    /// Least coverage of each band.
    pub least_coverage: f64,
    /// Largest squared Mahalanobis distance.
    pub largest_surprise: f64,
}

/// Settings where the posture is not known, `[vision.unlocated]`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UnlocatedSettings {
    /// Weights and thresholds that are tried after [`Settings::alternatives`].
    pub alternatives: Vec<([f64; 3], f64)>,
    /// Least edge share of each band at which no other candidate is tried.
    pub certain_edges: f64,
    /// See [`Settings::least_edges_on_average`].
    pub least_edges_on_average: f64,
    /// See [`BlurSettings::least_explained`].
    pub least_explained: f64,
}

/// Settings of the intensity fit of blurred bands, `[vision.blur]`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BlurSettings {
    /// Expected standard deviation of the blur kernel (px).
    pub sigma: f64,
    /// Standard deviation of that (px).
    pub sigma_deviation: f64,
    /// Largest standard deviation of the blur kernel in a sharp image (px).
    pub sharp_sigma: f64,
    /// Margin around the outlines whose pixels are fitted (px).
    pub margin: f64,
    /// Standard deviation of the brightness ratio of the two bands.
    pub brightness_ratio_deviation: f64,
    /// Unevenness of a band's brightness and least unevenness of the tissue's colour, relative to their values.
    pub unevenness: f64,
    /// Standard deviation of a position that the model of the image does not explain (px).
    pub model_deviation: f64,
    /// Least share of the intensity's variance that is explained.
    pub least_explained: f64,
    /// Least brightness of a band over the standard deviation of the residuals.
    pub least_contrast: f64,
    /// Least ratio of the darker band's brightness to the brighter one's.
    pub least_brightness_ratio: f64,
    /// Largest standard deviation of a position (px).
    pub largest_deviation: f64,
}

impl Settings {
    /// The settings for images of which the instrument's posture is not known: no band is accepted alone.
    pub(crate) fn unlocated(&self) -> Self {
        let least = &self.unlocated;
        let alternatives = self.alternatives.iter().chain(&least.alternatives);
        Self {
            alternatives: alternatives.copied().collect(),
            least_edges_on_average: least.least_edges_on_average,
            blur: BlurSettings {
                least_explained: least.least_explained,
                ..self.blur
            },
            is_unlocated: true,
            ..self.clone()
        }
    }
}
