//! Coverage of a recording in progress: the areas of speed and force that it has visited.

use crate::simulated::orientation::{from_rotation_vector, rotate};
use crate::vector::{Vec3, ZERO, add, norm, scale, sub};
use haptograph_engine::node::FileProgress;
use haptograph_surfaces::coverage::{Coverage, FORCE_BANDS_N, SPEED_BANDS_M_S};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

/// Length of the windows over which speed and force are averaged, s.
const WINDOW_S: f64 = 0.1;

/// The coverage so far, shared with the terminal.
#[derive(Debug, Default)]
pub(super) struct Visited(Mutex<Coverage>);

impl Visited {
    fn add(&self, speed_m_s: f64, force_n: f64, length_s: f64) {
        let mut coverage = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        coverage.add(speed_m_s, force_n, length_s);
    }
}

impl FileProgress for Visited {
    fn lines(&self) -> Vec<String> {
        let coverage = self.0.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let next =
            coverage.next_to_record().map_or_else(String::new, |next| format!("; record next: {next}"));
        let visited = 9 - coverage.missing().len();
        let mut lines =
            vec![format!("{visited} of 9 areas of speed and force, about {:.0} s{next}", coverage.used_s)];
        let speeds = SPEED_BANDS_M_S
            .map(|(low, high)| format!("{:>12}", format!("{:.0} to {:.0}", 1e3 * low, 1e3 * high)));
        lines.push(format!("  {:<12}{} mm/s", "", speeds.concat()));
        for (force, (low, high)) in FORCE_BANDS_N.iter().enumerate() {
            let cells = coverage.cells_s.map(|speed| format!("{:>12}", format!("{:.1} s", speed[force])));
            lines.push(format!("  {:<12}{}", format!("{low} to {high} N"), cells.concat()));
        }
        lines
    }
}

/// Computes the coverage from the readings.
#[derive(Debug)]
pub(super) struct Visits {
    visited: Arc<Visited>,
    tracker_to_tip_m: Vec3,
    /// Poses per window, and those of the present window.
    window: usize,
    poses: usize,
    period_s: f64,
    /// Incomplete poses.
    positions: VecDeque<Vec3>,
    turns: VecDeque<Vec3>,
    /// Position of the tip at the start of the window.
    start: Option<Vec3>,
    force: Vec3,
    loads: usize,
}

impl Visits {
    /// Takes the tracker's rate and the tip's offset from its sensor.
    pub(super) fn new(visited: Arc<Visited>, tracker_to_tip_m: Vec3, rate_hz: f64) -> Self {
        Self {
            visited,
            tracker_to_tip_m,
            window: ((WINDOW_S * rate_hz).round() as usize).max(1),
            poses: 0,
            period_s: 1.0 / rate_hz,
            positions: VecDeque::new(),
            turns: VecDeque::new(),
            start: None,
            force: ZERO,
            loads: 0,
        }
    }

    /// Takes frames of position (0), orientation (1) and wrench (2); ignores other streams.
    pub(super) fn take(&mut self, stream: usize, frames: &[f64]) {
        match stream {
            0 => self.positions.extend(frames.as_chunks::<3>().0),
            1 => self.turns.extend(frames.as_chunks::<3>().0),
            2 => frames.as_chunks::<6>().0.iter().for_each(|&[x, y, z, ..]| {
                self.force = add(self.force, [x, y, z]);
                self.loads += 1;
            }),
            _ => {}
        }
        while !self.positions.is_empty()
            && let Some(turned) = self.turns.pop_front()
        {
            let position = self.positions.pop_front().unwrap_or_default();
            self.pose(add(position, rotate(from_rotation_vector(turned), self.tracker_to_tip_m)));
        }
    }

    fn pose(&mut self, tip: Vec3) {
        let Some(start) = self.start else {
            self.start = Some(tip);
            return;
        };
        self.poses += 1;
        if self.poses < self.window {
            return;
        }
        let length_s = self.window as f64 * self.period_s;
        if self.loads > 0 {
            let force_n = norm(scale(self.force, 1.0 / self.loads as f64));
            self.visited.add(norm(sub(tip, start)) / length_s, force_n, length_s);
        }
        (self.start, self.poses) = (Some(tip), 0);
        (self.force, self.loads) = (ZERO, 0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stroke_is_counted_where_its_speed_and_force_are() {
        let visited = Arc::new(Visited::default());
        let mut visits = Visits::new(Arc::clone(&visited), [0.0, 0.0, -0.1], 240.0);
        // A second at 100 mm/s and 1 N; the tool turns by nothing.
        for pose in 0..241 {
            visits.take(2, &[0.0, 0.0, 1.0, 0.0, 0.0, 0.0].repeat(4));
            visits.take(0, &[0.1 * f64::from(pose) / 240.0, 0.0, 0.0]);
            visits.take(1, &[0.0; 3]);
        }
        let coverage = visited.0.lock().unwrap().clone();
        assert!((coverage.cells_s[1][1] - 1.0).abs() < 1e-9, "{coverage:?}");
        let lines = visited.lines();
        assert!(lines[0].starts_with("1 of 9 areas") && lines.len() == 5, "{lines:?}");
        assert!(lines[3].contains("1.0 s"), "{lines:?}");
    }
}
