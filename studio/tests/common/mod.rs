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
    requests: u64,
}

impl Page {
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
            requests: 0,
        };
        page.hello = page.wait(|said| said["type"] == "hello");
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
}
