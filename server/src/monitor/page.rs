//! The page of metrics: counters, and gauges of the moment.

use super::{Monitor, process};
use crate::{limits::Places, metrics::Exposition};

impl Monitor {
    pub(super) fn page(&self) -> String {
        let mut page = Exposition::default();
        self.handler.metrics.write(&mut page);
        let name = "grasp_queue_seconds";
        page.family(
            name,
            "histogram",
            "How long searches waited for their turns at the workers, all together.",
        );
        page.histogram(name, &[], &self.handler.executor.queue);
        self.write_places(&mut page);
        self.write_objects(&mut page);
        let name = "grasp_build_info";
        page.family(name, "gauge", "1, with the version of the server.");
        page.sample(name, &[("version", env!("CARGO_PKG_VERSION"))], 1);
        process::write(&mut page);
        page.into_text()
    }

    /// The use of each limit.
    fn write_places(&self, page: &mut Exposition) {
        let shared = &*self.handler;
        let of = |places: &Places| (places.taken(), places.maximum());
        for (name, help, (taken, maximum)) in [
            (
                "searches",
                "Searches that run or wait",
                of(&shared.executor.places),
            ),
            ("uploads", "Uploads that are received or built", of(&self.uploads)),
            ("tracks", "Tracks of moving givers", of(&shared.tracks.places)),
            ("watchers", "Watches of objects", of(&shared.watchers)),
            (
                "connections",
                "Open connections",
                (
                    shared.connections.count(),
                    shared.config.maximum_connections.get(),
                ),
            ),
            (
                "unread_bytes",
                "Bytes of answers that wait for clients, and of unanswered requests",
                (
                    shared.connections.unread_bytes(),
                    shared.config.maximum_unread_bytes.get(),
                ),
            ),
        ] {
            page.gauge(&format!("grasp_{name}"), &format!("{help}."), taken);
            page.gauge(
                &format!("grasp_{name}_limit"),
                &format!("{help}: the most."),
                maximum,
            );
        }
        page.gauge("grasp_calls", "Calls in flight.", shared.calls.receiver_count());
        let reserve = shared.reserve.at(std::time::Instant::now());
        page.gauge(
            "grasp_deadline_reserve_seconds",
            "The part of deadlines kept for answers.",
            reserve.as_secs_f64(),
        );
        page.counters(
            "grasp_closed_connections_total",
            "Connections that the server closed, by the reason.",
            &shared.connections.closings,
        );
        let is_reachable = u8::from(self.vitals.is_store_reachable());
        page.gauge(
            "grasp_store_reachable",
            "1 if the place where objects are saved answers.",
            is_reachable,
        );
    }

    fn write_objects(&self, page: &mut Exposition) {
        let shared = &*self.handler;
        let figures = shared.objects.figures();
        page.gauges(
            "grasp_objects",
            "Objects by where they are.",
            "state",
            &[
                ("pinned", figures.pinned),
                ("loaded", figures.loaded),
                ("at_rest", figures.at_rest),
                ("damaged", figures.damaged),
            ],
        );
        page.gauge(
            "grasp_cache_bytes",
            "Memory for created objects and atlases, by estimate.",
            figures.bytes,
        );
        page.gauge(
            "grasp_cache_bytes_limit",
            "The most memory for created objects and atlases.",
            figures.most_bytes,
        );
        let atlases = shared.atlases.growths();
        page.gauges(
            "grasp_atlases",
            "Atlases of objects in memory, by their growth.",
            "state",
            &atlases,
        );
        page.gauge("grasp_rigs", "Rigs that clients created.", shared.rigs.count());
        page.gauge(
            "grasp_rigs_limit",
            "The most rigs of clients.",
            shared.config.maximum_rigs.get(),
        );
    }
}
