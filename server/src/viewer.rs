//! The page that shows grasps in a browser, compiled in; its sources are in client/web/viewer.

use std::{future::ready, io::Read as _};

use bytes::Bytes;
use flate2::read::GzDecoder;
use http::{HeaderMap, HeaderValue, Method, Request, Response, StatusCode, header};
use http_body_util::Full;
use sha2::{Digest as _, Sha256};
use tonic::body::Body;

use crate::middleware::{Answer, Around, Middleware, is_gzip_among};

static PAGE: &[u8] = include_bytes!("../../client/web/viewer/dist/index.html.gz");

/// The page calls this server alone, and nothing embeds it. It names the hash of its only script itself.
const POLICY: &str = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src 'self' data: blob:; \
    connect-src 'self' data: blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// A layer that answers GET and HEAD of `/` with the page.
pub(crate) fn viewer() -> Around<Viewer> {
    let hash = Sha256::digest(PAGE);
    let start = hash[..]
        .first_chunk()
        .map_or(0, |start| u64::from_be_bytes(*start));
    Around(Viewer {
        etag: HeaderValue::try_from(format!("\"{start:016x}\"")).unwrap_or(HeaderValue::from_static("\"\"")),
    })
}

#[derive(Clone)]
pub(crate) struct Viewer {
    etag: HeaderValue,
}

impl<B> Middleware<B> for Viewer {
    fn handle<E, F>(&self, request: Request<B>, next: impl FnOnce(Request<B>) -> F) -> Answer<E>
    where
        E: Send + 'static,
        F: Future<Output = Result<Response<Body>, E>> + Send + 'static,
    {
        let is_read = [Method::GET, Method::HEAD].contains(request.method());
        if is_read && request.uri().path() == "/" {
            let answer = self.answer(request.headers(), request.method() == Method::HEAD);
            return Box::pin(ready(Ok(answer)));
        }
        Box::pin(next(request))
    }
}

impl Viewer {
    fn answer(&self, asked: &HeaderMap, is_head: bool) -> Response<Body> {
        let is_known = asked
            .get(header::IF_NONE_MATCH)
            .is_some_and(|known| lists(known, &self.etag));
        let takes_gzip = asked.get_all(header::ACCEPT_ENCODING).iter().any(is_gzip_among);
        let mut answer = Response::new(Body::default());
        let headers = answer.headers_mut();
        for (name, value) in [
            (header::CONTENT_TYPE, "text/html; charset=utf-8"),
            (header::CONTENT_SECURITY_POLICY, POLICY),
            (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
            (header::REFERRER_POLICY, "no-referrer"),
            (header::CACHE_CONTROL, "no-cache"),
            (header::VARY, "accept-encoding"),
        ] {
            headers.insert(name, HeaderValue::from_static(value));
        }
        headers.insert(header::ETAG, self.etag.clone());
        if is_known {
            *answer.status_mut() = StatusCode::NOT_MODIFIED;
            return answer;
        }
        let page = if takes_gzip {
            headers.insert(header::CONTENT_ENCODING, HeaderValue::from_static("gzip"));
            Bytes::from_static(PAGE)
        } else {
            Bytes::from(unpacked())
        };
        headers.insert(header::CONTENT_LENGTH, HeaderValue::from(page.len()));
        if !is_head {
            *answer.body_mut() = Body::new(Full::new(page));
        }
        answer
    }
}

/// True if a list of tags has this one, compared weakly (RFC 9110, 13.1.2).
fn lists(known: &HeaderValue, etag: &HeaderValue) -> bool {
    let (Ok(known), Ok(etag)) = (known.to_str(), etag.to_str()) else {
        return false;
    };
    known
        .split(',')
        .map(str::trim)
        .any(|tag| tag == "*" || tag.trim_start_matches("W/") == etag)
}

fn unpacked() -> Vec<u8> {
    let mut page = Vec::new();
    // Compiled in, so that it is whole.
    let _ = GzDecoder::new(PAGE).read_to_end(&mut page);
    page
}

#[cfg(test)]
mod tests {
    use http_body_util::BodyExt as _;

    use super::*;

    async fn ask(headers: &[(header::HeaderName, &str)], is_head: bool) -> (Response<()>, Bytes) {
        let Around(page) = viewer();
        let mut asked = HeaderMap::new();
        for (name, value) in headers {
            asked.append(name, HeaderValue::from_str(value).unwrap());
        }
        let (parts, body) = page.answer(&asked, is_head).into_parts();
        let body = body.collect().await.unwrap().to_bytes();
        (Response::from_parts(parts, ()), body)
    }

    #[tokio::test]
    async fn sends_the_page_packed_to_those_who_take_it() {
        for accepted in ["gzip", "br, gzip;q=0.5", "*"] {
            let (answer, body) = ask(&[(header::ACCEPT_ENCODING, accepted)], false).await;
            assert_eq!(answer.headers()[header::CONTENT_ENCODING], "gzip", "{accepted}");
            assert_eq!(body, PAGE);
        }
        for accepted in ["br", "gzip;q=0", "identity"] {
            let (answer, body) = ask(&[(header::ACCEPT_ENCODING, accepted)], false).await;
            assert!(
                !answer.headers().contains_key(header::CONTENT_ENCODING),
                "{accepted}"
            );
            assert!(body.starts_with(b"<!doctype html>"));
            assert_eq!(answer.headers()[header::CONTENT_LENGTH], body.len().to_string());
        }
    }

    #[tokio::test]
    async fn answers_without_the_page_if_it_is_known_or_not_wanted() {
        let (answer, body) = ask(&[], true).await;
        assert!(body.is_empty() && answer.status() == StatusCode::OK);
        let etag = answer.headers()[header::ETAG].to_str().unwrap().to_owned();
        for known in [etag.clone(), format!("\"other\", W/{etag}"), "*".to_owned()] {
            let (answer, body) = ask(&[(header::IF_NONE_MATCH, &known)], false).await;
            assert!(
                body.is_empty() && answer.status() == StatusCode::NOT_MODIFIED,
                "{known}"
            );
        }
        let (answer, _) = ask(&[(header::IF_NONE_MATCH, "\"other\"")], false).await;
        assert_eq!(answer.status(), StatusCode::OK);
    }

    #[test]
    fn is_small() {
        assert!(PAGE.len() <= 1_200_000, "{} bytes", PAGE.len());
    }
}
