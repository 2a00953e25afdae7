//! Tokens, certificates of clients, quotas, and what belongs to whom.

use std::{
    fmt::Write as _,
    path::PathBuf,
    time::{Duration, Instant},
};

use grasp_client::{ClientError, GraspClient, Health, RetryPolicy};
use grasp_proto::v1;
use grasp_server::{config::StorePlace, new_token};
use grasp_tests::{
    TestServer,
    certificates::{Authority, TestFolder},
};
use prost::Message as _;
use tonic::{
    Code, Request,
    metadata::{MetadataMap, MetadataValue},
};

use crate::{
    fixtures::{assert_status, bounded, box_request, forbidden, until, update_of, with_object},
    wire::{Connection, answer_to, call},
};

/// Tokens of a test, and their file.
struct TestTokens {
    folder: TestFolder,
    text: String,
}

impl TestTokens {
    fn new(test: &str) -> Self {
        Self {
            folder: TestFolder::new(test),
            text: String::new(),
        }
    }

    /// Adds a client with these lines in its entry; gives its secret.
    fn add(&mut self, name: &str, lines: &str) -> String {
        let (secret, entry) = new_token(name).unwrap();
        let hash = entry.lines().find(|line| line.starts_with("sha256")).unwrap();
        let _ = write!(self.text, "[{name}]\n{hash}\n{lines}\n");
        self.file();
        secret
    }

    fn file(&self) -> PathBuf {
        self.folder.write("tokens.toml", &self.text)
    }

    async fn server(&self) -> TestServer {
        TestServer::start_with(|config| config.tokens_file = Some(self.file())).await
    }
}

const ALL: &str = "scopes = ['find', 'read', 'write']";

async fn client(server: &TestServer, secret: &str) -> GraspClient {
    let builder = GraspClient::builder(server.endpoint()).retry(RetryPolicy::NEVER);
    builder.token(secret).unwrap().connect().await.unwrap()
}

/// The code and reason of a call that failed.
fn refusal<T: std::fmt::Debug>(result: Result<T, ClientError>) -> (Code, String) {
    let error = result.expect_err("the call is refused");
    let call = error.call().expect("the server has refused it");
    (call.code, call.details.error_info().unwrap().reason.clone())
}

fn expected(code: Code, reason: &str) -> (Code, String) {
    (code, reason.to_owned())
}

/// Every method of the server, and the scope that it needs: none for health.
fn methods() -> Vec<(String, Option<&'static str>)> {
    let set = prost_types::FileDescriptorSet::decode(grasp_proto::FILE_DESCRIPTOR_SET).unwrap();
    let services = set.file.iter().flat_map(|file| &file.service);
    let methods = services.flat_map(|service| {
        service
            .method
            .iter()
            .map(move |method| (service.name(), method.name()))
    });
    let own = methods.map(|(service, method)| {
        let scope = match (service, method) {
            ("GraspService", _) => "find",
            (
                _,
                "GetObject" | "ListObjects" | "WatchObjects" | "GetMesh" | "GetAtlas" | "GetRig" | "ListRigs",
            ) => "read",
            (
                _,
                "CreateObject" | "UpdateObject" | "UploadObject" | "DeleteObject" | "CreateRig" | "DeleteRig",
            ) => "write",
            other => panic!("{other:?} has no scope in this table"),
        };
        (format!("grasp.v1.{service}/{method}"), Some(scope))
    });
    let others = [
        ("grpc.health.v1.Health/Check", None),
        (
            "grpc.reflection.v1.ServerReflection/ServerReflectionInfo",
            Some("read"),
        ),
        (
            "grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo",
            Some("read"),
        ),
    ];
    own.chain(others.map(|(method, scope)| (method.to_owned(), scope)))
        .collect()
}

#[tokio::test]
async fn each_method_needs_its_scope_and_is_refused_before_its_message_is_read() {
    let mut tokens = TestTokens::new("scopes");
    let scopes = ["find", "read", "write"];
    let secrets = scopes.map(|scope| (scope, tokens.add(scope, &format!("scopes = ['{scope}']"))));
    let server = tokens.server().await;
    let (mut let_in, mut refused) = (0, 0);
    for (method, needed) in methods() {
        let mut tries = vec![
            (None, "Bearer nobody", "TOKEN_UNKNOWN"),
            (None, "Basic YTpi", "TOKEN_MISSING"),
        ];
        let bearers = secrets
            .each_ref()
            .map(|(scope, secret)| (*scope, format!("Bearer {secret}")));
        tries.extend(
            bearers
                .iter()
                .map(|(scope, bearer)| (Some(*scope), &**bearer, "TOKEN_LACKS_SCOPE")),
        );
        for (scope, authorization, reason) in tries {
            let mut connection = Connection::open(&server, 1 << 20).await;
            let call = connection
                .call(&method, &[("authorization", authorization)])
                .await;
            let (answer, mut request) = call.unwrap();
            let is_let_in = needed.is_none() || scope == needed;
            if is_let_in {
                // Ends the request without a message.
                request.send_data(bytes::Bytes::new(), true).unwrap();
            }
            let status = answer_to(answer).await.status_in_headers();
            if is_let_in {
                let_in += 1;
                let is_refused = [Code::Unauthenticated, Code::PermissionDenied].contains(&status.code());
                assert!(!is_refused, "{method} with {scope:?}: {status:?}");
            } else {
                refused += 1;
                let code = if scope.is_some() {
                    Code::PermissionDenied
                } else {
                    Code::Unauthenticated
                };
                assert_status(&status, code, reason);
                let challenge = status.metadata().get("www-authenticate").unwrap();
                assert!(
                    challenge.to_str().unwrap().starts_with("Bearer realm"),
                    "{challenge:?}"
                );
            }
            connection.task.abort();
        }
    }
    println!(
        "{} methods: {let_in} calls let in, {refused} refused",
        methods().len()
    );
}

#[tokio::test]
async fn connect_and_grpc_web_take_tokens_and_refuse_in_their_own_form() {
    let mut tokens = TestTokens::new("protocols-tokens");
    let secret = tokens.add("page", "scopes = ['read']");
    let server = tokens.server().await;
    let bearer = format!("Bearer {secret}");
    let json = ("content-type", "application/json");
    let with = |method: &'static str, headers: Vec<(&'static str, String)>, body: &'static [u8]| {
        let address = server.address();
        async move {
            let headers: Vec<(&str, &str)> = headers.iter().map(|(name, value)| (*name, &**value)).collect();
            call(address, method, &headers, body.to_vec()).await
        }
    };
    let json = |authorization: &str| {
        vec![
            (json.0, json.1.to_owned()),
            ("authorization", authorization.to_owned()),
        ]
    };
    let read = with("ObjectService/ListObjects", json(&bearer), b"{}").await;
    assert_eq!(read.status, 200);
    let unknown = with("ObjectService/ListObjects", json("Bearer x"), b"{}").await;
    assert_eq!(unknown.status, 401);
    assert_eq!(
        unknown.header("www-authenticate"),
        Some("Bearer realm=\"grasp\", error=\"invalid_token\"")
    );
    assert!(String::from_utf8_lossy(&unknown.body).contains("TOKEN_UNKNOWN"));
    let lacking = with("GraspService/FindGrasp", json(&bearer), b"{}").await;
    assert_eq!(lacking.status, 403);
    let web = with(
        "ObjectService/ListObjects",
        vec![("authorization", bearer)],
        &[0; 5],
    )
    .await;
    let (lists, status) = web.messages::<v1::ListObjectsResponse>();
    assert_eq!((lists.len(), status.code()), (1, Code::Ok));
    let web = with("ObjectService/ListObjects", vec![], &[0; 5]).await;
    assert_status(
        &web.messages::<v1::ListObjectsResponse>().1,
        Code::Unauthenticated,
        "TOKEN_MISSING",
    );
}

#[tokio::test]
async fn others_may_use_but_neither_change_nor_delete_what_a_client_owns() {
    let mut tokens = TestTokens::new("owners");
    let [one, two, shared] = [("one", ""), ("two", ""), ("shared", "\nshared = true")]
        .map(|(name, more)| tokens.add(name, &format!("{ALL}{more}")));
    let saved = tokens.folder.file("saved");
    let start = || {
        let (file, folder) = (tokens.file(), saved.clone());
        TestServer::start_with(|config| {
            config.tokens_file = Some(file);
            config.place = StorePlace::Folder(folder);
        })
    };
    let not_owner = expected(Code::PermissionDenied, "NOT_OWNER");
    let server = start().await;
    let object = client(&server, &one)
        .await
        .create_object(&box_request("of-one"))
        .await
        .unwrap();
    assert_eq!(object.owner, "one");
    let common = client(&server, &shared)
        .await
        .create_object(&box_request("of-all"))
        .await
        .unwrap();
    assert_eq!(common.owner, "");
    server.stop().await;
    // Owners outlast the server.
    let server = start().await;
    let (first, other) = (client(&server, &one).await, client(&server, &two).await);
    let heavier = |name: &str| update_of(name, |object| object.mass_kg = 0.2);
    for name in ["objects/of-one", "objects/of-all"] {
        let found = other.find_grasp(&v1::FindGraspRequest::new(name)).await;
        assert!(found.is_ok(), "{found:?}");
        let changed = other.update_object(&heavier(name)).await;
        let deleted = other.delete_object(name, None).await;
        if name == "objects/of-one" {
            assert_eq!(
                (refusal(changed), refusal(deleted)),
                (not_owner.clone(), not_owner.clone())
            );
            let changed = first.update_object(&heavier(name)).await.unwrap();
            assert_eq!((&*changed.owner, changed.mass_kg), ("one", 0.2));
            assert_eq!(other.get_object(name).await.unwrap().owner, "one");
            first.delete_object(name, None).await.unwrap();
        } else {
            assert_eq!(changed.unwrap().owner, "");
            deleted.unwrap();
        }
    }
    // Repeated requests are each client's own: the second is no repetition, but wants a name that is taken.
    let request = v1::CreateObjectRequest {
        request_id: "3f2a9c1e-8d57-4b06-9e1b-5a70c4d2f683".to_owned(),
        ..box_request("twice")
    };
    let created = first.create_object(&request).await.unwrap();
    assert_eq!(first.create_object(&request).await.unwrap(), created);
    let taken = refusal(other.create_object(&request).await);
    assert_eq!(taken, expected(Code::AlreadyExists, "OBJECT_EXISTS"));
    let own = v1::CreateObjectRequest {
        request_id: request.request_id.clone(),
        ..box_request("another")
    };
    assert_eq!(other.create_object(&own).await.unwrap().owner, "two");
    // A client sends no owner of its own.
    let forged = with_object(box_request("forged"), |object| object.owner = "one".to_owned());
    assert_eq!(other.create_object(&forged).await.unwrap().owner, "two");
    server.stop().await;
    // Without tokens, everything is everybody's.
    let server = TestServer::start_with(|config| config.place = StorePlace::Folder(saved.clone())).await;
    server
        .client()
        .await
        .delete_object("objects/another", None)
        .await
        .unwrap();
}

/// A request with metadata.
fn request<M>(message: M, authorize: &impl Fn(&mut MetadataMap)) -> Request<M> {
    let mut request = Request::new(message);
    authorize(request.metadata_mut());
    request
}

#[tokio::test]
async fn only_the_owner_of_a_track_feeds_and_ends_it() {
    let mut tokens = TestTokens::new("tracks");
    let (one, two) = (tokens.add("one", ALL), tokens.add("two", ALL));
    let server = tokens.server().await;
    let with = |secret: &str| {
        let bearer = format!("Bearer {secret}").parse::<MetadataValue<_>>().unwrap();
        move |metadata: &mut MetadataMap| {
            metadata.insert("authorization", bearer.clone());
        }
    };
    let (one, two) = (with(&one), with(&two));
    let mut grasps = server.grasps().await;
    let track = v1::Track::new("objects/remote").receiving(v1::Handedness::Right);
    let name = grasps
        .create_track(request(track, &one))
        .await
        .unwrap()
        .into_inner()
        .name;
    let frame = v1::TrackFrame {
        track: name.clone(),
        holdout: Some(v1::Holdout::default()),
        sequence: 1,
        ..Default::default()
    };
    let delete = v1::DeleteTrackRequest { name };
    let foreign = grasps.push_frame(request(frame.clone(), &two)).await.unwrap_err();
    assert_status(&foreign, Code::PermissionDenied, "NOT_OWNER");
    let foreign = grasps
        .delete_track(request(delete.clone(), &two))
        .await
        .unwrap_err();
    assert_status(&foreign, Code::PermissionDenied, "NOT_OWNER");
    grasps.push_frame(request(frame, &one)).await.unwrap();
    grasps.delete_track(request(delete, &one)).await.unwrap();
}

#[tokio::test]
async fn quotas_refuse_with_the_time_to_try_again_or_until_something_is_deleted() {
    let mut tokens = TestTokens::new("quotas");
    let calls = tokens.add("calls", &format!("{ALL}\ncalls_per_second = 2"));
    let searches = tokens.add("searches", &format!("{ALL}\nsearches = 1"));
    let objects = tokens.add("objects", &format!("{ALL}\nobjects = 1"));
    let bytes = tokens.add("bytes", &format!("{ALL}\nbytes = 10"));
    let server = tokens.server().await;
    let exceeded = expected(Code::ResourceExhausted, "QUOTA_EXCEEDED");
    let quick = client(&server, &calls).await;
    let error = async {
        loop {
            if let Err(error) = quick.get_object("objects/remote").await {
                return error;
            }
        }
    };
    let error = bounded("a refusal", error).await;
    let details = &error.call().unwrap().details;
    let delay = details.retry_info().unwrap().retry_delay.unwrap();
    assert!(
        delay > Duration::ZERO && delay <= Duration::from_millis(500),
        "{delay:?}"
    );
    assert_eq!(
        details.error_info().unwrap().metadata["quota"],
        "calls_per_second"
    );
    tokio::time::sleep(delay).await;
    quick.get_object("objects/remote").await.unwrap();

    let owner = client(&server, &objects).await;
    owner.create_object(&box_request("first")).await.unwrap();
    let second = refusal(owner.create_object(&box_request("second")).await);
    assert_eq!(second, exceeded);
    owner.delete_object("objects/first", None).await.unwrap();
    owner.create_object(&box_request("second")).await.unwrap();
    let large = refusal(
        client(&server, &bytes)
            .await
            .create_object(&box_request("large"))
            .await,
    );
    assert_eq!(large, exceeded);

    let searcher = client(&server, &searches).await;
    // No attempt can satisfy it.
    let untouchable = with_object(box_request("untouchable"), |object| {
        object.regions = vec![forbidden(&["shell"], &[])];
    });
    searcher.create_object(&untouchable).await.unwrap();
    let long = v1::FindGraspRequest::new("objects/untouchable").with_budget(Duration::from_secs(10));
    let running = tokio::spawn({
        let (searcher, long) = (searcher.clone(), long.clone());
        async move { searcher.find_grasp(&long).await }
    });
    until("a search", || server.gauges().searches() == 1).await;
    assert_eq!(refusal(searcher.find_grasp(&long).await), exceeded);
    running.abort();
}

#[tokio::test]
async fn changed_tokens_are_taken_up_while_calls_run() {
    let mut tokens = TestTokens::new("reload");
    let old = tokens.add("old", ALL);
    let server = tokens.server().await;
    let client_of_old = client(&server, &old).await;
    let mut watch = client_of_old.watch_objects("", true).await.unwrap();
    watch.next().await.unwrap().unwrap();
    // Broken files change nothing.
    tokens.folder.write("tokens.toml", "[old");
    server.reloader().reload();
    tokio::time::sleep(Duration::from_millis(300)).await;
    client_of_old.get_object("objects/remote").await.unwrap();
    tokens.text.clear();
    let new = tokens.add("new", ALL);
    let start = Instant::now();
    server.reloader().reload();
    let client_of_new = client(&server, &new).await;
    bounded("the change", async {
        while client_of_new.get_object("objects/remote").await.is_err() {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    })
    .await;
    println!("new tokens were in force after {:?}", start.elapsed());
    let refused = refusal(client_of_old.get_object("objects/remote").await);
    assert_eq!(refused, expected(Code::Unauthenticated, "TOKEN_UNKNOWN"));
    // A call that runs goes on.
    client_of_new.create_object(&box_request("news")).await.unwrap();
    bounded("news", async {
        loop {
            let news = watch.next().await.unwrap().unwrap();
            if format!("{news:?}").contains("objects/news") {
                return;
            }
        }
    })
    .await;
}

#[tokio::test]
async fn certificates_name_clients_and_health_needs_neither() {
    let (folder, authority) = (TestFolder::new("certificates"), Authority::default());
    let limited = "['cert:reader']\nscopes = ['read']";
    let server = TestServer::start_with(|config| {
        config.tls = Some(authority.files(&folder));
        config.tokens_file = Some(folder.write("tokens.toml", limited));
    })
    .await;
    let connect = |issued: Option<grasp_tests::certificates::Issued>| {
        let mut builder = GraspClient::builder(server.endpoint()).ca_certificate(authority.certificate());
        if let Some(issued) = issued {
            builder = builder.client_certificate(issued.certificate, issued.key);
        }
        builder.connect()
    };
    let nobody = connect(None).await.unwrap();
    assert_eq!(nobody.health().await.unwrap(), Health::Serving);
    let refused = refusal(nobody.get_object("objects/remote").await);
    assert_eq!(refused, expected(Code::Unauthenticated, "TOKEN_MISSING"));
    let studio = connect(Some(authority.issue("studio"))).await.unwrap();
    let object = studio.create_object(&box_request("of-studio")).await.unwrap();
    assert_eq!(object.owner, "cert:studio");
    // Without a common name, the first alternative one counts.
    let unnamed = connect(Some(authority.issue_with(|_| {}))).await.unwrap();
    let object = unnamed.create_object(&box_request("of-localhost")).await.unwrap();
    assert_eq!(object.owner, "cert:localhost");
    let reader = connect(Some(authority.issue("reader"))).await.unwrap();
    reader.get_object("objects/remote").await.unwrap();
    let refused = refusal(reader.create_object(&box_request("of-reader")).await);
    assert_eq!(refused, expected(Code::PermissionDenied, "TOKEN_LACKS_SCOPE"));
    // Another authority's certificate ends the connection.
    let stranger = connect(Some(Authority::default().issue("studio"))).await;
    let refused = match stranger {
        Err(_) => true,
        Ok(client) => client.health().await.is_err(),
    };
    assert!(refused);
    // A common name of a certificate cannot pose as a token.
    let posing = connect(Some(authority.issue("cert:studio"))).await.unwrap();
    let refused = refusal(posing.delete_object("objects/of-studio", None).await);
    assert_eq!(refused, expected(Code::PermissionDenied, "NOT_OWNER"));
}
