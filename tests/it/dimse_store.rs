//! C-STORE: whatever way the bytes come, either the whole instance is stored and acknowledged, or
//! nothing is and the peer is told why.

use std::time::Duration;

use crate::support::dimse::Listener;
use crate::support::scu::{
    COMMAND, COMMAND_PART, CT, DATA, DATA_PART, EXPLICIT, IMPLICIT, MR, Request, Scu, VERIFICATION, c_store,
    command, ct_slice, pdu, pdv, uid,
};

const SERIES: &str = "1.2.826.0.1.3680043.10.9999.10";
const ENHANCED_CT: &str = "1.2.840.10008.5.1.4.1.1.2.1";

fn storage() -> Request {
    Request::new(&[(1, VERIFICATION, &[IMPLICIT]), (3, CT, &[EXPLICIT])])
}

fn instance(number: u16) -> String {
    format!("{SERIES}.{number}")
}

/// Asserts the response to a C-STORE, whole.
fn expect_stored(scu: &mut Scu, message_id: u16, instance: &str) {
    let response = scu.response();
    assert_eq!(response.status(), 0, "{}", response.comment());
    assert_eq!(response.context_id, 3);
    assert_eq!(response.number(0x0100), 0x8001);
    assert_eq!(response.number(0x0120), message_id);
    assert_eq!(response.number(0x0800), 0x0101);
    assert_eq!(response.text(0x0002).as_deref(), Some(CT));
    assert_eq!(response.text(0x1000).as_deref(), Some(instance));
}

/// Asserts a refusal, and that the comment is a valid LO without a patient's identity.
fn expect_refused(scu: &mut Scu, message_id: u16, status: u16) -> String {
    let response = scu.response();
    let comment = response.comment();
    assert_eq!(format!("{:04X}", response.status()), format!("{status:04X}"), "{comment}");
    assert_eq!((response.number(0x0100), response.number(0x0120)), (0x8001, message_id));
    assert!(!comment.is_empty() && comment.len() <= 64, "{comment}");
    assert!(!comment.contains("SECRET"), "{comment}");
    comment
}

fn stored_exactly(listener: &Listener, data: &[u8]) -> bool {
    listener.files().iter().any(|file| file.ends_with(data) && file[128..132] == *b"DICM")
}

#[test]
fn however_the_bytes_are_cut_the_same_instance_is_stored() {
    let listener = Listener::start(|_| {});
    let mut scu = Scu::associate(listener.address, &storage());

    // Fragments of every size, a PDU each.
    for (number, fragment) in [(1, 100_000), (2, 1_000), (3, 7), (4, 1)] {
        let data = ct_slice(SERIES, &instance(number), number, 40);
        scu.store(3, 100 + number, &instance(number), &data, fragment);
        expect_stored(&mut scu, 100 + number, &instance(number));
        assert!(stored_exactly(&listener, &data), "fragments of {fragment} bytes");
    }

    // The command in single bytes, then the data set in a few values, all of it in one PDU.
    let data = ct_slice(SERIES, &instance(5), 5, 40);
    let rq = c_store(7, CT, &instance(5));
    let mut pdvs: Vec<_> = rq[..rq.len() - 1].iter().map(|byte| pdv(3, COMMAND_PART, &[*byte])).collect();
    pdvs.push(pdv(3, COMMAND, &rq[rq.len() - 1..]));
    pdvs.extend(data.chunks(300).map(|chunk| pdv(3, DATA_PART, chunk)));
    pdvs.push(pdv(3, DATA, &[]));
    scu.send_pdvs(&pdvs);
    expect_stored(&mut scu, 7, &instance(5));
    assert!(stored_exactly(&listener, &data), "an empty last fragment ends the data set");

    // The command in two PDUs, the second of which begins the data set; the TCP stream cut anywhere.
    let data = ct_slice(SERIES, &instance(6), 6, 40);
    let rq = c_store(8, CT, &instance(6));
    let stream = [
        pdu(0x04, &pdv(3, COMMAND_PART, &rq[..30])),
        pdu(0x04, &[pdv(3, COMMAND, &rq[30..]), pdv(3, DATA_PART, &data[..5])].concat()),
        pdu(0x04, &[pdv(3, DATA_PART, &[]), pdv(3, DATA, &data[5..])].concat()),
    ]
    .concat();
    for piece in stream.chunks(137) {
        scu.send(piece);
    }
    expect_stored(&mut scu, 8, &instance(6));
    assert!(stored_exactly(&listener, &data));

    scu.expect_echo(1, 9);
    scu.release();
    assert_eq!(listener.instances(SERIES).len(), 6);
}

#[test]
fn several_associations_store_at_once() {
    let listener = Listener::start(|_| {});
    std::thread::scope(|scope| {
        for sender in 0..6_u16 {
            let address = listener.address;
            scope.spawn(move || {
                let mut scu = Scu::associate(address, &storage());
                for number in sender * 10..sender * 10 + 10 {
                    let data = ct_slice(SERIES, &instance(number), number, 40);
                    scu.store(3, number, &instance(number), &data, 200);
                    expect_stored(&mut scu, number, &instance(number));
                }
                scu.release();
            });
        }
    });
    assert_eq!(listener.instances(SERIES).len(), 60);
}

#[test]
fn a_transfer_that_breaks_off_leaves_nothing() {
    let listener = Listener::start(|_| {});
    let data = ct_slice(SERIES, &instance(1), 1, 40);
    let mut kept = Scu::associate(listener.address, &storage());
    kept.store(3, 1, &instance(2), &ct_slice(SERIES, &instance(2), 2, 40), 500);
    expect_stored(&mut kept, 1, &instance(2));

    // An abort, a closed connection, a connection closed within a PDU.
    let endings: [&[u8]; 3] = [&pdu(0x07, &[0; 4]), &[], &[0x04, 0, 0, 0, 1, 0, 0]];
    for ending in endings {
        let mut scu = Scu::associate(listener.address, &storage());
        scu.send_pdvs(&[pdv(3, COMMAND, &c_store(1, CT, &instance(1)))]);
        scu.send_pdvs(&[pdv(3, DATA_PART, &data[..data.len() - 1])]);
        scu.send(ending);
        drop(scu);
    }
    listener.await_metric("triplanar_associations_open 1");
    assert_eq!(listener.instances(SERIES).len(), 1, "only what was acknowledged is stored");
    assert_eq!(listener.files().len(), 1, "no half file stays");
    kept.expect_echo(1, 2);
}

#[test]
fn a_full_disk_is_told_after_the_data_set_and_the_association_lives_on() {
    let listener = Listener::start(|config| config.storage.min_free_bytes = u64::MAX);
    let mut scu = Scu::associate(listener.address, &storage());
    for number in 1..4 {
        scu.store(3, number, &instance(number), &ct_slice(SERIES, &instance(number), number, 40), 100);
        let comment = expect_refused(&mut scu, number, 0xA700);
        assert!(comment.starts_with("out-of-storage"), "{comment}");
    }
    scu.expect_echo(1, 9);
    scu.release();
    assert!(listener.files().is_empty());
}

#[test]
fn an_instance_beyond_the_limit_is_refused_and_the_next_one_is_stored() {
    let small = ct_slice(SERIES, &instance(2), 2, 40);
    let limit = small.len() as u64 + 1_000;
    let listener = Listener::start(|config| config.intake.max_instance_bytes = limit);
    let mut scu = Scu::associate(listener.address, &storage());
    let mut large = ct_slice(SERIES, &instance(1), 1, 40);
    large.resize(1_000_000, 0);
    scu.store(3, 1, &instance(1), &large, 10_000);
    assert!(expect_refused(&mut scu, 1, 0xA700).starts_with("too-large"));
    scu.store(3, 2, &instance(2), &small, 10_000);
    expect_stored(&mut scu, 2, &instance(2));
    assert_eq!(listener.files().len(), 1);
}

#[test]
fn a_command_that_does_not_fit_is_refused_with_its_status() {
    let listener = Listener::start(|_| {});
    let request =
        Request::new(&[(3, CT, &[EXPLICIT]), (5, ENHANCED_CT, &[EXPLICIT]), (1, VERIFICATION, &[IMPLICIT])]);
    let mut scu = Scu::associate(listener.address, &request);
    let rq = |class: &str, instance: &str, data_set_type: [u8; 2]| {
        command(&[
            (0x0002, &uid(class)),
            (0x0100, &[1, 0]),
            (0x0110, &[42, 0]),
            (0x0700, &[0, 0]),
            (0x0800, &data_set_type),
            (0x1000, &uid(instance)),
        ])
    };
    // SOP class not supported; not this context's class; no UID; an empty UID; a class that is no
    // UID; no data set.
    let cases = [
        (3, rq(MR, "1.2.3", [0, 0]), true, 0x0122),
        (5, rq(CT, "1.2.3", [0, 0]), true, 0xA900),
        (3, rq(CT, "not.a.uid", [0, 0]), true, 0x0117),
        (3, rq(CT, "", [0, 0]), true, 0x0117),
        (3, rq("CT", "1.2.3", [0, 0]), true, 0x0212),
        (3, rq(CT, "1.2.3", [1, 1]), false, 0x0212),
    ];
    for (context_id, rq, has_data, status) in cases {
        scu.send_pdvs(&[pdv(context_id, COMMAND, &rq)]);
        if has_data {
            scu.send_pdvs(&[pdv(context_id, DATA_PART, &[8, 0]), pdv(context_id, DATA, &[0; 50])]);
        }
        expect_refused(&mut scu, 42, status);
    }
    scu.expect_echo(1, 1);
    assert!(listener.files().is_empty());
}

#[test]
fn a_data_set_that_is_none_is_refused_with_its_status() {
    let listener = Listener::start(|_| {});
    let mut scu = Scu::associate(listener.address, &storage());
    let announced = instance(1);
    let other = ct_slice(SERIES, &instance(2), 1, 40);
    let no_series = ct_slice("", &announced, 1, 40);
    // 8000 sequences within each other, each of undefined length: (0040,0260) SQ.
    let nested: Vec<u8> = std::iter::repeat_n(
        [
            0x40, 0, 0x60, 0x02, b'S', b'Q', 0, 0, 0xFF, 0xFF, 0xFF, 0xFF, 0xFE, 0xFF, 0x00, 0xE0, 0xFF,
            0xFF, 0xFF, 0xFF,
        ],
        8_000,
    )
    .flatten()
    .collect();
    // Pixel data that claims 4 GiB and ends at once.
    let mut claims = ct_slice(SERIES, &announced, 1, 40);
    claims.truncate(claims.len() - 516);
    claims.extend([0xFE, 0xFF, 0xFF, 0xFF]);
    let cases: [(&str, &[u8], &[u16]); 6] = [
        ("another instance than announced", &other, &[0xA900]),
        ("no Series Instance UID", &no_series, &[0xC002]),
        ("8000 nested sequences", &nested, &[0xC001]),
        ("an element that claims 4 GiB", &claims, &[0xC001]),
        ("text", b"this is no data set at all, just words", &[0xC000, 0xC001]),
        ("nothing", b"", &[0xC000, 0xC001, 0xC002]),
    ];
    for (what, data, statuses) in cases {
        println!("{what}");
        scu.send_pdvs(&[pdv(3, COMMAND, &c_store(9, CT, &announced)), pdv(3, DATA, data)]);
        let response = scu.response();
        let comment = response.comment();
        assert!(statuses.contains(&response.status()), "{:04X} {comment}", response.status());
        assert!(!comment.contains("SECRET") && comment.len() <= 64, "{comment}");
    }
    scu.expect_echo(1, 1);
    assert!(listener.files().is_empty());
}

#[test]
fn a_duplicate_is_success_and_other_pixels_are_a_conflict() {
    let listener = Listener::start(|_| {});
    let mut scu = Scu::associate(listener.address, &storage());
    let data = ct_slice(SERIES, &instance(1), 1, 40);
    for message_id in [1, 2] {
        scu.store(3, message_id, &instance(1), &data, 500);
        expect_stored(&mut scu, message_id, &instance(1));
    }
    scu.store(3, 3, &instance(1), &ct_slice(SERIES, &instance(1), 1, 41), 500);
    assert!(expect_refused(&mut scu, 3, 0xC003).starts_with("conflicting-instance"));
    assert_eq!(listener.instances(SERIES).len(), 1);
    assert!(stored_exactly(&listener, &data), "the stored one is untouched");
}

#[test]
fn a_message_on_its_way_at_shutdown_is_finished_and_acknowledged() {
    let mut listener = Listener::start(|_| {});
    let mut scu = Scu::associate(listener.address, &storage());
    let data = ct_slice(SERIES, &instance(1), 1, 40);
    let (begin, end) = data.split_at(300);
    scu.send_pdvs(&[pdv(3, COMMAND, &c_store(1, CT, &instance(1))), pdv(3, DATA_PART, begin)]);
    std::thread::sleep(Duration::from_millis(100));
    listener.stop();
    std::thread::sleep(Duration::from_millis(100));
    scu.send_pdvs(&[pdv(3, DATA, end)]);
    expect_stored(&mut scu, 1, &instance(1));
    scu.expect_abort(0, 0);
    listener.await_end();
    assert!(stored_exactly(&listener, &data));
}

#[test]
fn a_released_association_completes_its_series_after_the_short_quiet_time() {
    let listener = Listener::start(|config| {
        config.intake.quiet_after_association = Duration::from_millis(100);
        config.intake.quiet = Duration::from_secs(3_600);
    });
    let timers = listener.intake.clone();
    let stop = tokio_util::sync::CancellationToken::new();
    let running = listener.spawn({
        let stop = stop.clone();
        async move { timers.run_timers(stop).await }
    });
    // Aborted, lost, released: only the last is an end that starts the short quiet time.
    let endings: [&[u8]; 3] = [&pdu(0x07, &[0; 4]), &[], &pdu(0x05, &[0; 4])];
    for (number, ending) in (1_u16..).zip(endings) {
        let series = format!("{SERIES}.{number}.1");
        let mut scu = Scu::associate(listener.address, &storage());
        scu.store(3, 1, &instance(number), &ct_slice(&series, &instance(number), number, 40), 500);
        expect_stored(&mut scu, 1, &instance(number));
        scu.send(ending);
    }
    listener.await_metric(r#"triplanar_series_completed_total{reason="association_ended"} 1"#);
    stop.cancel();
    listener.run(running).unwrap();
}
