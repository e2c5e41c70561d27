//! Reports that come too slowly, late or with angles that cannot be.

use tega_hand::{LinkSettings, Phase};

use super::Bench;
use super::hand::{Hand, Owned};

#[test]
fn slow_reports_and_impossible_angles_are_refused_before_the_motors_go_on() {
    let mut bench = Bench::new(Hand { angles: [2.2; 16], ..Hand::default() });
    bench.run(300);
    assert_eq!(bench.fault(), "angle");
    let mut slow = Bench::with(Hand::default(), LinkSettings { lowest_rate_hz: 400.0, ..Default::default() });
    slow.run(1500);
    assert_eq!(slow.fault(), "too-slow");
    for bench in [bench, slow] {
        assert!(!bench.pushed() && bench.sent.iter().all(|(_, frame)| frame.id() != 0x100));
    }
}

#[test]
fn a_hand_held_up_while_it_is_looked_at_is_looked_at_once_more_with_the_motors_off() {
    let mut bench = Bench::new(Hand::default());
    // Half as many sets as wanted, from the first request on.
    bench.hand.every_ms = 6;
    bench.run(400);
    assert_eq!((bench.fault(), bench.link.phase()), ("", Phase::Checking));
    assert!(!bench.hand.servo_on && !bench.pushed());
    bench.hand.every_ms = 3;
    bench.run(400);
    assert_eq!((bench.fault(), bench.link.phase()), ("", Phase::Running));
    assert!(bench.hand.servo_on);
}

#[test]
fn a_hand_that_becomes_slow_is_let_go() {
    let mut bench = Bench::running();
    bench.hand.every_ms = 6;
    bench.lets_go(2200, "too-slow");
}

#[test]
fn a_standstill_of_this_side_is_no_slowness_of_the_hand() {
    let mut bench = Bench::new(Hand::default());
    bench.run(1100);
    for _ in 0..4 {
        // What the adapter kept of 0.4 s is given at once, as after a wait; the rest is lost.
        let kept: Vec<Owned> = (0..60).flat_map(|k| bench.hand.report(bench.t_ms + k)).collect();
        bench.t_ms += 400;
        bench.give(&kept);
        bench.run(300);
        assert_eq!((bench.fault(), bench.link.phase()), ("", Phase::Running));
    }
    bench.hand.every_ms = 6;
    bench.run(2200);
    assert_eq!(bench.fault(), "too-slow");
}

#[test]
fn angles_that_jump_are_not_followed() {
    let mut bench = Bench::running();
    for k in 0..12 {
        bench.hand.angles[9] = if k % 2 == 0 { 1.2 } else { 0.1 };
        bench.run(3);
    }
    assert_eq!(bench.link.phase(), Phase::Running, "a jump there and back is one set that is not used");
    bench.hand.moves = false;
    bench.hand.angles[9] = 1.5;
    bench.lets_go(40, "jumping");
}
