//! Associations: who may open one, what is accepted in it, and how it ends when the peer does not
//! keep to the protocol. Every answer is held byte by byte to PS3.8.

use std::time::Duration;

use crate::support::dimse::Listener;
use crate::support::scu::{
    COMMAND, COMMAND_PART, CT, DATA, DATA_PART, EXPLICIT, IMPLICIT, MR, Request, Scu, VERIFICATION, c_echo,
    c_store, command, item, pdu, pdv, uid,
};

const ENHANCED_CT: &str = "1.2.840.10008.5.1.4.1.1.2.1";
const LEGACY_ENHANCED_CT: &str = "1.2.840.10008.5.1.4.1.1.2.2";
const BIG_ENDIAN: &str = "1.2.840.10008.1.2.2";
const JPEG_BASELINE: &str = "1.2.840.10008.1.2.4.50";
const JPEG_LOSSLESS: &str = "1.2.840.10008.1.2.4.70";
const JPEG_2000: &str = "1.2.840.10008.1.2.4.90";
const JPEG_2000_LOSSY: &str = "1.2.840.10008.1.2.4.91";
const RLE: &str = "1.2.840.10008.1.2.5";

fn verification() -> Request {
    Request::new(&[(1, VERIFICATION, &[IMPLICIT])])
}

#[test]
fn an_echo_is_answered_with_its_own_message_id() {
    let listener = Listener::start(|_| {});
    let mut scu = Scu::associate(listener.address, &verification());
    for message_id in [1, 65_535, 7] {
        scu.expect_echo(1, message_id);
    }
    scu.release();
    listener.await_metric("triplanar_associations_open 0");
}

#[test]
fn an_association_that_is_not_for_us_is_rejected_with_its_reason() {
    let listener = Listener::start(|config| {
        config.dimse.calling_ae_titles = vec!["TESTER".to_owned(), "PACS".to_owned()];
    });
    /// What is wrong with the request; result, source and reason of the answer (PS3.8 table 9-21).
    type Case = (fn(&mut Request), [u8; 3]);
    let cases: [Case; 6] = [
        (|r| r.called = "SOMEONE".to_owned(), [1, 1, 7]),
        (|r| r.calling = "STRANGER".to_owned(), [1, 1, 3]),
        (|r| r.application_context = "1.2.840.10008.3.1.1.2".to_owned(), [1, 1, 2]),
        (|r| r.protocol_version = 2, [1, 2, 2]),
        (|r| r.contexts.push(r.contexts[0].clone()), [1, 2, 1]),
        (|r| r.contexts[0].0 = 2, [1, 2, 1]),
    ];
    for (change, [result, source, reason]) in cases {
        let mut request = verification();
        change(&mut request);
        let mut scu = Scu::connect(listener.address);
        scu.send(&request.pdu());
        scu.expect_rejection(result, source, reason);
    }
    let mut scu = Scu::associate(listener.address, &verification());
    scu.expect_echo(1, 1);
    listener.await_metric(r#"triplanar_associations_rejected_total{reason="unknown_calling_ae_title"} 1"#);
}

/// The request's PDU with these bytes in place of its AE titles.
fn with_titles(called: &[u8], calling: &[u8]) -> Vec<u8> {
    let mut pdu = verification().pdu();
    for (at, title) in [(10, called), (26, calling)] {
        pdu[at..at + 16].fill(b' ');
        pdu[at..at + title.len()].copy_from_slice(title);
    }
    pdu
}

#[test]
fn of_a_title_only_spaces_are_padding() {
    let listener = Listener::start(|config| config.dimse.calling_ae_titles = vec![" GOOD ".to_owned()]);
    for (called, calling) in [(&b"TRIPLANAR"[..], &b"GOOD"[..]), (b"  TRIPLANAR", b"  GOOD   ")] {
        let mut scu = Scu::connect(listener.address);
        scu.send(&with_titles(called, calling));
        let (pdu_type, answer) = scu.receive().expect("an answer");
        assert_eq!(pdu_type, 0x02);
        assert_eq!(answer[4..36], with_titles(called, calling)[10..42], "the answer repeats the titles");
    }
    // TAB, LF, VT, CR, NUL, no-break space, backslash, letters of another alphabet (PS3.5 section 6.2).
    let none: [&[u8]; 12] = [
        b"GOOD\t",
        b"\tGOOD",
        b"\nGOOD",
        b"GOOD\x0b",
        b"GOOD\r",
        b"GOOD\0\0",
        b"\xa0GOOD",
        b"GO\\OD",
        b"G\xd6\xd6D",
        b"good",
        b"",
        b"\x1b[31mGOOD",
    ];
    for calling in none {
        let mut scu = Scu::connect(listener.address);
        scu.send(&with_titles(b"TRIPLANAR", calling));
        // Calling AE title not recognized.
        scu.expect_rejection(1, 1, 3);
    }
    for called in [&b"TRIPLANAR\t"[..], b"\x0bTRIPLANAR", b"\nTRIPLANAR", b"TRIPLANAR\0", b"triplanar", b""] {
        let mut scu = Scu::connect(listener.address);
        scu.send(&with_titles(called, b"GOOD"));
        scu.expect_rejection(1, 1, 7);
    }
}

#[test]
fn a_title_that_is_none_is_refused_where_any_is_taken() {
    let listener = Listener::start(|config| config.dimse.check_called_ae_title = false);
    for (called, calling, reason) in [(&b"A\nB"[..], &b"GOOD"[..], 7), (b"A", b"GO\tOD", 3), (b"A", b"\\", 3)]
    {
        let mut scu = Scu::connect(listener.address);
        scu.send(&with_titles(called, calling));
        scu.expect_rejection(1, 1, reason);
    }
}

#[test]
fn any_called_title_is_taken_where_the_configuration_says_so() {
    let listener = Listener::start(|config| config.dimse.check_called_ae_title = false);
    let mut request = verification();
    request.called = "SOMEONE".to_owned();
    Scu::associate(listener.address, &request).expect_echo(1, 1);
}

#[test]
fn associations_beyond_a_limit_are_rejected_until_one_ends() {
    type Limit = fn(&mut triplanar::config::Config);
    let limits: [Limit; 2] =
        [|config| config.dimse.max_associations = 2, |config| config.dimse.max_associations_per_peer = 2];
    for limit in limits {
        let listener = Listener::start(limit);
        let first = Scu::associate(listener.address, &verification());
        let mut second = Scu::associate(listener.address, &verification());
        let mut third = Scu::connect(listener.address);
        third.send(&verification().pdu());
        // Rejected, transient; service provider (presentation); local limit exceeded.
        third.expect_rejection(2, 3, 2);
        second.expect_echo(1, 1);
        first.release();
        listener.await_metric("triplanar_associations_open 1");
        // The place is free when the released connection is closed, a moment later.
        let mut again = (0..200).find_map(|_| {
            let mut scu = Scu::connect(listener.address);
            scu.send(&verification().pdu());
            let accepted = scu.receive().expect("an answer").0 == 0x02;
            std::thread::sleep(Duration::from_millis(10));
            accepted.then_some(scu)
        });
        again.as_mut().expect("a place is free again").expect_echo(1, 1);
    }
}

/// The answer's context items: ID, result, transfer syntax.
fn results(answer: &[u8]) -> Vec<(u8, u8, String)> {
    let mut items = &answer[68..];
    let mut found = Vec::new();
    while !items.is_empty() {
        let length = usize::from(u16::from_be_bytes([items[2], items[3]]));
        let value = &items[4..4 + length];
        if items[0] == 0x21 {
            assert_eq!(value[4], 0x40);
            found.push((value[0], value[2], String::from_utf8(value[8..].to_vec()).unwrap()));
        }
        items = &items[4 + length..];
    }
    found
}

fn answer_to(listener: &Listener, request: &Request) -> Vec<u8> {
    let mut scu = Scu::connect(listener.address);
    scu.send(&request.pdu());
    let (pdu_type, body) = scu.receive().expect("an answer");
    assert_eq!(pdu_type, 0x02, "A-ASSOCIATE-AC");
    scu.release();
    body
}

#[test]
fn of_a_contexts_transfer_syntaxes_our_own_favourite_is_taken() {
    let listener = Listener::start(|_| {});
    let request = Request::new(&[
        (1, CT, &[JPEG_2000_LOSSY, JPEG_LOSSLESS, IMPLICIT, BIG_ENDIAN, EXPLICIT]),
        (3, CT, &[JPEG_2000, BIG_ENDIAN, IMPLICIT]),
        (5, ENHANCED_CT, &[JPEG_BASELINE, JPEG_2000_LOSSY, JPEG_2000]),
        (7, LEGACY_ENHANCED_CT, &[RLE]),
        (9, CT, &[JPEG_BASELINE]),
        (11, MR, &[EXPLICIT, IMPLICIT]),
        (255, VERIFICATION, &[IMPLICIT]),
    ]);
    let taken = results(&answer_to(&listener, &request));
    let taken: Vec<_> = taken.iter().map(|(id, result, syntax)| (*id, *result, syntax.as_str())).collect();
    assert_eq!(taken[..4], [(1, 0, EXPLICIT), (3, 0, IMPLICIT), (5, 0, JPEG_2000), (7, 0, RLE)]);
    // 4: transfer syntaxes not supported, 3: abstract syntax not supported (PS3.8 table 9-18).
    assert_eq!(taken[4..6].iter().map(|t| (t.0, t.1)).collect::<Vec<_>>(), [(9, 4), (11, 3)]);
    assert_eq!(taken[6], (255, 0, IMPLICIT));
}

#[test]
fn a_request_with_128_contexts_and_many_syntaxes_is_read_whole() {
    let listener = Listener::start(|config| config.dimse.max_pdu_length = 4_096);
    let mut request = Request::new(&[]);
    let syntaxes: Vec<_> =
        (0..30).map(|i| format!("1.2.840.10008.1.2.4.{i}")).chain([EXPLICIT.to_owned()]).collect();
    request.contexts = (0..128).map(|i| (2 * i + 1, CT.to_owned(), syntaxes.clone())).collect();
    assert!(request.pdu().len() > 100_000);
    let taken = results(&answer_to(&listener, &request));
    assert_eq!(taken.len(), 128);
    assert!(taken.iter().all(|(_, result, syntax)| (*result, syntax.as_str()) == (0, EXPLICIT)));
}

#[test]
fn the_answer_says_our_maximum_length_declines_the_scp_role_and_asynchronous_operations() {
    let listener = Listener::start(|_| {});
    let mut request = Request::new(&[(1, CT, &[EXPLICIT])]);
    let role = |scu, scp| {
        let mut value = u16::try_from(CT.len()).unwrap().to_be_bytes().to_vec();
        value.extend(CT.bytes());
        value.extend([scu, scp]);
        item(0x54, &value)
    };
    request.user_items = [item(0x53, &[0, 8, 0, 8]), role(1, 1)].concat();
    let answer = answer_to(&listener, &request);
    let holds = |needle: &[u8]| answer.windows(needle.len()).any(|window| window == needle);
    assert!(holds(&item(0x51, &262_144_u32.to_be_bytes())), "maximum length received");
    assert!(holds(&role(1, 0)), "SCU, but not SCP");
    assert!(!holds(&[0x53, 0, 0, 4]), "no asynchronous operations window");
}

#[test]
fn a_pdu_that_claims_4_gib_is_refused_before_it_is_read() {
    let listener = Listener::start(|_| {});
    for pdu_type in [0x01, 0x04] {
        let mut scu = Scu::connect(listener.address);
        scu.send(&[pdu_type, 0, 0xFF, 0xFF, 0xFF, 0xFF]);
        // Before there is an association, the abort is the service user's (PS3.8 AA-1).
        scu.expect_abort(0, 0);
    }
    for pdu_type in [0x01, 0x04, 0x05, 0x07] {
        let mut scu = Scu::associate(listener.address, &verification());
        scu.send(&[pdu_type, 0, 0xFF, 0xFF, 0xFF, 0xFF]);
        scu.expect_abort(2, 6);
    }
    // One byte more than we said we take.
    let mut scu = Scu::associate(listener.address, &verification());
    scu.send(&[0x04, 0, 0, 4, 0, 1]);
    scu.expect_abort(2, 6);
    Scu::associate(listener.address, &verification()).expect_echo(1, 1);
}

#[test]
fn what_is_no_association_request_is_aborted() {
    let listener = Listener::start(|_| {});
    let truncated = {
        let mut request = verification().pdu();
        request.truncate(40);
        pdu(0x01, &request[6..])
    };
    let first_words: [&[u8]; 5] = [
        b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n",
        &pdu(0x04, &pdv(1, COMMAND, &c_echo(1))),
        &pdu(0x05, &[0; 4]),
        &[0xFF; 64],
        &truncated,
    ];
    for words in first_words {
        let mut scu = Scu::connect(listener.address);
        scu.send(words);
        scu.expect_abort(0, 0);
    }
    Scu::associate(listener.address, &verification()).expect_echo(1, 1);
}

#[test]
fn a_breach_of_the_protocol_is_aborted_with_its_reason() {
    let listener = Listener::start(|_| {});
    let response = command(&[
        (0x0100, &[0x30, 0x80]),
        (0x0120, &[1, 0]),
        (0x0110, &[1, 0]),
        (0x0800, &[1, 1]),
        (0x0900, &[0, 0]),
    ]);
    let no_message_id = command(&[(0x0100, &[0x30, 0]), (0x0800, &[1, 1])]);
    let foreign_group = [8, 0, 0x18, 0, 0, 0, 0, 0];
    let half = c_echo(1)[..20].to_vec();
    let whole = pdv(1, COMMAND, &c_echo(1));
    // PS3.8 section 9.3.8: 1 unrecognized PDU, 2 unexpected PDU, 5 unexpected PDU parameter,
    // 6 invalid PDU parameter value; source 0 is the service user, whose reason is not significant.
    let cases: Vec<(&str, Vec<u8>, [u8; 2])> = vec![
        ("a PDU of no known type", pdu(0x09, &[0; 4]), [2, 1]),
        ("a second association request", verification().pdu(), [2, 2]),
        ("a release response", pdu(0x06, &[0; 4]), [2, 2]),
        ("a value that is longer than its PDU", pdu(0x04, &[0, 0, 0, 99, 1, 3]), [2, 6]),
        ("a value that is shorter than its header", pdu(0x04, &[0, 0, 0, 1, 1]), [2, 6]),
        ("a context that was not proposed", pdu(0x04, &pdv(77, COMMAND, &c_echo(1))), [2, 6]),
        ("a context that was rejected", pdu(0x04, &pdv(5, COMMAND, &c_store(1, MR, "1.2"))), [2, 6]),
        ("a data set without a command", pdu(0x04, &pdv(1, DATA, &[1, 2])), [2, 5]),
        (
            "a command that changes its context",
            pdu(0x04, &[pdv(1, COMMAND_PART, &half), pdv(3, COMMAND, &half)].concat()),
            [2, 5],
        ),
        (
            "a command within a data set",
            pdu(
                0x04,
                &[pdv(3, COMMAND, &c_store(1, CT, "1.2")), pdv(3, DATA_PART, &[8, 0]), whole.clone()]
                    .concat(),
            ),
            [2, 5],
        ),
        (
            "a data set that changes its context",
            pdu(0x04, &[pdv(3, COMMAND, &c_store(1, CT, "1.2")), pdv(1, DATA, &[8, 0])].concat()),
            [2, 5],
        ),
        (
            "a release within a data set",
            [pdu(0x04, &pdv(3, COMMAND, &c_store(1, CT, "1.2"))), pdu(0x05, &[0; 4])].concat(),
            [2, 2],
        ),
        ("a response to nothing", pdu(0x04, &pdv(1, COMMAND, &response)), [0, 0]),
        ("a command without a message ID", pdu(0x04, &pdv(1, COMMAND, &no_message_id)), [0, 0]),
        ("a command of another group", pdu(0x04, &pdv(1, COMMAND, &foreign_group)), [0, 0]),
        ("a command that ends too early", pdu(0x04, &pdv(1, COMMAND, &half)), [0, 0]),
        ("a command of 70 000 bytes", pdu(0x04, &pdv(1, COMMAND_PART, &[0; 70_000])), [0, 0]),
    ];
    for (what, bytes, [source, reason]) in cases {
        println!("{what}");
        let request =
            Request::new(&[(1, VERIFICATION, &[IMPLICIT]), (3, CT, &[EXPLICIT]), (5, MR, &[EXPLICIT])]);
        let mut scu = Scu::associate(listener.address, &request);
        scu.send(&bytes);
        scu.expect_abort(source, reason);
    }
    assert!(listener.files().is_empty(), "nothing of it is stored");
    listener.await_metric("triplanar_associations_open 0");
}

#[test]
fn a_peer_that_falls_silent_is_cut_off() {
    let listener = Listener::start(|config| {
        config.dimse.association_timeout = Duration::from_millis(150);
        config.dimse.idle_timeout = Duration::from_millis(150);
    });
    // No request at all, and half of one: closed without a word (PS3.8 AA-2).
    let mut silent = Scu::connect(listener.address);
    assert_eq!(silent.receive(), None);
    let mut half = Scu::connect(listener.address);
    half.send(&verification().pdu()[..50]);
    assert_eq!(half.receive(), None);
    // An association without a message, and one that trickles a PDU.
    let mut idle = Scu::associate(listener.address, &verification());
    idle.expect_abort(0, 0);
    let mut trickling = Scu::associate(listener.address, &verification());
    for byte in &pdu(0x04, &pdv(1, COMMAND, &c_echo(1)))[..60] {
        std::thread::sleep(Duration::from_millis(10));
        if std::io::Write::write_all(&mut trickling.stream, &[*byte]).is_err() {
            break;
        }
    }
    trickling.expect_abort(0, 0);
    listener.await_metric(r#"triplanar_associations_failed_total{reason="idle"} 4"#);
}

#[test]
fn answers_keep_to_the_peers_maximum_length() {
    let listener = Listener::start(|_| {});
    let mut request = verification();
    request.max_pdu_length = 32;
    let mut scu = Scu::associate(listener.address, &request);
    scu.send_pdvs(&[pdv(1, COMMAND, &c_echo(9))]);
    let response = scu.response();
    assert_eq!((response.number(0x0120), response.status()), (9, 0));
    // 26 bytes of each PDU are left for the command set.
    assert!(response.pdus >= 3, "{} PDUs", response.pdus);
}

#[test]
fn a_shutdown_aborts_who_waits_and_accepts_nobody() {
    let mut listener = Listener::start(|_| {});
    let mut waiting = Scu::associate(listener.address, &verification());
    waiting.expect_echo(1, 1);
    listener.stop();
    waiting.expect_abort(0, 0);
    listener.await_end();
    assert!(std::net::TcpStream::connect(listener.address).is_err());
}

#[test]
fn an_operation_that_is_not_provided_is_answered_and_a_cancel_is_ignored() {
    let listener = Listener::start(|_| {});
    let request = Request::new(&[(1, VERIFICATION, &[IMPLICIT]), (3, CT, &[EXPLICIT])]);
    let mut scu = Scu::associate(listener.address, &request);
    let rq = |field: u16, message_id: u16, data_set_type: u16| {
        command(&[
            (0x0002, &uid(CT)),
            (0x0100, &field.to_le_bytes()),
            (0x0110, &message_id.to_le_bytes()),
            (0x0800, &data_set_type.to_le_bytes()),
        ])
    };
    // C-FIND-RQ with an identifier, which is received and forgotten; C-ECHO-RQ on a storage
    // context; C-STORE-RQ on the verification context.
    for (context_id, field, message_id, has_data) in
        [(3, 0x0020, 5, true), (3, 0x0030, 6, false), (1, 0x0001, 7, true), (1, 0x7ABC, 8, false)]
    {
        let data_set_type = if has_data { 0 } else { 0x0101 };
        scu.send_pdvs(&[pdv(context_id, COMMAND, &rq(field, message_id, data_set_type))]);
        if has_data {
            scu.send_pdvs(&[pdv(context_id, DATA_PART, &[0; 9]), pdv(context_id, DATA, &[0; 7])]);
        }
        let response = scu.response();
        assert_eq!(response.context_id, context_id);
        assert_eq!(response.number(0x0100), field | 0x8000);
        assert_eq!(response.number(0x0120), message_id);
        assert_eq!(response.status(), 0x0211, "unrecognized operation");
        assert_eq!(response.number(0x0800), 0x0101);
        assert_eq!(response.text(0x0002).as_deref(), Some(CT));
    }
    let cancel = command(&[(0x0100, &[0xFF, 0x0F]), (0x0120, &[5, 0]), (0x0800, &[1, 1])]);
    scu.send_pdvs(&[pdv(3, COMMAND, &cancel)]);
    scu.expect_echo(1, 9);
}
