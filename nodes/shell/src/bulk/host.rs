//! What the host's sockets carry.

use std::io;

/// `net.core.rmem_max`, bytes: the largest receive buffer that a program may ask for. Stock Debian and Ubuntu: 212992.
/// None where the system does not tell.
pub fn receive_buffer_limit() -> Option<usize> {
    std::fs::read_to_string("/proc/sys/net/core/rmem_max").ok()?.trim().parse().ok()
}

/// The receive buffer that the kernel grants a UDP socket that asks for `wanted` bytes, read back from the socket.
/// Linux reports twice what it granted: the other half is for its own bookkeeping.
///
/// # Errors
/// If no socket could be made.
pub fn receive_buffer(wanted: usize) -> io::Result<usize> {
    let socket = std::net::UdpSocket::bind(("127.0.0.1", 0))?;
    let socket = socket2::SockRef::from(&socket);
    socket.set_recv_buffer_size(wanted)?;
    socket.recv_buffer_size()
}
