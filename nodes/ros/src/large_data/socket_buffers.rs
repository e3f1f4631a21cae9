//! The receive buffers that the host's sockets may have.

use std::io;

/// The largest receive buffer that a program may ask for, bytes: the kernel's
/// `net.core.rmem_max`, 212992 on stock Debian and Ubuntu. `None` where the system does not tell.
pub fn receive_buffer_limit() -> Option<usize> {
    std::fs::read_to_string("/proc/sys/net/core/rmem_max").ok()?.trim().parse().ok()
}

/// The receive buffer that the kernel grants a UDP socket that asks for `wanted` bytes, as the
/// socket reports it. Linux reports twice what it granted: the other half is for its own
/// bookkeeping.
///
/// # Errors
/// If no socket could be made.
pub fn receive_buffer(wanted: usize) -> io::Result<usize> {
    let socket = std::net::UdpSocket::bind(("127.0.0.1", 0))?;
    let socket = socket2::SockRef::from(&socket);
    socket.set_recv_buffer_size(wanted)?;
    socket.recv_buffer_size()
}
