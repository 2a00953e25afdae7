//! Asks a running server for its health, for container health checks without a shell or other tools.

use std::{
    net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr},
    time::Duration,
};

use tonic::transport::Endpoint;
use tonic_health::pb::{
    HealthCheckRequest, health_check_response::ServingStatus, health_client::HealthClient,
};

/// Time limit for connection and answer, below the default of Kubernetes' probes, one second.
const TIMEOUT: Duration = Duration::from_millis(900);

/// Asks the server that listens on `listen` for its overall health. For an unspecified address, it connects over the
/// loopback interface.
///
/// # Errors
/// Says in words why the answer within 900 ms was not `SERVING`.
pub async fn check_health(listen: SocketAddr) -> Result<(), String> {
    if listen.port() == 0 {
        return Err(format!(
            "listen is {listen}; the port must be more than 0 for a health check"
        ));
    }
    let address = reachable(listen);
    let answered = tokio::time::timeout(TIMEOUT, ask(address)).await;
    answered.map_err(|_| format!("{address} did not answer within {} ms", TIMEOUT.as_millis()))?
}

fn reachable(listen: SocketAddr) -> SocketAddr {
    let ip = match listen.ip() {
        IpAddr::V4(ip) if ip.is_unspecified() => Ipv4Addr::LOCALHOST.into(),
        IpAddr::V6(ip) if ip.is_unspecified() => Ipv6Addr::LOCALHOST.into(),
        ip => ip,
    };
    SocketAddr::new(ip, listen.port())
}

async fn ask(address: SocketAddr) -> Result<(), String> {
    let failed =
        |error: tonic::transport::Error| format!("cannot connect to {address}: {}", innermost(&error));
    let endpoint = Endpoint::from_shared(format!("http://{address}")).map_err(failed)?;
    let channel = endpoint.connect().await.map_err(failed)?;
    let answer = HealthClient::new(channel)
        .check(HealthCheckRequest::default())
        .await
        .map_err(|status| {
            let (code, message) = (status.code(), status.message());
            format!("{address} answered with {code:?}: {message}")
        })?;
    match answer.into_inner().status() {
        ServingStatus::Serving => Ok(()),
        status => Err(format!(
            "{address} is {}; only SERVING is healthy",
            status.as_str_name()
        )),
    }
}

fn innermost(error: &dyn std::error::Error) -> String {
    let mut cause = error;
    while let Some(source) = cause.source() {
        cause = source;
    }
    cause.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn reaches_unspecified_addresses_over_loopback_but_no_port_chosen_by_the_system() {
        for (listen, expected) in [
            ("0.0.0.0:50051", "127.0.0.1:50051"),
            ("[::]:50051", "[::1]:50051"),
            ("192.0.2.7:1", "192.0.2.7:1"),
            ("[::1]:9", "[::1]:9"),
        ] {
            assert_eq!(reachable(listen.parse().unwrap()), expected.parse().unwrap());
        }
        let error = check_health("[::1]:0".parse().unwrap()).await.unwrap_err();
        assert!(error.contains("the port must be more than 0"), "{error}");
    }
}
