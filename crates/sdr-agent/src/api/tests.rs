//! A real socket.
