//! A link against a hand made of bytes: time is a number here, so every deadline is exact.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::struct_excessive_bools,
    reason = "a test may fail, and a hand has many ways to be odd"
)]

mod hand;
mod pace;

use hand::{Hand, Owned};
use tega_hand::{Asked, CLOSURE_POSES_RAD, HandController, HandLink, LinkSettings, Phase};
use tega_wire::allegro::{CanFrame, Received};

const MS: i64 = 1_000_000;

struct Bench {
    link: HandLink,
    hand: Hand,
    t_ms: i64,
    level: f64,
    added: f64,
    sent: Vec<(i64, CanFrame)>,
}

impl Bench {
    fn new(hand: Hand) -> Self {
        Self::with(hand, LinkSettings::default())
    }

    fn with(hand: Hand, settings: LinkSettings) -> Self {
        let link = HandLink::new(settings, HandController::default());
        Self { link, hand, t_ms: 0, level: 1.0, added: 0.0, sent: Vec::new() }
    }

    fn give(&mut self, frames: &[Owned]) -> Vec<CanFrame> {
        let frames: Vec<_> = frames
            .iter()
            .map(|(id, data)| Received { id: *id, data, remote: false, extended: false, error: false })
            .collect();
        let asked = Asked { level: self.level, added: self.added };
        let out = self.link.exchange(&frames, self.t_ms * MS, asked).unwrap();
        self.sent.extend(out.iter().map(|frame| (self.t_ms, *frame)));
        out
    }

    fn tick(&mut self) {
        self.t_ms += 1;
        let mut frames = self.hand.report(self.t_ms);
        // Answers take the way back and forth within the millisecond.
        while {
            let out = self.give(&frames);
            frames = self.hand.hear(&out);
            !frames.is_empty()
        } {}
    }

    fn run(&mut self, ms: i64) {
        (0..ms).for_each(|_| self.tick());
    }

    /// The default hand, which is steered.
    fn running() -> Self {
        let mut bench = Self::new(Hand::default());
        bench.run(600);
        bench
    }

    /// Lets time pass; the hand is then let go for this reason.
    fn lets_go(&mut self, ms: i64, fault: &str) {
        self.run(ms);
        assert_eq!(self.fault(), fault);
        assert!(self.limp());
    }

    fn fault(&self) -> &'static str {
        self.link.fault().map_or("", tega_hand::Fault::kind)
    }

    /// Whether any joint was ever told to push.
    fn pushed(&self) -> bool {
        let torque = |frame: &CanFrame| (0x180..=0x18C).contains(&frame.id());
        self.sent.iter().any(|(_, frame)| torque(frame) && frame.data().iter().any(|&b| b != 0))
    }

    fn limp(&self) -> bool {
        self.hand.duties == [0; 16] && !self.hand.servo_on
    }
}

#[test]
fn it_identifies_looks_and_only_then_switches_on() {
    let mut bench = Bench::new(Hand::default());
    bench.run(52);
    let first = bench.sent[0];
    assert_eq!((first.0, first.1.id(), first.1.is_remote()), (51, 0x200, true));
    bench.run(150);
    assert_eq!(bench.link.phase(), Phase::Running);
    let ids: Vec<u16> = bench.sent.iter().map(|(_, frame)| frame.id()).collect();
    let at = |id| ids.iter().position(|&i| i == id).unwrap();
    assert!(at(0x200) < at(0x180) && at(0x104) < at(0x204) && at(0x204) < at(0x100));
    assert!(bench.hand.servo_on);
    assert_eq!(bench.link.serial(), b"A080R\0\0\0");
    bench.level = 3.0;
    // The measured pose is not exactly a pose: it is left slowly.
    bench.run(5000);
    for (angle, wanted) in bench.hand.angles.iter().zip(CLOSURE_POSES_RAD[2]) {
        assert!((angle - wanted).abs() < 0.01, "{angle} {wanted}");
    }
    assert!((bench.link.counts().sets as f64 / (bench.t_ms as f64 / 3.0) - 1.0).abs() < 0.05);
}

#[test]
fn a_stranger_gets_requests_and_nothing_else() {
    for (hand, fault) in [
        (Hand { hardware: 0x0500, ..Hand::default() }, "wrong-version"),
        (Hand { hardware: 0x0301, ..Hand::default() }, "wrong-version"),
        (Hand { side: 1, ..Hand::default() }, "wrong-side"),
        (Hand { mute: true, ..Hand::default() }, "no-answer"),
    ] {
        let mut bench = Bench::new(hand);
        bench.run(600);
        assert_eq!(bench.fault(), fault);
        assert!(bench.sent.iter().all(|(_, frame)| frame.id() == 0x200 && frame.is_remote()));
        assert!(bench.link.abandon().is_empty());
    }
}

#[test]
fn silence_switches_off_after_30_ms_and_is_survived() {
    let mut bench = Bench::new(Hand::default());
    bench.level = 4.0;
    bench.run(1000);
    let last = bench.link.counts().sets;
    bench.hand.mute = true;
    bench.run(28);
    assert_eq!((bench.link.phase(), bench.link.counts().late), (Phase::Running, 1));
    bench.run(4);
    assert_eq!((bench.link.phase(), bench.link.counts().silences), (Phase::Silent, 1));
    assert!(bench.limp());
    bench.hand.mute = false;
    bench.hand.told = false; // its power was off
    bench.run(1200);
    assert_eq!(bench.link.phase(), Phase::Running);
    assert!(bench.hand.servo_on && bench.link.counts().sets > last);
}

#[test]
fn thirty_milliseconds_without_positions_are_borne_and_not_one_more() {
    let mut bench = Bench::running();
    assert_eq!(bench.t_ms % bench.hand.every_ms, 0); // a set has just come
    bench.hand.mute = true;
    bench.run(30);
    assert_eq!(bench.link.phase(), Phase::Running);
    bench.run(1);
    assert_eq!(bench.link.phase(), Phase::Silent);
}

#[test]
fn after_a_fault_the_motors_are_switched_off_quickly_at_first_and_then_now_and_then() {
    let mut bench = Bench::running();
    bench.hand.joint_c = 85;
    bench.sent.clear();
    bench.run(3000);
    assert_ne!(bench.fault(), "");
    let off: Vec<i64> = bench.sent.iter().filter(|(_, frame)| frame.id() == 0x104).map(|(t, _)| *t).collect();
    let waits: Vec<i64> = off.windows(2).map(|pair| pair[1] - pair[0]).collect();
    assert_eq!(waits[..4], [5, 5, 100, 100]);
}

#[test]
fn a_hand_that_stays_away_is_given_up_after_five_attempts() {
    let mut bench = Bench::new(Hand::default());
    bench.run(500);
    bench.hand.mute = true;
    bench.lets_go(6500, "silent");
}

#[test]
fn one_lost_frame_holds_that_finger_and_a_lost_finger_stops() {
    let mut bench = Bench::new(Hand::default());
    bench.level = 2.0;
    bench.run(600);
    bench.hand.missing_finger = Some(2);
    bench.run(3);
    bench.hand.missing_finger = None;
    bench.run(60);
    assert_eq!((bench.link.phase(), bench.link.counts().incomplete), (Phase::Running, 1));
    bench.hand.missing_finger = Some(2);
    bench.run(60);
    assert_eq!(bench.link.phase(), Phase::Silent);
    assert!(bench.limp());
    bench.run(2500);
    assert_eq!(bench.fault(), "no-positions");
    assert!(bench.link.fault().unwrap().to_string().contains("ring"), "{:?}", bench.link.fault());
}

#[test]
fn frames_that_come_twice_count_once() {
    let mut bench = Bench::new(Hand { twice: true, ..Hand::default() });
    bench.level = 3.0;
    bench.run(1000);
    let counts = bench.link.counts();
    assert_eq!((bench.link.phase(), counts.incomplete), (Phase::Running, 0));
    assert_eq!(counts.copies, 4 * counts.sets);
}

#[test]
fn two_sets_in_one_batch_are_two_cycles() {
    let mut bench = Bench::new(Hand { moves: false, ..Hand::default() });
    bench.run(600);
    let before = bench.link.counts();
    let set = bench.hand.report(600);
    bench.t_ms += 3;
    let out = bench.give(&[set.clone(), set].concat());
    let after = bench.link.counts();
    assert_eq!((after.sets - before.sets, after.copies, out.len()), (2, 0, 4));
}

#[test]
fn a_frozen_hand_is_let_go() {
    let mut bench = Bench::new(Hand { moves: false, ..Hand::default() });
    bench.run(1000);
    assert_eq!(bench.link.phase(), Phase::Running); // at rest it may well stand still
    bench.level = 5.0;
    bench.lets_go(1500, "frozen");
}

#[test]
fn heat_lowers_the_torque_and_then_ends_it() {
    let [cool, warm] = [40, 75].map(|joint_c| {
        let mut bench = Bench::new(Hand { joint_c, moves: false, ..Hand::default() });
        bench.run(600);
        bench.level = 5.0;
        bench.run(500);
        bench.hand.duties.into_iter().sum::<i16>()
    });
    assert!(cool > 1000 && 5 * cool > 6 * warm, "{cool} {warm}");
    let mut bench = Bench::running();
    assert!((bench.link.heat_share(600 * MS) - 1.0).abs() < 1e-12);
    bench.hand.joint_c = 75;
    bench.run(600);
    assert!((bench.link.heat_share(1200 * MS) - 0.5).abs() < 1e-12);
    bench.hand.joint_c = 0xF6; // no reading at all
    bench.run(600);
    assert_eq!(bench.link.phase(), Phase::Running);
    bench.hand.joint_c = 80;
    bench.lets_go(600, "too-hot");
}

#[test]
fn what_is_no_longer_reported_counts_as_hot() {
    let changes: [fn(&mut Hand); 4] = [
        |hand| hand.index_c = Some(0xF6), // one joint's sensor, and not a whole finger
        |hand| hand.joint_c = 0xF6,       // every sensor
        |hand| hand.mute_info = true,     // status, with the fault bits
        |hand| hand.missing_heat = Some(3), // one finger's messages
    ];
    for change in changes {
        let mut bench = Bench::new(Hand { joint_c: 66, ..Hand::default() });
        bench.run(1000);
        change(&mut bench.hand);
        let share = |bench: &Bench| bench.link.heat_share(bench.t_ms * MS);
        bench.run(3000);
        assert!((share(&bench) - 0.8).abs() < 1e-12, "the last reading stands meanwhile: {}", share(&bench));
        bench.run(3000);
        assert!((share(&bench) - 0.5).abs() < 1e-12, "{}", share(&bench));
        assert_eq!(bench.link.phase(), Phase::Running);
    }
    // A sensor that has never answered, as on a real hand that was recorded, takes nothing from the others.
    let mut bench = Bench::new(Hand { index_c: Some(0xF6), ..Hand::default() });
    bench.run(8000);
    assert!((bench.link.heat_share(8000 * MS) - 1.0).abs() < 1e-12);
}

#[test]
fn a_hand_that_is_not_the_one_that_was_switched_on_is_let_go() {
    let mut bench = Bench::running();
    bench.hand.mute = true;
    bench.run(40);
    bench.hand = Hand { serial: b'Q', ..Hand::default() };
    bench.lets_go(1300, "other-hand");
    let mut bench = Bench::running();
    bench.run(1000);
    bench.hand.servo_on = false; // its own doing, or another program's
    bench.lets_go(1110, "motors-off");
    // Its guard has let go of the hand: with this patience the link finds that out by the silence alone.
    let patient = LinkSettings { silent_after_ns: 2000 * MS, lowest_rate_hz: 0.0, ..LinkSettings::default() };
    let mut bench = Bench::with(Hand::default(), patient);
    bench.run(1600);
    (bench.hand.servo_on, bench.hand.told) = (false, false);
    bench.run(5000);
    assert_eq!((bench.link.phase(), bench.link.counts().silences), (Phase::Running, 1));
}

#[test]
fn temperatures_that_do_not_come_are_asked_for() {
    let mut bench = Bench::new(Hand { reports_temperature: false, ..Hand::default() });
    bench.run(1500);
    assert_eq!(bench.link.joints_c(), &[None; 16]);
    bench.run(1500);
    assert_eq!(bench.link.joints_c(), &[Some(40); 16]);
}

#[test]
fn a_fault_of_the_hand_stops_and_a_warning_only_lowers() {
    let mut bench = Bench::new(Hand { status: 0b0100, ..Hand::default() });
    bench.run(1500);
    assert_eq!(bench.link.phase(), Phase::Running);
    assert!((bench.link.heat_share(1500 * MS) - 0.5).abs() < 1e-12);
    bench.hand.status = 0b1_0000;
    bench.lets_go(1010, "reported");
}

#[test]
fn another_program_on_the_bus_is_no_company() {
    let mut bench = Bench::new(Hand::default());
    bench.run(10);
    bench.give(&[(0x184, vec![1, 0, 0, 0, 0, 0, 0, 0])]);
    assert_eq!(bench.fault(), "foreign-host");
    assert!(bench.sent.is_empty());
    let mut bench = Bench::new(Hand::default());
    bench.level = 3.0;
    bench.run(800);
    let out = bench.give(&[(0x100, Vec::new())]);
    bench.hand.hear(&out);
    assert_eq!(bench.fault(), "foreign-host");
    assert!(bench.limp());
}

#[test]
fn letting_go_fades_the_torque_and_silences_the_hand() {
    let mut bench = Bench::new(Hand::default());
    bench.level = 5.0;
    bench.run(1500);
    assert!(bench.pushed());
    bench.link.release(bench.t_ms * MS);
    bench.run(100);
    assert!(bench.hand.servo_on && !bench.link.released());
    bench.run(130);
    assert!(bench.limp() && bench.link.released() && !bench.hand.told);
    let sent = bench.sent.len();
    bench.run(500);
    assert_eq!(bench.sent.len(), sent);
}

#[test]
fn reading_only_never_switches_on() {
    let settings = LinkSettings { torque: false, ..LinkSettings::default() };
    let mut bench = Bench::with(Hand { angles: [0.4; 16], ..Hand::default() }, settings);
    bench.level = 5.0;
    bench.run(1500);
    assert_eq!(bench.link.phase(), Phase::Running);
    assert!(!bench.hand.servo_on && !bench.pushed());
    assert!((bench.link.angles_rad().unwrap()[5] - 0.4).abs() < 1e-4);
}

#[test]
fn any_frame_is_survived() {
    let mut bench = Bench::new(Hand::default());
    bench.run(400);
    for id in [0x001, 0x040, 0x080, 0x0C0, 0x0E0, 0x200, 0x220, 0x3C0, 0x7FF] {
        for len in 0..=8 {
            bench.give(&[(id, vec![0xA5; len])]);
        }
    }
    bench.level = 6.0;
    assert!(bench.link.exchange(&[], bench.t_ms * MS, 6.0).is_err());
    for added in [f64::NAN, f64::INFINITY, -0.1, 1.1] {
        let before = bench.link.clone();
        assert!(bench.link.exchange(&[], bench.t_ms * MS, Asked { level: 3.0, added }).is_err());
        assert_eq!(bench.link, before);
    }
}

#[test]
fn what_is_added_is_in_the_targets_within_120_ms_and_goes_when_the_hand_is_let_go() {
    let mut bench = Bench::new(Hand::default());
    bench.level = 3.0;
    bench.run(5000);
    let place = |bench: &Bench| {
        let (below, above) = (CLOSURE_POSES_RAD[2][1], CLOSURE_POSES_RAD[3][1]);
        3.0 + (bench.link.target_rad().unwrap()[1] - below) / (above - below)
    };
    assert!((place(&bench) - 3.0).abs() < 1e-9);
    bench.added = 0.5;
    bench.run(120);
    assert!((place(&bench) - 3.5).abs() < 1e-9, "{}", place(&bench));
    // By the person's own level it takes half a second and more.
    (bench.level, bench.added) = (3.5, 0.0);
    bench.run(120);
    assert!(place(&bench) < 3.2, "{}", place(&bench));
    (bench.level, bench.added) = (3.0, 0.5);
    bench.run(1500);
    bench.link.release(bench.t_ms * MS);
    bench.run(150);
    assert!((place(&bench) - 3.0).abs() < 1e-9, "{}", place(&bench));
}
