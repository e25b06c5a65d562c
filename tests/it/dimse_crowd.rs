//! Nobody locks other senders out: a connection that says nothing takes no place, who drips is ended.

use std::net::{IpAddr, SocketAddr};
use std::time::Duration;

use crate::support::dimse::Listener;
use crate::support::scu::{
    COMMAND, CT, DATA, DATA_PART, EXPLICIT, IMPLICIT, Request, Scu, VERIFICATION, c_echo, c_store, pdu, pdv,
};

fn verification() -> Request {
    Request::new(&[(1, VERIFICATION, &[IMPLICIT]), (3, CT, &[EXPLICIT])])
}

/// A connection from another loopback address.
fn connect_from(listener: &Listener, last: u8) -> Scu {
    let stream = listener.run(async {
        let socket = tokio::net::TcpSocket::new_v4().unwrap();
        socket.bind(SocketAddr::new(IpAddr::from([127, 0, 9, last]), 0)).unwrap();
        socket.connect(listener.address).await.unwrap().into_std().unwrap()
    });
    stream.set_nonblocking(false).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    Scu { stream }
}

fn accepted(scu: &mut Scu) {
    scu.send(&verification().pdu());
    assert_eq!(scu.receive().expect("an answer").0, 0x02, "the association is accepted");
}

#[test]
fn a_silent_connection_takes_no_place_of_an_association() {
    let listener = Listener::start(|config| config.dimse.max_associations = 2);
    let mut half = Scu::connect(listener.address);
    half.send(&verification().pdu()[..60]);
    let silent: Vec<_> = (0..10).map(|_| Scu::connect(listener.address)).collect();
    let mut open = [(); 2].map(|()| Scu::associate(listener.address, &verification()));
    let mut third = Scu::connect(listener.address);
    third.send(&verification().pdu());
    // Rejected, transient; service provider (presentation); local limit exceeded.
    third.expect_rejection(2, 3, 2);
    open[1].expect_echo(1, 1);
    drop(silent);
}

#[test]
fn the_oldest_silent_ones_of_the_most_crowded_address_make_room() {
    let listener = Listener::start(|config| config.dimse.max_waiting = 4);
    let mut quiet = connect_from(&listener, 1);
    let mut crowd: Vec<_> = (0..3).map(|_| connect_from(&listener, 2)).collect();
    let mut fresh = connect_from(&listener, 3);
    assert_eq!(crowd[0].receive(), None, "the oldest of the crowd is closed");
    let mut another = connect_from(&listener, 4);
    assert_eq!(crowd[1].receive(), None);
    for scu in [&mut quiet, &mut fresh, &mut another] {
        accepted(scu);
        scu.expect_echo(1, 1);
    }
    listener.await_metric(r#"triplanar_associations_failed_total{reason="crowded"} 2"#);
}

#[test]
fn an_address_at_its_limit_makes_room_for_itself() {
    let listener = Listener::start(|config| config.dimse.max_waiting_per_peer = 2);
    let mut crowd: Vec<_> = (0..3).map(|_| connect_from(&listener, 1)).collect();
    assert_eq!(crowd[0].receive(), None);
    accepted(&mut crowd[2]);
    accepted(&mut crowd[1]);
}

#[test]
fn who_drips_a_message_is_ended_and_who_pauses_between_messages_is_not() {
    let listener = Listener::start(|config| {
        config.dimse.min_bytes_per_second = 100_000;
        config.dimse.rate_grace = Duration::from_millis(300);
    });
    // Byte by byte in presentation data values of their own, and within one PDU.
    let drips: [fn(&mut Scu) -> bool; 2] = [
        |scu| std::io::Write::write_all(&mut scu.stream, &pdu(0x04, &pdv(3, DATA_PART, &[7]))).is_ok(),
        |scu| std::io::Write::write_all(&mut scu.stream, &[0]).is_ok(),
    ];
    for (number, drip) in drips.into_iter().enumerate() {
        let mut scu = Scu::associate(listener.address, &verification());
        scu.send_pdvs(&[pdv(3, COMMAND, &c_store(1, CT, "1.2.3"))]);
        if number == 1 {
            scu.send(&[0x04, 0, 0, 0, 0xFF, 0]);
        }
        let ended = (0..500).any(|_| {
            std::thread::sleep(Duration::from_millis(20));
            !drip(&mut scu)
        });
        assert!(ended, "a dripping sender goes on");
    }
    listener.await_metric(r#"triplanar_associations_failed_total{reason="slow"} 2"#);
    let mut patient = Scu::associate(listener.address, &verification());
    for message in 1..4 {
        std::thread::sleep(Duration::from_millis(500));
        patient.send_pdvs(&[pdv(1, COMMAND, &c_echo(message))]);
        assert_eq!(patient.response().status(), 0);
    }
    patient.release();
}

#[test]
fn the_longest_idle_association_of_the_most_crowded_address_gives_way_before_those_within_a_message() {
    let listener = Listener::start(|config| {
        config.dimse.max_associations = 4;
        config.dimse.gives_way_after = Duration::from_millis(200);
    });
    // Alone from its address, and idle longest of all.
    let mut quiet = connect_from(&listener, 1);
    accepted(&mut quiet);
    let mut crowd: Vec<_> = (0..3).map(|_| connect_from(&listener, 2)).collect();
    crowd.iter_mut().for_each(accepted);
    crowd[0].send_pdvs(&[pdv(3, COMMAND, &c_store(1, CT, "1.2.3"))]);
    std::thread::sleep(Duration::from_millis(500));
    // It worked after the last one did.
    crowd[1].expect_echo(1, 1);
    let mut fresh = connect_from(&listener, 3);
    accepted(&mut fresh);
    // A-ABORT by the service user.
    let (kind, body) = crowd[2].receive().expect("a word before the end");
    assert_eq!((kind, body[2]), (0x07, 0));
    assert_eq!(crowd[2].receive(), None);
    listener.await_metric(r#"triplanar_associations_failed_total{reason="gave_way"} 1"#);
    for scu in [&mut quiet, &mut crowd[1], &mut fresh] {
        scu.expect_echo(1, 2);
    }
    crowd[0].send_pdvs(&[pdv(3, DATA, &[0; 8])]);
    assert_ne!(crowd[0].response().status(), 0, "what it sent is no instance, but it is answered");
}

#[test]
fn the_slowest_of_the_most_crowded_address_gives_way_to_one_that_has_none() {
    let listener = Listener::start(|config| {
        config.dimse.max_associations = 4;
        config.dimse.gives_way_after = Duration::from_secs(1);
    });
    let within_a_message = |last| {
        let mut scu = connect_from(&listener, last);
        accepted(&mut scu);
        scu.send_pdvs(&[pdv(3, COMMAND, &c_store(1, CT, "1.2.3"))]);
        scu
    };
    let mut quiet = within_a_message(1);
    let mut crowd: Vec<_> = (0..3).map(|_| within_a_message(2)).collect();
    std::thread::sleep(Duration::from_millis(1_500));
    let mut fresh = [3, 4].map(within_a_message);
    listener.await_metric(r#"triplanar_associations_failed_total{reason="gave_way"} 2"#);
    // Of those that have one each, none gives way, and none does for an address that has one.
    for last in [5, 2] {
        let mut late = connect_from(&listener, last);
        late.send(&verification().pdu());
        late.expect_rejection(2, 3, 2);
    }
    for scu in std::iter::once(&mut quiet).chain(&mut fresh) {
        scu.send_pdvs(&[pdv(3, DATA, &[0; 8])]);
        assert_ne!(scu.response().status(), 0, "what it sent is no instance, but it is answered");
    }
    // The third one may go on.
    let aborted = crowd.iter_mut().map(|scu| {
        let _gone = std::io::Write::write_all(&mut scu.stream, &pdu(0x04, &pdv(3, DATA, &[0; 8])));
        scu.receive().is_none_or(|(kind, _)| kind == 0x07)
    });
    assert_eq!(aborted.filter(|aborted| *aborted).count(), 2);
}

#[test]
fn who_sends_at_an_honest_rate_keeps_its_place() {
    let listener = Listener::start(|config| {
        config.dimse.max_associations = 2;
        config.dimse.gives_way_after = Duration::from_millis(200);
        config.dimse.crowded_bytes_per_second = 1;
    });
    let mut honest = [(); 2].map(|()| {
        let mut scu = connect_from(&listener, 1);
        accepted(&mut scu);
        scu.send_pdvs(&[pdv(3, COMMAND, &c_store(1, CT, "1.2.3")), pdv(3, DATA_PART, &[0; 100_000])]);
        scu
    });
    std::thread::sleep(Duration::from_millis(500));
    let mut fresh = connect_from(&listener, 2);
    fresh.send(&verification().pdu());
    fresh.expect_rejection(2, 3, 2);
    for scu in &mut honest {
        scu.send_pdvs(&[pdv(3, DATA, &[0; 8])]);
        assert_ne!(scu.response().status(), 0, "what it sent is no instance, but it is answered");
    }
}
