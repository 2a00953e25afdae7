//! Asks a running server for its health, for container health checks without a shell or other tools.

use std::{
    net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr},
    time::Duration,
};

use tonic::transport::{Channel, ClientTlsConfig, Endpoint};
use tonic_health::pb::{
    HealthCheckRequest, health_check_response::ServingStatus, health_client::HealthClient,
};

use crate::{listen::ListenAddress, tls::unverified_server};

/// Time limit for connection and answer, below the default of Kubernetes' probes, one second.
const TIMEOUT: Duration = Duration::from_millis(900);

/// Asks the server that listens on these addresses for its overall health, at the first that can be reached. For an unspecified
/// address, it connects over the loopback interface, and for the default one also over that of IPv4. With `tls`, connections of TCP are
/// encrypted; the server's certificate may have any name, and be of any authority.
///
/// # Errors
/// Says in words why the answer within 900 ms was not `SERVING`.
pub async fn check_health(listen: &[ListenAddress], tls: bool) -> Result<(), String> {
    let answered = tokio::time::timeout(TIMEOUT, ask_any(listen, tls)).await;
    answered.unwrap_or_else(|_| {
        let places: Vec<String> = listen
            .iter()
            .map(|address| reachable(address).to_string())
            .collect();
        Err(format!(
            "{} did not answer within {} ms",
            places.join(", "),
            TIMEOUT.as_millis()
        ))
    })
}

async fn ask_any(listen: &[ListenAddress], tls: bool) -> Result<(), String> {
    let fallback = (listen == [ListenAddress::DEFAULT]).then_some(&ListenAddress::DEFAULT_V4);
    let mut failures = Vec::new();
    for address in listen.iter().chain(fallback) {
        match connect(address, tls).await {
            Ok(channel) => return ask(address, channel).await,
            Err(failure) => failures.push(failure),
        }
    }
    Err(failures.join("; "))
}

fn reachable(listen: &ListenAddress) -> ListenAddress {
    let ListenAddress::Tcp(address) = listen else {
        return listen.clone();
    };
    let ip = match address.ip() {
        IpAddr::V4(ip) if ip.is_unspecified() => Ipv4Addr::LOCALHOST.into(),
        IpAddr::V6(ip) if ip.is_unspecified() => Ipv6Addr::LOCALHOST.into(),
        ip => ip,
    };
    ListenAddress::Tcp(SocketAddr::new(ip, address.port()))
}

async fn connect(listen: &ListenAddress, tls: bool) -> Result<Channel, String> {
    let address = reachable(listen);
    let uri = match &address {
        ListenAddress::Tcp(address) if address.port() == 0 => {
            return Err(format!(
                "listen is {listen}; the port must be more than 0 for a health check"
            ));
        }
        ListenAddress::Tcp(address) if tls => format!("https://{address}"),
        ListenAddress::Tcp(address) => format!("http://{address}"),
        ListenAddress::Unix(_) => address.to_string(),
    };
    let failed =
        |error: tonic::transport::Error| format!("cannot connect to {address}: {}", innermost(&error));
    let mut endpoint = Endpoint::from_shared(uri).map_err(failed)?;
    if tls && matches!(address, ListenAddress::Tcp(_)) {
        let any = endpoint.tls_config_with_verifier(ClientTlsConfig::new(), unverified_server());
        endpoint = any.map_err(failed)?;
    }
    endpoint.connect().await.map_err(failed)
}

async fn ask(listen: &ListenAddress, channel: Channel) -> Result<(), String> {
    let address = reachable(listen);
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
            ("unix:/a", "unix:/a"),
        ] {
            assert_eq!(reachable(&listen.parse().unwrap()), expected.parse().unwrap());
        }
        let error = check_health(&["[::1]:0".parse().unwrap()], false)
            .await
            .unwrap_err();
        assert!(error.contains("the port must be more than 0"), "{error}");
    }
}
