//! An authority of certificates for a test, and its files.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use grasp_server::TlsFiles;
use rcgen::{
    BasicConstraints, CertificateParams, CertifiedIssuer, DnType, IsCa, KeyPair, SanType, date_time_ymd,
};

/// A folder that is removed with it.
#[derive(Debug)]
pub struct TestFolder(PathBuf);

impl TestFolder {
    /// A new folder for files of a test with this name.
    pub fn new(test: &str) -> Self {
        let path = std::env::temp_dir().join(format!("grasp-{test}-{}", std::process::id()));
        fs::create_dir_all(&path).expect("a folder can be created");
        Self(path)
    }

    /// The path of a file in it.
    pub fn file(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    /// Writes a file as a whole, in place of another.
    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        let (new, path) = (self.file("new"), self.file(name));
        let written = fs::write(&new, content).and_then(|()| fs::rename(&new, &path));
        written.expect("a file can be written");
        path
    }
}

impl Drop for TestFolder {
    fn drop(&mut self) {
        let _: io::Result<()> = fs::remove_dir_all(&self.0);
    }
}

/// An authority that issues certificates.
#[derive(Debug)]
pub struct Authority(CertifiedIssuer<'static, KeyPair>);

/// A certificate and its key, in PEM.
#[derive(Clone, Debug)]
pub struct Issued {
    /// The certificate.
    pub certificate: String,
    /// The key.
    pub key: String,
}

impl Default for Authority {
    fn default() -> Self {
        let mut params = CertificateParams::default();
        params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
        params
            .distinguished_name
            .push(DnType::CommonName, "An authority of a test");
        let key = KeyPair::generate().expect("there is randomness");
        Self(CertifiedIssuer::self_signed(params, key).expect("the parameters are right"))
    }
}

impl Authority {
    /// Its own certificate, in PEM.
    pub fn certificate(&self) -> String {
        self.0.pem()
    }

    /// A certificate of a server on this machine's loopback interface, or of a client, whose subject has this common name.
    pub fn issue(&self, common_name: &str) -> Issued {
        self.issue_with(|params| params.distinguished_name.push(DnType::CommonName, common_name))
    }

    /// A server's certificate that has expired.
    pub fn issue_expired(&self) -> Issued {
        self.issue_with(|params| params.not_after = date_time_ymd(2020, 2, 29))
    }

    /// A certificate with changed parameters.
    pub fn issue_with(&self, change: impl FnOnce(&mut CertificateParams)) -> Issued {
        let key = KeyPair::generate().expect("there is randomness");
        let mut params = CertificateParams::new(["localhost".to_owned()]).expect("it is a name");
        for address in ["127.0.0.1", "::1"] {
            let address = address.parse().expect("it is an address");
            params.subject_alt_names.push(SanType::IpAddress(address));
        }
        params.distinguished_name = rcgen::DistinguishedName::new();
        change(&mut params);
        let certificate = params.signed_by(&key, &self.0).expect("the parameters are right");
        Issued {
            certificate: certificate.pem(),
            key: key.serialize_pem(),
        }
    }

    /// The files of a server with a new certificate, whose clients this authority certifies, too.
    pub fn files(&self, folder: &TestFolder) -> TlsFiles {
        let issued = self.issue("a server");
        TlsFiles {
            certificate: folder.write("server.pem", issued.certificate),
            key: folder.write("server.key", issued.key),
            client_ca: Some(folder.write("clients.pem", self.certificate())),
        }
    }
}

/// The text of a file.
pub fn text(path: &Path) -> String {
    fs::read_to_string(path).expect("it can be read")
}
