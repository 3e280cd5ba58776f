//! Whether devices speak, seen from the thread that looks after a run.

use super::link::Link;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A device is waited for so long at the start before anything is said.
const PATIENCE: Duration = Duration::from_secs(3);
/// Shorter silences are not told of: who looks after a run does not look more often.
const SHORTEST: Duration = Duration::from_millis(500);

/// A device that is listened to.
#[derive(Debug)]
pub(super) struct Listening {
    pub device: String,
    /// Address or path.
    pub place: String,
    pub link: Arc<Link>,
    timeout: Duration,
    /// Version of the latest news, and when they were first seen; the beginning where there are none.
    heard: u64,
    since: Instant,
    /// Was it said that nothing comes?
    missed: bool,
    /// Has the graph that runs no such device?
    parted: bool,
}

impl Listening {
    /// From `now` on.
    pub fn new(device: &str, place: String, link: &Arc<Link>, timeout: Duration, now: Instant) -> Self {
        Self {
            device: device.to_owned(),
            place,
            link: Arc::clone(link),
            timeout: timeout.max(SHORTEST),
            heard: link.news(),
            since: now,
            missed: false,
            parted: false,
        }
    }

    /// Whether the graph that runs from now on has it, and by which name.
    pub fn expect(&mut self, device: Option<&str>) {
        if let Some(device) = device {
            if self.parted {
                // What was not said meanwhile is not said now.
                (self.heard, self.since) = (self.link.news(), Instant::now());
            }
            device.clone_into(&mut self.device);
        }
        self.parted = device.is_none();
        self.missed &= !self.parted;
    }

    /// Looks whether anything came; says so when that changes.
    pub fn look(&mut self, now: Instant) -> Option<String> {
        if self.parted {
            return None;
        }
        let news = self.link.news();
        if news != self.heard {
            let first = self.heard == 0;
            (self.heard, self.since) = (news, now);
            let again = if first { "" } else { " again" };
            return std::mem::take(&mut self.missed).then(|| format!("{} speaks{again}", self.name()));
        }
        let patience = if self.heard == 0 { PATIENCE } else { self.timeout };
        if self.missed || now.saturating_duration_since(self.since) <= patience {
            return None;
        }
        self.missed = true;
        let said = if self.heard == 0 {
            "has said nothing yet: what it senses is zero, and nothing is driven"
        } else {
            "fell silent: forces and drives are at zero"
        };
        Some(format!("{} {said}", self.name()))
    }

    /// Does it say nothing, as was told?
    pub fn is_missed(&self) -> bool {
        self.missed
    }

    /// What to say at the end of one that never spoke.
    pub fn never(&self) -> Option<String> {
        let never = self.link.news() == 0 && !self.parted;
        never.then(|| {
            format!(
                "{} never spoke: what it sensed was zero, and nothing was driven",
                self.name()
            )
        })
    }

    fn name(&self) -> String {
        format!("`{}` at {}", self.device, self.place)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::link::SENSED;

    #[test]
    fn silence_is_told_of_when_it_begins_and_when_it_ends() {
        let (link, start) = (Arc::new(Link::new()), Instant::now());
        let place = "127.0.0.1:9750".to_owned();
        let mut arm = Listening::new("arm", place, &link, Duration::from_millis(20), start);
        let mut said = |ms: u64, speaks: bool| {
            if speaks {
                link.tell(&[0.0; SENSED]);
            }
            let note = arm.look(start + Duration::from_millis(ms));
            note.unwrap_or_default()
                .replace("`arm` at 127.0.0.1:9750 ", "")
                .split(':')
                .next()
                .unwrap()
                .to_owned()
        };
        let told = [
            (1000, false, ""),
            (3050, false, "has said nothing yet"),
            (3100, false, ""),
            (3150, true, "speaks"),
            (3200, true, ""),
            (3600, false, ""),
            (3750, false, "fell silent"),
            (9000, false, ""),
            (9050, true, "speaks again"),
        ];
        for (ms, speaks, note) in told {
            assert_eq!(said(ms, speaks), note, "at {ms} ms");
        }
    }

    #[test]
    fn only_one_that_never_spoke_is_told_of_in_the_end() {
        let link = Arc::new(Link::new());
        let arm = Listening::new("arm", "x".to_owned(), &link, Duration::ZERO, Instant::now());
        assert!(arm.never().is_some());
        link.tell(&[0.0; SENSED]);
        assert!(arm.never().is_none());
    }

    #[test]
    fn of_one_that_the_graph_has_no_more_nothing_is_said() {
        let (link, start) = (Arc::new(Link::new()), Instant::now());
        let mut arm = Listening::new("arm", "x".to_owned(), &link, Duration::ZERO, start);
        let later = |s: u64| start + Duration::from_secs(s);
        assert!(arm.look(later(4)).is_some() && arm.is_missed());
        arm.expect(None);
        assert!(arm.look(later(8)).is_none() && !arm.is_missed() && arm.never().is_none());
        arm.expect(Some("other arm"));
        let told = arm.look(later(12)).unwrap();
        assert!(
            told.starts_with("`other arm` at x has said nothing yet"),
            "{told}"
        );
        assert!(arm.never().is_some());
    }
}
