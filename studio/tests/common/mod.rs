//! A page as the studio meets it, by WebSocket. What takes time is waited for, however long a machine needs.
#![allow(dead_code, reason = "each file of tests uses a part")]

use haptograph_studio::Studio;
use serde_json::{Value, json};
use std::net::{SocketAddr, TcpStream};
use std::time::{Duration, Instant};
use tungstenite::client::IntoClientRequest;
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Message, WebSocket};

pub const PATIENCE: Duration = Duration::from_secs(60);

/// A page's end of the conversation.
pub struct Page {
    pub socket: WebSocket<MaybeTlsStream<TcpStream>>,
    pub hello: Value,
    pub graph: Value,
    begun: Instant,
    requests: u64,
}

impl Page {
    pub fn of(studio: &Studio) -> Self {
        Self::at(studio, studio.address())
    }

    pub fn at(studio: &Studio, address: SocketAddr) -> Self {
        let url = format!("ws://{address}/live?token={}", studio.token());
        let mut request = url.into_client_request().expect("a request");
        let origin = format!("http://{address}").parse().expect("a header");
        request.headers_mut().insert("origin", origin);
        let protocol = "haptograph.studio.1".parse().expect("a header");
        request.headers_mut().insert("sec-websocket-protocol", protocol);
        let (socket, _) = tungstenite::connect(request).expect("it is let in");
        if let MaybeTlsStream::Plain(stream) = socket.get_ref() {
            stream.set_read_timeout(Some(PATIENCE)).expect("a timeout");
        }
        let (hello, graph) = (Value::Null, Value::Null);
        let mut page = Self {
            socket,
            hello,
            graph,
            begun: Instant::now(),
            requests: 0,
        };
        page.hello = page.wait(|said| said["type"] == "hello");
        assert_eq!(page.hello["version"], 1);
        page.graph = page.wait(|said| said["type"] == "graph");
        page
    }

    pub fn say(&mut self, value: &Value) {
        let text = Message::text(value.to_string());
        self.socket.send(text).expect("it is heard");
    }

    /// The first text that is wanted.
    pub fn wait(&mut self, is_wanted: impl Fn(&Value) -> bool) -> Value {
        let asked = Instant::now();
        while asked.elapsed() < PATIENCE {
            if let Message::Text(text) = self.socket.read().expect("it goes on") {
                let said: Value = serde_json::from_str(&text).expect("JSON");
                if is_wanted(&said) {
                    return said;
                }
            }
        }
        panic!("it was never said");
    }

    pub fn request(&mut self, mut value: Value) -> Value {
        self.requests += 1;
        let request = json!(self.requests);
        value["request"] = request.clone();
        self.say(&value);
        self.wait(|said| said["type"] == "reply" && said["request"] == request)
    }

    pub fn point(&mut self, x_mm: f32, y_mm: f32, force_n: f32) {
        let mut bytes = vec![1, 0, 1, 0, 0, 0, 0, 0];
        bytes.extend((self.begun.elapsed().as_secs_f64() * 1e3).to_le_bytes());
        for value in [x_mm, y_mm, force_n, 0.0, 0.0] {
            bytes.extend(value.to_le_bytes());
        }
        self.socket.send(Message::binary(bytes)).expect("it is heard");
    }

    /// Strokes circles of 30 mm at so many mm/s until as many seconds of the first scope came; its samples.
    pub fn stroke(&mut self, speed_mm_s: f64, force_n: f32, seconds: f64) -> Vec<f32> {
        let (mut samples, mut covered_s) = (Vec::new(), 0.0);
        let asked = Instant::now();
        while covered_s < seconds && asked.elapsed() < PATIENCE {
            let angle = self.begun.elapsed().as_secs_f64() * speed_mm_s / 30.0;
            self.point(30.0 * angle.cos() as f32, 30.0 * angle.sin() as f32, force_n);
            if let Message::Binary(bytes) = self.socket.read().expect("it goes on")
                && bytes[0] == 2
            {
                let interval_s = f64::from_le_bytes(bytes[16..24].try_into().expect("eight"));
                let values = bytes[24..].chunks_exact(4);
                let values: Vec<f32> = values
                    .map(|four| f32::from_le_bytes(four.try_into().expect("four")))
                    .collect();
                covered_s += values.len() as f64 * interval_s;
                samples.extend(values);
            }
        }
        samples
    }
}
