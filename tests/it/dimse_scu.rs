//! Our own SCU against our own SCP.

use std::time::Duration;

use triplanar::dimse::scu::{Answer, Instance, Peer, ScuError, echo, store};

use crate::support::dimse::Listener;
use crate::support::scu::{CT, EXPLICIT, MR, ct_slice};

const SERIES: &str = "1.2.826.0.1.3680043.10.9999.20";

fn peer(listener: &Listener) -> Peer {
    Peer {
        address: listener.address.to_string(),
        called_ae_title: "TRIPLANAR".to_owned(),
        calling_ae_title: "TRIPLANAR_SCU".to_owned(),
        timeout: Duration::from_secs(10),
    }
}

/// The data set with another SOP class, whose UID is as long.
fn as_mr(mut data: Vec<u8>) -> Vec<u8> {
    let at = data.windows(CT.len()).position(|window| window == CT.as_bytes()).unwrap();
    data[at..at + CT.len()].copy_from_slice(MR.as_bytes());
    data
}

/// A Part 10 file of these UIDs (PS3.10 section 7.1).
fn part10(class: &str, instance: &str, syntax: &str, data: &[u8]) -> Vec<u8> {
    let mut group = Vec::new();
    for (element, text) in [(0x02_u8, class), (0x03, instance), (0x10, syntax)] {
        let length = u16::try_from(text.len().next_multiple_of(2)).unwrap();
        group.extend([2, 0, element, 0, b'U', b'I']);
        group.extend(length.to_le_bytes());
        group.extend(text.bytes());
        group.resize(group.len() + text.len() % 2, 0);
    }
    let mut file = vec![0; 128];
    file.extend(b"DICM");
    file.extend([2, 0, 0, 0, b'U', b'L', 4, 0]);
    file.extend(u32::try_from(group.len()).unwrap().to_le_bytes());
    file.extend(group);
    file.extend(data);
    file
}

#[test]
fn an_echo_goes_through_and_a_rejection_is_told() {
    let listener = Listener::start(|_| {});
    listener.run(echo(&peer(&listener))).unwrap();
    let wrong = Peer { called_ae_title: "SOMEONE".to_owned(), ..peer(&listener) };
    let error = listener.run(echo(&wrong)).unwrap_err();
    assert!(matches!(error, ScuError::Rejected { transient: false, .. }), "{error}");
    assert!(error.to_string().contains("called AE title not recognized"), "{error}");
}

#[test]
fn files_and_blobs_are_stored_and_each_answer_is_told() {
    let listener = Listener::start(|_| {});
    let dir = tempfile::tempdir().unwrap();
    let uid = |number: u16| format!("{SERIES}.{number}");
    let slice = |number: u16, value| ct_slice(SERIES, &uid(number), number, value);
    let file = dir.path().join("1.dcm");
    std::fs::write(&file, part10(CT, &uid(1), EXPLICIT, &slice(1, 40))).unwrap();
    // Exactly full last fragments must not lose the end of the data set: the listener takes
    // 262 144 bytes a PDU, the SCU sends 131 066 of them in a fragment.
    let mut full = slice(2, 40);
    full.truncate(full.len() - 516);
    let pixels = 131_066 * 2 - full.len() - 4;
    full.extend(u32::try_from(pixels).unwrap().to_le_bytes());
    full.resize(131_066 * 2, 0);
    let instances = [
        Instance::File(file),
        Instance::Bytes(part10(CT, &uid(2), EXPLICIT, &full)),
        Instance::Bytes(part10(CT, &uid(1), EXPLICIT, &slice(1, 41))),
        Instance::Bytes(part10(MR, &uid(3), EXPLICIT, &as_mr(slice(3, 40)))),
    ];
    let mut told = Vec::new();
    let outcomes =
        listener.run(store(&peer(&listener), &instances, |outcome| told.push(outcome.clone()))).unwrap();
    assert_eq!(told, outcomes);
    let uids: Vec<_> = outcomes.iter().map(|outcome| outcome.sop_instance_uid.as_str()).collect();
    assert_eq!(uids, [uid(1), uid(2), uid(1), uid(3)]);
    assert!(outcomes[0].answer.is_success() && outcomes[1].answer.is_success(), "{outcomes:?}");
    assert!(
        matches!(&outcomes[2].answer, Answer::Status { code: 0xC003, comment: Some(comment) } if comment.starts_with("conflicting-instance"))
    );
    assert_eq!(outcomes[3].answer, Answer::ContextNotAccepted);
    assert!(listener.files().iter().any(|file| file.ends_with(&full)), "every byte arrived");
}

#[test]
fn a_file_that_is_none_is_told_before_anything_is_sent() {
    let listener = Listener::start(|_| {});
    let instances = [Instance::Bytes(vec![0; 200])];
    let error = listener.run(store(&peer(&listener), &instances, |_| {})).unwrap_err();
    assert!(matches!(error, ScuError::Unreadable { .. }), "{error}");
    let nobody = Peer { address: "127.0.0.1:1".to_owned(), ..peer(&listener) };
    let error = listener.run(echo(&nobody)).unwrap_err();
    assert!(matches!(error, ScuError::Connect { .. }), "{error}");
}
