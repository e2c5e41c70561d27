//! Four finger columns on two torso arrays, and how they reach the motors of real vests.
//!
//! A 40-motor vest numbers its motors `4 * row + column` on the front (0 to 19) and 20 more on the back, row 0 at
//! the top, column 0 at the wearer's left on both faces. All layouts are subsets of those 40.

use std::fmt::Arguments;

use tega_error::{OutOfRange, UnknownChoice, choice};

use crate::HapticsError;

/// The fingers in column order, from the wearer's left.
pub const FINGERS: [&str; 4] = ["thumb", "index", "middle", "ring"];

const COLUMNS: usize = 4;
const X40_ROWS: usize = 5;
const FACE: usize = COLUMNS * X40_ROWS;

/// Which motors carry the paper's two 4 × 4 arrays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layout {
    /// Rows 0 to 3 of each face of a 40-motor vest; its bottom row stays off. 32 motors.
    Paper32,
    /// All 40 motors: the fifth row repeats the fourth.
    X40,
    /// Two rows on each face of a 16-motor vest.
    X16,
}

impl Layout {
    /// Find a layout by its name: `paper32`, `x40` or `x16`.
    ///
    /// # Errors
    /// A name that is none of these.
    pub fn from_name(name: &str) -> Result<Self, UnknownChoice> {
        choice("layout", name, &[Self::Paper32, Self::X40, Self::X16].map(|layout| (layout.name(), layout)))
    }

    /// The name [`Layout::from_name`] takes.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Paper32 => "paper32",
            Self::X40 => "x40",
            Self::X16 => "x16",
        }
    }

    /// For each row of a face in this layout, the rows of the 40-motor vest it stands for; the first is its own.
    ///
    /// A 16-motor vest takes the 40-motor frame and drives its upper motors with the largest of rows 0 and 1, its
    /// lower ones with the largest of rows 2 to 4.
    const fn rows(self) -> &'static [&'static [usize]] {
        match self {
            Self::Paper32 => &[&[0], &[1], &[2], &[3]],
            Self::X40 => &[&[0], &[1], &[2], &[3], &[4]],
            Self::X16 => &[&[0, 1], &[2, 3, 4]],
        }
    }

    /// Number of motors.
    pub const fn motor_count(self) -> usize {
        2 * COLUMNS * self.rows().len()
    }

    /// Index of each motor in the 40-motor numbering, front row by row, then back.
    pub fn motors(self) -> Vec<u8> {
        let per_face = |face: usize| {
            self.rows().iter().filter_map(|rows| rows.first()).flat_map(move |row| {
                (0..COLUMNS).map(move |column| (face * FACE + COLUMNS * row + column) as u8)
            })
        };
        per_face(0).chain(per_face(1)).collect()
    }
}

/// Which faces are mirrored left to right.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mirror {
    /// Thumb at the wearer's left on both faces.
    None,
    /// The back only: thumb at the wearer's right there.
    Back,
    /// Both faces, as for a left hand.
    All,
}

impl Mirror {
    /// Find a mirroring by its name: `none`, `back` or `all`.
    ///
    /// # Errors
    /// A name that is none of these.
    pub fn from_name(name: &str) -> Result<Self, UnknownChoice> {
        choice("mirror", name, &[("none", Self::None), ("back", Self::Back), ("all", Self::All)])
    }
}

/// What the motors of one layout are commanded at one moment.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct VestFrame {
    layout: Layout,
    intensities: Vec<u8>,
}

impl VestFrame {
    /// A frame from its motors' intensities in percent, front row by row, then back.
    ///
    /// # Errors
    /// Another number of motors than the layout has; an intensity above 100, named by its position.
    pub fn new(layout: Layout, intensities: Vec<u8>) -> Result<Self, HapticsError> {
        if intensities.len() != layout.motor_count() {
            let (got, wanted) = (intensities.len(), layout.motor_count());
            return Err(HapticsError::MotorCount { got, wanted, layout: layout.name() });
        }
        if let Some((index, &value)) = intensities.iter().enumerate().find(|&(_, &value)| value > 100) {
            let wrong = OutOfRange::new("intensities", f64::from(value), "percent", "0 to 100");
            return Err(wrong.placed(format_args!("[{index}]")).into());
        }
        Ok(Self { layout, intensities })
    }

    /// The layout.
    pub const fn layout(&self) -> Layout {
        self.layout
    }

    /// Intensity of each motor of the layout in percent, front row by row, then back.
    pub fn intensities(&self) -> &[u8] {
        &self.intensities
    }

    /// The intensities of the 40 motors of the largest vest that feel like this frame, in wearer order.
    pub fn x40(&self) -> [u8; 2 * FACE] {
        let rows = self.layout.rows();
        std::array::from_fn(|motor| {
            let (face, row, column) = (motor / FACE, motor % FACE / COLUMNS, motor % COLUMNS);
            let source = rows.iter().position(|stands_for| stands_for.contains(&row));
            let motor = source.map(|source| COLUMNS * (face * rows.len() + source) + column);
            motor.and_then(|motor| self.intensities.get(motor)).copied().unwrap_or(0)
        })
    }
}

/// Fill the columns of both faces: `front` and `back` hold thumb, index, middle, ring in percent.
///
/// Every row of a column has its finger's intensity, rounded half to even and held within 0 to 100.
///
/// # Errors
/// An intensity that is not finite; the message names face and finger.
///
/// # Examples
/// ```
/// use tega_haptics::{Layout, Mirror, vest_frame};
/// let frame = vest_frame([80.0, 60.0, 40.0, 20.0], [10.0, 0.0, 100.0, 55.0], Layout::X16, Mirror::None)?;
/// assert_eq!(frame.intensities(), [80, 60, 40, 20, 80, 60, 40, 20, 10, 0, 100, 55, 10, 0, 100, 55]);
/// # Ok::<(), tega_haptics::HapticsError>(())
/// ```
pub fn vest_frame(
    front: [f64; COLUMNS],
    back: [f64; COLUMNS],
    layout: Layout,
    mirror: Mirror,
) -> Result<VestFrame, HapticsError> {
    let (mut front, mut back) = (percents("front intensity", front)?, percents("back intensity", back)?);
    if mirror == Mirror::All {
        front.reverse();
    }
    if mirror != Mirror::None {
        back.reverse();
    }
    let rows = layout.rows().len();
    let intensities = [front, back].into_iter().flat_map(|face| face.repeat(rows)).collect();
    Ok(VestFrame { layout, intensities })
}

fn percents(name: &'static str, values: [f64; COLUMNS]) -> Result<[u8; COLUMNS], HapticsError> {
    let mut out = [0; COLUMNS];
    for ((out, value), finger) in out.iter_mut().zip(values).zip(FINGERS) {
        *out = whole_percent(name, value, format_args!(" of the {finger}"))?;
    }
    Ok(out)
}

/// Levels in percent as a vest takes them: rounded half to even and held within 0 to 100.
///
/// # Errors
/// A level that is not finite, named by its position.
///
/// # Examples
/// ```
/// assert_eq!(tega_haptics::whole_percents(&[-3.0, 0.5, 1.5, 1e300])?, [0, 0, 2, 100]);
/// # Ok::<(), tega_haptics::HapticsError>(())
/// ```
pub fn whole_percents(levels: &[f64]) -> Result<Vec<u8>, HapticsError> {
    let each = levels.iter().enumerate();
    each.map(|(index, level)| whole_percent("levels", *level, format_args!("[{index}]"))).collect()
}

fn whole_percent(name: &'static str, value: f64, place: Arguments<'_>) -> Result<u8, HapticsError> {
    if value.is_finite() {
        return Ok(value.round_ties_even().clamp(0.0, 100.0) as u8);
    }
    Err(OutOfRange::new(name, value, "percent", "any finite number").placed(place).into())
}

#[cfg(test)]
mod tests {
    use super::*;

    const CCI: [f64; 4] = [80.0, 60.0, 40.0, 20.0];
    const EDA: [f64; 4] = [10.0, 0.0, 100.0, 55.0];

    #[test]
    fn paper32_leaves_the_bottom_row_off() {
        let frame = vest_frame(CCI, EDA, Layout::Paper32, Mirror::None).unwrap();
        let x40 = frame.x40();
        assert_eq!(x40[..16], [80, 60, 40, 20].repeat(4));
        assert_eq!(x40[16..20], [0; 4]);
        assert_eq!(x40[20..36], [10, 0, 100, 55].repeat(4));
        assert_eq!(x40[36..], [0; 4]);
        assert_eq!(Layout::Paper32.motors(), (0..16).chain(20..36).collect::<Vec<u8>>());
    }

    #[test]
    fn x40_and_x16_light_all_forty() {
        for layout in [Layout::X40, Layout::X16] {
            let x40 = vest_frame(CCI, EDA, layout, Mirror::None).unwrap().x40();
            assert_eq!(x40[..20], [80, 60, 40, 20].repeat(5));
            assert_eq!(x40[20..], [10, 0, 100, 55].repeat(5));
        }
        assert_eq!(Layout::X40.motors(), (0..40).collect::<Vec<u8>>());
        assert_eq!(Layout::X16.motors(), [0, 1, 2, 3, 8, 9, 10, 11, 20, 21, 22, 23, 28, 29, 30, 31]);
    }

    #[test]
    fn every_motor_of_a_layout_finds_its_own_value_in_the_forty() {
        for layout in [Layout::Paper32, Layout::X40, Layout::X16] {
            let frame = vest_frame(CCI, EDA, layout, Mirror::None).unwrap();
            assert_eq!(frame.intensities().len(), layout.motor_count());
            let x40 = frame.x40();
            let back: Vec<u8> = layout.motors().iter().map(|&motor| x40[usize::from(motor)]).collect();
            assert_eq!(back, frame.intensities());
        }
    }

    #[test]
    fn mirrors_swap_left_and_right_only() {
        let back = vest_frame(CCI, EDA, Layout::X16, Mirror::Back).unwrap();
        assert_eq!(back.intensities(), [[80, 60, 40, 20].repeat(2), [55, 100, 0, 10].repeat(2)].concat());
        let all = vest_frame(CCI, EDA, Layout::X16, Mirror::All).unwrap();
        assert_eq!(all.intensities(), [[20, 40, 60, 80].repeat(2), [55, 100, 0, 10].repeat(2)].concat());
    }

    #[test]
    fn rounding_is_half_to_even_and_held_in_range() {
        let frame =
            vest_frame([0.5, 1.5, 2.5, 99.5], [-0.6, -1e300, 1e300, 100.4], Layout::X16, Mirror::None);
        let wanted = [[0, 2, 2, 100].repeat(2), [0, 0, 100, 100].repeat(2)].concat();
        assert_eq!(frame.unwrap().intensities(), wanted);
    }

    #[test]
    fn the_message_names_face_and_finger() {
        let error = vest_frame(CCI, [0.0, 0.0, f64::NAN, 0.0], Layout::X16, Mirror::None).unwrap_err();
        assert_eq!(
            error.to_string(),
            "back intensity of the middle = NaN percent is out of range: any finite number"
        );
    }

    #[test]
    fn a_frame_has_its_layouts_motors_and_percents() {
        let short = VestFrame::new(Layout::X16, vec![0; 15]).unwrap_err();
        assert_eq!(short, HapticsError::MotorCount { got: 15, wanted: 16, layout: "x16" });
        let mut loud = vec![100; 32];
        loud[7] = 101;
        let loud = VestFrame::new(Layout::Paper32, loud).unwrap_err();
        assert_eq!(loud.to_string(), "intensities[7] = 101 percent is out of range: 0 to 100");
        assert!(VestFrame::new(Layout::X40, vec![100; 40]).is_ok());
    }
}
