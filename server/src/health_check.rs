//! Asks a server whether it serves: what a container's health check runs, without a shell or another tool.

use std::{
    net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr},
    time::Duration,
};

use tonic::transport::Endpoint;
use tonic_health::pb::{
    HealthCheckRequest, health_check_response::ServingStatus, health_client::HealthClient,
};

/// How long a server may take to answer, from the connection on. An idle one takes a millisecond; one whose cores all
/// search, tens of them. Kubernetes gives a probe one second unless told otherwise: this stays below.
const TIMEOUT: Duration = Duration::from_millis(900);

/// Why a server is not healthy.
#[derive(Debug, thiserror::Error)]
pub enum HealthCheckError {
    /// The configuration leaves the port to the system, so nobody knows it.
    #[error("listen is {0}; the port must be more than 0 for a health check")]
    NoPort(SocketAddr),
    /// Nobody listens, or it does not speak HTTP/2.
    #[error("cannot connect to {address}: {reason}")]
    Connect {
        /// Where.
        address: SocketAddr,
        /// The innermost cause.
        reason: String,
    },
    /// It listens but does not answer.
    #[error("{address} did not answer within {} ms", TIMEOUT.as_millis())]
    Timeout {
        /// Where.
        address: SocketAddr,
    },
    /// It answers, but not the question.
    #[error("{address} answered with {code:?}: {message}")]
    Refused {
        /// Where.
        address: SocketAddr,
        /// The status code.
        code: tonic::Code,
        /// The status message.
        message: String,
    },
    /// It does not serve, or not yet, or not any more.
    #[error("{address} says {status}; only SERVING is healthy")]
    NotServing {
        /// Where.
        address: SocketAddr,
        /// What it said, as the protocol names it.
        status: &'static str,
    },
}

/// Asks the server that listens on `listen` for the health of all its services; an unspecified address is asked over
/// the loopback interface.
///
/// # Errors
/// Anything but `SERVING` within 900 ms; see [`HealthCheckError`].
pub async fn check_health(listen: SocketAddr) -> Result<(), HealthCheckError> {
    if listen.port() == 0 {
        return Err(HealthCheckError::NoPort(listen));
    }
    let address = reachable(listen);
    match tokio::time::timeout(TIMEOUT, ask(address)).await {
        Ok(result) => result,
        Err(_) => Err(HealthCheckError::Timeout { address }),
    }
}

/// Where a server that listens there can be reached from the same machine.
fn reachable(listen: SocketAddr) -> SocketAddr {
    let ip = match listen.ip() {
        IpAddr::V4(ip) if ip.is_unspecified() => Ipv4Addr::LOCALHOST.into(),
        IpAddr::V6(ip) if ip.is_unspecified() => Ipv6Addr::LOCALHOST.into(),
        ip => ip,
    };
    SocketAddr::new(ip, listen.port())
}

async fn ask(address: SocketAddr) -> Result<(), HealthCheckError> {
    let failed = |error: tonic::transport::Error| HealthCheckError::Connect {
        address,
        reason: innermost(&error),
    };
    let channel = Endpoint::from_shared(format!("http://{address}"))
        .map_err(failed)?
        .connect()
        .await
        .map_err(failed)?;
    let answer = HealthClient::new(channel)
        .check(HealthCheckRequest::default())
        .await
        .map_err(|status| HealthCheckError::Refused {
            address,
            code: status.code(),
            message: status.message().to_owned(),
        })?;
    match answer.into_inner().status() {
        ServingStatus::Serving => Ok(()),
        status => Err(HealthCheckError::NotServing {
            address,
            status: status.as_str_name(),
        }),
    }
}

/// The first cause of an error; the transport's own words only say that there was one.
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

    #[test]
    fn unspecified_addresses_are_asked_over_loopback() {
        for (listen, asked) in [
            ("0.0.0.0:50051", "127.0.0.1:50051"),
            ("[::]:50051", "[::1]:50051"),
            ("192.0.2.7:1", "192.0.2.7:1"),
            ("[::1]:9", "[::1]:9"),
        ] {
            assert_eq!(reachable(listen.parse().unwrap()), asked.parse().unwrap());
        }
    }

    #[tokio::test]
    async fn a_port_that_the_system_chose_cannot_be_checked() {
        let error = check_health("[::1]:0".parse().unwrap()).await.unwrap_err();
        assert!(matches!(error, HealthCheckError::NoPort(_)), "{error}");
    }
}
