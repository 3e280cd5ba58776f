//! What each page shows. The participant's never has a name, order, file or setting of a surface or version.

use super::{Conductor, Current, Seat, State};
use crate::document::{Masking, Page, Phase, Question, texts};
use crate::phase::Asks;
use haptograph_engine::settings::Setting;
use serde_json::{Map, Value, json};

impl Conductor {
    pub(super) fn participants(&self, now_s: f64) -> Value {
        let mut view = self.participant_state(now_s);
        view["type"] = json!("participant");
        let texts = self.texts();
        let feedback = self.seat.as_ref().and_then(|seat| seat.feedback);
        view["feedback"] =
            feedback.map_or(Value::Null, |right| texts[if right { "right" } else { "wrong" }].clone());
        view["texts"] = texts;
        view["masking"] = match self.page().map(|page| &page.masking) {
            None | Some(Masking::Silence) => Value::Null,
            Some(noise) => noise.show().to_lowercase().into(),
        };
        view
    }

    fn page(&self) -> Option<&Page> {
        self.checked.study.page.as_ref()
    }

    fn texts(&self) -> Value {
        let own = self.page().map(|page| &page.texts);
        let text = |(name, english): (&str, &str)| {
            let own = own.and_then(|own| own.0.iter().find(|(known, _)| known.text == name));
            (name.to_owned(), json!(own.map_or(english, |(_, text)| text)))
        };
        let mut texts: Map<String, Value> = texts().map(text).collect();
        let language = self.page().map_or("en", |page| &page.language);
        texts.insert("language".to_owned(), language.into());
        Value::Object(texts)
    }

    fn participant_state(&self, now_s: f64) -> Value {
        let Some(seat) = &self.seat else { return json!({ "state": "idle" }) };
        match &seat.state {
            State::Consent => json!({ "state": "consent" }),
            State::Done => json!({ "state": "done" }),
            State::Preparing(_) => {
                json!({ "state": if seat.held.is_some_and(|(why, _)| why.starts_with("STOP")) { "stopped" } else { "wait" } })
            }
            State::Prepared(current) if self.awaits_start(current) => {
                json!({ "state": "start", "trial": current.trial.number })
            }
            State::Prepared(_) => json!({ "state": "wait" }),
            State::Felt(current) if !current.has_begun(now_s) && !current.has_turns() => {
                json!({ "state": "wait" })
            }
            State::Felt(current) => self.trial_view(seat, current, now_s),
        }
    }

    fn trial_view(&self, seat: &Seat, current: &Current, now_s: f64) -> Value {
        let phase = &self.checked.study.phases.0[current.trial.phase].1;
        let turns = current.has_turns().then(|| json!({ "now": current.place, "felt": current.felt }));
        let is_open = current.opened_s.is_some();
        json!({
            "state": "trial", "trial": current.trial.number, "of": seat.trials.len(), "text": phase.facts().text,
            "input": self.input(phase, current),
            "turns": turns,
            // What is only laid out is felt beside the page.
            "pad": current.renders(&self.checked.study),
            "begins": !current.has_begun(now_s),
            "training": current.trial.is_training,
            "conditions": self.conditions(current, now_s), "open": is_open, "lamp": self.page().and_then(|page| page.lamp.as_ref()).map(|_| self.lamp),
        })
    }

    /// What is asked for.
    fn input(&self, phase: &Phase, current: &Current) -> Value {
        let line = || {
            let scale = current.trial.scale.and_then(|at| self.checked.study.scales.0.get(at));
            scale.map_or(
                Value::Null,
                |(_, of)| json!({ "kind": "line", "ask": of.ask, "from": of.from, "to": of.to }),
            )
        };
        match phase.facts().asks {
            Asks::Nothing => json!({ "kind": "none", "ask": "" }),
            Asks::Take => json!({ "kind": "record", "ask": "" }),
            Asks::Words(ask) => json!({ "kind": "words", "ask": ask, "optional": false }),
            Asks::Line => line(),
            Asks::Which(ask) | Asks::WhichIsX(ask) | Asks::More(ask) => {
                json!({ "kind": "which", "ask": ask })
            }
            Asks::Question(of) => match current.trial.question.and_then(|at| of.0.get(at)) {
                Some((_, Question::Number(of))) => {
                    json!({ "kind": "number", "ask": of.ask, "from": of.from, "to": of.to })
                }
                Some((_, Question::Choice(of))) => json!({ "kind": "choice", "ask": of.ask, "of": of.of }),
                Some((_, Question::Text(of))) => {
                    json!({ "kind": "words", "ask": of.ask, "optional": of.optional })
                }
                None => Value::Null,
            },
        }
    }

    pub(super) fn experimenters(&self, now_s: f64) -> Value {
        let study = &self.checked.study;
        let groups = (0..study.group_count()).map(|group| {
            let name = study.group_name(group);
            let there = self.known.iter().filter(|known| known.group == name && !known.has_withdrawn).count();
            json!({ "name": name, "wanted": study.groups.0.get(group).map(|(_, people)| people), "there": there })
        });
        let participants = self.known.iter().map(|known| {
            json!({ "code": known.code, "group": known.group, "done": known.done, "finished": known.has_finished, "withdrawn": known.has_withdrawn })
        });
        json!({
            "type": "experimenter", "about": study.about, "file": self.checked.path.display().to_string(),
            "folder": self.folder.path().display().to_string(),
            "groups": groups.collect::<Vec<_>>(), "participants": participants.collect::<Vec<_>>(),
            "has_consent_text": self.page().is_some_and(|page| page.texts.find("consent").is_some()),
            "driven": self.driven, "to_confirm": self.needs_confirmation(), "trouble": self.trouble,
            "session": self.seat.as_ref().map(|seat| self.session_view(seat, now_s)),
        })
    }

    fn session_view(&self, seat: &Seat, now_s: f64) -> Value {
        let (state, current) = match &seat.state {
            State::Consent => ("consent", None),
            State::Done => ("done", None),
            State::Preparing(current) => ("preparing", Some(current)),
            State::Prepared(current) => ("prepared", Some(current)),
            State::Felt(current) => ("felt", Some(current)),
        };
        let trial = current.map(|current| {
            let (name, phase) = &self.checked.study.phases.0[current.trial.phase];
            let row = self.checked.row_without_hash(&current.trial);
            json!({
                "trial": current.trial.number, "phase": name.text, "kind": phase.kind(),
                "scale": if phase.facts().has_x() { "" } else { &row.scale },
                "training": current.trial.is_training, "conditions": self.conditions(current, now_s),
                "open": current.opened_s.is_some(), "forced": current.is_forced, "felt_s": current.explored_s(now_s).round(),
            })
        });
        json!({
            "code": seat.code, "group": self.checked.study.group_name(seat.group), "state": state, "of": seat.trials.len(),
            "held": seat.held.map(|(why, _)| why), "laid": seat.laid, "is_pair": current.is_some_and(|current| current.places.len() > 1),
            "trial": trial,
        })
    }

    /// The conditions of what is felt now, and the part of each that is reached; of a recording the time that is left.
    fn conditions(&self, current: &Current, now_s: f64) -> Vec<Value> {
        let part = |part: f64| (part * 50.0).floor() / 50.0;
        if let Some(length_s) = self.checked.study.phases.0[current.trial.phase].1.facts().length_s {
            let done_s = current.explored_s(now_s).min(length_s);
            let left = format!("{:.0} s", (length_s - done_s).ceil());
            return vec![json!({ "name": left, "part": part(done_s / length_s.max(1e-9)) })];
        }
        let tally = current.tallies[current.place].as_ref().filter(|_| current.is_virtual(current.place));
        let reached = tally.into_iter().flat_map(|tally| tally.reached());
        reached.map(|(name, reached)| json!({ "name": name, "part": part(reached) })).collect()
    }
}
