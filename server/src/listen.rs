//! Where the server listens: addresses of TCP, and sockets of the file system.

use std::{
    fmt, fs, io,
    net::{Ipv4Addr, Ipv6Addr, SocketAddr},
    os::unix::fs::{FileTypeExt as _, MetadataExt as _, PermissionsExt as _},
    path::{Path, PathBuf},
    str::FromStr,
};

use rustix::io::Errno;
use tokio::net::{TcpListener, TcpStream, UnixListener, UnixStream};
use tokio_util::either::Either;

use crate::client::Client;

/// Values of the setting `listen`, for errors.
pub(crate) const NEEDED_LISTEN: &str = "an address like [::1]:50051, or unix:/PATH";

/// Port of the default address.
const DEFAULT_PORT: u16 = 50051;

/// The errors that say that the machine has no IPv6, or not on this interface.
const NO_IPV6: [Errno; 2] = [Errno::AFNOSUPPORT, Errno::ADDRNOTAVAIL];

const UNIX: &str = "unix:";

/// An address to listen on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ListenAddress {
    /// An address and port of TCP.
    Tcp(SocketAddr),
    /// A socket of the file system, for clients of the same machine and user.
    Unix(PathBuf),
}

impl ListenAddress {
    /// The default: the loopback interface, port 50051.
    pub const DEFAULT: Self = Self::Tcp(SocketAddr::V6(std::net::SocketAddrV6::new(
        Ipv6Addr::LOCALHOST,
        DEFAULT_PORT,
        0,
        0,
    )));

    /// The other address of the loopback interface, the only one without IPv6.
    pub const DEFAULT_V4: Self = Self::Tcp(SocketAddr::V4(std::net::SocketAddrV4::new(
        Ipv4Addr::LOCALHOST,
        DEFAULT_PORT,
    )));

    /// True if only processes of this machine can reach it.
    pub(crate) fn is_private(&self) -> bool {
        match self {
            Self::Tcp(address) => address.ip().to_canonical().is_loopback(),
            Self::Unix(_) => true,
        }
    }
}

impl FromStr for ListenAddress {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parsed = match text.strip_prefix(UNIX) {
            Some(path) => Path::new(path).is_absolute().then(|| Self::Unix(path.into())),
            None => text.parse().ok().map(Self::Tcp),
        };
        parsed.ok_or_else(|| format!("{text:?} is no address"))
    }
}

impl fmt::Display for ListenAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Tcp(address) => address.fmt(f),
            Self::Unix(path) => write!(f, "{UNIX}{}", path.display()),
        }
    }
}

/// A socket that accepts connections. That of a path is removed with it.
#[derive(Debug)]
pub struct Listener(Socket);

#[derive(Debug)]
enum Socket {
    Tcp(TcpListener),
    Unix(UnixListener, SocketFile),
}

impl From<TcpListener> for Listener {
    fn from(listener: TcpListener) -> Self {
        Self(Socket::Tcp(listener))
    }
}

impl Listener {
    /// Listens on addresses. The default alone means the loopback interface: 127.0.0.1 as well, where `localhost` may be, or only
    /// that without IPv6.
    ///
    /// # Errors
    /// As of [`Self::bind`], with the address.
    pub async fn bind_all(addresses: &[ListenAddress]) -> Result<Vec<Self>, (ListenAddress, io::Error)> {
        let mut listeners = Vec::new();
        let is_default = addresses == [ListenAddress::DEFAULT];
        for address in addresses {
            match Self::bind(address).await {
                Ok(listener) => listeners.push(listener),
                Err(error)
                    if is_default
                        && Errno::from_io_error(&error).is_some_and(|code| NO_IPV6.contains(&code)) =>
                {
                    tracing::warn!(%error, "this machine has no IPv6; listening on 127.0.0.1 instead");
                }
                Err(error) => return Err((address.clone(), error)),
            }
        }
        if is_default {
            match Self::bind(&ListenAddress::DEFAULT_V4).await {
                Ok(listener) => listeners.push(listener),
                Err(error) if listeners.is_empty() => return Err((ListenAddress::DEFAULT_V4, error)),
                Err(error) => tracing::warn!(%error, "cannot listen on 127.0.0.1 as well"),
            }
        }
        Ok(listeners)
    }

    /// Listens on an address.
    ///
    /// # Errors
    /// The address is in use, or is none of this machine's; or the path is no socket, or cannot be created.
    pub async fn bind(address: &ListenAddress) -> io::Result<Self> {
        match address {
            ListenAddress::Unix(path) => SocketFile::bind(path),
            ListenAddress::Tcp(tcp) => Ok(TcpListener::bind(tcp).await?.into()),
        }
    }

    /// The address on which it listens, with the port that the system chose.
    ///
    /// # Errors
    /// The system does not know it.
    pub fn address(&self) -> io::Result<ListenAddress> {
        Ok(match &self.0 {
            Socket::Tcp(listener) => ListenAddress::Tcp(listener.local_addr()?),
            Socket::Unix(_, file) => ListenAddress::Unix(file.path.clone()),
        })
    }

    /// The next connection, and whose it is.
    pub(crate) async fn accept(&self) -> io::Result<(Stream, Client)> {
        Ok(match &self.0 {
            Socket::Tcp(listener) => {
                let (stream, address) = listener.accept().await?;
                // Small messages must not wait for others. If this fails, the first read fails too.
                let _ = stream.set_nodelay(true);
                (Either::Left(stream), Client::at(address.ip()))
            }
            Socket::Unix(listener, _) => (Either::Right(listener.accept().await?.0), Client::Local),
        })
    }
}

/// A connection of either kind.
pub(crate) type Stream = Either<TcpStream, UnixStream>;

/// The file of a socket, removed when this is dropped unless another server has replaced it.
#[derive(Debug)]
struct SocketFile {
    path: PathBuf,
    /// Device and number.
    identity: (u64, u64),
}

impl SocketFile {
    /// Listens on a path that only this user may connect to. A socket there that nobody answers is replaced.
    fn bind(path: &Path) -> io::Result<Listener> {
        let listener = match UnixListener::bind(path) {
            Err(error) if error.kind() == io::ErrorKind::AddrInUse => {
                remove_stale(path)?;
                UnixListener::bind(path)?
            }
            listener => listener?,
        };
        fs::set_permissions(path, fs::Permissions::from_mode(0o600))?;
        let file = Self {
            path: path.to_owned(),
            identity: identity(path)?,
        };
        Ok(Listener(Socket::Unix(listener, file)))
    }
}

impl Drop for SocketFile {
    fn drop(&mut self) {
        if identity(&self.path).is_ok_and(|identity| identity == self.identity) {
            // If it stays, the next server replaces it.
            let _ = fs::remove_file(&self.path);
        }
    }
}

fn identity(path: &Path) -> io::Result<(u64, u64)> {
    let file = fs::symlink_metadata(path)?;
    Ok((file.dev(), file.ino()))
}

/// Removes a socket that a server left behind.
fn remove_stale(path: &Path) -> io::Result<()> {
    let problem = |text| Err(io::Error::new(io::ErrorKind::AddrInUse, text));
    if !fs::symlink_metadata(path)?.file_type().is_socket() {
        return problem("there is a file that is no socket");
    }
    match std::os::unix::net::UnixStream::connect(path) {
        Err(error) if error.kind() == io::ErrorKind::ConnectionRefused => fs::remove_file(path),
        Err(error) => Err(error),
        Ok(_) => problem("another server listens there"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_can_be_printed_and_read_again_and_others_are_rejected() {
        for text in ["[::1]:50051", "0.0.0.0:1", "unix:/run/grasp.sock"] {
            let address: ListenAddress = text.parse().unwrap();
            assert_eq!(address.to_string(), text);
        }
        assert_eq!(ListenAddress::DEFAULT.to_string(), "[::1]:50051");
        assert_eq!(ListenAddress::DEFAULT_V4.to_string(), "127.0.0.1:50051");
        for wrong in [
            "",
            "here",
            "::1",
            "1.2.3.4",
            "1.2.3.4:65536",
            "unix:",
            "unix:grasp.sock",
        ] {
            assert!(wrong.parse::<ListenAddress>().is_err(), "{wrong}");
        }
    }

    #[tokio::test]
    async fn sockets_are_private_replaced_if_stale_and_removed_at_the_end() {
        let path = std::env::temp_dir().join(format!("grasp-listen-{}.sock", std::process::id()));
        let address = ListenAddress::Unix(path.clone());
        // A socket that its server left behind.
        drop(std::os::unix::net::UnixListener::bind(&path).unwrap());
        let listener = Listener::bind(&address).await.unwrap();
        assert_eq!(listener.address().unwrap(), address);
        assert_eq!(fs::metadata(&path).unwrap().mode() & 0o777, 0o600);
        let (client, accepted) = tokio::join!(UnixStream::connect(&path), listener.accept());
        assert!(client.is_ok() && accepted.is_ok());
        let error = Listener::bind(&address).await.unwrap_err();
        assert!(error.to_string().contains("another server"), "{error}");
        // One that another server has put there meanwhile stays.
        fs::remove_file(&path).unwrap();
        let other = Listener::bind(&address).await.unwrap();
        drop(listener);
        assert!(path.exists());
        drop(other);
        assert!(!path.exists());
        fs::write(&path, "a file").unwrap();
        let error = Listener::bind(&address).await.unwrap_err();
        assert!(error.to_string().contains("no socket"), "{error}");
        fs::remove_file(&path).unwrap();
    }
}
