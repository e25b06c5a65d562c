//! Who makes room for whom.

use std::net::IpAddr;

use super::*;
use crate::crowd::member::MEASURED;

fn peer(number: u8) -> Peer {
    Peer::from(IpAddr::from([10, 0, 0, number]))
}

fn limits(max: usize, max_per_peer: usize) -> Limits {
    let (patience, least_wait) = (Duration::from_secs(30), Duration::ZERO);
    Limits {
        max,
        max_per_peer,
        names: ["all", "one"],
        patience,
        crowded_bytes_per_second: 65_536,
        slow: Slow::Any,
        least_wait,
        shrinks: true,
    }
}

fn connections(max: usize, max_per_peer: usize) -> Arc<Connections> {
    Connections::new(limits(max, max_per_peer))
}

fn is_closed(place: &Place) -> bool {
    place.member.closed.is_cancelled()
}

#[test]
fn the_oldest_that_waits_of_the_most_crowded_peer_makes_room() {
    let connections = connections(4, 3);
    let quiet = connections.admit(peer(1), false).unwrap();
    let crowd = [2, 2, 2].map(|it| connections.admit(peer(it), false).unwrap());
    let _fresh = connections.admit(peer(3), false).unwrap();
    assert!(!is_closed(&quiet), "the oldest, but alone");
    assert_eq!(crowd.each_ref().map(is_closed), [true, false, false]);
}

#[test]
fn a_peer_at_its_limit_makes_room_for_itself_and_work_is_not_closed() {
    let connections = connections(10, 2);
    let first = connections.admit(peer(1), false).unwrap();
    let busy = first.member().work();
    let second = connections.admit(peer(1), false).unwrap();
    let third = connections.admit(peer(1), false).unwrap();
    assert!(!is_closed(&first) && is_closed(&second));
    let _also = third.member().work();
    assert_eq!(connections.admit(peer(1), false).unwrap_err(), LimitReached("one"));
    connections.admit(peer(1), true).expect("a proxy has no limit of its own");
    drop(busy);
    connections.admit(peer(1), false).unwrap();
    assert!(is_closed(&first));
}

#[test]
fn all_at_work_is_the_end_and_what_is_apart_does_not_count() {
    let connections = connections(2, 2);
    let places = [1, 2].map(|it| connections.admit(peer(it), false).unwrap());
    let _busy = places.each_ref().map(|place| place.member().work());
    assert_eq!(connections.admit(peer(3), false).unwrap_err(), LimitReached("all"));
    let apart = places[0].member().stand_apart();
    let third = connections.admit(peer(3), false).unwrap();
    drop(third);
    let third = connections.admit(peer(3), false).expect("a place that was given back");
    let _also = third.member().work();
    drop(apart);
    assert!(connections.admit(peer(4), false).is_err());
}

#[test]
fn a_crowded_peer_takes_no_place_of_one_that_has_fewer() {
    let connections = connections(3, 3);
    let alone = connections.admit(peer(1), false).unwrap();
    let crowd = [2, 2].map(|it| connections.admit(peer(it), false).unwrap());
    let _busy = crowd.each_ref().map(|place| place.member().work());
    assert_eq!(connections.admit(peer(2), false).unwrap_err(), LimitReached("all"));
    assert!(!is_closed(&alone));
    let _fresh = connections.admit(peer(3), false).unwrap();
    assert!(is_closed(&alone), "an equal one does");
}

#[test]
fn where_all_work_the_slowest_peer_of_the_most_crowded_makes_room() {
    let mut connections = Arc::into_inner(connections(3, 3)).unwrap();
    connections.begun -= 2 * MEASURED;
    let connections = Arc::new(connections);
    let places = [1, 2, 2].map(|it| connections.admit(peer(it), false).unwrap());
    let _busy = places.each_ref().map(|place| place.member().work());
    let _awaited = places.each_ref().map(|place| place.member().wait_for_peer());
    assert!(connections.admit(peer(3), false).is_err(), "not measured yet");
    for place in &places {
        place.member.works_since.store(0, Ordering::Relaxed);
    }
    places[1].member().moved(1_000);
    places[2].member().moved(10_000_000);
    let fresh = connections.admit(peer(3), false).unwrap();
    assert_eq!(places.each_ref().map(is_closed), [false, true, false]);
    let _at_work = fresh.member().work();
    let _alone = connections.admit(peer(4), false).unwrap();
    assert_eq!(places.each_ref().map(is_closed), [true, true, false], "who keeps the rate stays");
}

#[test]
fn what_has_not_waited_long_enough_makes_no_room() {
    let least_wait = Duration::from_secs(3600);
    let connections = Connections::new(Limits { least_wait, shrinks: false, ..limits(2, 2) });
    let _both = [1, 2].map(|it| connections.admit(peer(it), false).unwrap());
    assert_eq!(connections.admit(peer(3), false).unwrap_err(), LimitReached("all"));
}

#[test]
fn patience_shrinks_when_it_is_more_than_half_full() {
    let connections = connections(100, 100);
    let seconds = |it| connections.patience(it).as_secs_f64();
    assert_eq!([seconds(1), seconds(50), seconds(75), seconds(100)], [30.0, 30.0, 15.0, 3.0]);
}
