//! What an association leaves in the log: what was offered and refused, what was stored and
//! refused, how it ended; and nothing that a sender wrote forges or hides a line of it.

use std::time::Duration;

use crate::support::dimse::Listener;
use crate::support::scu::{CT, EXPLICIT, IMPLICIT, MR, Request, Scu, VERIFICATION, ct_slice};
use crate::support::service::{Service, Settings};

const SERIES: &str = "1.2.826.0.1.3680043.10.9999.12";
const JPEG_BASELINE: &str = "1.2.840.10008.1.2.4.50";
const JPEG_EXTENDED: &str = "1.2.840.10008.1.2.4.51";

/// Waits for a line of the log that holds all of these.
fn await_line(service: &Service, holding: &[&str]) -> String {
    for _ in 0..400 {
        let log = service.log();
        if let Some(line) = log.lines().find(|line| holding.iter().all(|part| line.contains(part))) {
            return line.to_owned();
        }
        std::thread::sleep(Duration::from_millis(25));
    }
    panic!("no line with {holding:?} in\n{}", service.log());
}

#[test]
fn an_association_tells_what_was_offered_and_what_became_of_it() {
    let service = Settings::new().start();
    let request = Request::new(&[
        (1, VERIFICATION, &[IMPLICIT]),
        (3, CT, &[EXPLICIT]),
        (5, CT, &[JPEG_BASELINE, JPEG_EXTENDED]),
        (7, MR, &[EXPLICIT]),
    ]);
    let mut scu = Scu::associate(service.dimse, &request);
    let instance = |number: u16| format!("{SERIES}.{number}");
    for number in [1, 2, 1] {
        scu.store(3, number, &instance(number), &ct_slice(SERIES, &instance(number), number, 40), 10_000);
        assert_eq!(scu.response().status(), 0);
    }
    // Same instance, other pixels; then bytes that are no data set.
    scu.store(3, 4, &instance(1), &ct_slice(SERIES, &instance(1), 1, 41), 10_000);
    assert_eq!(scu.response().status(), 0xC003);
    scu.store(3, 5, &instance(5), &[7; 300], 10_000);
    assert_eq!(scu.response().status() & 0xF000, 0xC000);
    scu.release();
    let ended = await_line(&service, &["association ended", "released"]);
    for part in ["stored=2", "duplicate=1", "refused=2", "C003: 1"] {
        assert!(ended.contains(part), "{part} is missing: {ended}");
    }
    await_line(&service, &["offered=4", "accepted=2", "TESTER"]);
    let refused = await_line(&service, &["presentation contexts are refused"]);
    for part in [
        format!("{MR} abstract_syntax_not_supported"),
        format!("{CT} transfer_syntaxes_not_supported ({JPEG_BASELINE}, {JPEG_EXTENDED})"),
    ] {
        assert!(refused.contains(&part), "{part} is missing: {refused}");
    }
}

#[test]
fn an_association_of_which_nothing_is_accepted_and_one_that_is_cut_are_told() {
    let service = Settings::new().start();
    Scu::associate(service.dimse, &Request::new(&[(1, MR, &[EXPLICIT])])).release();
    await_line(&service, &["WARN", "every presentation context is refused", MR]);
    drop(Scu::associate(service.dimse, &Request::new(&[(1, CT, &[EXPLICIT])])));
    await_line(&service, &["association ended", "lost", "stored=0"]);
}

#[test]
fn contexts_and_ends_are_counted() {
    let listener = Listener::start(|_| {});
    let request = Request::new(&[(1, CT, &[EXPLICIT]), (3, CT, &[JPEG_BASELINE]), (5, MR, &[EXPLICIT])]);
    Scu::associate(listener.address, &request).release();
    drop(Scu::associate(listener.address, &request));
    for line in [
        r#"triplanar_presentation_contexts_total{result="accepted"} 2"#,
        r#"triplanar_presentation_contexts_total{result="transfer_syntaxes_not_supported"} 2"#,
        r#"triplanar_presentation_contexts_total{result="abstract_syntax_not_supported"} 2"#,
        r#"triplanar_associations_ended_total{end="released"} 1"#,
        r#"triplanar_associations_ended_total{end="lost"} 1"#,
    ] {
        listener.await_metric(line);
    }
}

#[test]
fn what_a_sender_writes_stays_on_its_line() {
    let hostile = "\n2026-01-01T00:00:00Z  INFO triplanar: forged\x1b[2J\u{202e}";
    for format in ["text", "json"] {
        let service = Settings::new().with("log.format", format).start();
        // As calling AE title, as abstract and transfer syntax, as SOP class of the command.
        let mut title = Request::new(&[(1, VERIFICATION, &[IMPLICIT])]);
        title.calling = "A\nINFO forged\x1b".to_owned();
        let mut scu = Scu::connect(service.dimse);
        scu.send(&title.pdu());
        scu.expect_rejection(1, 1, 3);
        let request = Request::new(&[(1, hostile, &[hostile]), (3, CT, &[hostile]), (5, CT, &[EXPLICIT])]);
        let mut scu = Scu::associate(service.dimse, &request);
        scu.store(5, 1, hostile, &[7; 300], 10_000);
        assert_eq!(scu.response().status(), 0x0117);
        scu.release();
        await_line(&service, &["association ended"]);
        let log = service.log();
        assert!(log.contains("forged"), "the log tells of it");
        for line in log.lines() {
            let begins = if format == "json" { line.starts_with("{\"") } else { line.starts_with("20") };
            assert!(begins && !line.starts_with("2026-01-01T00:00:00Z"), "a forged line: {line:?}");
            assert!(!line.chars().any(char::is_control) && !line.contains('\u{202e}'), "{line:?}");
        }
    }
}
