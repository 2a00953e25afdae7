//! Whose turn it is: that of the client which has had the least time, and of its jobs the one with the earliest deadline.
//!
//! A job takes a turn for each slice of its work, so that no long one keeps others waiting. Time is shared as in start-time fair
//! queueing (P. Goyal, H. M. Vin and H. Cheng, 1996): a client that was idle begins level with those that were not, and saves nothing
//! up. As the order of jobs is known, so is about how long a new one would wait.

use std::{
    collections::{BTreeMap, BTreeSet, HashMap, HashSet},
    time::{Duration, Instant},
};

use crate::Client;

/// Weight of the newest job in the mean of their costs.
const NEWEST_WEIGHT: f64 = 1.0 / 16.0;

/// Most clients of which one without a job is remembered. New clients might otherwise keep `now` from passing, and add up.
const MAX_KNOWN: usize = 1024;

/// The order of a client's jobs: by their deadlines, then by their numbers.
type Rank = (Instant, u64);

/// Who waits, and how much time each client has had.
#[derive(Debug)]
pub(crate) struct Turns<C> {
    free: usize,
    taken: usize,
    clients: HashMap<C, Share>,
    /// Jobs whose turn it is, and that have not begun it.
    called: HashSet<u64>,
    /// The time that the client called last had had before.
    now: Duration,
    next_job: u64,
    /// Mean turn time of recent jobs, in seconds.
    mean_cost: f64,
}

/// A client with jobs.
#[derive(Debug, Default)]
struct Share {
    /// Time that it has had, or that passed without it.
    had: Duration,
    /// Jobs that wait for a turn.
    waiting: BTreeSet<Rank>,
    /// Jobs that have not ended; true for those that others wait for.
    open: BTreeMap<Rank, bool>,
}

impl Share {
    /// Number of jobs that one with this deadline waits for.
    fn ahead(&self, due: Instant) -> usize {
        let earlier = self.open.range(..(due, u64::MAX));
        earlier.filter(|&(_, &counts)| counts).count()
    }

    fn is_idle(&self) -> bool {
        self.open.is_empty()
    }
}

/// The turn time of a job that has ended.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Cost {
    Whole(Duration),
    /// It was cut short.
    AtLeast(Duration),
    /// It was not done.
    Unknown,
}

/// A job that has not ended.
#[derive(Clone, Debug)]
pub(crate) struct Ticket<C> {
    client: C,
    rank: Rank,
}

impl<C> Ticket<C> {
    pub(crate) fn number(&self) -> u64 {
        self.rank.1
    }

    pub(crate) fn due(&self) -> Instant {
        self.rank.0
    }
}

impl<C: Client> Turns<C> {
    pub(crate) fn new(turns: usize) -> Self {
        Self {
            free: turns,
            taken: 0,
            clients: HashMap::new(),
            called: HashSet::new(),
            now: Duration::ZERO,
            next_job: 0,
            mean_cost: 0.0,
        }
    }

    /// The time until a new job of a client would end, by the mean cost of recent ones. Zero if it would not wait.
    pub(crate) fn expected(&self, client: &C, due: Instant) -> Duration {
        let own = self.clients.get(client).map_or(0, |share| share.ahead(due));
        // By the time that the client's jobs up to this one are done, another client has had as many done.
        let others = self.clients.iter().filter(|&(other, _)| other != client);
        let of_others = others.map(|(_, share)| share.open.values().filter(|&&counts| counts).count());
        let before = own + of_others.map(|jobs| jobs.min(own + 1)).sum::<usize>();
        if before == 0 {
            Duration::ZERO
        } else {
            Duration::from_secs_f64((before + 1) as f64 * self.mean_cost)
        }
    }

    /// Adds a job that has to end when it is due.
    pub(crate) fn open(&mut self, client: C, due: Instant) -> Ticket<C> {
        let rank = (due, self.next_job);
        self.next_job += 1;
        let share = self.clients.entry(client.clone()).or_default();
        if share.is_idle() {
            share.had = share.had.max(self.now);
        }
        share.open.insert(rank, true);
        Ticket { client, rank }
    }

    /// Sets when a job has to end, and whether others wait for it: not for one that goes on as long as there is time. Not while it
    /// waits.
    pub(crate) fn set_due(&mut self, ticket: &mut Ticket<C>, due: Instant, counts: bool) {
        if let Some(share) = self.clients.get_mut(&ticket.client) {
            share.open.remove(&ticket.rank);
            ticket.rank.0 = due;
            share.open.insert(ticket.rank, counts);
        }
    }

    /// Ends a job, whose cost counts for the expectation of others.
    pub(crate) fn close(&mut self, ticket: &Ticket<C>, cost: Cost) {
        self.leave(ticket);
        if let Some(share) = self.clients.get_mut(&ticket.client)
            && share.open.remove(&ticket.rank) == Some(true)
        {
            let cost = match cost {
                Cost::Whole(cost) => cost.as_secs_f64(),
                Cost::AtLeast(cost) => cost.as_secs_f64().max(self.mean_cost),
                Cost::Unknown => self.mean_cost,
            };
            self.mean_cost += NEWEST_WEIGHT * (cost - self.mean_cost);
        }
        // An idle client is kept only while it has had more than a new one begins with.
        let (now, are_few) = (self.now, self.clients.len() <= MAX_KNOWN);
        self.clients
            .retain(|_, share| !share.is_idle() || are_few && share.had > now);
        if self.clients.values().all(Share::is_idle) {
            self.clients.clear();
        }
    }

    /// Lets a job wait for its turn, which may be now.
    pub(crate) fn wait(&mut self, ticket: &Ticket<C>) {
        if let Some(share) = self.clients.get_mut(&ticket.client) {
            share.waiting.insert(ticket.rank);
        }
        self.call();
    }

    /// Ends the wait of a job; another one is called in its place.
    pub(crate) fn leave(&mut self, ticket: &Ticket<C>) {
        if let Some(share) = self.clients.get_mut(&ticket.client) {
            share.waiting.remove(&ticket.rank);
        }
        if self.called.remove(&ticket.number()) {
            self.give_back();
        }
    }

    /// Jobs whose turn it is, and that have not begun it.
    pub(crate) fn called(&self) -> impl Iterator<Item = u64> {
        self.called.iter().copied()
    }

    /// Begins the turn of a job if it is called; false if it has to wait.
    pub(crate) fn begin(&mut self, ticket: &Ticket<C>) -> bool {
        self.called.remove(&ticket.number())
    }

    /// Ends a turn that took so long. Returns its cost, which is a part of that if others ran beside it.
    pub(crate) fn end(&mut self, ticket: &Ticket<C>, elapsed: Duration) -> Duration {
        let cost = elapsed / u32::try_from(self.taken).unwrap_or(u32::MAX);
        if let Some(share) = self.clients.get_mut(&ticket.client) {
            share.had += cost;
        }
        self.give_back();
        cost
    }

    fn give_back(&mut self) {
        self.free += 1;
        self.taken -= 1;
        self.call();
    }

    /// Calls jobs while turns are free.
    fn call(&mut self) {
        while self.free > 0 {
            let waiting = self
                .clients
                .values_mut()
                .filter(|share| !share.waiting.is_empty());
            let next = waiting.min_by_key(|share| (share.had, share.waiting.first().copied()));
            let Some((share, (_, number))) = next.and_then(|share| {
                let first = share.waiting.pop_first()?;
                Some((share, first))
            }) else {
                return;
            };
            self.now = self.now.max(share.had);
            self.called.insert(number);
            self.free -= 1;
            self.taken += 1;
        }
    }

    /// True if nothing is left of any job.
    #[cfg(test)]
    pub(crate) fn is_idle(&self) -> bool {
        self.taken == 0 && self.called.is_empty() && self.clients.is_empty()
    }
}

#[cfg(all(test, not(shuttle)))]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const SLICE: Duration = Duration::from_millis(10);

    fn begun<C: Client>(turns: &mut Turns<C>, tickets: &[Ticket<C>]) -> Vec<usize> {
        let places = 0..tickets.len();
        places.filter(|&place| turns.begin(&tickets[place])).collect()
    }

    #[test]
    fn of_one_client_the_earliest_deadline_goes_first() {
        let start = Instant::now();
        let mut turns = Turns::new(1);
        let due = [30, 10, 40, 20];
        let tickets = due.map(|due| turns.open("a", start + Duration::from_millis(due)));
        for ticket in &tickets {
            turns.wait(ticket);
        }
        // The first to wait found the workers free.
        for expected in [0, 1, 3, 2] {
            assert_eq!(begun(&mut turns, &tickets), [expected]);
            turns.end(&tickets[expected], SLICE);
            turns.close(&tickets[expected], Cost::Whole(SLICE));
        }
        assert!(turns.is_idle());
    }

    #[test]
    fn a_light_client_waits_for_one_slice_of_a_heavy_one() {
        let start = Instant::now();
        let mut turns = Turns::new(1);
        let heavy: Vec<_> = (0..50).map(|_| turns.open("heavy", start)).collect();
        for ticket in &heavy {
            turns.wait(ticket);
        }
        let first = begun(&mut turns, &heavy)[0];
        for _ in 0..5 {
            turns.end(&heavy[first], SLICE);
            turns.wait(&heavy[first]);
            let _ = begun(&mut turns, &heavy);
        }
        // It is later than all others, but its client has had nothing.
        let light = turns.open("light", start + Duration::from_hours(1));
        turns.wait(&light);
        assert!(!turns.begin(&light));
        turns.end(&heavy[first], SLICE);
        assert!(turns.begin(&light));
    }

    #[test]
    fn expects_a_job_to_wait_for_earlier_ones_of_its_client_and_as_many_of_others() {
        let start = Instant::now();
        let due = |ms| start + Duration::from_millis(ms);
        let mut turns = Turns::new(1);
        for _ in 0..200 {
            let done = turns.open("a", start);
            turns.close(&done, Cost::Whole(SLICE));
        }
        let expected =
            |turns: &Turns<&str>, client, due| (turns.expected(&client, due).as_secs_f64() * 1e3).round();
        assert_eq!(expected(&turns, "a", due(50)), 0.0);
        let mut a: Vec<_> = [10, 20, 30].map(|ms| turns.open("a", due(ms))).into();
        assert_eq!(expected(&turns, "a", due(25)), 30.0);
        assert_eq!(expected(&turns, "a", due(50)), 40.0);
        assert_eq!(expected(&turns, "b", due(50)), 20.0);
        // Nobody waits for one that goes on as long as there is time.
        turns.set_due(&mut a[0], due(10), false);
        assert_eq!(expected(&turns, "a", due(50)), 30.0);
    }

    #[test]
    fn clients_that_come_once_do_not_add_up() {
        let start = Instant::now();
        let mut turns = Turns::new(2);
        let busy = turns.open(0, start);
        turns.wait(&busy);
        assert!(turns.begin(&busy));
        for client in 1..3 * MAX_KNOWN {
            let once = turns.open(client, start);
            turns.wait(&once);
            assert!(turns.begin(&once));
            turns.end(&once, SLICE);
            turns.close(&once, Cost::Whole(SLICE));
            assert!(turns.clients.len() <= MAX_KNOWN + 1);
        }
    }

    proptest! {
        /// Clients whose jobs always wait have had the same time, but for a slice of each turn.
        #[test]
        fn clients_get_equal_time(
            slices in prop::collection::vec(1_u64..20, 2..6),
            turns_at_once in 1_usize..4,
            steps in 50_usize..300,
        ) {
            let mut turns = Turns::new(turns_at_once);
            let start = Instant::now();
            // Several jobs a client, or it could not use several turns.
            let tickets: Vec<(usize, Ticket<usize>)> = (0..slices.len())
                .flat_map(|client| [client; 4])
                .map(|client| (client, turns.open(client, start)))
                .collect();
            for (_, ticket) in &tickets {
                turns.wait(ticket);
            }
            let mut had = vec![Duration::ZERO; slices.len()];
            // Turns that run, by when they end.
            let mut running = BTreeSet::new();
            let mut now = Duration::ZERO;
            for _ in 0..steps {
                for (place, (client, ticket)) in tickets.iter().enumerate() {
                    if turns.begin(ticket) {
                        let slice = Duration::from_millis(slices[*client]);
                        running.insert((now + slice, place));
                    }
                }
                prop_assert!(running.len() <= turns_at_once);
                let (end, place) = running.pop_first().unwrap();
                now = end;
                let (client, ticket) = &tickets[place];
                had[*client] += turns.end(ticket, Duration::from_millis(slices[*client]));
                turns.wait(ticket);
            }
            let longest = Duration::from_millis(*slices.iter().max().unwrap());
            let (least, most) = (had.iter().min().unwrap(), had.iter().max().unwrap());
            prop_assert!(most.saturating_sub(*least) <= longest * 2 * turns_at_once as u32, "{had:?}");
        }
    }
}
