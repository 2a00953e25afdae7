//! TLS: every protocol, certificates that change, clients that hang, and files that are wrong.

use std::{
    net::SocketAddr,
    sync::Arc,
    time::{Duration, Instant},
};

use grasp_client::{ClientError, GraspClient, Health};
use grasp_server::{Config, ServeError, Server, TlsFiles, config::StorePlace};
use grasp_tests::{
    TestServer,
    certificates::{Authority, TestFolder},
};
use rustls::{
    ClientConfig, ProtocolVersion, RootCertStore, SupportedProtocolVersion,
    crypto::ring,
    pki_types::{CertificateDer, ServerName, pem::PemObject as _},
    version::{TLS12, TLS13},
};
use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::TcpStream,
};
use tokio_rustls::{TlsConnector, client::TlsStream};

use crate::fixtures::bounded;

/// How long a changed file may wait until the server has taken it up: two looks of 2 s, and a busy machine.
const TAKEN_UP: Duration = Duration::from_secs(30);

async fn start(files: TlsFiles) -> TestServer {
    TestServer::start_with(|config| config.tls = Some(files)).await
}

/// The project's client on a new connection that trusts an authority.
async fn connect(server: &TestServer, authority: &Authority) -> Result<GraspClient, ClientError> {
    let builder = GraspClient::builder(server.endpoint()).ca_certificate(authority.certificate());
    builder.connect().await
}

/// A connection by hand, with one version of TLS and one protocol inside.
async fn handshake(
    address: SocketAddr,
    authority: &Authority,
    version: &'static SupportedProtocolVersion,
    protocol: &[u8],
) -> std::io::Result<TlsStream<TcpStream>> {
    let mut roots = RootCertStore::empty();
    let pem = authority.certificate();
    roots
        .add(CertificateDer::from_pem_slice(pem.as_bytes()).unwrap())
        .unwrap();
    let config = ClientConfig::builder_with_provider(Arc::new(ring::default_provider()));
    let config = config.with_protocol_versions(&[version]).unwrap();
    let mut config = config.with_root_certificates(roots).with_no_client_auth();
    config.alpn_protocols = vec![protocol.to_vec()];
    let stream = TcpStream::connect(address).await?;
    let name = ServerName::try_from("localhost").unwrap();
    TlsConnector::from(Arc::new(config)).connect(name, stream).await
}

#[tokio::test]
async fn both_versions_of_tls_carry_both_versions_of_http_and_nothing_goes_in_the_clear() {
    let (folder, authority) = (TestFolder::new("protocols"), Authority::default());
    let server = start(authority.files(&folder)).await;
    let client = connect(&server, &authority).await.unwrap();
    assert_eq!(client.health().await.unwrap(), Health::Serving);
    for (version, number) in [
        (&TLS12, ProtocolVersion::TLSv1_2),
        (&TLS13, ProtocolVersion::TLSv1_3),
    ] {
        let stream = handshake(server.address(), &authority, version, b"h2")
            .await
            .unwrap();
        let session = stream.get_ref().1;
        assert_eq!(session.protocol_version(), Some(number));
        assert_eq!(session.alpn_protocol(), Some(&b"h2"[..]));
        let mut stream = handshake(server.address(), &authority, version, b"http/1.1")
            .await
            .unwrap();
        let request = "POST /grpc.health.v1.Health/Check HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\
                       content-type: application/json\r\ncontent-length: 2\r\n\r\n{}";
        stream.write_all(request.as_bytes()).await.unwrap();
        let mut answer = String::new();
        let read = bounded("the answer", stream.read_to_string(&mut answer)).await;
        read.unwrap();
        assert!(answer.starts_with("HTTP/1.1 200 OK"), "{answer}");
        assert!(answer.contains("SERVING"), "{answer}");
    }
    let unknown = handshake(server.address(), &authority, &TLS13, b"smtp").await;
    assert!(unknown.is_err(), "no protocol of the server");
    // A client that trusts another authority, and one that speaks in the clear.
    let error = connect(&server, &Authority::default()).await.unwrap_err();
    assert!(matches!(error, ClientError::Connect { .. }), "{error}");
    let mut clear = TcpStream::connect(server.address()).await.unwrap();
    clear
        .write_all(b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n")
        .await
        .unwrap();
    let mut answer = Vec::new();
    // The alert of TLS, or a reset.
    let _ = bounded("the end", clear.read_to_end(&mut answer)).await;
    assert!(!answer.windows(4).any(|bytes| bytes == b"HTTP"), "{answer:?}");
}

#[tokio::test]
async fn clients_that_hang_in_the_handshake_delay_no_other() {
    const HANGING: usize = 100;
    let (folder, authority) = (TestFolder::new("hanging"), Authority::default());
    let server = start(authority.files(&folder)).await;
    let mut hanging = Vec::new();
    for number in 0..HANGING {
        let mut stream = TcpStream::connect(server.address()).await.unwrap();
        // Nothing, or the first bytes of a handshake.
        stream.write_all(&[0x16, 3, 1][..number % 4]).await.unwrap();
        hanging.push(stream);
    }
    let start = Instant::now();
    let client = bounded("a connection", connect(&server, &authority))
        .await
        .unwrap();
    assert_eq!(client.health().await.unwrap(), Health::Serving);
    // Target: 5 ms on an idle machine.
    println!(
        "connected in {:?} beside {HANGING} clients that hang",
        start.elapsed()
    );
    // They are closed in the time of a preface.
    let mut byte = [0];
    for mut stream in hanging {
        while let Ok(1..) = bounded("the end", stream.read(&mut byte)).await {}
    }
}

#[tokio::test]
async fn changed_certificates_are_taken_up_and_broken_ones_are_not() {
    let (folder, old, new) = (
        TestFolder::new("changed"),
        Authority::default(),
        Authority::default(),
    );
    let server = start(old.files(&folder)).await;
    let before = connect(&server, &old).await.unwrap();
    // The certificate of one pair with the key of another.
    let (one, other) = (new.issue("one"), new.issue("other"));
    folder.write("server.pem", &one.certificate);
    server.reloader().reload();
    tokio::time::sleep(Duration::from_millis(500)).await;
    connect(&server, &old).await.unwrap();
    folder.write("server.pem", other.certificate);
    folder.write("server.key", other.key);
    let start = Instant::now();
    // Taken up without a word.
    while connect(&server, &new).await.is_err() {
        assert!(start.elapsed() < TAKEN_UP, "the new certificate is not used");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    // Target: 4 s.
    println!("a changed certificate was taken up after {:?}", start.elapsed());
    assert!(connect(&server, &old).await.is_err());
    assert_eq!(
        before.health().await.unwrap(),
        Health::Serving,
        "open connections stay"
    );
}

#[test]
fn everything_wrong_with_the_files_is_reported_at_once() {
    let (folder, authority) = (TestFolder::new("wrong"), Authority::default());
    let right = authority.files(&folder);
    let problems = |files: TlsFiles| {
        let config = Config {
            tls: Some(files),
            place: StorePlace::Memory,
            ..Config::default()
        };
        match Server::new(config) {
            Err(ServeError::Secrets(problems)) => problems,
            other => panic!("{other:?}"),
        }
    };
    let wrong = problems(TlsFiles {
        certificate: folder.file("missing.pem"),
        key: right.certificate.clone(),
        client_ca: Some(right.key.clone()),
    });
    let starts = [
        format!(
            "tls_certificate is {}; it must be a file with",
            folder.file("missing.pem").display()
        ),
        format!(
            "tls_key is {}; it must be a file with a private key",
            right.certificate.display()
        ),
        format!("tls_client_ca is {}; it must be a file with", right.key.display()),
    ];
    for start in &starts {
        assert!(
            wrong.iter().any(|problem| problem.starts_with(start)),
            "{start}: {wrong:?}"
        );
    }
    assert_eq!(wrong.len(), starts.len(), "{wrong:?}");
    let other = problems(TlsFiles {
        key: folder.write("other.key", authority.issue("other").key),
        ..right.clone()
    });
    assert!(
        other[0].contains("it must be the key of tls_certificate"),
        "{other:?}"
    );
    // An expired one is used, with a warning: the server's clock may be wrong.
    let expired = authority.issue_expired();
    let files = TlsFiles {
        certificate: folder.write("expired.pem", expired.certificate),
        key: folder.write("expired.key", expired.key),
        ..right
    };
    let config = Config {
        tls: Some(files),
        place: StorePlace::Memory,
        ..Config::default()
    };
    Server::new(config).unwrap();
}
