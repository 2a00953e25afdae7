//! The client: connection, deadlines, retries.

use std::{
    error::Error as _,
    fmt,
    future::Future,
    pin::Pin,
    time::{Duration, Instant},
};

use grasp_proto::v1::{self, grasp_service_client::GraspServiceClient};
use serde::Serialize;
use tonic::{
    Code, Request, Response, Status,
    metadata::{Ascii, MetadataValue},
    transport::{Certificate, Channel, ClientTlsConfig, Endpoint, Identity},
};
use tonic_health::pb::{
    HealthCheckRequest, health_check_response::ServingStatus, health_client::HealthClient,
};

use crate::{error::ClientError, retry::RetryPolicy};

/// Default time limit for connecting. Longer helps on slow networks; shorter reports a missing server sooner.
const DEFAULT_CONNECT_TIMEOUT: Duration = Duration::from_secs(5);

/// Default time limit of a call, retries included; a search's budget is added.
const DEFAULT_CALL_TIMEOUT: Duration = Duration::from_secs(10);

/// Message of the CANCELLED status with which tonic reports an expired deadline, on either side.
const TONIC_TIMEOUT_MESSAGE: &str = "Timeout expired";

/// Health of a server.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Health {
    /// Accepts requests.
    Serving,
    /// Up, but accepts no requests, for instance while draining.
    NotServing,
    /// Not reported.
    Unknown,
}

/// Settings of a client.
#[derive(Clone, Debug)]
pub struct GraspClientBuilder {
    endpoint: String,
    connect_timeout: Duration,
    call_timeout: Duration,
    retry: RetryPolicy,
    authorization: Option<Authorization>,
    ca: Option<Certificate>,
    identity: Option<ClientIdentity>,
}

/// A certificate and its key, which no log shows.
#[derive(Clone)]
struct ClientIdentity(Identity);

impl fmt::Debug for ClientIdentity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("ClientIdentity")
    }
}

/// The value of the header that every call has.
type Authorization = MetadataValue<Ascii>;

impl GraspClientBuilder {
    /// Time limit for connecting. Default: 5 s.
    #[must_use]
    pub fn connect_timeout(mut self, timeout: Duration) -> Self {
        self.connect_timeout = timeout;
        self
    }

    /// Time limit of a call, retries included; a search's budget is added. It is sent to the server (header
    /// `grpc-timeout`), which stops working once it has passed. Default: 10 s.
    #[must_use]
    pub fn call_timeout(mut self, timeout: Duration) -> Self {
        self.call_timeout = timeout;
        self
    }

    /// When calls are retried. Default: [`RetryPolicy::default`].
    #[must_use]
    pub fn retry(mut self, policy: RetryPolicy) -> Self {
        self.retry = policy;
        self
    }

    /// Sends a token with every call, for servers that demand one. Use a URL with https, or anyone on the way can read it.
    ///
    /// # Errors
    /// [`ClientError::Token`].
    pub fn token(mut self, secret: &str) -> Result<Self, ClientError> {
        let mut value: Authorization = format!("Bearer {secret}")
            .parse()
            .map_err(|_| ClientError::Token)?;
        value.set_sensitive(true);
        self.authorization = Some(value);
        Ok(self)
    }

    /// Trusts servers with certificates of this authority (PEM), instead of those of the system's authorities.
    #[must_use]
    pub fn ca_certificate(mut self, pem: impl AsRef<[u8]>) -> Self {
        self.ca = Some(Certificate::from_pem(pem));
        self
    }

    /// Shows a certificate (PEM) to the server, with its key, for servers that know their clients by certificates.
    #[must_use]
    pub fn client_certificate(mut self, pem: impl AsRef<[u8]>, key: impl AsRef<[u8]>) -> Self {
        self.identity = Some(ClientIdentity(Identity::from_pem(pem, key)));
        self
    }

    /// Connects now.
    ///
    /// # Errors
    /// [`ClientError::Endpoint`] or [`ClientError::Connect`].
    pub async fn connect(self) -> Result<GraspClient, ClientError> {
        let channel = open(self.transport_endpoint()?).await;
        let channel = channel.map_err(|error| ClientError::Connect {
            endpoint: self.endpoint.clone(),
            source: error.into(),
        })?;
        Ok(self.over(channel))
    }

    /// Connects on the first call: the client may start before the server. Must be called inside a tokio runtime.
    ///
    /// # Errors
    /// [`ClientError::Endpoint`].
    pub fn connect_lazy(self) -> Result<GraspClient, ClientError> {
        let channel = self.transport_endpoint()?.connect_lazy();
        Ok(self.over(channel))
    }

    /// Uses an existing channel. The connect timeout and certificates do not apply.
    pub fn over(self, channel: Channel) -> GraspClient {
        GraspClient {
            channel,
            call_timeout: self.call_timeout,
            retry: self.retry,
            authorization: self.authorization,
        }
    }

    fn transport_endpoint(&self) -> Result<Endpoint, ClientError> {
        let endpoint_error = |source| ClientError::Endpoint {
            endpoint: self.endpoint.clone(),
            source,
        };
        let mut endpoint =
            Endpoint::from_shared(self.endpoint.clone()).map_err(|error| endpoint_error(error.into()))?;
        if endpoint.uri().scheme_str().is_none() || endpoint.uri().host().is_none() {
            return Err(endpoint_error("it has no scheme or no host".into()));
        }
        if endpoint.uri().scheme_str() == Some("https") {
            let mut tls = match &self.ca {
                Some(ca) => ClientTlsConfig::new().ca_certificate(ca.clone()),
                None => ClientTlsConfig::new().with_native_roots(),
            };
            if let Some(ClientIdentity(identity)) = &self.identity {
                tls = tls.identity(identity.clone());
            }
            endpoint = endpoint
                .tls_config(tls)
                .map_err(|error| endpoint_error(error.into()))?;
        } else if self.ca.is_some() || self.identity.is_some() {
            return Err(endpoint_error("certificates need a URL with https".into()));
        }
        Ok(endpoint
            .connect_timeout(self.connect_timeout)
            // Messages are small: waiting to fill a packet would only add latency.
            .tcp_nodelay(true))
    }
}

/// Opens a connection. Boxed, so that the transport is compiled with this crate and not once more with every program that connects.
fn open(
    endpoint: Endpoint,
) -> Pin<Box<dyn Future<Output = Result<Channel, tonic::transport::Error>> + Send>> {
    Box::pin(async move { endpoint.connect().await })
}

/// A client of a grasp server. Cheap to clone; clones share one connection.
///
/// # Examples
/// ```no_run
/// use grasp_client::{ClientError, GraspClient, v1};
///
/// # async fn take() -> Result<(), ClientError> {
/// let client = GraspClient::connect("http://[::1]:50051").await?;
/// let answer = client.find_grasp(&v1::FindGraspRequest::new("objects/remote")).await?;
/// match answer.grasp() {
///     Some(grasp) => println!("move the wrist to {:?}", grasp.client_from_wrist()),
///     None => println!("no grasp in {} attempts", answer.attempts()),
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct GraspClient {
    channel: Channel,
    pub(crate) call_timeout: Duration,
    pub(crate) retry: RetryPolicy,
    authorization: Option<Authorization>,
}

impl GraspClient {
    /// Connects with default settings.
    ///
    /// # Errors
    /// [`ClientError::Endpoint`] or [`ClientError::Connect`].
    pub async fn connect(endpoint: impl Into<String>) -> Result<Self, ClientError> {
        Self::builder(endpoint).connect().await
    }

    /// A client with custom settings; `endpoint` is a URL like `http://[::1]:50051`.
    pub fn builder(endpoint: impl Into<String>) -> GraspClientBuilder {
        GraspClientBuilder {
            endpoint: endpoint.into(),
            connect_timeout: DEFAULT_CONNECT_TIMEOUT,
            call_timeout: DEFAULT_CALL_TIMEOUT,
            retry: RetryPolicy::default(),
            authorization: None,
            ca: None,
            identity: None,
        }
    }

    /// Searches for a grasp. Finding none within the budget is an answer, not an error. Takes at most the call timeout
    /// plus the request's budget. Dropping the future stops the search on the server.
    ///
    /// # Errors
    /// Any except those of connecting; the violations of `InvalidArgument` list everything wrong with the request.
    pub async fn find_grasp(
        &self,
        request: &v1::FindGraspRequest,
    ) -> Result<v1::FindGraspResponse, ClientError> {
        self.call(
            "FindGrasp",
            request.budget(),
            request,
            |channel, request| async move { GraspServiceClient::new(channel).find_grasp(request).await },
        )
        .await
    }

    /// Checks a grasp of the client's own: every check is made, and its verdict has a value. A grasp that is not valid is an
    /// answer, not an error. Takes at most the call timeout plus the time to search for one near it.
    ///
    /// # Errors
    /// Any except those of connecting; the violations of `InvalidArgument` list everything wrong with the request.
    pub async fn validate_grasp(
        &self,
        request: &v1::ValidateGraspRequest,
    ) -> Result<v1::ValidateGraspResponse, ClientError> {
        self.call(
            "ValidateGrasp",
            request.nearest_budget(),
            request,
            |channel, request| async move { GraspServiceClient::new(channel).validate_grasp(request).await },
        )
        .await
    }

    /// Rates whether and from where an object can be taken, for one pose of the giver's hand or several. Takes at most the call
    /// timeout plus the request's budget.
    ///
    /// # Errors
    /// Any except those of connecting; the violations of `InvalidArgument` list everything wrong with the request.
    pub async fn evaluate_holdout(
        &self,
        request: &v1::EvaluateHoldoutRequest,
    ) -> Result<v1::EvaluateHoldoutResponse, ClientError> {
        self.call("EvaluateHoldout", request.budget(), request, |channel, request| async move {
            GraspServiceClient::new(channel).evaluate_holdout(request).await
        })
        .await
    }

    /// Queries the health of the whole server.
    ///
    /// # Errors
    /// Any except those of connecting.
    pub async fn health(&self) -> Result<Health, ClientError> {
        let message = HealthCheckRequest::default();
        let answer = self
            .call("Check", None, &message, |channel, request| async move {
                HealthClient::new(channel).check(request).await
            })
            .await?;
        Ok(match answer.status() {
            ServingStatus::Serving => Health::Serving,
            ServingStatus::NotServing => Health::NotServing,
            ServingStatus::Unknown | ServingStatus::ServiceUnknown => Health::Unknown,
        })
    }

    /// Sends `message` until it is answered, fails permanently, or the call timeout and `budget` have passed since the first
    /// attempt.
    pub(crate) async fn call<M, T, F>(
        &self,
        method: &'static str,
        budget: Option<Duration>,
        message: &M,
        send: impl Fn(Channel, Request<M>) -> F,
    ) -> Result<T, ClientError>
    where
        M: Clone,
        F: Future<Output = Result<Response<T>, Status>>,
    {
        let timeout = self.call_timeout.saturating_add(budget.unwrap_or_default());
        let start = Instant::now();
        let mut attempts = 0;
        loop {
            attempts += 1;
            let remaining = timeout.saturating_sub(start.elapsed());
            let mut request = Request::new(message.clone());
            request.set_timeout(remaining);
            if let Some(authorization) = &self.authorization {
                request
                    .metadata_mut()
                    .insert("authorization", authorization.clone());
            }
            let result = tokio::time::timeout(remaining, send(self.channel.clone(), request)).await;
            let status = match result {
                Ok(Ok(response)) => return Ok(response.into_inner()),
                Ok(Err(status)) if !is_timeout(&status, start.elapsed() >= timeout) => of_transport(status),
                Ok(Err(_)) | Err(_) => {
                    Status::deadline_exceeded(format!("{method} was not answered within {timeout:?}"))
                }
            };
            let wait = self.retry.wait_after(attempts, &status);
            match wait.filter(|&wait| start.elapsed() + wait < timeout) {
                Some(wait) => {
                    tracing::debug!(method, attempts, ?wait, message = status.message(), "retrying");
                    tokio::time::sleep(wait).await;
                }
                None => return Err(ClientError::from_status(&status, attempts)),
            }
        }
    }
}

/// The status, or that of a lost connection: tonic has several codes for those, each with its cause. Every call may be sent again.
pub(crate) fn of_transport(status: Status) -> Status {
    match status.source() {
        Some(cause) if status.code() != Code::Unavailable => {
            Status::unavailable(format!("the connection was lost: {}: {cause}", status.message()))
        }
        _ => status,
    }
}

/// True if the status is tonic's report of an expired deadline.
fn is_timeout(status: &Status, deadline_passed: bool) -> bool {
    status.code() == Code::Cancelled && (deadline_passed || status.message() == TONIC_TIMEOUT_MESSAGE)
}
