//! The 20-byte motor frame of the vests: forty 4-bit steps in an order of their own.

use super::{Intensities, MOTORS, motor_step};

/// A motor frame as written to the vest.
pub type BleFrame = [u8; 20];

/// Slot of the top motor of each column, wearer's left to right; each row below is two slots further.
const FRONT_TOP: [usize; 4] = [31, 30, 1, 0];
const BACK_TOP: [usize; 4] = [10, 11, 20, 21];

/// Slot of the top motor of a column; front columns 0 to 3, back columns 4 to 7.
///
/// `front_mirror` swaps left and right on the front panel only: its sense on the wire rests on one published table.
fn top_slots(front_mirror: bool) -> [usize; 8] {
    let [a, b, c, d] = FRONT_TOP;
    let [e, f, g, h] = BACK_TOP;
    if front_mirror { [d, c, b, a, e, f, g, h] } else { [a, b, c, d, e, f, g, h] }
}

/// Slot of a motor given in the wearer's order.
fn slot(motor: usize, tops: &[usize; 8]) -> usize {
    let (panel, dot) = (motor / 20, motor % 20);
    tops.get(panel * 4 + dot % 4).map_or(0, |top| top + 2 * (dot / 4))
}

/// The step in a slot: even slots are high nibbles, odd slots low nibbles.
fn nibble(frame: &BleFrame, slot: usize) -> u8 {
    frame.get(slot / 2).map_or(0, |byte| if slot.is_multiple_of(2) { byte >> 4 } else { byte & 15 })
}

/// Forty intensities to the frame that sets all motors at once; all zeros is off.
///
/// ```
/// use tega_wire::bhaptics::{Intensities, ble_frame};
/// let mut intensities = [0; 40];
/// intensities[0] = 100; // front, top row, wearer's left
/// assert_eq!(ble_frame(&Intensities::new(&intensities)?, false)[15], 0x0F);
/// # Ok::<(), tega_wire::WireError>(())
/// ```
pub fn ble_frame(intensities: &Intensities, front_mirror: bool) -> BleFrame {
    let tops = top_slots(front_mirror);
    let mut frame = [0; 20];
    for (motor, &intensity) in intensities.values().iter().enumerate() {
        let slot = slot(motor, &tops);
        if let Some(byte) = frame.get_mut(slot / 2) {
            *byte |= if slot.is_multiple_of(2) { motor_step(intensity) << 4 } else { motor_step(intensity) };
        }
    }
    frame
}

/// The forty steps, 0 to 15, in a frame, in the wearer's order.
pub fn ble_steps(frame: &BleFrame, front_mirror: bool) -> [u8; MOTORS] {
    let tops = top_slots(front_mirror);
    std::array::from_fn(|motor| nibble(frame, slot(motor, &tops)))
}

/// The sixteen steps an X16 makes of a frame: front upper, front lower, back upper, back lower, each of four columns
/// from the wearer's left. An upper motor takes the maximum of rows 0 and 1, a lower one that of rows 2 to 4.
pub fn x16_steps(frame: &BleFrame, front_mirror: bool) -> [u8; 16] {
    let tops = top_slots(front_mirror);
    std::array::from_fn(|motor| {
        let (panel, lower, column) = (motor / 8, motor / 4 % 2 == 1, motor % 4);
        let top = tops.get(panel * 4 + column).copied().unwrap_or_default();
        let rows = if lower { 2..5 } else { 0..2 };
        rows.map(|row| nibble(frame, top + 2 * row)).max().unwrap_or_default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_motor_has_a_slot_of_its_own() {
        for front_mirror in [false, true] {
            let mut slots: Vec<usize> =
                (0..MOTORS).map(|motor| slot(motor, &top_slots(front_mirror))).collect();
            slots.sort_unstable();
            assert!(slots.into_iter().eq(0..MOTORS));
        }
    }

    #[test]
    fn levels_come_back_for_every_motor_and_both_senses() {
        let intensities: [u8; MOTORS] = std::array::from_fn(|motor| ((motor * 37) % 101) as u8);
        for front_mirror in [false, true] {
            let frame = ble_frame(&Intensities::new(&intensities).unwrap(), front_mirror);
            assert_eq!(ble_steps(&frame, front_mirror), intensities.map(motor_step));
        }
    }
}
