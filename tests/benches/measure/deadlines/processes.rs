//! The helper processes: this program itself, in other roles.

use std::{
    env,
    io::{self, BufRead as _, BufReader, Read as _},
    net::Ipv6Addr,
    process::{Child, Command, Stdio},
    thread,
};

use clap::ValueEnum as _;
use grasp_server::{Config, Server, config::StorePlace};
use tokio::net::TcpListener;

use crate::deadlines::Role;

/// A running helper process; killed when dropped. It ends by itself if this process dies, because its input ends.
pub(crate) struct Helper(Child);

impl Helper {
    /// Starts this program in a role.
    pub(crate) fn start(role: Role) -> Self {
        let role = role.to_possible_value().expect("no role is skipped");
        let child = Command::new(env::current_exe().expect("this program has a path"))
            .args(["deadlines", "--role", role.get_name()])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn();
        Self(child.expect("this program can be started again"))
    }

    /// The first line that it prints.
    pub(crate) fn first_line(&mut self) -> String {
        let output = self.0.stdout.take().expect("its output is a pipe");
        let mut line = String::new();
        BufReader::new(output)
            .read_line(&mut line)
            .expect("the helper prints text");
        line.trim_end().to_owned()
    }
}

impl Drop for Helper {
    fn drop(&mut self) {
        // Fails only if it has ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Serves with the binary's defaults, but with objects in memory only, on a free port until the input ends. Prints the URL.
pub(crate) fn serve() {
    let config = Config {
        place: StorePlace::Memory,
        ..Config::default()
    };
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(config.io_threads.get())
        .enable_all()
        .build()
        .expect("threads can be started");
    let server = Server::new(config).expect("the server starts");
    let (sender, input_end) = tokio::sync::oneshot::channel();
    thread::spawn(move || {
        wait_for_input_end();
        // Fails only if the server has ended.
        let _ = sender.send(());
    });
    runtime.block_on(async {
        let listener = TcpListener::bind((Ipv6Addr::LOCALHOST, 0))
            .await
            .expect("a free port of the loopback interface");
        println!("http://{}", listener.local_addr().expect("it is bound"));
        let shutdown = async {
            let _ = input_end.await;
        };
        server
            .serve(listener, shutdown)
            .await
            .expect("the server stops without an error");
    });
}

/// Computes until the input ends.
pub(crate) fn burn() {
    thread::spawn(|| {
        let mut number: u64 = 1;
        loop {
            number = std::hint::black_box(number.wrapping_mul(3));
        }
    });
    wait_for_input_end();
}

fn wait_for_input_end() {
    // An error is an end, too.
    let _ = io::stdin().read_to_end(&mut Vec::new());
}
