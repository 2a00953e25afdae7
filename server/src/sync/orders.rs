//! What stands in for the tools of `std` and `tokio` while tests run threads and tasks in many orders.

use std::{future::pending, pin::pin, time::Duration};

use futures_util::future::{Either, select};
pub(crate) use shuttle::{
    future::block_on as wait_for,
    sync::{Mutex, MutexGuard},
};
use shuttle::{
    future::{JoinHandle, spawn, yield_now},
    rand::{Rng as _, thread_rng},
};

/// Runs a test in thousands of orders, the same ones each time. A failure prints its order for [`shuttle::replay`] and, if the order is
/// one of the random ones, a seed: with `SHUTTLE_RANDOM_SEED` set to it, the test runs that order first.
#[cfg(test)]
pub(crate) fn in_many_orders(test: fn()) {
    use shuttle::{
        Config, Runner,
        scheduler::{PctScheduler, RandomScheduler},
    };
    const SEED: u64 = 1;
    const CHANGES_OF_PRIORITY: usize = 3;
    let all = std::env::var("GRASP_TEST_CASES").is_ok_and(|cases| cases == "all");
    let orders = if all { 20_000 } else { 2_000 };
    let mut config = Config::new();
    config.stack_size = 1 << 20;
    Runner::new(RandomScheduler::new_from_seed(SEED, orders), config.clone()).run(test);
    let by_priority = PctScheduler::new_from_seed(SEED, CHANGES_OF_PRIORITY, orders);
    Runner::new(by_priority, config).run(test);
}

/// The output of a future, unless the time is over before: at any moment, or never.
pub(crate) async fn timeout<T>(_: Duration, future: impl Future<Output = T>) -> Result<T, ()> {
    let moments = thread_rng().gen_range(0..8);
    let over = async {
        if moments == 0 {
            pending::<()>().await;
        }
        for _ in 1..moments {
            yield_now().await;
        }
    };
    match select(pin!(future), pin!(over)).await {
        Either::Left((output, _)) => Ok(output),
        Either::Right(_) => Err(()),
    }
}

/// Runs work beside the task that waits for it.
pub(crate) async fn spawn_blocking<T: Send + 'static>(
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, tokio::task::JoinError> {
    Ok(spawn(async { work() }).await.expect("nothing aborts it"))
}

/// Tasks that end with this.
#[derive(Debug)]
pub(crate) struct JoinSet<T>(Vec<JoinHandle<T>>);

impl<T: Send + 'static> JoinSet<T> {
    pub(crate) fn new() -> Self {
        Self(Vec::new())
    }

    pub(crate) fn spawn(&mut self, task: impl Future<Output = T> + Send + 'static) {
        self.0.push(spawn(task));
    }

    pub(crate) async fn shutdown(&mut self) {
        for task in self.0.drain(..) {
            task.abort();
            // It may have ended before.
            let _ = task.await;
        }
    }
}

impl<T> Drop for JoinSet<T> {
    fn drop(&mut self) {
        for task in &self.0 {
            task.abort();
        }
    }
}
