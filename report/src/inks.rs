//! Assignment of one colour per signal of a page.

use super::theme::Ink;
use super::thinning::Envelope;

/// The colours of signals, in the order of their appearance. Signals with equal names or equal samples share
/// a colour.
#[derive(Debug, Default)]
pub(crate) struct Inks {
    known: Vec<(String, Option<Envelope>, Ink)>,
}

impl Inks {
    /// The colour of a signal in a frame that already uses the colours `beside`: its own, unless another
    /// signal there has the same.
    pub(crate) fn of(&mut self, name: &str, samples: Option<&Envelope>, beside: &[Ink]) -> Ink {
        let is_it = |(known, of, _): &&(String, Option<Envelope>, Ink)| {
            known == name || samples.is_some() && of.as_ref() == samples
        };
        let known = self.known.iter().find(is_it).map(|(.., ink)| *ink);
        if let Some(ink) = known.filter(|ink| !beside.contains(ink)) {
            return ink;
        }
        let uses = |ink: &Ink| self.known.iter().filter(|(.., of)| of == ink).count();
        let free = Ink::CYCLE.into_iter().filter(|ink| !beside.contains(ink));
        // The first of the least used colours.
        let ink = free.min_by_key(uses).unwrap_or(Ink::number(beside.len()));
        if known.is_none() {
            self.known.push((name.to_owned(), samples.cloned(), ink));
        }
        ink
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_signal_keeps_its_colour_and_shares_it_with_its_aliases() {
        let curve = |samples: [f64; 3]| {
            let mut envelope = Envelope::new(10.0);
            envelope.extend(samples);
            envelope
        };
        let (load, speed) = (curve([1.0, 2.0, 3.0]), curve([3.0, 2.0, 1.0]));
        let mut inks = Inks::default();
        let first = inks.of("tip.load", Some(&load), &[]);
        let second = inks.of("tip.speed", Some(&speed), &[first]);
        assert_ne!(first, second);
        assert_eq!(inks.of("tip.load", None, &[]), first);
        assert_eq!(inks.of("felt.force", Some(&load), &[second]), first);
        // Beside another of its colour it has another, there only.
        assert_ne!(inks.of("tip.load", None, &[first]), first);
        assert_eq!(inks.of("tip.load", None, &[]), first);
    }
}
