//! A sender that breaks off: whatever the door, the cloud of half a head says so.

use std::io::Write as _;
use std::net::TcpStream;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::support::client::Client;
use crate::support::http::zipped;
use crate::support::scu::{CT, EXPLICIT, Request, Scu, c_store, ct_slice, pdu, pdv};
use crate::support::service::{Service, Settings};

/// No quiet time after an end that counts: it would be the reason for which a series is complete.
pub(crate) fn settings() -> Settings {
    Settings::new()
        .with("intake.quiet_after_association", "0.001")
        .with("intake.quiet", "2")
        .with("intake.min_slices", "3")
}

pub(crate) fn series(number: u8) -> String {
    format!("1.2.3.{number}")
}

/// Stores `indices` of the series on an association that stays open.
pub(crate) fn stored(service: &Service, number: u8, indices: std::ops::Range<u16>) -> Scu {
    let mut scu = Scu::associate(service.dimse, &Request::new(&[(1, CT, &[EXPLICIT])]));
    for index in indices {
        let instance = format!("{}.{}", series(number), index + 1);
        scu.store(1, index + 1, &instance, &ct_slice(&series(number), &instance, index, 40), 8_000);
        assert_eq!(scu.response().status(), 0);
    }
    scu
}

pub(crate) async fn complete(service: &Service, number: u8) -> Value {
    let begin = Instant::now();
    loop {
        let told = Client::new(service.http).json(&format!("/v1/series/{}", series(number))).await;
        if told["state"] != "receiving" {
            return told;
        }
        assert!(begin.elapsed() < Duration::from_secs(60), "{told:#}");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}

pub(crate) async fn is_doubted(service: &Service, number: u8, end: &str) {
    let told = complete(service, number).await;
    assert_eq!(told["complete_reason"], "quiet", "{told:#}");
    assert_eq!(told["sender_end"], end, "{told:#}");
    assert_eq!(told["doubts"], json!(["incomplete_transfer"]), "{told:#}");
}

#[tokio::test(flavor = "multi_thread")]
async fn an_association_that_breaks_off_leaves_a_doubt_until_it_is_sent_well() {
    let service = settings().start();
    // An A-ABORT between two instances (PS3.8 section 9.3.8), a closed connection, and one that is
    // closed in the middle of a PDU.
    stored(&service, 1, 0..4).send(&pdu(7, &[0; 4]));
    drop(stored(&service, 2, 0..4));
    let mut torn = stored(&service, 3, 0..4);
    torn.send(&[4, 0, 0, 0, 100, 0, 0]);
    drop(torn);
    stored(&service, 4, 0..4).release();
    is_doubted(&service, 1, "association_aborted").await;
    is_doubted(&service, 2, "association_lost").await;
    is_doubted(&service, 3, "association_lost").await;
    let well = complete(&service, 4).await;
    assert_eq!((&well["complete_reason"], &well["doubts"]), (&json!("association_ended"), &json!([])));
    assert_eq!(well["sender_end"], "association_released");
    for number in 1..=3 {
        stored(&service, number, 0..6).release();
        let again = complete(&service, number).await;
        assert_eq!((&again["doubts"], &again["revision"]), (&json!([]), &json!(2)), "{again:#}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn so_does_a_stop_of_the_service_in_the_middle() {
    let service = settings().start();
    let open = stored(&service, 1, 0..4);
    let service = settings().start_on(service.kill());
    drop(open);
    is_doubted(&service, 1, "service_stopped").await;
    let mut open = stored(&service, 2, 0..4);
    let (status, dir) = service.terminate();
    assert!(status.success());
    open.expect_abort(0, 0);
    let service = settings().start_on(dir);
    is_doubted(&service, 2, "service_stopped").await;
}

/// A multipart body of four whole files, cut in the fifth.
fn cut_body(number: u8, head: &str) -> Vec<u8> {
    let mut body = Vec::new();
    for index in 0..5_u16 {
        let instance = format!("{}.{}", series(number), index + 1);
        let mut part = file(&ct_slice(&series(number), &instance, index, 40), &instance);
        if index == 4 {
            part.truncate(part.len() / 2);
        }
        body.extend(format!("--b\r\n{head}\r\n\r\n").bytes());
        body.extend(part);
        body.extend(b"\r\n");
    }
    body
}

/// A Part 10 file (PS3.10 section 7.1) around a data set in explicit VR.
pub(crate) fn file(data_set: &[u8], instance: &str) -> Vec<u8> {
    let mut meta = vec![2, 0, 1, 0, b'O', b'B', 0, 0, 2, 0, 0, 0, 0, 1];
    for (element, uid) in [(0x02_u8, CT), (0x03, instance), (0x10, EXPLICIT), (0x12, "1.2.3.4")] {
        let mut value = uid.as_bytes().to_vec();
        value.resize(value.len().next_multiple_of(2), 0);
        meta.extend([2, 0, element, 0, b'U', b'I', u8::try_from(value.len()).unwrap(), 0]);
        meta.extend(value);
    }
    let mut file = vec![0; 128];
    file.extend(b"DICM");
    file.extend([2, 0, 0, 0, b'U', b'L', 4, 0]);
    file.extend(u32::try_from(meta.len()).unwrap().to_le_bytes());
    file.extend(meta);
    file.extend(data_set);
    file
}

#[tokio::test(flavor = "multi_thread")]
async fn so_does_a_request_that_is_cut_in_the_middle() {
    let service = settings().start();
    let doors = [
        (
            1,
            "/v1/series",
            "multipart/form-data",
            "Content-Disposition: form-data; name=\"f\"; filename=\"a\"",
        ),
        (
            2,
            "/dicom-web/studies",
            "multipart/related; type=\"application/dicom\"",
            "Content-Type: application/dicom",
        ),
    ];
    for (number, path, media_type, head) in doors {
        let body = cut_body(number, head);
        let mut stream = TcpStream::connect(service.http).unwrap();
        let request = format!(
            "POST {path} HTTP/1.1\r\nHost: {}\r\nContent-Type: {media_type}; boundary=b\r\n\
             Content-Length: {}\r\n\r\n",
            service.http,
            body.len() + 100_000
        );
        stream.write_all(request.as_bytes()).unwrap();
        stream.write_all(&body).unwrap();
        // Until the whole ones are stored: the cut is to be met in the fifth.
        let client = Client::new(service.http);
        for _ in 0..600 {
            let told = client.get(&format!("/v1/series/{}", series(number))).await.text().await.unwrap();
            if told.contains("\"instances\":4") {
                break;
            }
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
        drop(stream);
    }
    for (number, ..) in doors {
        is_doubted(&service, number, "upload_broken").await;
    }
}

/// The command and half of the data set of instance `index`, then the end of the connection.
fn cut_within(mut scu: Scu, number: u8, index: u16) {
    let instance = format!("{}.{}", series(number), index + 1);
    let data_set = ct_slice(&series(number), &instance, index, 40);
    scu.send_pdvs(&[pdv(1, 3, &c_store(99, CT, &instance)), pdv(1, 0, &data_set[..data_set.len() / 2])]);
    drop(scu);
}

async fn doubted(service: &Service, number: u8, doubts: &Value) -> Value {
    let begin = Instant::now();
    loop {
        let told = complete(service, number).await;
        if told["doubts"] == *doubts {
            return told;
        }
        assert!(begin.elapsed() < Duration::from_secs(60), "{told:#}");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}

/// Waits until so many instances were cut, by the metrics.
async fn cut(service: &Service, sender: &str, instances: u32) {
    let line = format!("triplanar_instances_total{{sender=\"{sender}\",outcome=\"cut\"}} {instances}");
    let begin = Instant::now();
    loop {
        let metrics = Client::new(service.http).get("/metrics").await.text().await.unwrap();
        if metrics.lines().any(|told| told == line) {
            return;
        }
        assert!(begin.elapsed() < Duration::from_secs(60), "{line} is missing in\n{metrics}");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn an_instance_that_is_cut_leaves_a_doubt_be_it_the_first_one_of_its_sender() {
    let service = settings().start();
    cut_within(stored(&service, 1, 0..4), 1, 4);
    is_doubted(&service, 1, "association_lost").await;
    cut(&service, "association", 1).await;

    // The series is whole, and its sender ended well: another one meant to add to it.
    stored(&service, 2, 0..4).release();
    assert_eq!(complete(&service, 2).await["doubts"], json!([]));
    cut_within(Scu::associate(service.dimse, &Request::new(&[(1, CT, &[EXPLICIT])])), 2, 4);
    cut(&service, "association", 2).await;
    let told = doubted(&service, 2, &json!(["incomplete_transfer"])).await;
    assert_eq!(
        (&told["sender_end"], &told["instances"]),
        (&json!("association_lost"), &json!(4)),
        "{told:#}"
    );
    // Once it has come it is as whole as it was; and a cut of one that is stored takes nothing away.
    stored(&service, 2, 4..5).release();
    doubted(&service, 2, &json!([])).await;
    cut_within(Scu::associate(service.dimse, &Request::new(&[(1, CT, &[EXPLICIT])])), 2, 2);
    cut(&service, "association", 3).await;
    assert_eq!(complete(&service, 2).await["doubts"], json!([]));

    // Of a series that is not there yet: held against it until the instance comes.
    cut_within(Scu::associate(service.dimse, &Request::new(&[(1, CT, &[EXPLICIT])])), 3, 0);
    cut(&service, "association", 4).await;
    stored(&service, 3, 1..5).release();
    let told = doubted(&service, 3, &json!(["instances_refused"])).await;
    let detail = told["doubt_details"][0]["detail"].as_str().unwrap();
    assert!(detail.contains("cut-instance: 1"), "{detail}");
    stored(&service, 3, 0..5).release();
    doubted(&service, 3, &json!([])).await;
    for number in [1, 2] {
        let instance = format!("{}.5", series(number));
        let log = service.log();
        let line =
            log.lines().find(|line| line.contains("ended within an instance") && line.contains(&instance));
        assert!(line.is_some_and(|line| line.contains("WARN")), "{instance}: {log}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn so_does_a_request_that_is_cut_in_its_first_instance() {
    let service = settings().start();
    let doors = [
        ("/v1/series", "multipart/form-data", "Content-Disposition: form-data; name=\"f\"; filename=\"a\""),
        (
            "/dicom-web/studies",
            "multipart/related; type=\"application/dicom\"",
            "Content-Type: application/dicom",
        ),
    ];
    stored(&service, 1, 0..4).release();
    assert_eq!(complete(&service, 1).await["doubts"], json!([]));
    for (number, (path, media_type, head)) in (1_u32..).zip(doors) {
        let instance = format!("{}.9", series(1));
        let part = file(&ct_slice(&series(1), &instance, 9, 40), &instance);
        let mut body = format!("--b\r\n{head}\r\n\r\n").into_bytes();
        body.extend(&part[..part.len() - 100]);
        let request = format!(
            "POST {path} HTTP/1.1\r\nHost: {}\r\nContent-Type: {media_type}; boundary=b\r\n\
             Content-Length: {}\r\n\r\n",
            service.http,
            body.len() + 100_000
        );
        let mut stream = TcpStream::connect(service.http).unwrap();
        stream.write_all(request.as_bytes()).unwrap();
        stream.write_all(&body).unwrap();
        tokio::time::sleep(Duration::from_millis(300)).await;
        drop(stream);
        cut(&service, "upload", number).await;
    }
    let told = doubted(&service, 1, &json!(["incomplete_transfer"])).await;
    assert_eq!(told["instances"], 4, "{told:#}");

    // Archives that are cut before the first of their instances.
    let whole = file(&ct_slice(&series(2), &format!("{}.1", series(2)), 0, 40), &format!("{}.1", series(2)));
    let archive = zipped(&[("a.dcm", &whole[..])]);
    for (number, length) in (3_u32..).zip([40, 700]) {
        let head = format!(
            "POST /v1/series HTTP/1.1\r\nHost: {}\r\nContent-Type: application/zip\r\nContent-Length: {}\r\n\r\n",
            service.http,
            archive.len()
        );
        let mut stream = TcpStream::connect(service.http).unwrap();
        stream.write_all(head.as_bytes()).unwrap();
        stream.write_all(&archive[..length.min(archive.len() - 30)]).unwrap();
        tokio::time::sleep(Duration::from_millis(300)).await;
        drop(stream);
        cut(&service, "upload", number).await;
    }
    // And one whose rest was lost before it was sent.
    let (status, _) =
        Client::new(service.http).upload("application/zip", archive[..archive.len() - 30].to_vec()).await;
    assert_eq!(status, 400);
    cut(&service, "upload", 5).await;
}
