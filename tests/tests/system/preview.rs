//! The preview page as a browser gets it: texts, pictures, states.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use wheelarm_tests::{Server, program};

struct Page {
    child: Child,
    address: String,
}

impl Page {
    fn open(server: &Server) -> Self {
        let mut child = Command::new(program("wheelarm").expect("the client"))
            .args(["--connect", &server.endpoint, "--sim", &server.sim])
            .args(["preview", "--page", "127.0.0.1:0"])
            .stdout(Stdio::piped())
            .spawn()
            .expect("the page");
        let pipe = child.stdout.take().expect("a pipe");
        let mut first = String::new();
        BufReader::new(pipe)
            .read_line(&mut first)
            .expect("its first line");
        let address = first
            .trim()
            .strip_prefix("page http://")
            .expect("an address");
        Self {
            address: address.to_owned(),
            child,
        }
    }

    fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(&self.address).expect("a connection");
        stream
            .set_read_timeout(Some(Duration::from_secs(20)))
            .expect("a patience");
        stream
    }

    /// The whole answer to a question.
    fn get(&self, path: &str, host: &str) -> Vec<u8> {
        let mut stream = self.connect();
        let question = format!("GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n");
        stream.write_all(question.as_bytes()).expect("a question");
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).expect("an answer");
        answer
    }
}

impl Drop for Page {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Head and body of an answer.
fn parts(answer: &[u8]) -> (String, &[u8]) {
    let end = answer.windows(4).position(|w| w == b"\r\n\r\n");
    let end = end.expect("a head") + 4;
    (
        String::from_utf8_lossy(&answer[..end]).to_lowercase(),
        &answer[end..],
    )
}

#[test]
fn the_page_shows_live_pictures_and_state_and_only_to_this_host() {
    let camera = ["--camera", "gen3=64x48@10", "--quality", "fast"];
    let server = Server::start("page", &camera).expect("a server");
    let page = Page::open(&server);
    let text = page.get("/", &page.address);
    let (head, body) = parts(&text);
    assert!(head.starts_with("http/1.1 200"), "{head}");
    assert!(head.contains("default-src 'none'"), "{head}");
    let html = String::from_utf8_lossy(body);
    assert!(
        !html.contains("http://") && !html.contains("https://"),
        "loads from elsewhere"
    );
    for file in ["/page.js", "/page.css", "/favicon.ico"] {
        assert!(
            page.get(file, "localhost").starts_with(b"HTTP/1.1 200"),
            "{file}"
        );
    }

    let mut numbers = Vec::new();
    for _ in 0..3 {
        let last = numbers.last().copied().unwrap_or(0);
        let path = format!("/camera/gen3?after={last}&viewer=test");
        let answer = page.get(&path, "127.0.0.1");
        let (head, jpeg) = parts(&answer);
        assert!(head.starts_with("http/1.1 200"), "{head}");
        assert!(jpeg.starts_with(&[0xff, 0xd8, 0xff]), "no JPEG");
        let number = head
            .lines()
            .find_map(|line| line.strip_prefix("x-number: "));
        numbers.push(
            number
                .and_then(|n| n.trim().parse::<u64>().ok())
                .expect("a number"),
        );
    }
    assert!(numbers.is_sorted_by(|a, b| a < b), "{numbers:?}");

    let mut stream = page.connect();
    let question = format!("GET /state HTTP/1.1\r\nHost: {}\r\n\r\n", page.address);
    stream.write_all(question.as_bytes()).expect("a question");
    let lines = BufReader::new(stream).lines().map_while(Result::ok);
    let state = lines
        .filter_map(|line| line.strip_prefix("data: ").map(str::to_owned))
        .filter_map(|line| serde_json::from_str::<serde_json::Value>(&line).ok())
        .find(|state| state["connection"] == "open" && !state["conditions"][0].is_null())
        .expect("a state");
    assert_eq!(state["task"], "pick_mustard");
    assert_eq!(state["cameras"][0], "gen3");

    for (path, host, code) in [
        ("/", "evil.example", "403"),
        ("/../etc/passwd", "127.0.0.1", "404"),
        ("/camera/a/b", "127.0.0.1", "404"),
    ] {
        let answer = page.get(path, host);
        let (head, _) = parts(&answer);
        assert!(
            head.starts_with(&format!("http/1.1 {code}")),
            "{path}: {head}"
        );
    }
}

/// A browser without a window; `None` where there is none.
fn browser() -> Option<&'static str> {
    ["chromium", "chromium-browser", "google-chrome"]
        .into_iter()
        .find(|name| {
            let version = Command::new(name).arg("--version").output();
            version.is_ok_and(|output| output.status.success())
        })
}

#[test]
fn a_browser_shows_the_task_and_the_camera() {
    let Some(browser) = browser() else {
        println!("skipped: no Chromium on this machine");
        return;
    };
    let camera = ["--camera", "gen3=64x48@10", "--quality", "fast"];
    let server = Server::start("browser", &camera).expect("a server");
    let page = Page::open(&server);
    let profile = tempfile::tempdir().expect("a folder");
    let mut shown = String::new();
    // The browser tells the page as it is after a moment, which may be too early.
    for _ in 0..8 {
        let output = Command::new(browser)
            .args([
                "--headless",
                "--no-sandbox",
                "--disable-gpu",
                "--timeout=4000",
            ])
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .args(["--dump-dom", &format!("http://{}/", page.address)])
            .output()
            .expect("a browser");
        shown = String::from_utf8_lossy(&output.stdout).into_owned();
        if shown.contains("hand camera") {
            break;
        }
    }
    for words in [
        "hand camera",
        "pick_mustard, seed 0",
        "lifted_and_held(mustard)",
        "no episode",
    ] {
        assert!(shown.contains(words), "{words:?} is missing:\n{shown}");
    }
}
