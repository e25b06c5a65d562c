//! Nobody locks other clients out: connections that wait make room, who drips is ended, probes are
//! always answered, and limits are those of an address.

use std::net::{IpAddr, SocketAddr};
use std::time::Duration;

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpSocket, TcpStream};

use crate::support::http::{Server, problem, zip_of};
use crate::support::raw::exchange;

async fn connect_from(server: &Server, last: u8) -> TcpStream {
    let socket = TcpSocket::new_v4().unwrap();
    socket.bind(SocketAddr::new(IpAddr::from([127, 0, 9, last]), 0)).unwrap();
    socket.connect(server.address).await.unwrap()
}

/// An upload that has begun and goes no further: the server waits for its body.
async fn begun_upload(mut stream: TcpStream, lines: &str) -> TcpStream {
    let head = format!(
        "POST /v1/series HTTP/1.1\r\nhost: localhost\r\n{lines}expect: 100-continue\r\ncontent-length: 10000000\r\n\r\n"
    );
    stream.write_all(head.as_bytes()).await.unwrap();
    let mut answer = [0; 25];
    stream.read_exact(&mut answer).await.unwrap();
    assert_eq!(&answer, b"HTTP/1.1 100 Continue\r\n\r\n");
    stream
}

async fn get(server: &Server, path: &str, lines: &str) -> String {
    let request = format!("GET {path} HTTP/1.1\r\nhost: localhost\r\n{lines}connection: close\r\n\r\n");
    exchange(server.address, request.as_bytes()).await
}

fn status(answer: &str) -> &str {
    answer.get(9..12).unwrap_or(answer)
}

async fn rest(mut stream: TcpStream) -> String {
    let mut answer = Vec::new();
    // A reset is an end too.
    let _ended = stream.read_to_end(&mut answer).await;
    String::from_utf8_lossy(&answer).into_owned()
}

#[tokio::test]
async fn connections_that_drip_their_head_make_room_the_oldest_of_the_most_crowded_first() {
    let server = Server::with(|config| config.http.max_connections = 4).await;
    let mut quiet = connect_from(&server, 1).await;
    let mut crowd = Vec::new();
    for _ in 0..3 {
        let mut stream = connect_from(&server, 2).await;
        stream.write_all(b"GET / HTTP/1.1\r\nx-drip: ").await.unwrap();
        crowd.push(stream);
    }
    assert_eq!(status(&get(&server, "/v1/series", "").await), "200");
    assert_eq!(rest(crowd.remove(0)).await, "", "the oldest is closed without a word");
    crowd[1].write_all(b"x\r\nhost: localhost\r\nconnection: close\r\n\r\n").await.unwrap();
    assert_eq!(status(&rest(crowd.remove(1)).await), "200", "the youngest is not");
    quiet.write_all(b"GET / HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n").await.unwrap();
    assert_eq!(status(&rest(quiet).await), "200", "nor is the one that came before them all");
}

#[tokio::test]
async fn where_all_connections_work_probes_are_answered_and_others_are_told() {
    for of_one_address in [false, true] {
        let server = Server::with(|config| {
            config.http.crowded_bytes_per_second = 0;
            match of_one_address {
                false => config.http.max_connections = 2,
                true => config.http.max_connections_per_address = 2,
            }
        })
        .await;
        let mut held = Vec::new();
        for _ in 0..2 {
            held.push(begun_upload(TcpStream::connect(server.address).await.unwrap(), "").await);
        }
        let answer = get(&server, "/v1/series", "").await;
        assert_eq!(status(&answer), "503", "{answer}");
        assert!(
            answer.contains("retry-after: 5") && answer.contains("urn:triplanar:problem:busy"),
            "{answer}"
        );
        for path in ["/healthz", "/readyz"] {
            assert_eq!(status(&get(&server, path, "").await), "200", "{path}");
        }
        if of_one_address {
            let mut other = connect_from(&server, 1).await;
            other
                .write_all(b"GET /v1/series HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n")
                .await
                .unwrap();
            assert_eq!(status(&rest(other).await), "200", "another address is served");
        }
        drop(held);
        while status(&get(&server, "/v1/series", "").await) != "200" {
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    }
}

#[tokio::test]
async fn streams_of_events_have_limits_of_their_own() {
    let server = Server::with(|config| {
        config.http.max_connections = 2;
        config.http.max_event_streams = 3;
        config.http.max_event_streams_per_address = 2;
    })
    .await;
    let (_, id) = server.queued(1).await;
    let path = format!("/v1/reconstructions/{id}/events");
    let request = format!("GET {path} HTTP/1.1\r\nhost: localhost\r\n\r\n");
    let mut streams = Vec::new();
    for (from, expected) in [(1, "200"), (1, "200"), (1, "503"), (2, "200"), (3, "503")] {
        let mut stream = connect_from(&server, from).await;
        stream.write_all(request.as_bytes()).await.unwrap();
        let mut first = [0; 12];
        stream.read_exact(&mut first).await.unwrap();
        assert_eq!(status(std::str::from_utf8(&first).unwrap()), expected, "of 127.0.9.{from}");
        if expected == "200" {
            streams.push(stream);
        }
    }
    problem(server.get(&path).send().await.unwrap(), 503, "busy").await;
    assert_eq!(status(&get(&server, "/v1/series", "").await), "200", "streams take no connection of others");
    streams.pop();
    while server.get(&path).send().await.unwrap().status() != 200 {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

#[tokio::test]
async fn a_body_that_drips_ends() {
    let server = Server::with(|config| {
        config.http.min_bytes_per_second = 1_000_000;
        config.http.rate_grace = Duration::from_millis(300);
    })
    .await;
    let upload = begun_upload(TcpStream::connect(server.address).await.unwrap(), "").await;
    let (mut reading, mut writing) = upload.into_split();
    let dripping = tokio::spawn(async move {
        while writing.write_all(b"P").await.is_ok() {
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    });
    let mut answer = [0; 12];
    reading.read_exact(&mut answer).await.unwrap();
    assert_eq!(&answer, b"HTTP/1.1 408");
    dripping.abort();
}

#[tokio::test]
async fn an_answer_that_is_not_taken_ends() {
    let server = Server::with(|config| config.http.rate_grace = Duration::from_millis(300)).await;
    let mut stream = TcpStream::connect(server.address).await.unwrap();
    let (asked, request) = (300, "GET /openapi.json HTTP/1.1\r\nhost: localhost\r\n\r\n");
    let one =
        exchange(server.address, request.replace("\r\n\r\n", "\r\nconnection: close\r\n\r\n").as_bytes())
            .await;
    stream.write_all(request.repeat(asked).as_bytes()).await.unwrap();
    // Once the time is over, what the system's buffers hold is all that comes.
    tokio::time::sleep(Duration::from_secs(2)).await;
    let got = rest(stream).await;
    assert!(got.len() < one.len() * asked, "all of {} bytes came", got.len());
}

#[tokio::test]
async fn uploads_of_one_address_leave_places_for_others() {
    let server = Server::with(|config| {
        config.http.max_uploads_per_address = 1;
        config.http.min_bytes_per_second = 0;
    })
    .await;
    let held = begun_upload(connect_from(&server, 1).await, "").await;
    let mut second = connect_from(&server, 1).await;
    second
        .write_all(b"POST /v1/series HTTP/1.1\r\nhost: localhost\r\ncontent-length: 1\r\n\r\nx")
        .await
        .unwrap();
    let mut told = [0; 12];
    second.read_exact(&mut told).await.unwrap();
    assert_eq!(&told, b"HTTP/1.1 503");
    server.upload("", zip_of(1, 3)).await;
    drop(held);
}

#[tokio::test]
async fn an_upload_that_drips_loses_its_place_where_all_are_taken() {
    let server = Server::with(|config| config.http.max_uploads = 1).await;
    let dripping = begun_upload(connect_from(&server, 1).await, "").await;
    // Until it is sure that it drips, another one is told to come again.
    while server.post("/v1/series").body(zip_of(1, 3)).send().await.unwrap().status() != 202 {
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    assert_eq!(status(&rest(dripping).await), "408");
}

#[tokio::test]
async fn an_upload_that_keeps_the_least_rate_but_is_slow_loses_its_place_in_a_crowd() {
    let server = Server::with(|config| config.http.max_uploads = 1).await;
    let upload = begun_upload(connect_from(&server, 1).await, "").await;
    let (_reading, mut writing) = upload.into_split();
    let steady = tokio::spawn(async move {
        while writing.write_all(&[b'P'; 500]).await.is_ok() {
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
    });
    while server.post("/v1/series").body(zip_of(1, 3)).send().await.unwrap().status() != 202 {
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    steady.abort();
}

#[tokio::test]
async fn an_address_with_more_than_its_share_of_uploads_must_be_as_many_times_faster() {
    let server = Server::with(|config| {
        config.http.max_uploads = 2;
        config.http.crowded_bytes_per_second = 8_000;
    })
    .await;
    let mut held = tokio::task::JoinSet::new();
    for _ in 0..2 {
        let (_reading, mut writing) = begun_upload(connect_from(&server, 1).await, "").await.into_split();
        held.spawn(async move {
            // Up to 12 000 bytes a second: enough for one, too slow for two.
            while writing.write_all(&[b'P'; 600]).await.is_ok() {
                tokio::time::sleep(Duration::from_millis(50)).await;
            }
        });
    }
    let fresh = async || server.post("/v1/series").body(zip_of(1, 3)).send().await.unwrap().status();
    let mut tries = 0;
    while fresh().await != 202 {
        tries += 1;
        assert!(tries < 400, "an address that has none gets a place");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    held.shutdown().await;
}

#[tokio::test]
async fn requests_whose_bodies_drip_make_room_where_all_connections_work() {
    let server = Server::with(|config| config.http.max_connections = 4).await;
    let mut dripping = Vec::new();
    for address in 1..=4 {
        let mut stream = connect_from(&server, address).await;
        let head = "POST /v1/series/1.2.3/reconstructions HTTP/1.1\r\nhost: localhost\r\n\
                    content-type: application/json\r\ncontent-length: 60000\r\n\r\n{";
        stream.write_all(head.as_bytes()).await.unwrap();
        dripping.push(stream);
    }
    // Until it is sure that they drip, others are told to come again.
    loop {
        let request = b"GET /v1/series HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n";
        let mut fresh = connect_from(&server, 9).await;
        fresh.write_all(request).await.unwrap();
        if status(&rest(fresh).await) == "200" {
            break;
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    assert!(rest(dripping.remove(0)).await.is_empty(), "the slowest and first one is closed");
}

#[tokio::test]
async fn who_is_refused_keeps_no_probe_waiting() {
    let server = Server::with(|config| {
        config.http.crowded_bytes_per_second = 0;
        config.http.max_connections = 1;
    })
    .await;
    let held = begun_upload(connect_from(&server, 1).await, "").await;
    let mut refused = Vec::new();
    for n in 0..40 {
        let mut stream = connect_from(&server, 2 + n % 5).await;
        let head = "POST /v1/series HTTP/1.1\r\nhost: localhost\r\ncontent-length: 60000\r\n\r\nx";
        stream.write_all(head.as_bytes()).await.unwrap();
        refused.push(stream);
    }
    let mut probe = connect_from(&server, 9).await;
    probe.write_all(b"GET /healthz HTTP/1.1\r\nhost: localhost\r\n\r\n").await.unwrap();
    assert_eq!(status(&rest(probe).await), "200");
    drop(held);
}

#[tokio::test]
async fn behind_a_trusted_proxy_the_forwarded_address_counts() {
    let server = Server::with(|config| {
        config.http.trusted_proxies = vec!["127.0.0.1".parse().unwrap()];
        config.http.max_connections_per_address = 1;
    })
    .await;
    let of = |address: &str| format!("x-forwarded-for: {address}\r\n");
    let held = begun_upload(TcpStream::connect(server.address).await.unwrap(), &of("192.0.2.1")).await;
    assert_eq!(status(&get(&server, "/v1/series", &of("192.0.2.1")).await), "503");
    assert_eq!(status(&get(&server, "/v1/series", &of("198.51.100.9, 192.0.2.1")).await), "503");
    assert_eq!(status(&get(&server, "/v1/series", &of("192.0.2.2")).await), "200");
    assert_eq!(status(&get(&server, "/v1/series", &of("192.0.2.1, 192.0.2.2")).await), "200");
    assert_eq!(status(&get(&server, "/healthz", &of("192.0.2.1")).await), "200");
    drop(held);
    // From elsewhere the header is hearsay.
    let mut first = begun_upload(connect_from(&server, 1).await, &of("192.0.2.7")).await;
    let mut other = connect_from(&server, 1).await;
    other
        .write_all(b"GET /v1/series HTTP/1.1\r\nhost: localhost\r\nx-forwarded-for: 192.0.2.8\r\nconnection: close\r\n\r\n")
        .await
        .unwrap();
    assert_eq!(status(&rest(other).await), "503");
    first.shutdown().await.unwrap();
}
