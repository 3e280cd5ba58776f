//! A study on the stage: the run of each trial, and what its two pages say and see.

use super::super::pads::Pad;
use super::super::pages::Reach;
use super::super::run_cycle::{NextRun, State};
use super::super::study::OnStage;
use super::super::talk::Response;
use super::super::wire::{ClientMessage, text};
use super::Stage;
use crate::actuators::driven;
use haptograph_engine::run::ARM_HOLD_S;
use haptograph_study::conduct::{Conduct, Presentation, Said, Step};
use serde_json::{Value, json};

impl Stage {
    /// True if the participant's page may hear what is rendered.
    pub(crate) fn study_renders(&self) -> bool {
        let renders =
            |study: &OnStage| study.conductor.is_rendering() && study.conductor.is_felt_at(study.now_s());
        self.pages.study.as_ref().is_none_or(renders)
    }

    /// True unless a study does not let the participant feel anything now.
    pub(crate) fn study_feels(&self) -> bool {
        self.pages.study.as_ref().is_none_or(|study| study.conductor.is_felt_at(study.now_s()))
    }

    /// Takes what a page of a study says: its own messages, STOP and what an actuator's safety needs; all else is refused.
    pub(crate) fn hear_in_study(&mut self, page: u64, message: ClientMessage) -> Response {
        let reach = self.pages.list.iter().find(|known| known.id == page).map(|page| page.reach);
        let done = match (message, reach) {
            (ClientMessage::Stop, reach) => {
                let whose = match reach {
                    Some(Reach::Participant) => "STOP of the participant",
                    _ => "STOP of the experimenter",
                };
                self.interrupt_study(whose);
                Ok(())
            }
            (ClientMessage::Sound { on }, Some(Reach::Participant)) => {
                self.page_of(page, |page| page.hears = on);
                Ok(())
            }
            (ClientMessage::Hold, Some(Reach::Machine)) => {
                self.devices.switch.hold();
                if let Some(study) = &mut self.pages.study {
                    study.held_s = Some(study.now_s());
                }
                Ok(())
            }
            (ClientMessage::Study(said), Some(Reach::Participant))
                if said.is_participants() && self.pages.owner == Some(page) =>
            {
                self.say(said)
            }
            (ClientMessage::Study(said), Some(Reach::Machine)) if !said.is_participants() => self.say(said),
            _ => Err("this page of a study cannot do that".to_owned()),
        };
        match done {
            Ok(()) => Response::None,
            Err(error) => {
                // A participant is told no path and no name.
                let error = match (reach, &mut self.pages.study) {
                    (Some(Reach::Participant), Some(study)) => {
                        study.conductor.report(error);
                        String::new()
                    }
                    _ => error,
                };
                Response::Answer(json!({ "type": "refused", "error": error }))
            }
        }
    }

    fn say(&mut self, said: Said) -> Result<(), String> {
        let Some(study) = &mut self.pages.study else { return Ok(()) };
        let now_s = study.now_s();
        let step = study.conductor.hear(said, now_s)?;
        self.step(step);
        self.tell_study();
        Ok(())
    }

    /// Does what the study asks for.
    fn step(&mut self, step: Step) {
        let Some(study) = &mut self.pages.study else { return };
        match step {
            Step::None => {}
            Step::Silence => {
                study.presentation = None;
                self.halt();
            }
            Step::Present(presentation) => {
                study.presentation = Some(presentation);
                if self.cycle.state == State::Failed {
                    // The experimenter knows, and tries again.
                    self.cycle.state = State::Stopped;
                }
                self.restart(NextRun::Record);
            }
            Step::Arm => {
                let now_s = study.now_s();
                let is_held = study.held_s.is_some_and(|held_s| now_s - held_s < ARM_HOLD_S);
                if is_held && self.pages.owner.is_some() {
                    self.devices.switch.arm(1.0);
                } else {
                    self.interrupt_study("a page is not there");
                }
            }
        }
    }

    /// What the next run of a study is of, with the folder in which it is kept.
    pub(crate) fn prepare_presentation(&mut self) {
        let Some(study) = &mut self.pages.study else { return };
        if let Some(Presentation { set, seed, folder, name }) = study.presentation.take() {
            (self.source.set, self.source.seed) = (set, Some(seed));
            (self.recorder.out, self.recorder.name) = (Some(folder), Some(name));
        }
    }

    /// Says that the run of a trial has begun.
    pub(crate) fn began_in_study(&mut self) {
        if let Some(study) = &mut self.pages.study {
            let now_s = study.now_s();
            study.conductor.began(now_s);
        }
    }

    /// Interrupts the trial of a study and ends its run.
    pub(crate) fn interrupt_study(&mut self, why: &'static str) {
        if let Some(study) = &mut self.pages.study {
            let now_s = study.now_s();
            study.conductor.interrupt(why, now_s);
            study.presentation = None;
            self.halt();
        }
    }

    /// True if a study drives something real.
    pub(crate) fn study_drives(&self) -> bool {
        self.pages.study.is_some() && !driven(&self.loaded.graph).is_empty()
    }

    /// Says that a run of a study did not start.
    pub(crate) fn fail_in_study(&mut self, why: &str) {
        if let Some(study) = &mut self.pages.study {
            let now_s = study.now_s();
            study.conductor.fail(why.to_owned(), now_s);
            study.presentation = None;
        }
    }

    /// Lets time pass for a study: its conditions, and what its pages see.
    pub(crate) fn conduct(&mut self) {
        let Some(study) = &mut self.pages.study else { return };
        let now_s = study.now_s();
        for name in study.conductor.ports() {
            let Ok((node, output)) = self.loaded.graph.find_output(&name) else { continue };
            let node = &self.loaded.graph.nodes()[node];
            let port = format!("{}.{}", node.path, node.outputs[output].name);
            if let Some(scope) = self.signals.scopes.iter().find(|scope| scope.port.name == port) {
                let unit = scope.port.quantity.unit();
                study.conductor.take(&name, (scope.lanes(), &unit), scope.fresh(), now_s);
            }
        }
        if !study.conductor.has_run() && self.session.is_some() && !self.cycle.is_stopping {
            // No run without a trial.
            study.presentation = None;
            self.halt();
            return self.tell_study();
        }
        let is_unarmed = !driven(&self.loaded.graph).is_empty() && !self.devices.switch.is_armed();
        // How a real device is touched only the graph knows.
        let pads = &self.signals.pads;
        let is_touched = pads.is_empty() || pads.iter().any(|pad| pad.force_n() > 0.0);
        if study.conductor.is_rendering() && self.cycle.state != State::Running {
            self.interrupt_study("the run ended");
        } else if study.conductor.is_rendering() && is_unarmed {
            self.interrupt_study("the actuators were disarmed");
        } else {
            match study.conductor.tick(now_s, (self.session.is_some(), is_touched)) {
                Ok(step) => self.step(step),
                Err(error) => self.fail_in_study(&error),
            }
        }
        self.tell_study();
    }

    /// Sends each page what it shows, if that has changed.
    fn tell_study(&mut self) {
        let recorded = self.recorded().into();
        let Some(study) = &mut self.pages.study else { return };
        let now_s = study.now_s();
        let mut views = [study.conductor.participant_view(now_s), study.conductor.experimenter_view(now_s)];
        let is_there = self.pages.list.iter().any(|page| page.reach == Reach::Participant);
        views[0]["pads"] = self.loaded.pads.iter().map(|pad| pad.plain()).collect();
        let rate_hz = self.signals.sound.as_ref().map(|sound| sound.rate_hz);
        views[0]["sound_hz"] = rate_hz.filter(|_| driven(&self.loaded.graph).is_empty()).into();
        views[1]["participant_is_there"] = is_there.into();
        // A hand on the page's pad, N; how hard one presses tells nothing about what is rendered.
        views[1]["recorded"] = recorded;
        let pressed_n = self.signals.pads.iter().map(Pad::force_n).fold(0.0, f64::max);
        views[1]["pressed_n"] = ((pressed_n * 10.0).round() / 10.0).into();
        for (number, view) in views.into_iter().enumerate() {
            if study.told[number] == view {
                continue;
            }
            let message = text(&view);
            let of_kind = |reach| (reach == Reach::Participant) == (number == 0) && reach != Reach::Network;
            for page in self.pages.list.iter_mut().filter(|page| of_kind(page.reach)) {
                page.tell(message.clone());
            }
            study.told[number] = view;
        }
    }

    /// The first message about a study to a page that comes.
    pub(crate) fn study_greeting(&mut self, reach: Reach) -> Option<Value> {
        let study = self.pages.study.as_mut()?;
        // Whoever comes is told all.
        study.told[usize::from(reach != Reach::Participant)] = Value::Null;
        let role = if reach == Reach::Participant { "participant" } else { "experimenter" };
        Some(
            json!({ "type": "hello", "version": crate::wire::VERSION, "role": role, "host": self.host.name }),
        )
    }

    /// Puts a study on the stage; nothing runs before its first trial.
    pub(crate) fn begin_study(&mut self, conductor: impl Conduct + Send + 'static) {
        self.pages.study = Some(OnStage::new(Box::new(conductor)));
        self.halt();
    }
}
