//! How a tracker is made, and what it reports of a frame.

use super::dent::Outline;
use super::light::GelLight;
use super::noise::SensorNoise;
use crate::frame::Order;

/// How the tracker of a fingertip is made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackerOptions {
    /// Frames a second when no time is given with a frame.
    pub rate_hz: f64,
    /// Order of the colour bytes.
    pub order: Order,
    /// Noise of the sensor; that of a DIGIT where it is not known.
    pub noise: SensorNoise,
    /// Light, scale and stiffness of the gel.
    pub light: GelLight,
    /// What the outline means.
    pub outline: Outline,
    /// Whether the rest is taken again after a release.
    pub rezero: bool,
}

impl Default for TrackerOptions {
    fn default() -> Self {
        Self {
            rate_hz: 60.0,
            order: Order::default(),
            noise: SensorNoise::default(),
            light: GelLight::default(),
            outline: Outline::default(),
            rezero: true,
        }
    }
}

/// What one frame says of a fingertip's contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Touch {
    /// Whether something touches.
    pub in_contact: bool,
    /// Effective deformation area, pixels; 0 without contact.
    pub eda: u32,
    /// Contact concentration: `peak` over the root of `eda`; focal contacts have more of it than broad ones.
    pub cci: f64,
    /// Height of the dent in counts: change of colour times width; rises with the press.
    pub peak: f64,
    /// Depth of the dent, millimetres, as far as light and scale are those of the sensor.
    pub depth_mm: f64,
    /// Normal force, newtons, by the gel's stiffness and the volume pressed in; likewise.
    pub force_n: f64,
    /// Sum of the change of colour over the dent, counts times pixels.
    pub mass: f64,
    /// Middle of the dent (column, row): of its outline in an even light; NaN without contact.
    pub centroid_xy: (f64, f64),
    /// Root mean square distance of the outlined pixels from their mean place, pixels; NaN without contact.
    pub spread: f64,
    /// How sure the contact is: 0 to 1, graded around the threshold.
    pub strength: f64,
    /// Share of the picture that is dented, 0 to 1.
    pub broad: f64,
    /// S: how much of the picture differs from the untouched gel, noise units.
    pub difference: f64,
    /// S from which a contact begins.
    pub threshold: f64,
}

impl Default for Touch {
    /// No contact.
    fn default() -> Self {
        Self {
            in_contact: false,
            eda: 0,
            cci: 0.0,
            peak: 0.0,
            depth_mm: 0.0,
            force_n: 0.0,
            mass: 0.0,
            centroid_xy: (f64::NAN, f64::NAN),
            spread: f64::NAN,
            strength: 0.0,
            broad: 0.0,
            difference: 0.0,
            threshold: 0.0,
        }
    }
}
