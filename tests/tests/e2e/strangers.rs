//! Who is not of the fleet, and words that were said before: refused, counted, named.

use std::{
    net::{SocketAddr, UdpSocket},
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, JoinHandle},
    time::Duration,
};

use sdr_tests::house::{Agent, House};

/// Words of all bad input that an agent told of.
fn told(agent: &Agent) -> String {
    agent.events("bad-input").iter().map(|view| view.event.reason.clone() + "\n").collect()
}

/// Two robots meet at this socket; what the first says to the second is kept.
struct Relay {
    socket: UdpSocket,
    first: SocketAddr,
    second: SocketAddr,
    kept: Arc<Mutex<Vec<Vec<u8>>>>,
    over: Arc<AtomicBool>,
    carrier: Option<JoinHandle<()>>,
}

impl Relay {
    fn between(first: u16, second: u16) -> Self {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        socket.set_read_timeout(Some(Duration::from_millis(50))).unwrap();
        let [first, second] = [first, second].map(|port| SocketAddr::from(([127, 0, 0, 1], port)));
        let (kept, over) = (Arc::default(), Arc::default());
        let mut relay = Self { socket, first, second, kept, over, carrier: None };
        relay.carrier = Some(relay.carry());
        relay
    }

    fn carry(&self) -> JoinHandle<()> {
        let socket = self.socket.try_clone().unwrap();
        let (first, second) = (self.first, self.second);
        let (kept, over) = (Arc::clone(&self.kept), Arc::clone(&self.over));
        thread::spawn(move || {
            let mut buffer = [0; 2000];
            while !over.load(Ordering::Relaxed) {
                // Silence, or a port that is not open yet.
                let Ok((length, from)) = socket.recv_from(&mut buffer) else { continue };
                let to = if from == first { second } else { first };
                if from == first {
                    kept.lock().unwrap().push(buffer[..length].to_vec());
                }
                let _ = socket.send_to(&buffer[..length], to);
            }
        })
    }

    fn port(&self) -> u16 {
        self.socket.local_addr().unwrap().port()
    }

    fn kept(&self) -> Vec<Vec<u8>> {
        self.kept.lock().unwrap().clone()
    }

    /// Says it to the second once more.
    fn say_again(&self, datagrams: &[Vec<u8>]) {
        for datagram in datagrams {
            self.socket.send_to(datagram, self.second).unwrap();
        }
    }
}

impl Drop for Relay {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        if let Some(carrier) = self.carrier.take() {
            let _ = carrier.join();
        }
    }
}

#[test]
fn what_a_living_robot_said_before_is_refused_when_it_is_said_again() {
    let mut house = House::build(2);
    let relay = Relay::between(house.agents[0].port, house.agents[1].port);
    let (one, two) = (house.agents[0].port, house.agents[1].port);
    for (number, other) in [(0, two), (1, one)] {
        let (seed, meeting) = (format!("127.0.0.1:{other}"), format!("127.0.0.1:{}", relay.port()));
        house.agents[number].rewrite(&format!("[\"{seed}\"]"), &format!("[\"{meeting}\"]"));
    }
    house.agents.iter_mut().for_each(Agent::start);
    house.wait("they meet", |house| [0, 1].into_iter().all(|number| house.sees(number, 2)));
    house.wait("much was said", |_| relay.kept().len() >= 40);

    let before = house.agents[1].bad_input("datagrams_replayed");
    let old = relay.kept();
    relay.say_again(&old);

    house.wait("all of it is refused, counted and named", |house| {
        let agent = &house.agents[1];
        agent.bad_input("datagrams_replayed") >= before + 30
            && told(agent).contains(&format!("datagram from 127.0.0.1:{}: it came", relay.port()))
    });
    assert!(house.sees(1, 2), "the sender is heard on: {}", house.story());
    assert!(house.agents[1].events("robot-gone").is_empty());
}

#[test]
fn a_robot_without_the_mesh_key_hears_nothing_and_is_named_by_those_it_speaks_to() {
    let mut house = House::build(3);
    let keys = format!("keys = {:?}", house.agents[2].keys());
    house.agents[2].rewrite(&keys, "unsealed = true\nfleet = \"house\"");
    let api = format!("listen = \"127.0.0.1:{}\"", house.agents[2].api_port);
    house.agents[2].rewrite(&api, "");
    house.agents[2].rewrite("key_grace = \"3s\"", "");

    house.agents.iter_mut().for_each(Agent::start);

    house.wait("it is refused, counted and named", |house| {
        [0, 1].into_iter().all(|number| {
            let agent = &house.agents[number];
            let from = format!("datagram from 127.0.0.1:{}", house.agents[2].port);
            agent.bad_input("datagrams_unsealed") >= 3
                && told(agent).contains(&format!("{from}: it is not sealed"))
        })
    });
    house.wait("the others see each other", |house| {
        [0, 1].into_iter().all(|number| house.sees(number, 2))
    });
    let alone = house.status(2).unwrap();
    assert_eq!(alone.robots.len(), 1, "{alone:?}");
    assert_eq!(house.agents[2].health()["mesh"]["received"], 0);
}
