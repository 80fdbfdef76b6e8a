//! Operator, camera and driver of `tautscope ros2 --driver`.

use std::io::BufRead;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use hiroz::attachment::Attachment;
use hiroz::msg::ZMessage;
use hiroz::prelude::*;
use hiroz_msgs::builtin_interfaces::Time;
use hiroz_msgs::sensor_msgs::{Image, JointState};
use hiroz_msgs::std_msgs::Header;

use crate::record::{Bits, Record};
use crate::say;

/// Width and height of the images [px].
pub const SIZE: (u32, u32) = (720, 576);
const CENTRE: [f64; 3] = [0.025, 0.0, 0.9];
const AMPLITUDE: [f64; 3] = [0.004, 0.5, 0.25];
const PERIOD: f64 = 10.0;
const WATCHDOG: Duration = Duration::from_millis(100);

fn header(frame: &str) -> Header {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).expect("clock");
    let stamp = Time {
        sec: now.as_secs() as i32,
        nanosec: now.subsec_nanos(),
    };
    Header {
        stamp,
        frame_id: frame.into(),
    }
}

fn joints(position: &[f64]) -> JointState {
    let name = ["insertion", "rotation", "bending"]
        .map(String::from)
        .to_vec();
    JointState {
        header: header("guide"),
        name,
        position: position.to_vec(),
        ..Default::default()
    }
}

fn bits(message: &JointState) -> Bits {
    std::array::from_fn(|i| message.position[i].to_bits())
}

fn reference(phase: f64) -> [f64; 3] {
    let sine = (std::f64::consts::TAU * phase / PERIOD).sin();
    std::array::from_fn(|i| CENTRE[i] + AMPLITUDE[i] * sine)
}

/// Sleep in steps of a period that do not add up delays.
struct Pace {
    due: Instant,
    period: Duration,
}

impl Pace {
    fn new(period: Duration) -> Self {
        Self {
            due: Instant::now(),
            period,
        }
    }

    fn wait(&mut self) {
        self.due += self.period;
        let now = Instant::now();
        if self.due > now {
            std::thread::sleep(self.due - now);
        } else {
            self.due = now;
        }
    }
}

fn quality(depth: usize, reliability: QosReliability) -> QosProfile {
    QosProfile {
        history: QosHistory::from_depth(depth),
        reliability,
        ..Default::default()
    }
}

/// Plays operator, camera and driver until a request ends it.
pub fn stream(node: Arc<ZNode>, frames: Vec<Vec<u8>>) -> Result<()> {
    let record = Arc::new(Mutex::new(Record::default()));
    let is_silent = Arc::new(AtomicBool::new(true));
    let phase = Arc::new(AtomicU64::new(0.0f64.to_bits()));
    let position = Arc::new(Mutex::new(reference(0.0)));
    let reliable = |depth| quality(depth, QosReliability::Reliable);

    // The driver: positions are the last set-point; without set-points it stops.
    let driver = node
        .create_pub::<JointState>("/instrument/actuators/measured_js")
        .with_qos(reliable(1))
        .build()?;
    let at = position.clone();
    let watched = record.clone();
    std::thread::spawn(move || {
        let mut pace = Pace::new(Duration::from_millis(5));
        loop {
            let now = *at.lock().expect("lock");
            driver.publish(&joints(&now)).expect("publish");
            let mut record = watched.lock().expect("lock");
            if let (Some(last), false) = (record.received_at, record.is_stopped) {
                let silence = last.elapsed();
                if silence > WATCHDOG {
                    record.is_stopped = true;
                    say(format!(
                        "{{\"event\": \"quick stop\", \"after\": {}}}",
                        silence.as_secs_f64()
                    ));
                }
            }
            drop(record);
            pace.wait();
        }
    });

    let setpoints = node
        .create_sub::<JointState>("/instrument/setpoint_js")
        .with_qos(reliable(1000))
        .build()?;
    let accepted = record.clone();
    std::thread::spawn(move || {
        loop {
            let sample = setpoints.recv_serialized().expect("sample");
            let message =
                JointState::deserialize(&sample.payload().to_bytes()).expect("JointState");
            let sequence =
                Attachment::try_from(sample.attachment().expect("attachment")).expect("attachment");
            accepted
                .lock()
                .expect("lock")
                .setpoints
                .insert(sequence.sequence_number, bits(&message));
        }
    });

    let commands = node
        .create_sub::<JointState>("/instrument/actuators/setpoint_js")
        .with_qos(reliable(1000))
        .build()?;
    let received = record.clone();
    let moved = position.clone();
    std::thread::spawn(move || {
        loop {
            let sample = commands.recv_serialized().expect("sample");
            let now = Instant::now();
            let message =
                JointState::deserialize(&sample.payload().to_bytes()).expect("JointState");
            let sequence = Attachment::try_from(sample.attachment().expect("attachment"))
                .expect("attachment")
                .sequence_number;
            moved
                .lock()
                .expect("lock")
                .copy_from_slice(&message.position);
            let mut record = received.lock().expect("lock");
            record.commands += 1;
            if let Some(last) = record.last_sequence {
                record.missed_commands += sequence - last - 1;
            }
            record.last_sequence = Some(sequence);
            if let Some(last) = record.received_at {
                record.largest_gap = record.largest_gap.max((now - last).as_secs_f64());
            }
            record.received_at = Some(now);
            record.is_stopped = false;
            let command = Some(bits(&message));
            if record.last_command != command {
                record.last_command = command;
                record.changed_at = Some(now);
            }
            record.arrivals.insert(sequence, now);
        }
    });

    let servo = node
        .create_pub::<JointState>("/instrument/servo_jp")
        .with_qos(reliable(1))
        .build()?;
    let (silent, sent, at) = (is_silent.clone(), record.clone(), phase.clone());
    std::thread::spawn(move || {
        let mut pace = Pace::new(Duration::from_millis(5));
        let mut was_silent = true;
        loop {
            let is_silent = silent.load(Ordering::SeqCst);
            if !is_silent {
                let last = f64::from_bits(at.load(Ordering::SeqCst));
                // A stream begins where the last one has ended: at the set-point, bit for bit.
                let now = if was_silent { last } else { last + 0.005 };
                at.store(now.to_bits(), Ordering::SeqCst);
                let message = joints(&reference(now));
                let mut record = sent.lock().expect("lock");
                let instant = Instant::now();
                record.sent.insert(bits(&message), instant);
                record.references += 1;
                record.last_reference = Some(instant);
                drop(record);
                servo.publish(&message).expect("publish");
            }
            was_silent = is_silent;
            pace.wait();
        }
    });

    let camera = node
        .create_pub::<Image>("/endoscope/image_raw")
        .with_qos(quality(1, QosReliability::BestEffort))
        .build()?;
    let shown = record.clone();
    let at = phase.clone();
    std::thread::spawn(move || {
        let mut pace = Pace::new(Duration::from_millis(40));
        loop {
            let now = f64::from_bits(at.load(Ordering::SeqCst));
            let index = (now * 25.0) as usize % frames.len();
            let message = Image {
                header: header("endoscope"),
                height: SIZE.1,
                width: SIZE.0,
                encoding: "bgr8".into(),
                is_bigendian: 0,
                step: 3 * SIZE.0,
                data: frames[index].clone().into(),
            };
            camera.publish(&message).expect("publish");
            shown.lock().expect("lock").images += 1;
            pace.wait();
        }
    });

    for line in std::io::stdin().lock().lines() {
        match line.expect("standard input").as_str() {
            "talk" => is_silent.store(false, Ordering::SeqCst),
            "silent" => {
                is_silent.store(true, Ordering::SeqCst);
                std::thread::sleep(Duration::from_millis(500));
                let after = record
                    .lock()
                    .expect("lock")
                    .motion_after_the_last_reference();
                say(format!("{{\"event\": \"silent\", \"after\": {after}}}"));
            }
            "report" => say(record.lock().expect("lock").report()),
            _ => break,
        }
    }
    Ok(())
}
