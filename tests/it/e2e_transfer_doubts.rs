//! What makes the break of a sender good, and what does not; archives without their end; instances
//! that were refused. Half a head is never quiet.

use std::io::Write as _;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::e2e_incomplete_transfer::{complete, file, is_doubted, series, settings, stored};
use crate::support::client::Client;
use crate::support::http::zipped;
use crate::support::scu::{CT, EXPLICIT, Request, Scu, c_store, ct_slice, pdu, pdv};
use crate::support::service::Service;

/// An A-ABORT of the service user (PS3.8 section 9.3.8).
fn abort(mut scu: Scu) {
    scu.send(&pdu(7, &[0; 4]));
}

fn instance(number: u8, index: u16) -> (String, Vec<u8>) {
    let uid = format!("{}.{}", series(number), index + 1);
    let data_set = ct_slice(&series(number), &uid, index, 40);
    (uid, data_set)
}

fn part10(number: u8, index: u16) -> Vec<u8> {
    let (uid, data_set) = instance(number, index);
    file(&data_set, &uid)
}

async fn told(service: &Service, number: u8) -> Value {
    Client::new(service.http).json(&format!("/v1/series/{}", series(number))).await
}

/// Until the end of a sender is recorded that ended in that way.
async fn ended(service: &Service, number: u8, end: &str) {
    let begin = Instant::now();
    while told(service, number).await["sender_end"] != end {
        assert!(begin.elapsed() < Duration::from_secs(60), "{:#}", told(service, number).await);
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

async fn until_doubts(service: &Service, number: u8, doubts: &Value) -> Value {
    let begin = Instant::now();
    loop {
        let now = told(service, number).await;
        if now["state"] != "receiving" && now["doubts"] == *doubts {
            return now;
        }
        assert!(begin.elapsed() < Duration::from_secs(60), "{now:#}");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_sender_that_began_before_the_break_does_not_make_it_good() {
    let service = settings().start();
    let (broken, parallel) = (stored(&service, 1, 0..3), stored(&service, 1, 3..6));
    abort(broken);
    ended(&service, 1, "association_aborted").await;
    parallel.release();
    is_doubted(&service, 1, "association_released").await;
    // The other way round.
    let (parallel, broken) = (stored(&service, 2, 0..3), stored(&service, 2, 3..6));
    parallel.release();
    ended(&service, 2, "association_released").await;
    abort(broken);
    is_doubted(&service, 2, "association_aborted").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn one_instance_again_does_not_make_it_good_nor_does_less_than_was_announced() {
    let service = settings().start();
    let client = Client::new(service.http);
    let announced = format!("/v1/series/{}/expected-instances", series(2));
    let request = client.request(reqwest::Method::PUT, &announced).json(&json!({ "instances": 8 }));
    assert!(request.send().await.unwrap().status().is_success());
    for number in [1, 2] {
        abort(stored(&service, number, 0..4));
        ended(&service, number, "association_aborted").await;
    }
    stored(&service, 1, 0..1).release();
    stored(&service, 2, 0..6).release();
    is_doubted(&service, 1, "association_released").await;
    is_doubted(&service, 2, "association_released").await;
    let (status, _) = client.upload("application/dicom", part10(1, 1)).await;
    assert_eq!(status, 202);
    let detail = told(&service, 1).await;
    assert_eq!(detail["doubts"], json!(["incomplete_transfer"]));
    let text = detail["doubt_details"][0]["detail"].as_str().unwrap();
    assert!(text.contains("association_aborted: 1"), "{text}");
    stored(&service, 2, 6..8).release();
    until_doubts(&service, 2, &json!([])).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn new_instances_do_not_make_a_break_between_two_instances_good() {
    let service = settings().start();
    for number in 1..=4 {
        abort(stored(&service, number, 0..4));
        ended(&service, number, "association_aborted").await;
        // What the broken one meant to send besides nobody knows.
        stored(&service, number, 4..5).release();
        is_doubted(&service, number, "association_released").await;
    }
    // Nor does one that brings some of them again.
    stored(&service, 1, 2..6).release();
    is_doubted(&service, 1, "association_released").await;
    // What was sent then, again, and the rest of it.
    stored(&service, 1, 0..8).release();
    until_doubts(&service, 1, &json!([])).await;
    // By word.
    let client = Client::new(service.http);
    let (status, _) = client.post(&format!("/v1/series/{}/complete", series(2)), &json!({})).await;
    assert!(status.is_success());
    until_doubts(&service, 2, &json!([])).await;
    // By count.
    let announced = format!("/v1/series/{}/expected-instances", series(3));
    let request = client.request(reqwest::Method::PUT, &announced).json(&json!({ "instances": 5 }));
    assert!(request.send().await.unwrap().status().is_success());
    until_doubts(&service, 3, &json!([])).await;
    // By a sender that brings all that is stored once more, and ends well.
    stored(&service, 4, 0..5).release();
    until_doubts(&service, 4, &json!([])).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_was_cut_must_have_come() {
    let service = settings().start();
    // The fifth instance is cut in its data set.
    let mut torn = stored(&service, 1, 0..4);
    let (uid, data_set) = instance(1, 4);
    torn.send_pdvs(&[pdv(1, 3, &c_store(9, CT, &uid)), pdv(1, 0, &data_set[..300])]);
    drop(torn);
    ended(&service, 1, "association_lost").await;
    stored(&service, 1, 5..7).release();
    is_doubted(&service, 1, "association_released").await;
    let text = told(&service, 1).await["doubt_details"][0]["detail"].as_str().unwrap().to_owned();
    assert!(text.contains("1 instances that were under way"), "{text}");
    stored(&service, 1, 4..5).release();
    until_doubts(&service, 1, &json!([])).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_revision_keeps_the_doubt_under_which_it_was_made() {
    let service = settings().start();
    abort(stored(&service, 1, 0..4));
    is_doubted(&service, 1, "association_aborted").await;
    let client = Client::new(service.http);
    // A sender that ends well and leaves a gap: the second revision is another one's matter.
    let mut again = stored(&service, 1, 0..4);
    for index in 8..11 {
        let (uid, data_set) = instance(1, index);
        again.store(1, index + 1, &uid, &data_set, 8_000);
        assert_eq!(again.response().status(), 0);
    }
    again.release();
    let now = until_doubts(&service, 1, &json!([])).await;
    assert_eq!(now["revision"], 2, "{now:#}");
    let rows = client.reconstructions(&series(1)).await;
    let doubts: Vec<&Value> = rows.iter().map(|row| &row["transfer_doubts"]).collect();
    assert_eq!(doubts, [&json!(["incomplete_transfer"]), &json!([])]);
}

/// A request of `indices`, cut between two parts.
fn cut_between_parts(service: &Service, number: u8, indices: std::ops::Range<u16>) {
    let mut body = Vec::new();
    for index in indices {
        body.extend(b"--b\r\nContent-Type: application/dicom\r\n\r\n");
        body.extend(part10(number, index));
        body.extend(b"\r\n");
    }
    body.extend(b"--b\r\n");
    let mut stream = std::net::TcpStream::connect(service.http).unwrap();
    let head = format!(
        "POST /dicom-web/studies HTTP/1.1\r\nHost: {}\r\nContent-Type: multipart/related; \
         type=\"application/dicom\"; boundary=b\r\nContent-Length: {}\r\n\r\n",
        service.http,
        body.len() + 100_000
    );
    stream.write_all(head.as_bytes()).unwrap();
    stream.write_all(&body).unwrap();
    stream.flush().unwrap();
    // The end of the stream comes after the parts: all of them are read.
    stream.shutdown(std::net::Shutdown::Write).unwrap();
    std::mem::forget(stream);
}

async fn stow(service: &Service, number: u8, indices: std::ops::Range<u16>) {
    let mut body = Vec::new();
    for index in indices {
        body.extend(b"--b\r\nContent-Type: application/dicom\r\n\r\n");
        body.extend(part10(number, index));
        body.extend(b"\r\n");
    }
    body.extend(b"--b--\r\n");
    let client = Client::new(service.http);
    let media_type = "multipart/related; type=\"application/dicom\"; boundary=b";
    let request = client.request(reqwest::Method::POST, "/dicom-web/studies");
    let answer = request.header("content-type", media_type).body(body).send().await.unwrap();
    assert_eq!(answer.status(), 200);
}

#[tokio::test(flavor = "multi_thread")]
async fn another_batch_does_not_make_a_broken_one_good_but_its_repetition_does() {
    let service = settings().start();
    cut_between_parts(&service, 1, 4..6);
    ended_once_known(&service, 1, "upload_broken").await;
    stow(&service, 1, 0..4).await;
    is_doubted(&service, 1, "upload_ended").await;
    stow(&service, 1, 4..8).await;
    until_doubts(&service, 1, &json!([])).await;
}

/// The same of a series that is not there yet.
async fn ended_once_known(service: &Service, number: u8, end: &str) {
    let begin = Instant::now();
    let path = format!("/v1/series/{}", series(number));
    while Client::new(service.http).get(&path).await.status() != 200 {
        assert!(begin.elapsed() < Duration::from_secs(60));
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    ended(service, number, end).await;
}

fn tar_of(number: u8, indices: std::ops::Range<u16>) -> Vec<u8> {
    let mut archive = tar::Builder::new(Vec::new());
    for index in indices {
        let bytes = part10(number, index);
        let mut header = tar::Header::new_ustar();
        header.set_size(bytes.len() as u64);
        header.set_mode(0o644);
        header.set_cksum();
        archive.append_data(&mut header, format!("{index}.dcm"), bytes.as_slice()).unwrap();
    }
    archive.into_inner().unwrap()
}

fn gzipped(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn an_archive_without_its_end_is_a_cut_upload() {
    let service = settings().start();
    let client = Client::new(service.http);
    // Two blocks of 512 bytes end an archive (POSIX.1-2017, pax).
    let open = |number| {
        let whole = tar_of(number, 0..4);
        whole[..whole.len() - 1024].to_vec()
    };
    let with = |number, tail: &[u8]| [open(number), tail.to_vec()].concat();
    let mut bad = vec![
        (1, open(1)),
        (2, gzipped(&open(2))),
        (3, with(3, &[0; 512])),
        (4, with(4, &vec![0; 1_000_000 / 512 * 512])),
        (5, with(5, &[[0; 512].to_vec(), tar_of(5, 4..6)].concat())),
        (6, with(6, &[[0; 1024].to_vec(), tar_of(6, 4..6)].concat())),
    ];
    let zipped_whole = gzipped(&tar_of(7, 0..4));
    bad.push((7, zipped_whole[..zipped_whole.len() - 8].to_vec()));
    for (number, body) in bad {
        let (status, answer) = client.upload("application/x-tar", body).await;
        assert_eq!((status.as_u16(), answer["type"].as_str().is_some()), (400, true), "{number}: {answer:#}");
        // What came before the end goes on being stored after the answer.
        ended_once_known(&service, number, "upload_broken").await;
        is_doubted(&service, number, "upload_broken").await;
    }
    let good = [(8, tar_of(8, 0..4)), (9, with(9, &[0; 10_240])), (10, gzipped(&tar_of(10, 0..4)))];
    for (number, body) in good {
        let (status, answer) = client.upload("application/x-tar", body).await;
        assert_eq!(status, 202, "{number}: {answer:#}");
        let now = complete(&service, number).await;
        assert_eq!(
            (&now["complete_reason"], &now["doubts"]),
            (&json!("upload_ended"), &json!([])),
            "{number}"
        );
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn refused_instances_are_a_doubt_until_they_are_stored() {
    let service = settings().start();
    let refused = |scu: &mut Scu, index: u16, length: fn(usize) -> usize| {
        let (uid, data_set) = instance(1, index);
        scu.store(1, index + 1, &uid, &data_set[..length(data_set.len())], 8_000);
        assert_ne!(scu.response().status(), 0);
    };
    let mut scu = stored(&service, 1, 0..4);
    refused(&mut scu, 4, |length| length - 100);
    scu.release();
    let now = complete(&service, 1).await;
    assert_eq!((&now["doubts"], &now["refused_instances"]), (&json!(["instances_refused"]), &json!(1)));
    stored(&service, 1, 4..5).release();
    let now = until_doubts(&service, 1, &json!([])).await;
    assert_eq!((&now["instances"], &now["refused_instances"]), (&json!(5), &json!(1)));
    // So short that not even its series can be told.
    let mut scu = stored(&service, 1, 5..7);
    refused(&mut scu, 7, |_| 90);
    scu.release();
    is_doubted(&service, 1, "instances_refused").await;
    stored(&service, 1, 7..8).release();
    until_doubts(&service, 1, &json!([])).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn files_that_were_damaged_before_they_were_sent_are_told() {
    let service = settings().start();
    let client = Client::new(service.http);
    let cut = [|_: usize| 0, |_| 300, |length| length / 2 + 400];
    for (number, cut) in (1_u8..).zip(cut) {
        let files: Vec<(String, Vec<u8>)> = (0..6_u16)
            .map(|index| {
                let mut bytes = part10(number, index);
                if index > 3 {
                    bytes.truncate(cut(bytes.len()));
                }
                (format!("{index}.dcm"), bytes)
            })
            .collect();
        let files: Vec<(&str, &[u8])> =
            files.iter().map(|(name, bytes)| (name.as_str(), bytes.as_slice())).collect();
        let (status, answer) = client.upload("application/zip", zipped(&files)).await;
        assert_eq!(status, 202, "{answer:#}");
        let counts = &answer["instances"];
        assert_eq!(
            counts["refused"].as_u64().unwrap() + counts["skipped"].as_u64().unwrap(),
            2,
            "{answer:#}"
        );
        let now = complete(&service, number).await;
        let expected = if number == 3 { "instances_refused" } else { "incomplete_transfer" };
        assert_eq!(now["doubts"], json!([expected]), "{now:#}");
    }
    let (status, _) = client.post(&format!("/v1/series/{}/complete", series(3)), &json!({})).await;
    assert!(status.is_success());
    assert_eq!(told(&service, 3).await["doubts"], json!([]));
}

#[tokio::test(flavor = "multi_thread")]
async fn the_second_study_of_a_series_is_named() {
    let service = settings().start();
    let mut scu = Scu::associate(service.dimse, &Request::new(&[(1, CT, &[EXPLICIT])]));
    for index in 0..8_u16 {
        let (uid, mut data_set) = instance(1, index);
        if index >= 4 {
            // Another study, of a UID of the same length.
            let study = b"1.2.826.0.1.3680043.10.9999.1";
            let place = data_set.windows(study.len()).position(|bytes| bytes == study).unwrap();
            data_set[place + study.len() - 1] = b'7';
        }
        scu.store(1, index + 1, &uid, &data_set, 8_000);
        assert_eq!(scu.response().status(), if index < 4 { 0 } else { 0xC006 });
    }
    scu.release();
    let now = complete(&service, 1).await;
    assert_eq!((&now["doubts"], &now["refused_instances"]), (&json!(["instances_refused"]), &json!(4)));
    let text = now["doubt_details"][0]["detail"].as_str().unwrap();
    assert!(text.contains("4 of study 1.2.826.0.1.3680043.10.9999.1 are stored"), "{text}");
    assert!(text.contains("4 of study 1.2.826.0.1.3680043.10.9999.7 were refused"), "{text}");
    assert_eq!(now["refused"][0]["study_instance_uid"], "1.2.826.0.1.3680043.10.9999.7");
    let rows = Client::new(service.http).reconstructions(&series(1)).await;
    assert_eq!(rows[0]["transfer_doubts"], json!(["instances_refused"]));
}
