//! The soundcards of a live run: the stream that drives it, and its inputs.

use super::streams::{CardDriver, Inputs};
use super::{CardRequests, OpenedStream, Request, card_requests, output_sinks};
use crate::backend::{Backend, BackendError, BackendEvent, Connected, Counts, Lives, Role, State};
use haptograph_engine::graph::Graph;
use haptograph_engine::run::RingReport;

/// The streams that a run requested when it began, as they are open.
#[derive(Default)]
pub(super) struct Soundcards {
    requests: Option<CardRequests>,
    /// True if the requests came with the last open.
    is_new: bool,
    inputs: Inputs,
    driver: Option<Driver>,
}

/// A card that drives a clock.
struct Driver {
    clock: usize,
    name: String,
    card: CardDriver,
    request: Request,
}

impl Backend for Soundcards {
    fn open(&mut self, graph: &mut Graph) -> Result<(), BackendError> {
        self.is_new = false;
        let requests = card_requests(graph)?;
        match &self.requests {
            Some(running) if running.output != requests.output => {
                Err(BackendError::Stream("another soundcard"))
            }
            Some(running) if running.inputs != requests.inputs => {
                Err(BackendError::Stream("another soundcard input"))
            }
            Some(_) => Ok(()),
            None => {
                self.requests = Some(requests);
                self.is_new = true;
                Ok(())
            }
        }
    }

    fn undo(&mut self) {
        if std::mem::take(&mut self.is_new) {
            self.requests = None;
        }
    }

    fn keep(&mut self, _: &Graph) {
        self.is_new = false;
    }

    fn drive(&mut self, graph: &Graph, lives: &mut Lives) -> Result<(), BackendError> {
        self.is_new = false;
        self.inputs = Inputs::open(graph, lives.iter_mut().map(|(_, live)| live))?;
        let request = self.requests.as_ref().and_then(|requests| requests.output.clone());
        let sinks = output_sinks(graph);
        let clock = sinks.first().and_then(|output| graph.driver_of(output.sink));
        let own = lives.iter().position(|(driver, _)| Some(*driver) == clock);
        if let (Some(request), Some(own)) = (request, own) {
            let (clock, live) = lives.remove(own);
            self.driver = Some(Driver {
                clock,
                name: graph.clocks()[clock].name.clone(),
                card: CardDriver::start(request.clone(), live)?,
                request,
            });
        }
        Ok(())
    }

    fn poll(&mut self) -> Vec<BackendEvent> {
        let driver = self.driver.as_mut().map(|driver| driver.card.poll());
        let mut events = driver.unwrap_or_default();
        events.extend(self.inputs.poll());
        events
    }

    fn status(&self) -> Vec<Connected> {
        let place = |driver: &Driver| description(driver.card.got(), &driver.request);
        let driver = self.driver.iter().map(|driver| Connected {
            state: match (driver.card.is_finished(), driver.card.is_waiting()) {
                (true, _) => State::Finished,
                (false, true) => State::Waiting,
                (false, false) => State::Running,
            },
            hardware: driver.card.got().card.clone(),
            ..Connected::driver(&driver.name, driver.clock, place(driver))
        });
        let inputs = self.inputs.streams().map(|(endpoints, request, got, _)| Connected {
            names: endpoints.to_vec(),
            role: Role::Input,
            clock: None,
            place: description(got, request),
            hardware: got.card.clone(),
            state: State::Running,
            refused: Vec::new(),
        });
        driver.chain(inputs).collect()
    }

    fn counts(&self) -> Vec<Counts> {
        let driver = self.driver.iter().map(|driver| driver.card.counts());
        let inputs = self.inputs.streams().map(|(.., counts)| counts);
        let all = driver.chain(inputs);
        all.map(|counts| Counts::Stream(Box::new(counts))).collect()
    }

    fn rings(&self) -> Vec<RingReport> {
        self.inputs.rings().map(RingReport::of).collect()
    }

    fn close(&mut self) -> Result<Lives, BackendError> {
        match self.driver.take() {
            Some(driver) => {
                let live = driver.card.join().ok_or(BackendError::Lost)?;
                Ok(vec![(driver.clock, live)])
            }
            None => Ok(Lives::new()),
        }
    }
}

/// A stream in words.
fn description(got: &OpenedStream, request: &Request) -> String {
    let frames = got.buffer_frames.map_or_else(|| "?".to_owned(), |frames| frames.to_string());
    format!(
        "soundcard {}: {} Hz, {} channels, {}, buffers of {frames} frames ({} requested)",
        got.card, got.rate_hz, got.channels, got.format, request.buffer_frames
    )
}
