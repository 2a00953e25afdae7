//! Cancellation: for how long workers go on after their client has gone.

use std::{
    fs, io,
    path::PathBuf,
    time::{Duration, Instant},
};

use grasp_tests::raw::{Connection, framed};
use h2::Reason;

use crate::{
    Failure,
    bench::{Bench, FIND_GRASP, NO_ATLASES, WINDOW},
    load::{LIGHT, connect, milliseconds, socket},
    report::{Row, Unit, quantile},
    requests::impossible,
};

/// Longest time, and the aim, in milliseconds.
const GOES_ON_MS: [f64; 2] = [1.0, 0.2];

/// Longest wait for workers to start or stop.
const HANGS_AFTER: Duration = Duration::from_secs(5);

/// How a client goes.
#[derive(Clone, Copy, Debug)]
enum Exit {
    /// It cancels the call, as tonic does when a call is dropped.
    Cancel,
    /// It resets the stream with an error.
    Reset,
    /// It closes the connection.
    Disconnect,
}

pub(crate) async fn measure(bench: &Bench) -> Result<Vec<Row>, Failure> {
    let server = bench.server(NO_ATLASES)?;
    let channel = connect(server.address, LIGHT).await?;
    let hopeless = impossible(&channel, Duration::from_secs(10)).await?;
    let repeats = if bench.long { 200 } else { 30 };
    let mut rows = Vec::new();
    for exit in [Exit::Cancel, Exit::Reset, Exit::Disconnect] {
        bench.step(format_args!("cancellation: {exit:?}"));
        let mut times = Vec::new();
        for _ in 0..repeats {
            let mut connection = Connection::over(socket(server.address, LIGHT).await?, WINDOW).await?;
            let call = connection.call(FIND_GRASP, &[]).await;
            let (answer, mut request) = call.ok_or("the connection is closed")?;
            request.send_data(framed(&hopeless).into(), true)?;
            let threads = server.search_threads()?;
            wait_until("a worker runs", || Ok(count_running(&threads)? > 0)).await?;
            tokio::time::sleep(Duration::from_millis(20)).await;
            let before = server.usage()?;
            let gone = Instant::now();
            match exit {
                Exit::Cancel => request.send_reset(Reason::CANCEL),
                Exit::Reset => request.send_reset(Reason::INTERNAL_ERROR),
                Exit::Disconnect => connection.task.abort(),
            }
            wait_until("all workers sleep", || Ok(count_running(&threads)? == 0)).await?;
            let elapsed = milliseconds(gone.elapsed());
            // The kernel counts the time of a running thread at its ticks, so that its time before may come too late. On a core
            // that others use, the elapsed time is too long.
            let counted = 1e3 * server.spent_since(&before)?.searching / threads.len() as f64;
            times.push(counted.min(elapsed));
            drop(answer);
        }
        rows.push(Row::at_most(
            &format!(
                "processor time after a {}, per worker",
                format!("{exit:?}").to_lowercase()
            ),
            Unit::Milliseconds,
            GOES_ON_MS,
            quantile(&times, 0.5),
            format!(
                "median of {repeats}, until the worker sleeps; p90 {:.2} ms, longest {:.2} ms",
                quantile(&times, 0.9),
                quantile(&times, 1.0)
            ),
        ));
    }
    Ok(rows)
}

async fn wait_until(condition_name: &str, condition: impl Fn() -> io::Result<bool>) -> Result<(), Failure> {
    let start = Instant::now();
    while !condition()? {
        if start.elapsed() > HANGS_AFTER {
            return Err(format!("within {HANGS_AFTER:?}, never: {condition_name}").into());
        }
        tokio::task::yield_now().await;
    }
    Ok(())
}

/// How many of these threads run or could run.
fn count_running(threads: &[PathBuf]) -> io::Result<usize> {
    let mut running = 0;
    for stat in threads {
        // The state follows the name, which is in parentheses.
        let stat = fs::read_to_string(stat)?;
        running += usize::from(
            stat.rsplit(')')
                .next()
                .is_some_and(|rest| rest.trim_start().starts_with('R')),
        );
    }
    Ok(running)
}
